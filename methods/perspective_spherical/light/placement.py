"""Host side of where a light's shadow rays lie: its axes, its rectangles and the edges of their tiles (section 4.1)."""

import math

import warp as wp

from ....harness.frame.effects.receivers import facing_passes, facing_reads
from ....harness.frame.effects.specialise import specialised
from ....harness.frame.frame import Frame
from ....harness.frame.geometry import filled
from ....harness.frame.schedule.passes import Pass
from ....harness.scene.effects import Effects
from ...common.bounds import launch_bounds
from ..camera.grid import CameraGrid
from ..lists.staging import wide
from ..parameters import CLAMPS, LIGHT_MAPS, Build
from . import rays
from .mapping import LightSpace
from .rays import FLOAT32_PAD, FLOAT64_PAD
from .rectangle import make_clamp_kernel, scene_kernel
from .tile_edges import EXTENT, edges_kernel

PARALLEL_PAD = 2.0**-45
"""How far the rays of a directional light turn, seen from its proxy position 2^24 scene radii away: 2 (2^-24)^2, and
twice that again."""

REDUCE_BLOCK, REDUCE_THREADS = 256, 1 << 17


def marks_receivers(cuda: bool) -> bool:
    """Whether the pass that maps the rays marks the receivers. On a GPU a pass for them, and conditions around the passes
    between two sorts, take longer than passes without a ray."""
    return cuda


