"""Passes on a device, launched in order or as a captured graph."""

from typing import Any

import warp as wp

from .capture import capture_passes
from .passes import Pass, run_passes


class PassRunner:
    """Launches passes on a device, in order or as a captured graph.

    passes      the passes that :meth:`run`, :meth:`graph` and :meth:`replay` launch; may be replaced
    capturable  whether they may be captured as a graph
    """

    def __init__(self, device: str, passes: list[Pass], capturable: bool = True):
        self.device = device
        self.passes = passes
        self.capturable = capturable
        self._graphs: dict[tuple[Pass, ...], Any] = {}

    @property
    def replays(self) -> bool:
        """Whether the passes are timed as one graph: on CUDA, if they can be captured."""
        return self.capturable and wp.get_device(self.device).is_cuda

    def run(self) -> None:
        with wp.ScopedDevice(self.device):
            run_passes(self.passes)

    def graph(self, upto: int | None = None) -> Any:
        """The captured graph of the first ``upto`` passes (all by default). Captured once."""
        chosen = tuple(self.passes[:upto])
        if chosen not in self._graphs:
            self._graphs[chosen] = capture_passes(chosen, self.device)
        return self._graphs[chosen]

    def replay(self) -> None:
        """Launch the passes as they are timed: as a graph if possible, else one by one."""
        if self.replays:
            wp.capture_launch(self.graph())
        else:
            self.run()
