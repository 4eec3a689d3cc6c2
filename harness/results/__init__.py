"""Records, journals and folders of results, and the tables that are made from them. ``tidy(folder)`` gives a results
folder as one pandas DataFrame, ``samples(folder)`` every sample in long form, and ``points(table)`` means over the
frames of each point.
"""

from .means import points
from .table import samples, tidy

__all__ = ["points", "samples", "tidy"]