class LightPlaces:
    """Which pixels have a shadow ray to one light, and where in the light's rectangles each ray lies.

    receiver   uint8 [pixels]: which pixels have a shadow ray
    place      vec4d [pixels]: where the ray lies in the light's rectangles, its distance, which rectangle
    space      :class:`.light.mapping.LightSpace`
    extent     float64 [faces, 8]: lowest then highest coordinates and distance: the clamped rectangles
    columns, rows  vec4d [faces * light_tiles]: edges of the tiles
    marks      whether the receivers are marked here (:func:`marks_receivers`)
    """

    def __init__(self, frame: Frame, index: int, camera: CameraGrid, build: Build, effects: Effects):
        self.frame, self.index, self.camera, self.build, self.effects = frame, index, camera, build, effects
        self.map = LIGHT_MAPS.index(build.light_map)
        self.pad = FLOAT64_PAD if build.precision == "float64" else FLOAT32_PAD
        if effects.is_directional(index):
            self.pad += PARALLEL_PAD
        self.of_scene = build.clamp == "scene"
        self.marks = effects.has_receivers(index) and marks_receivers(wp.get_device(frame.device).is_cuda)
        n, faces = build.light_tiles, build.light_faces
        many = wide(frame.device)
        share = 1 if many else 128
        threads = min(REDUCE_THREADS, -(-frame.pixels // share))
        self.reduce_threads = -(-threads // REDUCE_BLOCK) * REDUCE_BLOCK if many else threads
        with wp.ScopedDevice(frame.device):
            self.receiver = wp.zeros(frame.pixels, dtype=wp.uint8)
            self.place = wp.zeros(frame.pixels, dtype=wp.vec4d)
            self.space = filled(
                LightSpace,
                index=index,
                lights=frame.lights,
                proxy_positions=frame.proxy_positions,
                axes=wp.zeros(1, dtype=wp.mat33d),
                pads=wp.zeros(2, dtype=wp.float64),
                distance_pad=1e-9 if build.precision == "float64" else FLOAT32_PAD,
                # Where the rectangle is the scene's, the scene's box and a bound take the place of hit points and eye.
                eye=wp.zeros(1, dtype=wp.vec3f) if self.of_scene else frame.eye,
                box=wp.zeros(6, dtype=wp.float64),
            )
            self.extent = wp.zeros(faces * int(EXTENT), dtype=wp.float64)
            self.no_extent = wp.array(([math.inf] * 3 + [-math.inf] * 5) * faces, dtype=wp.float64)
            self.columns = wp.zeros(faces * n, dtype=wp.vec4d)
            self.rows = wp.zeros(faces * n, dtype=wp.vec4d)
            self.stretch = wp.zeros(faces, dtype=wp.vec2d)
            # Where the rectangle is the scene's: what it is made from, and what the rays are reduced to apart from it.
            self.scene_box = wp.zeros(6 if self.of_scene else 0, dtype=wp.float32)
            self.ray_box = wp.zeros(6 if self.of_scene else 0, dtype=wp.float64)
            self.ray_extent = wp.zeros(self.extent.shape[0] if self.of_scene else 0, dtype=wp.float64)

    def passes(self) -> tuple[list[Pass], str, str]:
        """The passes, and the resources that hold the rectangles and the rays' places in them."""
        i, light, effect = self.index, f"light/{self.index}", f"shadows/{self.index}"
        rect = f"light rectangle/{i}"
        view = ("camera", "camera boxes") if self.build.clamp == "view" else ()
        masks = self.effects.receiver_reads(i)
        asked = ("points", "triangles", "camera", *facing_reads(self.frame, self.effects, i))
        seen = ("hits", light, *view, *(asked if self.marks else masks))
        made = masks if self.marks else ()
        first = facing_passes(self.frame, self.effects, i, threads=1) if self.marks else []
        if not self.of_scene:
            mapping = Pass(f"light {i}: map rays", "shadow", seen, (rect, *made), self.launch_map, effect)
            return [*first, mapping], rect, rect
        # The rectangle does not depend on the rays, so the grid is not rebuilt where only the camera moves.
        place = f"ray places/{i}"
        around = ("points", "triangles", "max_coordinate", light)
        passes = [
            *first,
            Pass(f"light {i}: rectangle", "light build", around, (rect,), self.launch_rectangle, effect),
            Pass(f"light {i}: map rays", "shadow", (*seen, rect), (place, *made), self.launch_map_rays, effect),
        ]
        return passes, rect, place

    def launch_rectangle(self) -> None:
        """The light's axes, the rectangles around the scene and the edges of their tiles, without any ray."""
        f, b = self.frame, self.build
        launch_bounds(f, self.scene_box)
        inputs = [self.map, b.aimed, self.space, f.spots, self.scene_box, f.max_coordinate]
        self._launch(scene_kernel, b.light_faces, inputs, [self.extent])
        self._aim()
        self._edges()

    def launch_map_rays(self) -> None:
        """Receivers and the place of every ray, in rectangles that are there."""
        wp.copy(self.ray_box, self.no_extent[:6])
        wp.copy(self.ray_extent, self.no_extent)
        self._box(self.ray_box)
        self._map(self.ray_extent)

    def launch_map(self) -> None:
        """Receivers, the light's axes, the place of every ray, the rectangles and the edges of their tiles."""
        f, b = self.frame, self.build
        wp.copy(self.space.box, self.no_extent[:6])
        wp.copy(self.extent, self.no_extent)
        self._box(self.space.box)
        self._aim()
        self._map(self.extent)
        if b.clamp != "hits":
            inputs = [b.light_faces, CLAMPS.index(b.clamp), b.aimed, 6, self.space, f.spots, f.camera]
            inputs.append(self.camera.depth_range)
            self._launch(make_clamp_kernel(b.light_map), b.light_faces, inputs, [self.extent])
        self._edges()

    def _box(self, box: wp.array) -> None:
        f = self.frame
        inputs = [
            f.pixels, self.reduce_threads, self.index, self.marks, self.effects.facing, f.camera, f.mesh, f.lights,
            f.spots, f.front_facing, f.hits(0), self.camera.hit,
        ]  # fmt: skip
        kernel = specialised(rays.box_kernel, self.effects.switches(self.index))
        self._launch(kernel, self.reduce_threads, inputs, [f.receivers, self.receiver, box], REDUCE_BLOCK)

    def _aim(self) -> None:
        f, b = self.frame, self.build
        centred = b.precision == "float32-centred"
        self._launch(rays.aim_kernel, 1, [b.aimed, centred, self.pad, f.spots], [self.space])

    def _map(self, extent: wp.array) -> None:
        single, threads = self.build.precision != "float64", self.reduce_threads
        inputs = [self.frame.pixels, threads, self.map, single, self.space, self.receiver, self.camera.hit]
        self._launch(rays.map_kernel, threads, inputs, [self.place, extent], REDUCE_BLOCK)

    def _edges(self) -> None:
        n, faces = self.build.light_tiles, self.build.light_faces
        outputs = [self.columns, self.rows, self.stretch]
        self._launch(edges_kernel, faces * n, [self.map, n, self.extent], outputs)

    def _launch(self, kernel: wp.Kernel, dim: int, inputs: list, outputs: list, block: int = 256) -> None:
        self.frame.launch(kernel, dim, inputs, outputs, block)
