"""The camera's passes: clear, test triangles against the pixels, resolve; and how many triangles each pixel is tested
against, counted apart: the kernels of a frame do not count.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from typing import Any

import numpy as np
import warp as wp
from numpy.typing import NDArray

from ....harness.frame.effects.specialise import specialised
from ....harness.frame.frame import Frame
from ....harness.frame.geometry import Camera as CameraArrays
from ....harness.frame.geometry import Mesh
from ....harness.frame.schedule.passes import Pass
from ....harness.scene.effects import Effects
from ...common.bands import Band, Bands
from ...common.reads import corners_at
from ...gpu.entries import entry
from ..queues import BLOCK_DIM, WORDS, Queues, Step, in_shares
from ..settings import Settings
from . import on_cpu, resolve, rows, stream
from .pixels import edge_planes, sign_bound


class Camera:
    """The primary rays of a frame. ``threads``: of a CPU, that each resolve a band of the image.

    hit, rounded  hit points [pixels], vec3d if the ``points`` that are kept are "exact", vec3f if they are "rounded";
           else empty
    """

    def __init__(
        self,
        frame: Frame,
        settings: Settings,
        queues: Queues,
        effects: Effects,
        points: str = "exact",
        threads: int = 1,
    ):
        self.frame, self.settings, self.queues = frame, settings, queues
        self.effects = effects
        self.queue = queues.of_stream(0)
        self._points = points
        with wp.ScopedDevice(frame.device):
            self.hit = wp.zeros(frame.pixels if points == "exact" else 0, dtype=wp.vec3d)
            self.rounded = wp.zeros(frame.pixels if points == "rounded" else 0, dtype=wp.vec3f)
        self.bands = Bands(frame, threads)

    def passes(
        self, steps: Callable[[Camera], list[Step]] | None = None, structure: tuple[str, ...] = ()
    ) -> list[Pass]:
        """Clear, test the shares of the triangles at the same time, and resolve. ``steps``: the passes of each share,
        by default :func:`stream_steps`; structure: resources that they read besides the scene.
        """
        scene = (*structure, "points", "triangles", "camera", *self.effects.surface_reads())
        words = (WORDS,)
        passes = [Pass("camera: clear", "trace", scene, words, self.queues.cleared.zero_)]
        made = (steps or stream_steps)(self)
        passes += in_shares("camera", "trace", made, self.queues, (*scene, *words), words)
        passes.append(Pass("camera: resolve", "trace", (*scene, *words), ("hits",), self.launch_resolve))
        return passes

    def step(self, kernel: wp.Kernel, threads: int, *inputs: Any, sets: tuple[Any, ...] = ()) -> Callable[[int], None]:
        """The launch of a kernel for each share, for the frame's effects. ``sets``: what it sets besides the queue."""

        def launch(share: int) -> None:
            specific = specialised(kernel, self.effects.switches())
            self.frame.launch(specific, threads, [*inputs], [*sets, self.queue[share]], BLOCK_DIM)

        return launch

    def stream(self, kernel: wp.Kernel, threads: int) -> Callable[[int], None]:
        """The launch of a kernel over the triangles of each share."""
        f, q = self.frame, self.queues
        inputs = [self.settings.inline_pixels, f.camera, f.mesh, f.alpha]
        launches = [
            self.step(kernel, threads, q.share(k), *inputs, sets=(q.nearest, q.exact_path)) for k in range(q.shares)
        ]
        return lambda share: launches[share](share)

    def launch_resolve(self) -> None:
        self.bands.run(self._resolve_band)

    def _resolve_band(self, band: Band) -> None:
        f = self.frame
        inputs = [band.camera, f.flagged_mesh(self.effects), band.of(self.queues.nearest)]
        outputs = [band.fields_of(f.hits(0)), band.of(self.hit), band.of(self.rounded), self.queues.touched]
        switches = replace(self.effects.switches(), closed=self.effects.closed)
        kernel = specialised(resolve.make_resolve_kernel(self._points), switches)
        f.launch(kernel, band.thread_count(), inputs, outputs, BLOCK_DIM)


