"""Rays passed to Embree by kernels that Warp compiles for the CPU: a C loop over packets, as a user of Embree writes it.

A thread takes a block of 4x4 pixels. Its 16 rays go to Embree one by one or as one packet, by rtcIntersect1 or
rtcIntersect16 (rtcOccluded...), whose addresses are arguments of the kernel. The layouts are those of ``RTCRay``,
``RTCRayHit`` and their packets in ``embree4/rtcore_ray.h``: 12 words of ray, then 9 of hit (normal, u, v, primID,
geomID, instID, instPrimID), each 16 times in a packet. Tests compare the answers with embreex's, bit for bit.
"""

from __future__ import annotations

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


INTERSECT = """
    using Single = void (*)(void*, void*, void*);
    using Packet = void (*)(const int32_t*, void*, void*, void*);
    alignas(64) int32_t valid[16];
    alignas(64) uint32_t word[21 * 16];
    float* real = (float*)word;
    int32_t pixel_of[16];
    const int32_t across = (width + 3) / 4;
    for (int32_t lane = 0; lane < 16; ++lane) {
        const int32_t x = (block % across) * 4 + lane % 4, y = (block / across) * 4 + lane / 4;
        const bool inside = x < width && y < height;
        const int32_t pixel = inside ? y * width + x : 0;
        const bool sent = inside && (!bounced || active.data[pixel]);
        pixel_of[lane] = inside ? pixel : -1;
        valid[lane] = sent ? -1 : 0;
        wp::vec3f o(0.0f, 0.0f, 0.0f), d(0.0f, 0.0f, 1.0f);
        if (sent && bounced) { o = origin.data[pixel]; d = direction.data[pixel]; }
        else if (sent) { o = eye.data[0]; d = wp::add(column.data[x], row.data[y]); }
        real[lane] = o[0]; real[16 + lane] = o[1]; real[32 + lane] = o[2];
        real[48 + lane] = 0.0f;
        real[64 + lane] = d[0]; real[80 + lane] = d[1]; real[96 + lane] = d[2];
        real[112 + lane] = 0.0f;
        real[128 + lane] = INFINITY;
        word[144 + lane] = 0xffffffffu; word[160 + lane] = 0u; word[176 + lane] = 0u;
        for (int32_t k = 12; k < 17; ++k) real[16 * k + lane] = 0.0f;
        for (int32_t k = 17; k < 21; ++k) word[16 * k + lane] = 0xffffffffu;
    }
    if (packets) ((Packet)query)(valid, (void*)scene, word, (void*)arguments);
    else for (int32_t lane = 0; lane < 16; ++lane) {
        if (!valid[lane]) continue;
        alignas(16) uint32_t one[24];
        for (int32_t k = 0; k < 21; ++k) one[k] = word[16 * k + lane];
        ((Single)query)((void*)scene, one, (void*)arguments);
        for (int32_t k = 0; k < 21; ++k) word[16 * k + lane] = one[k];
    }
    for (int32_t lane = 0; lane < 16; ++lane) {
        const int32_t pixel = pixel_of[lane];
        if (pixel < 0) continue;
        const bool hit = valid[lane] && word[16 * 18 + lane] != 0xffffffffu;
        triangle.data[pixel] = hit ? (int32_t)word[16 * 17 + lane] : -1;
        t.data[pixel] = hit ? real[128 + lane] : INFINITY;
        u.data[pixel] = hit ? real[16 * 15 + lane] : 0.0f;
        v.data[pixel] = hit ? real[16 * 16 + lane] : 0.0f;
    }
"""

