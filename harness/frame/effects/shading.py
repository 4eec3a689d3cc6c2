"""Shading: linear colour of each pixel from its hits, shadow bits and mirrored hits. Frames and pictures use one kernel.

Surfaces are diffuse and two-sided: the geometric normal is turned towards the origin of the ray. A light adds colour
times intensity times the cosine, times the spot's factor (0 outside, cos^falloff inside); there is no attenuation with
distance, so that a scene looks the same at any scale. A light behind the visible side and a light whose shadow bit is
set add nothing. A light with an area adds the mean of what its targets add, each as a light of its own.
Because the geometric normal is used, there is no terminator problem: the cosine is zero or less exactly where the
triangle's own plane would shadow it. A mirror adds :data:`REFLECTANCE` of the colour that its ray sees to the rest of its
own colour.

The picture shows the answers of a method: the triangle gives the normal, t the position. Wrong answers are visible.
"""

from collections.abc import Callable, Sequence
from typing import Any

import numpy as np
import warp as wp
from numpy.typing import NDArray

from ...arrays import F32
from ...scene.effects import Effects, Switches
from ...scene.moment import Moment
from ...scene.prepared import Prepared
from ...scene.scene import Light
from ...scene.spotlight import SPOT
from ...scene.targets import per_target
from ..frame import BOUNCED, Frame
from ..geometry import Bounces, Camera, Hits, Mesh, corners_of, filled, parallel_ray, ray_of
from ..materials import lamp_rows, reflectances
from ..schedule.passes import Pass
from ..vectors import to_float64
from .receivers import in_spot
from .specialise import effects, specialised

AMBIENT = wp.constant(wp.float64(0.22))
HEADLIGHT = wp.constant(wp.float64(0.05))
SKYLIGHT = wp.constant(wp.vec3d(0.96, 0.99, 1.04))  # colour of the ambient light, slightly blue as from the sky

SKY_TOP = wp.constant(wp.vec3d(0.60085957, 0.70707411, 0.84391996))
SKY_BOTTOM = wp.constant(wp.vec3d(0.93063122, 0.95278825, 0.97524999))
"""Linear radiance of the background; displayed as the colours (0.80, 0.86, 0.93) and (0.96, 0.97, 0.98)."""

REFLECTANCE = wp.constant(wp.float64(0.85))  # share of the reflection in a mirror's colour; the rest is its own

ZERO = wp.constant(wp.float64(0.0))
ONE = wp.constant(wp.float64(1.0))


@wp.func
def sky(share: wp.float64) -> wp.vec3d:
    """The background colour; the argument is 0 at the top and 1 at the bottom."""
    return SKY_TOP * (ONE - share) + SKY_BOTTOM * share


@wp.func
def sky_along(d: wp.vec3d, up: wp.vec3d) -> wp.vec3d:
    """The background colour for a mirrored ray that hits nothing."""
    return sky((ONE - wp.dot(wp.normalize(d), up)) * wp.float64(0.5))


@wp.struct
class Looks:
    """Appearance of surfaces and lights.

    up      the camera's up direction, unit length
    count   triangles of the scene
    tint    vec3f [triangle_count]      lights  vec3f [light_count]
    spots   float64 [light_count, 12]   lamps   float64 [light_count, 5]: see :class:`..frame.Frame`
    """

    up: wp.vec3d
    count: wp.int32
    tint: wp.array(dtype=wp.vec3f)
    lights: wp.array(dtype=wp.vec3f)
    spots: wp.array2d(dtype=wp.float64)
    lamps: wp.array2d(dtype=wp.float64)