def resolved_late(passes: list[Pass], others: list[Pass], first: bool) -> list[Pass]:
    """The camera's passes, and ``others``, of which few or none read the answers: on a GPU these are resolved where
    they leave it idle. first: whether the pass stands before the others, because one reads what it writes.
    """
    *before, resolving = passes
    resolving = resolving.hinted(overlap=True, yields=True)
    others = [work if work.hints.early else work.hinted(phase=1) for work in others]
    return [*before, resolving, *others] if first else [*before, *others, resolving]


def stream_steps(camera: Camera) -> list[Step]:
    """The stream of triangles, and on a GPU the rows of larger ones."""
    f, q, size = camera.frame, camera.queues, camera.settings.chunk
    name = "stream triangles"
    if not q.queued:
        streamed = camera.stream(on_cpu.stream_kernel, q.share_threads // int(BLOCK_DIM))
        return [(name, (), ("items",), streamed), undecided_step(camera)]
    last, sets = rows.BLOCKS_OF_LAST * int(BLOCK_DIM) * wp.get_device(f.device).sm_count, (q.nearest,)
    of_rows = camera.step(rows.rows_kernel, q.threads, q.threads, size, f.camera, f.alpha, sets=sets)
    further = camera.step(rows.last_kernel, last, last, size, f.camera, f.mesh, f.alpha, sets=sets)
    return [
        (name, (), ("items",), camera.stream(stream.make_stream_kernel(), q.share_threads)),
        ("queued rows", ("items",), ("chunks",), of_rows),
        ("further chunks, undecided pairs", ("chunks",), (), further),
    ]


def undecided_step(camera: Camera) -> Step:
    """The last step, where undecided pairs have a pass of their own."""
    f, q = camera.frame, camera.queues
    launch = camera.step(
        stream.undecided_kernel, q.few_threads, q.few_threads, f.camera, f.mesh, f.alpha, sets=(q.nearest,)
    )
    return ("undecided pairs", (), (), launch)


@wp.kernel(enable_backward=False, grid_stride=False)
def tests_kernel(
    inline_pixels: wp.int32, queued: wp.bool, camera: CameraArrays, mesh: Mesh, tests: wp.array(dtype=wp.int32)
):
    """One thread per triangle: one more test for each pixel that :mod:`.stream` and :mod:`.rows` test it against."""
    i = wp.tid()
    o = entry(camera.eye, 0)
    corners = corners_at(mesh, i)
    box = stream.box_of(corners, o, camera)
    if entry(mesh.valid, i) == wp.uint8(0) or box[2] < box[0] or box[3] < box[1]:
        return
    inline = (box[2] - box[0] + 1) * (box[3] - box[1] + 1) <= inline_pixels
    tall = not inline and queued and box[3] - box[1] >= stream.TALL * (box[2] - box[0] + 1)
    lines = stream.lines_of(edge_planes(o, corners), sign_bound(camera.tangents), tall, camera)
    low = wp.where(tall, box[1], box[0])
    high = wp.where(tall, box[3], box[2])
    for line in range(wp.where(tall, box[0], box[1]), wp.where(tall, box[2], box[3]) + 1):
        ends = wp.vec2i(low, high)
        if not inline:
            ends = stream.ends_of_line(lines, line, low, high, camera)
        for along in range(ends[0], ends[1] + 1):
            wp.atomic_add(tests, wp.where(tall, along * camera.width + line, line * camera.width + along), 1)


def tests_per_pixel(camera: Camera) -> NDArray[np.int32]:
    """The tests of each primary ray of the last frame, of a camera with the stream's own steps."""
    f = camera.frame
    tests = wp.zeros(f.pixels, dtype=wp.int32, device=f.device)
    kernel = specialised(tests_kernel, camera.effects.switches())
    f.launch(kernel, f.triangle_count, [camera.settings.inline_pixels, camera.queues.queued, f.camera, f.mesh], [tests])
    return tests.numpy()
