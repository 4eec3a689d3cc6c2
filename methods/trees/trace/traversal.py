"""The traversal of a tree by a ray: one loop, specialised by what is asked of it.

closest, any     the nearest triangle; or whether any hides a hit point from a light: the traversal ends at the first
single, packet   each ray has its own stack; or the 32 rays of a warp share one and visit the union of their nodes, where
                 the warp votes which child comes first (Wald et al. 2001; Guenther et al. 2007)
one level, two   a tree of triangles; or one of bodies, each with a tree of its own (:mod:`.bodies`)
float32, exact   triangles are tested as usual; or with bounds (:mod:`.triangle_tests`), and what float32 does not decide
                 is left to float64 (:mod:`.undecided`)
holes            every hit on a triangle with holes is left, too: float64 asks whether it lies in a hole. An argument that a
                 compiler knows (:func:`has_holes`)

Shadow rays are traced from the light to the hit point: those of a warp, whose hit points are neighbours, then share the
nodes near the light. That is valid as long as the light is not farther than boxes are padded for (:mod:`..nodes`). For a
light beyond ``max_coordinate`` the same segment is traversed from the hit point. The end at which it starts only decides
which boxes are met first: triangles are tested by planes (:mod:`..records.planes`).
"""

from __future__ import annotations

import functools
from typing import Any

import warp as wp

from ....harness.frame.effects.specialise import effects
from ....harness.frame.geometry import Ray
from ..constants import BLOCK
from ..native import BASICS, STACK
from ..nodes import MEET, Tree
from ..records.planes import LightPlanes
from .bodies import LEVELS, ROOM
from .triangle_tests import TESTS
from .undecided import TRAVERSED, Undecided

CLOSEST = """
constexpr bool ANY = false;
float limit = 3.4e38f, u = 0.0f, v = 0.0f;
int best = -1;
const int own = -1;
const wp::vec3f o = ray.origin, d = ray.direction;
const float tiny = 1.0e-37f, shrink = !EXACT || tree.max_coordinate.data[0] < 1.0e25f ? 1.0f : 5.4210109e-20f;
auto left_out = [](int) { return false; };
"""
"""``shrink``: for a direction of about one, a coordinate beyond 1e26 over 2^-40 would be infinite, and a box before it be
missed. So the slabs of large scenes are met at t times 2^-64.
"""

ANY = {
    True: """
constexpr bool ANY = true, seen = true;
float limit = 1.0f;
const float shrink = 1.0f, far = high(size(light[0]), high(size(light[1]), size(light[2])));
const bool near = far <= tree.max_coordinate.data[0];
const wp::vec3f o = near ? light : h;
const wp::vec3f d = near ? wp::vec3f(h[0] - light[0], h[1] - light[1], h[2] - light[2])
                         : wp::vec3f(light[0] - h[0], light[1] - h[1], light[2] - h[2]);
const float tiny = tree.max_coordinate.data[0] * 8.3e-25f + 1.0e-37f;
""",
    False: """
constexpr bool ANY = true, seen = true;
float limit = 1.0f - 1.0e-4f, u, v;
int best;
const float shrink = 1.0f, tiny = 1.0e-20f;
const wp::vec3f o = light, d = wp::vec3f(h[0] - light[0], h[1] - light[1], h[2] - light[2]);
const auto& records = planes.edges;
auto left_out = [](int) { return false; };
""",
}
"""By whether it is exact. ``tiny`` is in proportion to the scene, or float32 may err."""

SINGLE = """
constexpr bool PACKET = false;
unsigned int stack[ROOM];
int held = 0;
auto push = [&](unsigned int ref) { stack[held++] = ref; };
auto pop = [&]() { return stack[--held]; };
auto vote = [](bool met) { return met; };
auto choose = [](bool second, bool) { return second; };
"""

PACKET = f"""
constexpr bool PACKET = true;
__shared__ unsigned int stacks[{BLOCK // 32} * {STACK}];
const unsigned int stack = (unsigned int)__cvta_generic_to_shared(stacks) + 4 * {STACK} * (threadIdx.x >> 5);
int held = 0;
auto push = [&](unsigned int ref) {{
    if ((threadIdx.x & 31) == 0) asm volatile("st.shared.b32 [%0], %1;" :: "r"(stack + 4 * held), "r"(ref) : "memory");
    __syncwarp();
    held++;
}};
auto pop = [&]() {{
    unsigned int ref;
    held--;
    asm volatile("ld.shared.b32 %0, [%1];" : "=r"(ref) : "r"(stack + 4 * held) : "memory");
    __syncwarp();
    return ref;
}};
auto vote = [](bool met) {{ return __ballot_sync(0xffffffffu, met); }};
auto choose = [](bool second, unsigned int some) {{
    return 2 * __popc(__ballot_sync(0xffffffffu, second)) > __popc(some);
}};
if (!seen) limit = -1.0f;
"""
"""A lane without a ray has a limit that no box is before."""

START = "unsigned int now = PACKET || seen ? (unsigned int)tree.root.data[0] : NONE;\n"

