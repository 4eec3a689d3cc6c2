"""Receivers: the hits that have a shadow ray to a light. A pass of the harness marks them, unless a method does.

The rule and its float64 arithmetic are those of :mod:`...judge.receivers`. The hit point is computed again from the
triangle of the answer, so that the mask does not depend on a method's own t. The pass clears the light's row of shadow
bits and records on the device whether the light has any receiver. If not, the light's other passes are not launched
(:func:`skippable`); in a captured graph the device decides this.
"""

import itertools
from collections.abc import Sequence
from dataclasses import replace

import warp as wp

from ...scene.effects import Effects, Switches
from ...scene.spotlight import DOUBT
from ..digits import wide_hit_point
from ..frame import Frame
from ..geometry import Camera, Corners, Hits, Mesh, Ray, Rays, corners_of, mirrored_ray, ray_of
from ..schedule.passes import Hints, Pass
from ..schedule.threads import Launch, in_ranges
from ..vectors import largest, to_float64
from .specialise import effects, specialised

DOUBT64 = wp.constant(wp.float64(DOUBT))

EACH = 64  # pixels of a thread that marks receivers on a CPU: few threads write the word that says there are any


@wp.func
def in_spot(spots: wp.array2d(dtype=wp.float64), index: wp.int32, v: wp.vec3d) -> wp.bool:
    """Whether the point at offset v from the light lies in its spot: as in :func:`...judge.receivers.in_spot`."""
    kind = spots[index, 0]
    if kind == wp.float64(0.0):
        return True
    f = spots[index, 1] * v[0] + spots[index, 2] * v[1] + spots[index, 3] * v[2]
    if kind == wp.float64(1.0):
        cosine = spots[index, 10]
        square = cosine * cosine * (v[0] * v[0] + v[1] * v[1] + v[2] * v[2])
        if cosine >= wp.float64(0.0):
            return f >= wp.float64(0.0) and f * f >= square
        return f >= wp.float64(0.0) or f * f <= square
    r = spots[index, 4] * v[0] + spots[index, 5] * v[1] + spots[index, 6] * v[2]
    u = spots[index, 7] * v[0] + spots[index, 8] * v[1] + spots[index, 9] * v[2]
    return (
        wp.abs(wp.atan2(r, f)) <= spots[index, 10] and wp.abs(wp.atan2(u, wp.sqrt(f * f + r * r))) <= spots[index, 11]
    )


@wp.func
def faces(n: wp.vec3d, size: wp.float64, seen: wp.vec3d, lit: wp.vec3d) -> wp.bool:
    """Whether eye and light, at offsets ``seen`` and ``lit``, may lie on one side (``judge.receivers.facing``)."""
    side_e = wp.dot(n, seen)
    side_l = wp.dot(n, lit)
    sure_e = wp.abs(side_e) > size * largest(seen)
    sure_l = wp.abs(side_l) > size * largest(lit)
    return not (sure_e and sure_l and ((side_e > wp.float64(0.0)) != (side_l > wp.float64(0.0))))


@wp.func
def faces_light(light: wp.int32, eye: wp.vec3f, corners: Corners, lights: wp.array(dtype=wp.vec3f)) -> wp.bool:
    """:func:`faces` of a triangle: all that :func:`receives` asks of rays from the eye to a light without a spot."""
    a = to_float64(corners.a)
    e = to_float64(corners.b) - a
    f = to_float64(corners.c) - a
    size = largest(e) * largest(f) * DOUBT64
    return faces(wp.cross(e, f), size, to_float64(eye) - a, to_float64(lights[light]) - a)


@wp.func
def receives(
    light: wp.int32, facing: wp.bool, ray: Ray, corners: Corners, lights: wp.array(dtype=wp.vec3f),
    spots: wp.array2d(dtype=wp.float64),
) -> wp.bool:  # fmt: skip
    """Whether the hit of a ray on a triangle has a shadow ray to a light."""
    a = to_float64(corners.a)
    n = wp.cross(to_float64(corners.b) - a, to_float64(corners.c) - a)
    o = to_float64(ray.origin)
    d = to_float64(ray.direction)
    wanted = wp.bool(True)
    if facing:
        wanted = faces_light(light, ray.origin, corners, lights)
    if wanted:
        t = wp.dot(n, a - o) / wp.dot(n, d)
        h = o + d * t
        if wp.static(effects.wide):
            h = wide_hit_point(ray, corners)
        wanted = in_spot(spots, light, h - to_float64(lights[light]))
    return wanted


