"""All rays of a frame through a tree: arrays, launches, and the passes of the frame."""

import functools
from typing import Any

import numpy as np
import warp as wp
from numpy.typing import NDArray

from ....harness.frame.effects.mirrors import traced_bounces
from ....harness.frame.effects.receivers import facing_passes, facing_reads
from ....harness.frame.effects.specialise import specialised
from ....harness.frame.frame import Frame
from ....harness.frame.geometry import filled
from ....harness.frame.schedule.passes import Pass, joined
from ....harness.frame.schedule.threads import cpu_threads
from ....harness.scene.effects import Effects
from ...gpu.reserve import counted
from .. import constants
from ..nodes import Tree
from ..records import planes
from ..records.planes import LightPlanes
from ..records.rays import float32_ray_kernel, ray_kernel
from .closest import Share, list_kernel, make_eye_kernel, make_listed_kernel, make_resolve_kernel, make_tests_kernel
from .order import Order
from .shadow import Lit, make_shadow_kernel, make_shadow_tests_kernel, make_together_kernel
from .shares import Shares
from .undecided import Undecided

SCENE = ("bvh", "points", "triangles")
RAY_RECORDS = "ray triangles"
"""Resource: records of triangles for rays that lie in arrays."""


def marks_receivers(cuda: bool, effects: Effects) -> bool:
    """Whether the shadow rays of primary hits mark the receivers. On a GPU a pass for them and a condition take longer than
    threads without a ray.
    """
    return cuda and not effects.orthographic


