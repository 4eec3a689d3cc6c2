"""The parameters of the two levels. None of them changes an answer."""

from dataclasses import dataclass

from ...harness.frame.schedule.threads import check_threads
from ..common.parameters import check_choices


@dataclass(frozen=True)
class Build:
    """How trees are made.

    deforming  a mesh that deforms, or of which nothing says what moves together: "rebuild": it is traced with a single tree
               of all triangles, rebuilt in each frame; "refuse": it is rejected
    """

    deforming: str = "rebuild"

    def __post_init__(self) -> None:
        check_choices(self, deforming=("rebuild", "refuse"))


@dataclass(frozen=True)
class Trace:
    """How rays are traced.

    threads  of a CPU: each traces a share of the pixels; 0: one for each core that this process may use, at most 16
    """

    threads: int = 0

    def __post_init__(self) -> None:
        check_threads(self.threads)