@wp.func
def radiance(
    o: wp.vec3d, d: wp.vec3d, t: wp.float32, hit: wp.int32, pixel: wp.int32, mesh: Mesh, looks: Looks,
    shadowed: wp.array2d(dtype=wp.uint8),
) -> wp.vec3d:  # fmt: skip
    """The radiance from the surface of triangle ``hit`` towards the origin of the ray o + t d."""
    corners = corners_of(mesh, hit)
    a = to_float64(corners.a)
    n = wp.normalize(wp.cross(to_float64(corners.b) - a, to_float64(corners.c) - a))
    if not wp.isfinite(n):
        n = wp.vec3d(ZERO, ZERO, ZERO)
    facing = -wp.dot(n, wp.normalize(d))
    if facing < ZERO:
        n = -n
    place = o + d * wp.float64(t)
    grey = AMBIENT * (wp.float64(0.72) + wp.float64(0.28) * wp.dot(n, looks.up)) + HEADLIGHT * wp.abs(facing)
    total = SKYLIGHT * grey
    for i in range(looks.lamps.shape[0]):
        way = to_float64(looks.lights[i]) - place
        cosine = wp.dot(n, wp.normalize(way))
        if looks.lamps[i, 4] != ZERO and shadowed[i, pixel] != wp.uint8(0):
            cosine = ZERO
        if cosine > ZERO and in_spot(looks.spots, i, -way):
            if looks.lamps[i, 3] != ZERO:
                forward = wp.vec3d(looks.spots[i, 1], looks.spots[i, 2], looks.spots[i, 3])
                cosine *= wp.pow(wp.max(-wp.dot(forward, wp.normalize(way)), ZERO), looks.lamps[i, 3])
            total += wp.vec3d(looks.lamps[i, 0], looks.lamps[i, 1], looks.lamps[i, 2]) * cosine
    return wp.cw_mul(total, to_float64(looks.tint[hit]))