class TreeRays:
    """The rays of a frame, and where they are kept.

    counts   int32 [bounces + 1, lights + 1, shares]: pairs left to float64, of the rays of each bounce (0: primary rays),
             then of the shadow rays of their hits to each light
    pairs    vec2i [capacity] for each share: those beyond two of a ray, of one launch after another (:mod:`.undecided`);
             or of the eye's rays and of the light's, if they are traced together
    starts   for each bounce vec3f [pixels]: :class:`.closest.Share`
    planes   for each light with shadows :class:`..records.planes.LightPlanes`
    marks    whether shadow rays mark the receivers (:func:`marks_receivers`)
    orders   whether the blocks of primary rays are sorted in each frame (:mod:`.order`)
    joint    the light whose shadow rays are traced together with the primary rays, or None
             (:func:`.shadow.make_together_kernel`)

    Of rays that lie in arrays, mirrored ones and those of an orthographic camera (:mod:`.closest`):

    ray_records  vec4f [3 * triangles]: :mod:`..records.rays`
    lengths      int32 [bounces + 1, shares]: how many pixels of each share have a ray
    lists        for each bounce and share, which: int32 [threads]
    found        vec4i [threads] for each share: what the traversal of each ray gave

    ``precision``: "exact" or "float32" (holes, rays of an orthographic camera and to a directional light are exact in
    either case); ``packets``: of rays from the eye on a GPU, through a tree of one level; ``threads``: of a CPU;
    ``shares``: of a GPU; ``capacity``: of the pairs. ``primary_starts``: those of the primary hits, if another method finds
    these. ``together``: whether a GPU traces the rays of the eye and of a light in one launch, if there is one light and all
    hits receive it.
    """

    def __init__(
        self,
        frame: Frame,
        tree: Tree,
        effects: Effects,
        precision: str,
        packets: bool,
        threads: int,
        shares: int,
        capacity: int,
        primary_starts: wp.array | None = None,
        together: bool = False,
    ):
        self.frame, self.tree, self.effects, self.threads = frame, tree, effects, threads
        self.levels = 2 if tree.bodies else 1
        self.exact = precision == "exact" or effects.alpha or effects.orthographic
        self.lights = [i for i, wanted in enumerate(effects.shadows) if wanted]
        cuda = wp.get_device(frame.device).is_cuda
        self.packets = packets and self.levels == 1 and cuda
        self.marks = marks_receivers(cuda, effects)
        self.orders = cuda and frame.triangle_count < constants.MANY_TRIANGLES
        self.joint = self._joint() if cuda and together else None
        if self.joint is not None:
            shares = 1
        self.shares = Shares(frame, shares if cuda else cpu_threads(threads, frame.device))
        # On a GPU, where a bounce is one chain of passes, it is not divided into shares.
        listing = bool(effects.bounces or effects.orthographic)
        self.listed_shares = Shares(frame, 1) if cuda and listing else self.shares
        count, bounces = frame.triangle_count, range(effects.bounces + 1)
        listed = range(self.listed_shares.count if listing else 0)
        threads = self.listed_shares.threads
        with wp.ScopedDevice(frame.device):
            self.counts = wp.zeros((len(bounces), frame.light_count + 1, self.shares.count), dtype=wp.int32)
            lists = 2 if self.joint is not None else self.shares.count
            self.pairs = [wp.zeros(capacity, dtype=wp.vec2i) for _ in range(lists)]
            self.starts = [wp.zeros(frame.pixels, dtype=wp.vec3f) for _ in range(effects.bounces)]
            if primary_starts is None:
                primary_starts = wp.zeros(frame.pixels, dtype=wp.vec3f)
            self.starts.insert(0, primary_starts)
            exact = [i for i in self.lights if self._exactly(i)]
            self.planes = {
                i: filled(
                    LightPlanes,
                    edges=wp.zeros(3 * count, dtype=wp.vec4f),
                    sides=wp.zeros(count if i in exact else 0, dtype=wp.vec4f),
                    facing=wp.zeros(count + count % 2 if i in exact else 0, dtype=wp.uint8),  # read two at a time
                )
                for i in self.lights
            }
            self.joined = wp.array(planes.joined_pairs(frame.prepared) if exact else [], dtype=wp.uint8)
            self.eye_records = wp.zeros(0, dtype=wp.vec4f)
            self.ray_records = wp.zeros(3 * count if listed else 0, dtype=wp.vec4f)
            self.lengths = wp.zeros((len(bounces), len(listed)), dtype=wp.int32)
            self.lists = [[wp.zeros(threads, dtype=wp.int32) for _ in listed] for _ in bounces]
            self.found = [wp.zeros(threads if self.exact else 0, dtype=wp.vec4i) for _ in listed]
        self._made: dict[Any, Any] = {}

    def built(self) -> dict[str, int]:
        """For :meth:`....harness.frame.method.Method.built`: threads of a CPU."""
        return {"threads": self.shares.count} if self.shares.threaded else {}

    def undecided_pairs(self) -> dict[str, int]:
        """The pairs of the last frame that were left to float64, by kind of rays."""
        found = counted(self.counts.numpy().astype(np.int64)).sum(axis=2)
        pairs = {"primary": int(found[0, 0]), "shadow": int(found[:, 1:].sum())}
        if self.effects.bounces:
            pairs["mirror"] = int(found[1:, 0].sum())
        return pairs

    def tests_per_pixel(self) -> tuple[NDArray[np.int32], NDArray[np.int32]]:
        """Triangle tests of each pixel's primary ray of the last frame, traced again alone, not in a packet, and of the
        shadow rays of its hit.
        """
        f = self.frame
        records, triangles = ("ray", self.ray_records) if self.effects.orthographic else ("eye", self.eye_records)
        tests, shadow = (wp.zeros(f.pixels, dtype=wp.int32, device=f.device) for _ in range(2))
        kernel = specialised(make_tests_kernel(records, self.exact, self.levels), self.effects.switches())
        f.launch(kernel, f.pixels, [self._share(0, 0), triangles, Undecided()], [tests])
        for i in self.lights:
            kernel = specialised(make_shadow_tests_kernel(self._exactly(i), self.levels), self.effects.switches(i))
            f.launch(kernel, f.pixels, [self._share(0, 0), self._lit(i, 0), Undecided()], [shadow])
        return tests.numpy(), shadow.numpy()

    def _exactly(self, light: int) -> bool:
        """Whether the shadow rays of a light are exact: float32 cannot trace rays from a directional one, which lies where
        its numbers end.
        """
        return self.exact or self.effects.is_directional(light)

    def _joint(self) -> int | None:
        """The only light with shadows, if its rays can be traced together with the eye's."""
        e = self.effects
        if e.orthographic or len(self.lights) != 1 or e.has_receivers(self.lights[0]):
            return None
        return self.lights[0] if self._exactly(self.lights[0]) == self.exact else None

    def record_passes(self) -> list[Pass]:
        """Records of the triangles for rays without a common origin and for the lights; they need no tree. Not those for the
        lights whose receivers another pass marks (:meth:`late_passes`).
        """
        passes = []
        if self.found:
            effect = None if self.effects.orthographic else "mirror"
            reads = ("points", "triangles")
            passes.append(Pass("rays: triangles", "trace", reads, (RAY_RECORDS,), self._ray_records, effect))
        passes += [self._light_pass(i) for i in self.lights if not self._late(i)]
        if self.marks:
            for i in self.lights:
                passes += facing_passes(self.frame, self.effects, i, self.threads)
        return passes

    def late_passes(self) -> list[Pass]:
        """Records for the other lights: after the hits, and left out where none receives the light."""
        return [self._light_pass(i) for i in self.lights if self._late(i)]

    def _late(self, light: int) -> bool:
        return self.effects.has_receivers(light) and not self.marks

    def _light_pass(self, light: int) -> Pass:
        reads = ("points", "triangles", f"light/{light}", *(("extent",) if self._exactly(light) else ()))
        made, launch = (f"light triangles/{light}",), functools.partial(self._light_records, light)
        return Pass(f"light {light}: triangles", "light build", reads, made, launch, f"shadows/{light}")

    def eye_passes(self) -> list[Pass]:
        """The order of blocks, records of the triangles for the eye, and the counters of its rays cleared. They need no
        tree.
        """
        if self.effects.orthographic:
            return []
        f = self.frame
        self.eye_records = wp.zeros(3 * f.triangle_count, dtype=wp.vec4f, device=f.device)
        reads, made = ("points", "triangles", "camera"), ("eye triangles", "primary counts")
        ordered = [Order(f, self.shares).find_pass()] if self.orders else []
        return [*ordered, Pass("eye: triangles", "trace", reads, made, self._eye_records)]

    def clear_passes(self) -> list[Pass]:
        """The counters of lights whose rays are exact, before the shadow rays of primary hits."""
        return [self._clear_pass(i) for i in self.lights if self._exactly(i) and i != self.joint]

    def _clear_pass(self, light: int) -> Pass:
        made, launch = f"shadow counts/{light}", self.counts[0, 1 + light].zero_
        return Pass(f"light {light}: clear counts", "shadow", (), (made,), launch, f"shadows/{light}")

    def passes(self, primary: bool) -> list[Pass]:
        """``primary`` rays, if they are traced here, and the shadow rays of their hits, in shares that run concurrently.
        The records for each light come before its rays.
        """
        if self.effects.orthographic:
            passes = self._parallel_passes()
        elif self.joint is not None:
            passes = [self._joint_pass(self.joint)]
        else:
            passes = self.shares.passes(functools.partial(self._share_passes, primary))
        for late in self.late_passes():
            made = set(late.writes)
            passes.insert(next(k for k, step in enumerate(passes) if made.intersection(step.reads)), late)
        return passes

    def _eye_reads(self) -> tuple[str, ...]:
        """What primary rays read besides the scene."""
        ordered = ("blocks",) if self.orders else ()
        return ("eye triangles", "primary counts", *ordered, *(("extent",) if self.exact else ()))

    def _joint_pass(self, light: int) -> Pass:
        """Primary rays, and the shadow rays of their hits to the only light; those alone where only the light moved."""
        primary, shadow = self._share_passes(True, 0)
        apart = (primary, *([self._clear_pass(light)] if self.exact else []), shadow)
        return joined(
            f"primary rays, and shadow rays of light {light}", apart, functools.partial(self._together, light)
        )

    def _share_passes(self, primary: bool, share: int) -> list[Pass]:
        """The steps of one share of the pixels. ``hits`` is all shares', ``hits of`` what a share continues with."""
        of, run = self.shares.of(share), functools.partial
        seen = (*SCENE, "camera", *self.effects.surface_reads())
        hits, passes = "hits", []
        if primary:
            hits = f"hits of share{of}"
            reads, found = (*seen, *self._eye_reads()), ("hits", hits, "primary counts")
            passes.append(Pass(f"primary rays{of}", "trace", reads, found, run(self._primary, share)))
        for i in self.lights:
            counts, masks = f"shadow counts/{i}", self.effects.receiver_reads(i)
            marked, given = (masks, facing_reads(self.frame, self.effects, i)) if self.marks else ((), masks)
            reads = (*seen, hits, f"light/{i}", f"light triangles/{i}", counts, "max_coordinate", *given)
            made = (f"shadowed/{i}", f"undecided/{i}{of}", counts, *marked)
            launch = run(self._shadow, i, 0, share)
            passes.append(Pass(f"light {i}: shadow rays{of}", "shadow", reads, made, launch, f"shadows/{i}"))
        return passes

    def _parallel_passes(self) -> list[Pass]:
        """Primary rays of an orthographic camera and the shadow rays of their hits."""
        seen = (*SCENE, "camera", "max_coordinate", *self.effects.surface_reads())
        passes = [Pass("primary rays", "trace", (*seen, RAY_RECORDS), ("hits",), lambda: self.trace_listed(0))]
        for i in self.lights:
            reads = (*seen, "hits", f"light/{i}", f"light triangles/{i}", *self.effects.receiver_reads(i))
            launch = functools.partial(self.trace_listed, 0, i)
            made = (f"shadowed/{i}",)
            passes.append(Pass(f"light {i}: shadow rays", "shadow", reads, made, launch, f"shadows/{i}"))
        return passes

    def bounce_passes(self) -> list[Pass]:
        """Mirrored rays, and the shadow rays of their hits."""
        return traced_bounces(
            self.effects, (*SCENE, "max_coordinate", RAY_RECORDS), self.trace_listed, lambda i, b: self.trace_listed(b, i),
            lambda i: (f"light triangles/{i}",),
        )  # fmt: skip

    def _light_records(self, light: int) -> None:
        f, made = self.frame, self.planes[light]
        kernel, inputs, outputs = planes.float32_kernel, [f.mesh, light, f.lights], [made.edges]
        if self._exactly(light):
            kernel, outputs = planes.light_kernel, [made.edges, made.sides, made.facing]
            inputs = [f.mesh, light, f.lights, self.tree.extent, self.joined]
        f.launch(kernel, f.triangle_count, inputs, outputs)

    def _eye_records(self) -> None:
        f = self.frame
        if self.exact:
            cleared = self.counts[0, 0] if self.joint is None else self.counts[0].flatten()
            f.launch(planes.eye_kernel, f.triangle_count, [f.mesh, f.eye], [self.eye_records, cleared])
        else:
            f.launch(planes.float32_kernel, f.triangle_count, [f.mesh, 0, f.eye], [self.eye_records])

    def _ray_records(self) -> None:
        f = self.frame
        f.launch(ray_kernel if self.exact else float32_ray_kernel, f.triangle_count, [f.mesh], [self.ray_records])

    def _shares_of(self, bounce: int) -> Shares:
        return self.listed_shares if self.frame.tabled(bounce) else self.shares

    def _share(self, bounce: int, share: int) -> Any:
        if ("share", bounce, share) not in self._made:
            f, listed = self.frame, {}
            if f.tabled(bounce):
                listed = {"listed": self.lists[bounce][share], "count": self.lengths[bounce, share : share + 1]}
            self._made["share", bounce, share] = filled(
                Share, camera=f.camera, tiles=self._shares_of(bounce).tiles[share], rays=f.rays(bounce), tree=self.tree,
                mesh=f.mesh, alpha=f.alpha, hits=f.hits(bounce), starts=self.starts[bounce], **listed,
            )  # fmt: skip
        return self._made["share", bounce, share]

    def _lit(self, light: int, bounce: int) -> Any:
        if ("lit", light, bounce) not in self._made:
            f = self.frame
            self._made["lit", light, bounce] = filled(
                Lit, light=light, faces=self.effects.facing, lights=f.lights, spots=f.spots, front_facing=f.front_facing,
                planes=self.planes[light], receivers=f.masks(bounce), shadowed=f.bits(bounce),
            )  # fmt: skip
        return self._made["lit", light, bounce]

    def _undecided(self, bounce: int, slot: int, share: int, pairs: int | None = None) -> Any:
        room = self.pairs[share if pairs is None else pairs]
        return filled(Undecided, count=self.counts[bounce, slot, share : share + 1], pairs=room)

    def _launch(self, kernel: wp.Kernel, switches: Any, bounce: int, share: int, *given: Any) -> None:
        inputs = [self._share(bounce, share), *given]
        self.frame.launch(specialised(kernel, switches), self._shares_of(bounce).threads, inputs, block=constants.BLOCK)

    def _primary(self, share: int) -> None:
        kernel = make_eye_kernel(self.exact, self.packets, self.levels)
        self._launch(kernel, self.effects.switches(), 0, share, self.eye_records, self._undecided(0, 0, share))

    def _together(self, light: int) -> None:
        kernel = make_together_kernel(self.exact, self.packets, self.levels)
        seen = [self.eye_records, self._undecided(0, 0, 0)]
        lit = [self._lit(light, 0), self._undecided(0, 1 + light, 0, pairs=1)]
        self._launch(kernel, self.effects.switches(light), 0, 0, *seen, *lit)

    def _shadow(self, light: int, bounce: int, share: int) -> None:
        kernel = make_shadow_kernel(self._exactly(light), self.marks and bounce == 0, self.levels)
        given = [self._lit(light, bounce), self._undecided(bounce, 1 + light, share)]
        self._launch(kernel, self.effects.switches(light, bounce), bounce, share, *given)

    def _closest(self, bounce: int, share: int) -> None:
        """The hits of a share's listed rays, and the points that shadow rays start at."""
        switches, undecided = self.effects.switches(bounce=1), self._undecided(bounce, 0, share)
        self._launch(list_kernel, switches, bounce, share)
        kernel = make_listed_kernel(self.exact, self.levels)
        self._launch(kernel, switches, bounce, share, self.ray_records, undecided, self.found[share])
        if self.exact:
            self._launch(make_resolve_kernel(bounce == 0), switches, bounce, share, undecided, self.found[share])

    def trace_listed(self, bounce: int, light: int | None = None) -> None:
        """Trace listed rays of all shares, or with ``light`` the shadow rays of their hits."""
        self.counts[bounce, 0 if light is None else 1 + light].zero_()
        if light is None:
            self.lengths[bounce].zero_()
        else:
            self.frame.bits(bounce)[light].zero_()
        if (bounce, light) not in self._made:
            trace = self._closest if light is None else functools.partial(self._shadow, light)
            self._made[bounce, light] = self.listed_shares.launch(functools.partial(trace, bounce))
        self._made[bounce, light]()
