"""Rays passed to Embree by kernels that Warp compiles for the CPU: a C loop over packets, as a user of Embree writes it.

A thread takes a block of 4x4 pixels. Its 16 rays go to Embree one by one or as one packet, by rtcIntersect1 or
rtcIntersect16 (rtcOccluded...), whose addresses are arguments of the kernel. The layouts are those of ``RTCRay``,
``RTCRayHit`` and their packets in ``embree4/rtcore_ray.h``: 12 words of ray, then 9 of hit (normal, u, v, primID,
geomID, instID, instPrimID), each 16 times in a packet. Tests compare the answers with embreex's, bit for bit.
"""

import ctypes

import warp as wp

from ...harness.frame.geometry import Camera, Hits, Rays

SIDE = 4
"""Pixels of a block's side: 16 rays."""

COHERENT = 1 << 16
"""RTC_RAY_QUERY_FLAG_COHERENT: the rays of a packet go much the same way."""


class Arguments(ctypes.Structure):
    """``RTCIntersectArguments`` and ``RTCOccludedArguments``, laid out alike. Builds without RTC_MIN_WIDTH lack the last."""

    _fields_ = [
        ("flags", ctypes.c_uint),
        ("feature_mask", ctypes.c_uint),
        ("context", ctypes.c_void_p),
        ("filter", ctypes.c_void_p),
        ("callback", ctypes.c_void_p),
        ("min_width", ctypes.c_float),
    ]


def coherent_arguments() -> Arguments:
    """Arguments of a query of coherent rays, every feature allowed, no callbacks."""
    return Arguments(COHERENT, 0xFFFFFFFF, None, None, None, 0.0)


PACKET = """
    using Single = void (*)(void*, void*, void*);
    using Packet = void (*)(const int32_t*, void*, void*, void*);
    alignas(64) int32_t valid[16];
    alignas(64) uint32_t word[WORDS * 16];
    float* real = (float*)word;
    int32_t pixel_of[16];
    bool any = false;
    const int32_t width = camera.width, height = camera.height, across = (width + 3) / 4;
    for (int32_t lane = 0; lane < 16; ++lane) {
        const int32_t x = (block % across) * 4 + lane % 4, y = (block / across) * 4 + lane / 4;
        const bool inside = x < width && y < height;
        const int32_t pixel = inside ? y * width + x : 0;
        wp::vec3f o(0.0f, 0.0f, 0.0f), d(0.0f, 0.0f, 1.0f);
        const bool sent = inside && ray_of(pixel, x, y, o, d);
        pixel_of[lane] = inside ? pixel : -1;
        valid[lane] = sent ? -1 : 0;
        any = any || sent;
        for (int32_t k = 0; k < 3; ++k) {
            real[16 * k + lane] = o[k];
            real[64 + 16 * k + lane] = d[k];
        }
        real[48 + lane] = real[112 + lane] = 0.0f;
        real[128 + lane] = end;
        word[144 + lane] = 0xffffffffu; word[160 + lane] = 0u; word[176 + lane] = 0u;
        for (int32_t k = 12; k < WORDS; ++k) word[16 * k + lane] = k < 17 ? 0u : 0xffffffffu;
    }
    if (any && query.packets) ((Packet)query.function)(valid, (void*)query.scene, word, (void*)query.arguments);
    else if (any) for (int32_t lane = 0; lane < 16; ++lane) {
        if (!valid[lane]) continue;
        alignas(16) uint32_t one[24];
        for (int32_t k = 0; k < WORDS; ++k) one[k] = word[16 * k + lane];
        ((Single)query.function)((void*)query.scene, one, (void*)query.arguments);
        for (int32_t k = 0; k < WORDS; ++k) word[16 * k + lane] = one[k];
    }
"""
"""The 16 rays of a block, sent to Embree. ``ray_of(pixel, x, y, o, d)`` sets a ray, or says that the pixel has none."""

CLOSEST = (
    """
    constexpr int32_t WORDS = 21;
    const float end = INFINITY;
    auto ray_of = [&](int32_t pixel, int32_t x, int32_t y, wp::vec3f& o, wp::vec3f& d) {
        if (bounced && !rays.active.data[pixel]) return false;
        o = bounced ? rays.origin.data[pixel] : camera.eye.data[0];
        d = bounced ? rays.direction.data[pixel] : wp::add(camera.column.data[x], camera.row.data[y]);
        return true;
    };
"""
    + PACKET
    + """
    for (int32_t lane = 0; lane < 16; ++lane) {
        const int32_t pixel = pixel_of[lane];
        if (pixel < 0) continue;
        const bool hit = valid[lane] && word[16 * 18 + lane] != 0xffffffffu;
        hits.triangle.data[pixel] = hit ? (int32_t)word[16 * 17 + lane] : -1;
        hits.t.data[pixel] = hit ? real[128 + lane] : INFINITY;
        hits.u.data[pixel] = hit ? real[16 * 15 + lane] : 0.0f;
        hits.v.data[pixel] = hit ? real[16 * 16 + lane] : 0.0f;
    }
"""
)

ANY = (
    """
    constexpr int32_t WORDS = 12;
    const float end = of.end;
    auto ray_of = [&](int32_t pixel, int32_t x, int32_t y, wp::vec3f& o, wp::vec3f& d) {
        if (of.triangle.data[pixel] < 0 || (of.limited && !of.receivers.data[pixel])) return false;
        o = of.starts.data[pixel];
        d = wp::sub(target, o);
        return true;
    };
"""
    + PACKET
    + """
    for (int32_t lane = 0; lane < 16; ++lane)
        if (pixel_of[lane] >= 0) of.shadowed.data[pixel_of[lane]] = valid[lane] && real[128 + lane] < 0.0f;
"""
)


@wp.struct
class Query:
    """Whether Embree takes the 16 rays of a block at once; the addresses of its function, of its scene and of arguments."""

    packets: wp.bool
    function: wp.uint64
    scene: wp.uint64
    arguments: wp.uint64


@wp.func_native(CLOSEST)
def closest_of_block(block: wp.int32, query: Query, bounced: wp.bool, camera: Camera, rays: Rays, hits: Hits): ...


@wp.struct
class ShadowRays:
    """Shadow rays of one light, arrays [pixels]: of hits ``triangle`` that receive it, if it is ``limited`` to some, from
    ``starts`` to the share ``end`` of the way to it.
    """

    limited: wp.bool
    end: wp.float32
    starts: wp.array(dtype=wp.vec3f)
    triangle: wp.array(dtype=wp.int32)
    receivers: wp.array(dtype=wp.uint8)
    shadowed: wp.array(dtype=wp.uint8)


@wp.func_native(ANY)
def any_of_block(block: wp.int32, query: Query, target: wp.vec3f, camera: Camera, of: ShadowRays): ...


@wp.kernel(enable_backward=False)
def intersect_kernel(first: wp.int32, query: Query, bounced: wp.bool, camera: Camera, rays: Rays, hits: Hits):
    """Closest hits of the pixels of block ``first`` + thread: of primary rays, or of mirrored ones."""
    closest_of_block(first + wp.tid(), query, bounced, camera, rays, hits)


@wp.kernel(enable_backward=False)
def occluded_kernel(
    first: wp.int32, query: Query, light: wp.int32, lights: wp.array(dtype=wp.vec3f), camera: Camera, of: ShadowRays
):
    """Shadow bits of the pixels of block ``first`` + thread."""
    any_of_block(first + wp.tid(), query, lights[light], camera, of)