@wp.kernel(enable_backward=False)
def color_kernel(
    start: wp.int32, bounces: wp.int32, camera: Camera, mesh: Mesh, looks: Looks, hits: Hits,
    shadowed: wp.array2d(dtype=wp.uint8), mirrored: Bounces, color: wp.array(dtype=wp.vec3f),
):  # fmt: skip
    """The linear colour of pixel ``start`` + thread index, written at the thread index."""
    pixel = start + wp.tid()
    hit = hits.triangle[pixel]
    t = hits.t[pixel]
    # An answer with an invalid triangle index is shown as a miss; the score reports it.
    seen = sky(wp.float64(pixel // camera.width) / wp.float64(wp.max(1, camera.height - 1)))
    if hit >= 0 and hit < looks.count and wp.isfinite(t):
        ray = ray_of(camera, pixel)
        if wp.static(effects.orthographic):
            ray = parallel_ray(camera, pixel)
        o = to_float64(ray.origin)
        seen = radiance(o, to_float64(ray.direction), t, hit, pixel, mesh, looks, shadowed)
    if wp.static(effects.bounced):
        weight = wp.float64(1.0)
        total = wp.vec3d(ZERO, ZERO, ZERO)
        going = wp.bool(True)
        for b in range(bounces):
            if going and mirrored.active[b, pixel] == wp.uint8(1):
                total += seen * (weight * (ONE - REFLECTANCE))
                weight *= REFLECTANCE
                o = to_float64(mirrored.origin[b, pixel])
                d = to_float64(mirrored.direction[b, pixel])
                seen = sky_along(d, looks.up)
                hit = mirrored.triangle[b, pixel]
                t = mirrored.t[b, pixel]
                if hit >= 0 and hit < looks.count and wp.isfinite(t):
                    seen = radiance(o, d, t, hit, pixel, mesh, looks, mirrored.shadowed[b])
            else:
                going = wp.bool(False)
        seen = total + seen * weight
    color[wp.tid()] = wp.vec3f(wp.float32(seen[0]), wp.float32(seen[1]), wp.float32(seen[2]))


def unit_up(up: Sequence[float]) -> wp.vec3d:
    """The up direction of a camera, unit length; zero if the camera has none."""
    vector = np.asarray(up, dtype=np.float64)
    return wp.vec3d(*(vector / (np.linalg.norm(vector) or 1.0)))


def shading_passes(frame: Frame, effects: Effects) -> list[Pass]:
    """The pass that fills ``frame.color``, if colour is an output."""
    if not effects.color:
        return []
    looks = filled(
        Looks, up=unit_up(frame.prepared.scene.camera.up), count=frame.triangle_count, tint=frame.tint,
        lights=frame.lights, spots=frame.spots, lamps=frame.lamps,
    )  # fmt: skip

    def launch() -> None:
        kernel = specialised(color_kernel, Switches(bounced=effects.bounces > 0, orthographic=effects.orthographic))
        answers = frame.hits(0), frame.answers.shadowed, frame.answers.bounces
        inputs = [0, effects.bounces, frame.camera, frame.mesh, looks, *answers]
        frame.launch(kernel, frame.pixels, inputs, [frame.color])

    lit = [i for i, wanted in enumerate(effects.shadows) if wanted]
    reads = ["hits", "camera", "points", "triangles", "surfaces", *(f"light/{i}" for i in range(frame.light_count))]
    reads += [f"shadowed/{i}" for i in lit]
    for b in range(1, effects.bounces + 1):
        reads += [f"rays/{b}", f"hits/{b}", *(f"shadowed/{i}/{b}" for i in lit)]
    return [Pass("shade", "trace", tuple(reads), ("color",), launch, effect="color")]


def shaded(
    prepared: Prepared, moment: Moment, answers: dict[str, NDArray], lights: Sequence[Light]
) -> Callable[[int, int], F32]:
    """A function (first pixel, number of pixels) to their linear colours, float32 [n, 3].

    It colours answers on the host (:meth:`..frame.Answers.to_host`). On a CPU, several threads may call it at once.
    The bits of lights without shadows do not count. ``lights`` gives colours, flags and numbers of targets; positions and
    spots come from the moment. Runs on the CPU; if Warp cannot compile for it, on the first GPU.
    """
    device = "cpu" if wp.is_cpu_available() else "cuda:0"

    def on_device(values: NDArray, kind: type) -> wp.array:
        scalar = {wp.vec3f: np.float32, wp.vec3i: np.int32}.get(kind) or wp.dtype_to_numpy(kind)
        return wp.array(np.ascontiguousarray(values, dtype=scalar), dtype=kind, device=device, copy=False)

    def filled_from(struct: Any, **fields: Any) -> Any:
        """A struct with arrays of the host, which get the types that it declares."""
        arrays = {name: values for name, values in fields.items() if isinstance(values, np.ndarray)}
        kinds = {name: struct.vars[name].type.dtype for name in arrays}
        return filled(struct, **fields | {name: on_device(arrays[name], kind) for name, kind in kinds.items()})

    pixels = moment.width * moment.height
    bits = np.asarray(answers["shadowed"]).reshape(-1, pixels)
    lights = per_target(lights)
    lamps = lamp_rows(lights, [light.shadows and i < len(bits) for i, light in enumerate(lights)])
    spots = np.zeros((max(1, len(lights)), SPOT))
    spots[: len(moment.spots)] = moment.spots[: len(spots)]
    bounces = len(answers.get("bounce_active", ()))
    mirrored = filled_from(
        Bounces, **{one: answers[f"bounce_{one}"] for one in BOUNCED if bounces and f"bounce_{one}" in answers}
    )
    seen = {"tint": reflectances(prepared), "lights": moment.lights, "spots": spots, "lamps": lamps}
    looks = filled_from(Looks, up=unit_up(prepared.scene.camera.up), count=prepared.triangle_count, **seen)
    image = {name: getattr(moment, name) for name in ("width", "height", "axes", "column", "row")}
    camera = filled_from(Camera, eye=moment.eye.reshape(1, 3), **image)
    mesh = filled_from(Mesh, points=moment.points, triangles=prepared.faces)
    hits = filled_from(Hits, triangle=answers["triangle"], t=answers["t"])
    inputs = [bounces, camera, mesh, looks, hits, on_device(bits, wp.uint8), mirrored]
    kernel = specialised(color_kernel, Switches(bounced=bounces > 0, orthographic=moment.orthographic))

    def colors(first: int, count: int) -> F32:
        color = wp.empty(count, dtype=wp.vec3f, device=device)
        wp.launch(kernel, dim=count, inputs=[first, *inputs], outputs=[color], device=device)
        return color.numpy()

    return colors
