"""The parameters of the ray grids. None of them changes an answer."""

from dataclasses import dataclass

from ...harness.frame.schedule.threads import check_threads
from ..common.parameters import check_choices
from ..streams.settings import Trial

OCCLUDERS = ("none", "last")


@dataclass(frozen=True)
class Build(Trial):
    """How triangles are streamed over the rays.

    occluders  "last": each shadow ray is tested first against the triangle that shadowed its pixel in the last frame;
               a ray that it shadows still is not placed in the light's grid. "none": no occluder is kept
    closed     whether triangles of closed surfaces that face away from a light are left out
               (methods/streams/occlusion/closed.py)
    threads    of a CPU: each streams a part of the triangles, places a part of the rays and resolves a band of the
               image; 0: one for each core that this process may use, at most 16
    trial      for tests and measurements: settings in place of those that are chosen for a frame, as
               "name=value+name=value" (methods/streams/settings.py lists them)
    """

    occluders: str = "none"
    closed: bool = True
    threads: int = 0

    def __post_init__(self) -> None:
        super().__post_init__()
        check_threads(self.threads)
        check_choices(self, occluders=OCCLUDERS)