TRAVERSE = """
auto descends = [&]() {
    if (BODIES && now == BACK) return go_out();
    if (BODIES && !inside) come_back();
    Children c = children_of(now);
    auto some0 = vote(c.met0), some1 = vote(c.met1);
    if (!some0 && !some1) return false;
    bool second = some1;
    if (some0 && some1) {
        second = choose(c.met1 & (!c.met0 | (c.near1 < c.near0)), some0 | some1);
        if (BODIES && !ANY && !inside) push(bits(second ? c.near0 : c.near1));
        push(second ? c.ref0 : c.ref1);
    }
    now = second ? c.ref1 : c.ref0;
    return true;
};
auto steps = [&]() {
    if (descends()) return true;
    if (held == 0) return false;
    now = next();
    return true;
};
auto ends_at = [&](int at, auto leave) { return test(at, leave); };
auto ends_in_leaf = [&](auto leave) {
    int at = (int)(now & INDEX);
    if (left_out(at)) return false;
    return ends_at(at, leave) || (now & PAIR && ends_at(at + 1, leave));
};
auto traverse = [&](auto leave, auto full) {
    if (now == NONE) return false;
    while (true) {
        bool done = true;
        if (BODIES && !inside && (now & LEAF)) go_in();
        if (ANY || PACKET) {
            if (PACKET) {
                while (!(now & LEAF))
                    if (!steps()) return false;
            } else if (!(now & LEAF) && !steps()) {
                break;
            }
            done = (now & LEAF) && inside;
            if (done) {
                if (ends_in_leaf(leave)) return true;
                if (full()) break;
            }
        } else if (!(now & LEAF)) {
            done = !descends();
        } else {
            if (ends_in_leaf(leave)) return true;
            if (full()) break;
        }
        if (done) {
            if (held == 0) break;
            now = next();
        }
    }
    return false;
};
"""
"""Single rays to a closest hit take one step an iteration, down to a child or through a leaf, so that the lanes of a warp
meet after each. To any hit they test a leaf in the iteration that has come to it. A packet goes down to the next one.
"""


def traversal(ray: str, test: str, result: str, exact: bool, packets: bool, levels: int, counts: bool) -> str:
    """The body of a native function: what is traversed, by a ray that ``ray`` sets up, with ``test`` for a triangle.

    ``counts``: its tests are counted, and no triangle is left to float64, which changes no later test.
    """

    def loop(stack: str, leaving: str) -> str:
        traverse = TRAVERSE
        if counts:
            traverse = "int tests = 0;" + TRAVERSE.replace("test(at, leave)", "(tests++, test(at, leave))")
        return f"{stack}{test}{START}{LEVELS[levels]}{traverse}{TRAVERSED[leaving]}"

    left = exact and not counts
    single, together = (loop(SINGLE, "exact" if left else "float32"), loop(PACKET, "packet" if left else "float32"))
    asked = f"constexpr bool EXACT = {exact:d};\nint first = -1, second = -1, last = -1;\n"
    asked += f"constexpr int ROOM = {ROOM[levels]};\n"
    solid = "auto solid = [&](int at) { return !holes || tree.masked.data[at] == 0; };\n"
    by_device = f"\n#if defined(__CUDA_ARCH__)\n{together}\n#else\n{single}\n#endif\n" if packets else single
    return BASICS + asked + ray + MEET + solid + by_device + f"return {'{tests, 0, 0, 0}' if counts else result};"


@wp.func
def has_holes() -> wp.bool:
    """Whether triangles may have holes."""
    holes = wp.bool(False)
    if wp.static(effects.alpha):
        holes = wp.bool(True)
    return holes


@functools.cache
def make_closest(records: str, exact: bool, packets: bool = False, levels: int = 1, counts: bool = False) -> Any:
    """A function of a ray that gives (first, second, last, closest certain triangle), with what it left
    (:mod:`.undecided`); in float32 the bits of (t, u, v) and the closest triangle. -1: none. With ``counts`` it gives (its
    tests, 0, 0, 0).

    ``records``: "eye", of rays from the eye (:mod:`..records.planes`), or "ray", of any ray (:mod:`..records.rays`).
    ``seen`` is False in a lane without a ray; ``packets`` are traversed together only where a warp does, on the GPU.
    """
    result = "{first, second, last, best}" if exact else "{(int)bits(limit), (int)bits(u), (int)bits(v), best}"

    @wp.func_native(traversal(CLOSEST, TESTS[records, exact], result, exact, packets, levels, counts))
    def closest(
        seen: wp.bool, ray: Ray, tree: Tree, records: wp.array[wp.vec4f], undecided: Undecided, holes: wp.bool
    ) -> wp.vec4i: ...

    return closest


@functools.cache
def make_any(exact: bool, levels: int = 1, counts: bool = False) -> Any:
    """A function of the hit point h on triangle ``own`` and a light that gives (first, second, last, 1 if some other
    triangle certainly lies between, else 0), with what it left (:mod:`.undecided`); with ``counts`` (its tests, 0, 0, 0).
    """
    result = "{first, second, last, (int)found}"

    @wp.func_native(traversal(ANY[exact], TESTS["light", exact], result, exact, False, levels, counts))
    def any_between(
        h: wp.vec3f,
        light: wp.vec3f,
        own: wp.int32,
        tree: Tree,
        planes: LightPlanes,
        undecided: Undecided,
        holes: wp.bool,
    ) -> wp.vec4i: ...

    return any_between
