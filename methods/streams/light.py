"""The passes of one light: its rays are placed, and triangles are tested against them."""

import functools

from ...harness.frame.schedule.passes import Pass
from .occlusion.last_occluder import LastOccluder
from .occlusion.passes import Occlusion
from .queues import Step, in_shares
from .rays.placing import ByRays


class Light:
    """The passes of a light, from how its rays are placed and how triangles are tested against them. memory: tests first the
    triangle that shadowed each ray in the last frame, or None."""

    def __init__(self, placing: ByRays, occlusion: Occlusion, memory: LastOccluder | None = None):
        self.rays, self.placing, self.occlusion, self.memory = placing.rays, placing, occlusion, memory

    def passes(self, branch: int = 0) -> list[Pass]:
        """The light's passes, which may run at the same time as those of lights in another branch."""
        r, queues = self.rays, self.rays.queues
        cells, bits = r.name("ray cells"), r.name("shadowed")
        seen = ("points", "triangles", f"light/{r.index}", r.name("light aim"), *r.effects.surface_reads())
        scene = (*seen, cells)
        placed, sorting, steps = self.placing.passes(), self.placing.sorting(), self.occlusion.steps()
        if self.occlusion.overlaps:
            sorting = [work.hinted(overlap=True) for work in sorting]
            reads = (*seen, r.name("ray places"))
            sorting += in_shares(r.who, "shadow", steps[:1], queues, reads, (), r.effect)
            steps = steps[1:]
        tested = in_shares(r.who, "shadow", steps, queues, (*scene, bits), (bits,), r.effect)
        launch = functools.partial(self.occlusion.launch_undecided, self.placing.outside)
        undecided: Step = ("undecided pairs", (), (), launch)
        reads = (*scene, "camera", *(("hits",) if r.exact.size else ()), bits)
        tested += in_shares(r.who, "shadow", [undecided], queues, reads, (bits,), r.effect)
        if self.memory is not None:
            tested = [self.memory.noting(work) for work in tested]
            placed = [*placed[:-1], self.memory.settling(), placed[-1]]
        return [work.hinted(parallel=(branch, *work.hints.parallel)) for work in (*placed, *sorting, *tested)]
