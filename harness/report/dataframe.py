"""pandas for reports: imported when it is first used. It takes a second, and most commands draw nothing."""

from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    import pandas as pd
    from pandas import DataFrame, Series
else:

    class Later:
        """The module, on the first use of anything in it."""

        def __getattr__(self, name: str) -> Any:
            import pandas

            return getattr(pandas, name)

    pd, DataFrame, Series = Later(), Any, Any

__all__ = ["DataFrame", "Series", "pd"]
