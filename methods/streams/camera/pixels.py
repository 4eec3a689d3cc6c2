"""One pixel of the image against one triangle: edge planes in float32, and nearest hits as words.

The nearest hit of a pixel is stored as one 64-bit word, 1 / t and the complemented index, by atomic maximum: the order in
which triangles arrive does not matter. 1 / t has 40 bits, and up to eight that the index does not need. Edge functions in
float32 with an error bound decide all but a few pixels; those, and every 1 / t, are float64 (:mod:`...exact.triangle`).
"""

import warp as wp

from ....harness.frame.alpha import Alpha
from ....harness.frame.effects.specialise import effects
from ....harness.frame.geometry import Camera, Corners
from ...common.pixels import whole_quotient
from ...common.reads import direction_at
from ...exact.planes import farthest_corner, longest_edge, normal_through
from ...exact.triangle import U32, U64, largest, nearness_key, spare_bits, to_float64
from ...gpu.bits import lowest_bit, without_lowest_bit
from ...gpu.division import about_inverse, quotient, reciprocal
from ...gpu.entries import entry, entry_now, raise_entry
from ..queues import Queue, queue_undecided

LEAST_HEIGHT = wp.constant(wp.float64(2.0**-14))
LONGEST_WAY = wp.constant(wp.float32(32.0))
"""Of ``steep`` in :class:`Planes`."""


@wp.struct
class Planes:
    """Edge planes through the eye, scaled so that their parts are at most 2 and turned so that inside is positive.

    Signs of n . d beyond :func:`sign_bound` are certain; all three are zero where float64 must decide.

    steep: whether 1 / t of a :func:`hit_word` gives hit points to 2^-29 of their way from the eye, and that way is at most
    32 times the largest coordinate of the triangle. The word cuts 1 / t at 2^-29 of itself, so that the middle is off by
    2^-30. Rounding adds at most 2 NORMAL_UNITS S / |height|, with S at most 6 distance edge^2
    (:func:`...exact.triangle.hit_distance`): 2^-31 with the least height that is asked for.
    """

    n0: wp.vec3f
    n1: wp.vec3f
    n2: wp.vec3f
    steep: wp.bool


@wp.struct
class Candidate:
    """A triangle as pixels are tested against it.

    i      its index                        planes   its edge planes
    bound  a pixel with an edge function below -bound is certainly outside (:func:`sign_bound`)
    sure   three edge functions above this are a certain hit (:func:`sure_of`)
    m      1 / t = m . direction on its plane (:func:`inverse_depth`)
    spare  :func:`...exact.triangle.spare_bits`
    """

    i: wp.int32
    planes: Planes
    bound: wp.float32
    sure: wp.float32
    m: wp.vec3d
    spare: wp.int32


@wp.func
def largest_of(corners: Corners) -> wp.float32:
    """The largest coordinate of a triangle."""
    return wp.max(largest(corners.a), wp.max(largest(corners.b), largest(corners.c)))


@wp.func
def sure_of(i: wp.int32, bound: wp.float32, alpha: Alpha) -> wp.float32:
    """What signs must exceed to be a certain hit of triangle i: their bound; nothing exceeds it where that has holes."""
    sure = bound
    if wp.static(effects.alpha):
        if alpha.masked[i] != wp.uint8(0):
            sure = wp.INF
    return sure


@wp.func
def edge_planes(o: wp.vec3f, corners: Corners) -> Planes:
    """A triangle seen edge-on within rounding, or of a size beyond the range of float32, gets zeros."""
    distance = farthest_corner(o, corners)
    edge = longest_edge(corners)
    planes = Planes()
    if not (distance * edge > 1.0e-30 and distance * edge < 1.0e30):
        return planes
    a64 = to_float64(corners.a)
    n = wp.cross(to_float64(corners.b) - a64, to_float64(corners.c) - a64)
    det = wp.dot(n, a64 - to_float64(o))
    product = wp.float64(distance) * wp.float64(edge) * wp.float64(edge)
    if not (wp.abs(det) > wp.float64(96.0) * U64 * product):
        return planes
    planes.steep = wp.abs(det) > LEAST_HEIGHT * product and distance < LONGEST_WAY * largest_of(corners)
    if wp.static(effects.wide):
        # Where sizes are unlike, 1 / t of another triangle may not be known by its plane in float64.
        if not planes.steep:
            return planes
    scale = about_inverse(distance * edge)
    if det < wp.float64(0.0):
        scale = -scale
    planes.n0 = normal_through(o, corners.b, corners.c) * scale
    planes.n1 = normal_through(o, corners.c, corners.a) * scale
    planes.n2 = normal_through(o, corners.a, corners.b) * scale
    return planes