OCCLUDED = """
    using Single = void (*)(void*, void*, void*);
    using Packet = void (*)(const int32_t*, void*, void*, void*);
    alignas(64) int32_t valid[16];
    alignas(64) uint32_t word[12 * 16];
    float* real = (float*)word;
    int32_t pixel_of[16];
    bool any = false;
    const int32_t across = (width + 3) / 4;
    for (int32_t lane = 0; lane < 16; ++lane) {
        const int32_t x = (block % across) * 4 + lane % 4, y = (block / across) * 4 + lane / 4;
        const bool inside = x < width && y < height;
        const int32_t pixel = inside ? y * width + x : 0;
        const bool sent = inside && triangle.data[pixel] >= 0 && (!limited || receivers.data[pixel]);
        pixel_of[lane] = inside ? pixel : -1;
        valid[lane] = sent ? -1 : 0;
        any = any || sent;
        wp::vec3f o(0.0f, 0.0f, 0.0f), d(0.0f, 0.0f, 1.0f);
        if (sent) { o = origins.data[pixel]; d = wp::sub(target, o); }
        real[lane] = o[0]; real[16 + lane] = o[1]; real[32 + lane] = o[2];
        real[48 + lane] = 0.0f;
        real[64 + lane] = d[0]; real[80 + lane] = d[1]; real[96 + lane] = d[2];
        real[112 + lane] = 0.0f;
        real[128 + lane] = end;
        word[144 + lane] = 0xffffffffu; word[160 + lane] = 0u; word[176 + lane] = 0u;
    }
    if (any && packets) ((Packet)query)(valid, (void*)scene, word, (void*)arguments);
    else if (any) for (int32_t lane = 0; lane < 16; ++lane) {
        if (!valid[lane]) continue;
        alignas(16) uint32_t one[12];
        for (int32_t k = 0; k < 12; ++k) one[k] = word[16 * k + lane];
        ((Single)query)((void*)scene, one, (void*)arguments);
        word[128 + lane] = one[8];
    }
    for (int32_t lane = 0; lane < 16; ++lane)
        if (pixel_of[lane] >= 0) shadowed.data[pixel_of[lane]] = valid[lane] && real[128 + lane] < 0.0f;
"""


@wp.func_native(INTERSECT)
def intersect_block(
    block: wp.int32,
    packets: wp.bool,
    bounced: wp.bool,
    query: wp.uint64,
    scene: wp.uint64,
    arguments: wp.uint64,
    width: wp.int32,
    height: wp.int32,
    eye: wp.array(dtype=wp.vec3f),
    column: wp.array(dtype=wp.vec3f),
    row: wp.array(dtype=wp.vec3f),
    origin: wp.array(dtype=wp.vec3f),
    direction: wp.array(dtype=wp.vec3f),
    active: wp.array(dtype=wp.uint8),
    triangle: wp.array(dtype=wp.int32),
    t: wp.array(dtype=wp.float32),
    u: wp.array(dtype=wp.float32),
    v: wp.array(dtype=wp.float32),
): ...


@wp.func_native(OCCLUDED)
def occluded_block(
    block: wp.int32,
    packets: wp.bool,
    limited: wp.bool,
    query: wp.uint64,
    scene: wp.uint64,
    arguments: wp.uint64,
    width: wp.int32,
    height: wp.int32,
    end: wp.float32,
    target: wp.vec3f,
    origins: wp.array(dtype=wp.vec3f),
    triangle: wp.array(dtype=wp.int32),
    receivers: wp.array(dtype=wp.uint8),
    shadowed: wp.array(dtype=wp.uint8),
): ...


@wp.kernel(enable_backward=False)
def intersect_kernel(
    first: wp.int32,
    packets: wp.bool,
    bounced: wp.bool,
    query: wp.uint64,
    scene: wp.uint64,
    arguments: wp.uint64,
    camera: Camera,
    rays: Rays,
    hits: Hits,
):
    """Closest hits of the pixels of block ``first`` + thread: of primary rays, or of mirrored ones."""
    intersect_block(
        first + wp.tid(), packets, bounced, query, scene, arguments, camera.width, camera.height,
        camera.eye, camera.column, camera.row, rays.origin, rays.direction, rays.active,
        hits.triangle, hits.t, hits.u, hits.v,
    )  # fmt: skip


@wp.kernel(enable_backward=False)
def occluded_kernel(
    first: wp.int32,
    packets: wp.bool,
    limited: wp.bool,
    query: wp.uint64,
    scene: wp.uint64,
    arguments: wp.uint64,
    end: wp.float32,
    light: wp.int32,
    camera: Camera,
    lights: wp.array(dtype=wp.vec3f),
    origins: wp.array(dtype=wp.vec3f),
    triangle: wp.array(dtype=wp.int32),
    receivers: wp.array(dtype=wp.uint8),
    shadowed: wp.array(dtype=wp.uint8),
):
    """Shadow bits of the pixels of block ``first`` + thread, from ``origins`` to ``end`` of the way to the light."""
    occluded_block(
        first + wp.tid(), packets, limited, query, scene, arguments, camera.width, camera.height, end,
        lights[light], origins, triangle, receivers, shadowed,
    )  # fmt: skip
