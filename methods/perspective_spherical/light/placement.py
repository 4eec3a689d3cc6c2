"""Host side of where a light's shadow rays lie: its axes, its rectangles and the edges of their tiles (section 4.1)."""

import math

import warp as wp

from ....harness.frame.effects.receivers import facing_passes, facing_reads
from ....harness.frame.effects.specialise import specialised
from ....harness.frame.schedule.passes import Pass
from ...common.bounds import launch_bounds
from ...common.pairs import zeroed
from ..camera.grid import CameraGrid
from ..camera.ray_tests import WIDENINGS
from ..lists.binning import GridSettings
from ..lists.sorting import TileLists
from ..lists.staging import wide
from ..parameters import CLAMPS, LIGHT_MAPS
from . import rays
from .mapping import LightSpace
from .rays import FLOAT32_PAD, FLOAT64_PAD, LightRays
from .rectangle import make_clamp_kernel, scene_kernel
from .tile_edges import EXTENT, LightTiles, edges_kernel

PARALLEL_PAD = 2.0**-45
"""How far the rays of a directional light turn, seen from its proxy position 2^24 scene radii away: 2 (2^-24)^2, and
twice that again.
"""

REDUCE_BLOCK, REDUCE_THREADS = 256, 1 << 17


def marks_receivers(cuda: bool) -> bool:
    """Whether the pass that maps the rays marks the receivers. On a GPU a pass for them, and conditions around the passes
    between two sorts, take longer than passes without a ray.
    """
    return cuda


class LightPlaces:
    """Which pixels have a shadow ray to one light, and where in the light's rectangles each ray lies.

    rays   :class:`.rays.LightRays`            space  :class:`.mapping.LightSpace`
    grid   :class:`.tile_edges.LightTiles`: its rectangles and the edges of its tiles
    marks  whether the receivers are marked here (:func:`marks_receivers`)
    """

    def __init__(self, settings: GridSettings, index: int, camera: CameraGrid):
        self.settings, self.index, self.camera = settings, index, camera
        self.frame, self.build, self.effects = frame, build, effects = settings.frame, settings.build, settings.effects
        double = build.precision == "float64"
        self.pad = FLOAT64_PAD if double else FLOAT32_PAD
        if effects.is_directional(index):
            self.pad += PARALLEL_PAD
        self.of_scene = build.clamp == "scene"
        self.marks = effects.has_receivers(index) and marks_receivers(wp.get_device(frame.device).is_cuda)
        n, faces = build.light_tiles, build.light_faces
        many = wide(frame.device)
        threads = min(REDUCE_THREADS, -(-frame.pixels // (1 if many else 128)))
        self.reduce_threads = -(-threads // REDUCE_BLOCK) * REDUCE_BLOCK if many else threads
        corners = faces * int(EXTENT)
        with wp.ScopedDevice(frame.device):
            self.rays = zeroed(LightRays, frame.pixels, hit_points=camera.out.hit_points)
            self.space = zeroed(
                LightSpace, 1, index=index, map=LIGHT_MAPS.index(build.light_map), single=not double, aimed=build.aimed,
                lights=frame.lights, proxy_positions=frame.proxy_positions, pads=2, box=6,
                distance_pad=1e-9 if double else FLOAT32_PAD,
                # Where the rectangle is the scene's, the scene's box and a bound take the place of hit points and eye.
                eye=1 if self.of_scene else frame.eye,
            )  # fmt: skip
            self.grid = zeroed(
                LightTiles, faces * n, faces=faces, tiles=n, slices=build.light_slices,
                every_slice=build.depth_lists == "spans", skip_empty=build.skip_empty and not self.of_scene,
                widening=WIDENINGS[settings.test], extent=corners, stretch=faces, deepest=build.light_tile_count,
                spans=max(1, frame.triangle_count * faces), records=6 * max(1, frame.triangle_count), lists=TileLists(),
            )  # fmt: skip
            self.no_extent = wp.array(([math.inf] * 3 + [-math.inf] * 5) * faces, dtype=wp.float64)
            # Where the rectangle is the scene's: what it is made from, and what the rays are reduced to apart from it.
            self.scene_box = wp.zeros(6 if self.of_scene else 0, dtype=wp.float32)
            self.ray_box = wp.zeros(6 if self.of_scene else 0, dtype=wp.float64)
            self.ray_extent = wp.zeros(corners if self.of_scene else 0, dtype=wp.float64)

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
        f, faces = self.frame, self.grid.faces
        launch_bounds(f, self.scene_box)
        f.launch(scene_kernel, faces, [self.space, f.spots, self.scene_box, f.max_coordinate], [self.grid.extent])
        self._aim()
        self._edges()

    def launch_map_rays(self) -> None:
        """Receivers and the place of every ray, in rectangles that are there."""
        wp.copy(self.ray_extent, self.no_extent)
        self._box(self.ray_box)
        self._map(self.ray_extent)

    def launch_map(self) -> None:
        """Receivers, the light's axes, the place of every ray, the rectangles and the edges of their tiles."""
        f, b, faces, extent = self.frame, self.build, self.grid.faces, self.grid.extent
        wp.copy(extent, self.no_extent)
        self._box(self.space.box)
        self._aim()
        self._map(extent)
        if b.clamp != "hits":
            inputs = [faces, CLAMPS.index(b.clamp), 6, self.space, f.spots, f.camera, self.camera.grid.depth_range]
            f.launch(make_clamp_kernel(b.light_map), faces, inputs, [extent])
        self._edges()

    def _box(self, box: wp.array) -> None:
        f, threads = self.frame, self.reduce_threads
        wp.copy(box, self.no_extent[:6])
        inputs = [
            threads, self.marks, self.effects.facing, f.camera, f.mesh, self.space, f.spots, f.front_facing, f.hits(0)
        ]  # fmt: skip
        kernel = specialised(rays.box_kernel, self.effects.switches(self.index))
        f.launch(kernel, threads, inputs, [self.rays, f.receivers, box], REDUCE_BLOCK)

    def _aim(self) -> None:
        centred = self.build.precision == "float32-centred"
        self.frame.launch(rays.aim_kernel, 1, [centred, self.pad, self.frame.spots], [self.space])

    def _map(self, extent: wp.array) -> None:
        threads = self.reduce_threads
        self.frame.launch(rays.map_kernel, threads, [threads, self.space, self.rays], [extent], REDUCE_BLOCK)

    def _edges(self) -> None:
        self.frame.launch(edges_kernel, self.grid.columns.shape[0], [self.space.map, self.grid])