@wp.func
def sign_bound(tangents: wp.array(dtype=wp.float32)) -> wp.float32:
    """Error of n . d for every pixel: 16 u |d|_1 of the sum (:mod:`...exact.planes`), 6 u |d|_1 of the scale. What the
    scale itself is off is the same for the three parts of n, so it moves no plane.

    Forward, right and up have length 1, so each sums to at most sqrt 3.
    """
    return 24.0 * U32 * 1.7321 * (1.0001 + tangents[0] + tangents[1])


@wp.func
def inverse_depth(o: wp.vec3f, corners: Corners) -> wp.vec3d:
    """m with 1 / t = m . d on the triangle's plane, float64, rounded as divisions round it; zero where the plane contains
    the eye.
    """
    a64 = to_float64(corners.a)
    n = wp.cross(to_float64(corners.b) - a64, to_float64(corners.c) - a64)
    height = wp.dot(n, a64 - to_float64(o))
    if height == wp.float64(0.0):
        return wp.vec3d()
    inverse = reciprocal(height)
    return wp.vec3d(quotient(n[0], height, inverse), quotient(n[1], height, inverse), quotient(n[2], height, inverse))


@wp.func
def candidate_of(
    i: wp.int32,
    o: wp.vec3f,
    corners: Corners,
    camera: Camera,
    alpha: Alpha,
    triangles: wp.int32,
    exact_path: wp.array(dtype=wp.uint8),
) -> Candidate:
    """A triangle, of so many, as pixels are tested against it; sets whether its hit points take the exact path."""
    candidate = Candidate()
    candidate.i = i
    candidate.spare = spare_bits(triangles)
    candidate.bound = sign_bound(camera.tangents)
    candidate.planes = edge_planes(o, corners)
    candidate.m = inverse_depth(o, corners)
    exact_path[i] = wp.uint8(not candidate.planes.steep)
    candidate.sure = sure_of(i, candidate.bound, alpha)
    return candidate


@wp.func
def greatest_edge(n: wp.vec3f, camera: Camera, box: wp.vec4i) -> wp.float32:
    """The largest value of an edge function over a box of pixels."""
    x = wp.max(wp.dot(n, entry(camera.column, box[0])), wp.dot(n, entry(camera.column, box[2])))
    y = wp.max(wp.dot(n, entry(camera.row, box[1])), wp.dot(n, entry(camera.row, box[3])))
    return x + y


@wp.func
def is_outside(planes: Planes, bound: wp.float32, camera: Camera, box: wp.vec4i) -> wp.bool:
    """Whether all pixels of a box lie certainly outside an edge plane.

    Directions are sums of a column's and a row's part, and each part is a multiple of an axis plus another, but for the
    rounding of the tables. So the largest edge function of the box is that of a corner; four bounds cover all rounding, as
    in :func:`.stream.plane_line`. A plane that is not a number leaves nothing out.
    """
    return (
        greatest_edge(planes.n0, camera, box) < -4.0 * bound
        or greatest_edge(planes.n1, camera, box) < -4.0 * bound
        or greatest_edge(planes.n2, camera, box) < -4.0 * bound
    )


@wp.func
def hit_word(inverse: wp.float64, i: wp.int32, spare: wp.int32) -> wp.uint64:
    """A hit as one word: a larger one is nearer, or as near with a lower index (:func:`...exact.triangle.spare_bits`)."""
    bits = wp.uint64(24 - spare)
    return (nearness_key(inverse, spare) << bits) | wp.uint64((0xFFFFFF >> spare) - i)


@wp.func
def index_of(word: wp.uint64, spare: wp.int32) -> wp.int32:
    """The triangle of a :func:`hit_word`."""
    last = 0xFFFFFF >> spare
    return last - wp.int32(word & wp.uint64(last))