@wp.func
def hit_receives(
    light: wp.int32, facing: wp.bool, ray: Ray, hit: wp.int32, mesh: Mesh, lights: wp.array(dtype=wp.vec3f),
    spots: wp.array2d(dtype=wp.float64), front_facing: wp.array2d(dtype=wp.uint8),
) -> wp.bool:  # fmt: skip
    """:func:`receives` of the hit of a ray on triangle ``hit``. ``front_facing``: of a primary ray, which triangles may
    face the light, if that is known (:class:`..frame.Frame`); else empty.
    """
    wanted = wp.bool(True)
    if front_facing.shape[0] > 0:
        wanted = front_facing[light, hit] != wp.uint8(0)
    elif facing:
        wanted = faces_light(light, ray.origin, corners_of(mesh, hit), lights)
    if wanted and spots[light, 0] != wp.float64(0.0):
        wanted = receives(light, False, ray, corners_of(mesh, hit), lights, spots)
    return wanted


@wp.func
def note_receiver(reached: wp.array(dtype=wp.int32)):
    """Set ``reached`` (int32 [1], or empty) to 1 where it is not: on a CPU threads would take the word in turns."""
    if reached.shape[0] == 0:
        return
    if reached[0] == 0:
        reached[0] = 1


@wp.kernel(enable_backward=False)
def receivers_kernel(
    first: wp.int32, number: wp.int32, each: wp.int32, light: wp.int32, facing: wp.bool, camera: Camera, mesh: Mesh,
    lights: wp.array(dtype=wp.vec3f), spots: wp.array2d(dtype=wp.float64), front_facing: wp.array2d(dtype=wp.uint8),
    hits: Hits, rays: Rays, receivers: wp.array2d(dtype=wp.uint8), reached: wp.array(dtype=wp.int32),
    shadowed: wp.array2d(dtype=wp.uint8),
):  # fmt: skip
    """1 where a pixel's hit has a shadow ray to the light; 0 elsewhere and at a miss. Clears the shadow bits. Of
    ``number`` pixels from ``first`` on; a thread takes ``each``.
    """
    start = wp.tid() * each
    some = wp.bool(False)
    for k in range(start, wp.min(start + each, number)):
        pixel = first + k
        shadowed[light, pixel] = wp.uint8(0)
        hit = hits.triangle[pixel]
        wanted = hit >= 0
        if wanted:
            ray = ray_of(camera, pixel)
            if wp.static(effects.bounced):
                ray = mirrored_ray(rays, pixel)
            wanted = hit_receives(light, facing, ray, hit, mesh, lights, spots, front_facing)
        receivers[light, pixel] = wp.uint8(wanted)
        some = some or wanted
    if some:
        note_receiver(reached)


@wp.kernel(enable_backward=False)
def facing_kernel(
    first: wp.int32, light: wp.int32, camera: Camera, mesh: Mesh, lights: wp.array(dtype=wp.vec3f),
    front_facing: wp.array2d(dtype=wp.uint8),
):  # fmt: skip
    """Which triangles may face a light (:func:`faces_light`); ``first``: of them, the first one here."""
    i = first + wp.tid()
    if mesh.valid[i] != wp.uint8(0):
        front_facing[light, i] = wp.uint8(faces_light(light, camera.eye[0], corners_of(mesh, i), lights))


def facing_reads(frame: Frame, effects: Effects, light: int) -> tuple[str, ...]:
    """What :func:`hit_receives` reads of a primary hit besides the scene."""
    known = effects.facing_by_triangle(frame.triangle_count, frame.pixels)
    return (f"facing triangles/{light}",) if known else ()


def facing_passes(frame: Frame, effects: Effects, light: int, threads: int) -> list[Pass]:
    """The pass that finds triangles that may face a light; none where hits decide. ``threads``: of a CPU."""
    made = facing_reads(frame, effects, light)
    if not made:
        return []
    if not frame.front_facing.size:
        shape = (frame.light_count, frame.triangle_count)
        frame.front_facing = wp.zeros(shape, dtype=wp.uint8, device=frame.device)

    def launch(first: int, number: int) -> None:
        inputs = [first, light, frame.camera, frame.mesh, frame.lights]
        frame.launch(facing_kernel, number, inputs, [frame.front_facing])

    together = in_ranges(launch, frame.triangle_count, threads, frame.device)
    name, reads = f"light {light}: facing triangles", ("points", "triangles", "camera", f"light/{light}")
    return [Pass(name, "shadow", reads, made, together, effect="receivers", hints=Hints(early=True))]