@wp.func_native("""
unsigned long long bits = (word >> (24 - spare) << (23 - spare)) | (1ull << (22 - spare));
double inverse;
#if defined(__CUDA_ARCH__)
inverse = __longlong_as_double(bits);
double t;
asm("rcp.approx.ftz.f64 %0, %1;" : "=d"(t) : "d"(inverse));
double left = fma(-inverse, t, 1.0);
return fma(fma(left, left, left), t, t);
#else
memcpy(&inverse, &bits, sizeof(inverse));
return 1.0 / inverse;
#endif
""")
def distance_of(word: wp.uint64, spare: wp.int32) -> wp.float64:
    """t of a :func:`hit_word` to 2^-30 of itself, from the middle of the 1 / t that have its bits."""


@wp.func
def store_if_nearer(
    nearest: wp.array(dtype=wp.uint64), pixel: wp.int32, known: wp.uint64, candidate: Candidate, d: wp.vec3f
):
    """Store a certain hit if it is nearer than ``known``, an earlier word of the pixel: most hits then need no atomic."""
    inverse = wp.dot(candidate.m, to_float64(d))
    if inverse > wp.float64(0.0):
        word = hit_word(inverse, candidate.i, candidate.spare)
        if word > known:
            raise_entry(nearest, pixel, word)


@wp.func
def least_edge(planes: Planes, d: wp.vec3f) -> wp.float32:
    """The smallest of the three edge functions for direction d."""
    return wp.min(wp.dot(planes.n0, d), wp.min(wp.dot(planes.n1, d), wp.dot(planes.n2, d)))


@wp.func
def test_pixel(nearest: wp.array(dtype=wp.uint64), pixel: wp.int32, candidate: Candidate, d: wp.vec3f) -> wp.bool:
    """Store a certain hit if it is the nearest of its pixel so far; whether float64 must decide."""
    known = entry_now(nearest, pixel)
    low = least_edge(candidate.planes, d)
    if low > candidate.sure:
        store_if_nearer(nearest, pixel, known, candidate, d)
        return False
    return not (low < -candidate.bound)


@wp.func
def test_pixel_or_queue(
    nearest: wp.array(dtype=wp.uint64), queue: Queue, pixel: wp.int32, candidate: Candidate, d: wp.vec3f
):
    """Test one pixel, and queue the pair where float64 must decide."""
    if test_pixel(nearest, pixel, candidate, d):
        queue_undecided(queue, candidate.i, pixel)


@wp.func
def pixel_in(box: wp.vec4i, k: wp.int32) -> wp.vec2i:
    """Column and row of the k-th pixel of a box."""
    across = box[2] - box[0] + 1
    down = whole_quotient(k, across)
    return wp.vec2i(box[0] + k - down * across, box[1] + down)


@wp.func
def test_box(nearest: wp.array(dtype=wp.uint64), queue: Queue, box: wp.vec4i, candidate: Candidate, camera: Camera):
    """Test every pixel of a small box, 32 at a time: all against the planes first, then those stored that passed.

    A warp waits for its lane with the most work. Tests are short and read only the directions of pixels. Slow steps
    (reading the stored word, reserving a place in the queue of undecided pairs) are done only for the few pixels that need
    them, and every lane processes its own pixels, whatever the shape of its box.
    """
    number = (box[2] - box[0] + 1) * (box[3] - box[1] + 1)
    first = wp.int32(0)
    x = box[0]
    y = box[1]
    while first < number:
        hits = wp.uint32(0)
        unsure = wp.uint32(0)
        bit = wp.uint32(1)
        for _ in range(wp.min(32, number - first)):
            low = least_edge(candidate.planes, direction_at(camera, x, y))
            if low > candidate.sure:
                hits |= bit
            elif not (low < -candidate.bound):
                unsure |= bit
            bit <<= wp.uint32(1)
            x += 1
            if x > box[2]:
                x = box[0]
                y += 1
        while hits != wp.uint32(0):
            at = pixel_in(box, first + lowest_bit(hits))
            hits = without_lowest_bit(hits)
            pixel = at[1] * camera.width + at[0]
            # An atomic whose result is not used does not stall the thread; reading the stored word first would.
            store_if_nearer(nearest, pixel, wp.uint64(0), candidate, direction_at(camera, at[0], at[1]))
        while unsure != wp.uint32(0):
            at = pixel_in(box, first + lowest_bit(unsure))
            unsure = without_lowest_bit(unsure)
            queue_undecided(queue, candidate.i, at[1] * camera.width + at[0])
        first += 32