def marking_launch(frame: Frame, effects: Effects, light: int, bounce: int, threads: int) -> Launch:
    """Launch :func:`receivers_kernel` on all pixels, on a CPU in ``threads``."""
    front_facing = wp.empty((0, 0), dtype=wp.uint8, device=frame.device) if bounce else frame.front_facing
    reached = reached_by(frame, light, bounce)
    each = 1 if wp.get_device(frame.device).is_cuda else EACH

    def launch(first: int, number: int) -> None:
        kernel = specialised(receivers_kernel, Switches(bounced=frame.tabled(bounce), wide=effects.wide))
        scene = frame.camera, frame.mesh, frame.lights, frame.spots, front_facing
        inputs = [first, number, each, light, effects.facing, *scene, frame.hits(bounce), frame.rays(bounce)]
        frame.launch(kernel, -(-number // each), inputs, [frame.masks(bounce), reached, frame.bits(bounce)])

    together = in_ranges(launch, frame.pixels, threads, frame.device)

    def mark() -> None:
        reached.zero_()
        together()

    return mark


def receiver_passes(frame: Frame, effects: Effects, planned: Sequence[Pass] = (), threads: int = 1) -> list[Pass]:
    """One pass per bounce and per light to which only some hit points have a shadow ray, unless a ``planned`` pass marks
    them. ``threads``: of a CPU, 0 for one on each processor.
    """
    marked = {name for work in planned for name in work.writes}
    passes: list[Pass] = []
    for b, i in itertools.product(range(effects.bounces + 1), range(len(effects.shadows))):
        masks = effects.receiver_reads(i, b)
        if not masks or not marked.isdisjoint(masks):
            continue
        if b:
            name, effect, bits = f"bounce {b}, light {i}: receivers", "mirror", f"shadowed/{i}/{b}"
            seen: tuple[str, ...] = (f"hits/{b}", f"rays/{b}")
        else:
            name, effect, bits = f"light {i}: receivers", "receivers", f"shadowed/{i}"
            seen = ("hits", "camera", *facing_reads(frame, effects, i))
            passes += facing_passes(frame, effects, i, threads)
        reads = (*seen, "points", "triangles", f"light/{i}")
        launch, reached = marking_launch(frame, effects, i, b, threads), reached_by(frame, i, b)
        passes.append(Pass(name, "shadow", reads, (*masks, bits), launch, effect, reached=reached))
    return passes


def skippable(passes: list[Pass], effects: Effects) -> list[Pass]:
    """The same passes; those of a light with a mask of receivers get the condition that the light has a receiver, if the
    pass that marks them says so (:attr:`..schedule.passes.Pass.reached`).

    If rays bounce, the structure that a method builds for a light serves the hits of every bounce. So only the tracing
    passes, which read the receivers of their own hits, get the condition. In a captured graph, passes with scratch memory
    always run; without receivers they process the data of the last traced frame, and their results are not read. Passes
    listed before the receivers are found always run too: the condition would be that of the last frame.
    """
    given: dict[str | None, tuple[str, wp.array]] = {}
    for marking in passes:
        for name in marking.writes:
            if marking.reached is not None and name.startswith("receivers/"):
                given[name] = name, marking.reached
    for i in range(len(effects.shadows)):
        if f"receivers/{i}" in given and not effects.bounces:
            given[f"shadows/{i}"] = given[f"receivers/{i}"]

    result: list[Pass] = []
    made: set[str] = set()
    for work in passes:
        names = [name for name in (work.effect, *work.reads) if name in given and given[name][0] in made]
        result.append(replace(work, only_if=given[names[0]][1] if names else None))
        made.update(work.writes)
    return result


def reached_by(frame: Frame, light: int, bounce: int) -> wp.array:
    """Int32 [1]: not 0 if a hit of the bounce is a receiver of the light."""
    at = bounce * frame.light_count + light
    return frame.reached[at : at + 1]
