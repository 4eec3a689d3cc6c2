"""Exact decisions about one ray and one triangle, for the few pairs that float64 leaves in doubt.

With float32 inputs every quantity that matters is a sum of triple products of inputs, and each of these is two float64
numbers exactly (a product of two float32 is exact, and a fused multiplication finds what the third loses). The sum is
distilled: passes of error-free additions (Knuth's; Ogita, Rump and Oishi 2005) until what is left below the leading two
numbers is less than 2^-100 of them. A sum of zero ends as zeros. So signs are exact, and values are right to 2^-100.

    edge function of p and q   d . ((p - o) x (q - o)) = [d p q] + [d q o] + [d o p]
    det = n . d                [d a b] + [d b c] + [d c a]                             n = (b - a) x (c - a)
    height = n . (a - o)       [a b c] - [o a b] - [o b c] - [o c a]

where [x y z] is the triple product. Inputs from 2^-149 to 2^128 give terms from 2^-447 to 2^384: nothing overflows or
underflows. A call takes some microseconds; on a GPU it is a real call, so that kernels that rarely make it keep their
registers.
"""

from __future__ import annotations

import warp as wp

DISTIL = """
#if defined(__CUDA_ARCH__)
#define EXACTLY static __device__ __noinline__
#else
#define EXACTLY static __attribute__((noinline))
#endif
struct Exactly {
    double terms[48];
    int count;

    EXACTLY void product(Exactly& self, double sign, float a, float b, float c) {
        double ab = sign * (double)a * (double)b;
#if defined(__CUDA_ARCH__)
        double abc = __dmul_rn(ab, (double)c);
#else
        double abc = ab * (double)c;
#endif
        self.terms[self.count++] = abc;
        self.terms[self.count++] = fma(ab, (double)c, -abc);
    }
    EXACTLY void triple(Exactly& self, double sign, wp::vec3f a, wp::vec3f b, wp::vec3f c) {
        for (int i = 0; i < 3; ++i) {
            int j = i == 2 ? 0 : i + 1, k = i == 0 ? 2 : i - 1;
            product(self, sign, a[i], b[j], c[k]);
            product(self, -sign, a[i], b[k], c[j]);
        }
    }
    EXACTLY wp::vec2d sum(Exactly& self) {
        double* x = self.terms;
        int top = self.count - 1;
        for (int pass = 0; pass < 64; ++pass) {
            double rest = 0.0;
            for (int i = 0; i < top; ++i) {
                double s = x[i] + x[i + 1], of_next = s - x[i];
                double lost = (x[i] - (s - of_next)) + (x[i + 1] - of_next);
                x[i + 1] = s;
                x[i] = lost;
                if (i < top - 1) rest += lost < 0.0 ? -lost : lost;
            }
            if (rest <= 7.9e-31 * (x[top] < 0.0 ? -x[top] : x[top])) break;
        }
        return wp::vec2d(x[top], x[top - 1]);
    }
    EXACTLY double edge(wp::vec3f o, wp::vec3f d, wp::vec3f p, wp::vec3f q) {
        Exactly e;
        e.count = 0;
        triple(e, 1.0, d, p, q);
        triple(e, 1.0, d, q, o);
        triple(e, 1.0, d, o, p);
        return sum(e)[0];
    }
    EXACTLY wp::vec2d slope(wp::vec3f d, wp::vec3f a, wp::vec3f b, wp::vec3f c) {
        Exactly e;
        e.count = 0;
        triple(e, 1.0, d, a, b);
        triple(e, 1.0, d, b, c);
        triple(e, 1.0, d, c, a);
        return sum(e);
    }
    EXACTLY wp::vec2d height(wp::vec3f o, wp::vec3f a, wp::vec3f b, wp::vec3f c) {
        Exactly e;
        e.count = 0;
        triple(e, 1.0, a, b, c);
        triple(e, -1.0, o, a, b);
        triple(e, -1.0, o, b, c);
        triple(e, -1.0, o, c, a);
        return sum(e);
    }
    // Height over slope in two numbers: a quotient, and one of what it leaves.
    EXACTLY wp::vec2d distance(wp::vec3f o, wp::vec3f d, wp::vec3f a, wp::vec3f b, wp::vec3f c) {
        wp::vec2d under = slope(d, a, b, c), over = height(o, a, b, c);
        double first = over[0] / under[0];
        if (under[0] == 0.0 || over[0] == 0.0) return wp::vec2d(first, 0.0);
        double back = first * under[0], lost = fma(first, under[0], -back);
        double second = (((over[0] - back) - lost) + (over[1] - first * under[1])) / under[0];
        double t = first + second;
        return wp::vec2d(t, second - (t - first));
    }
    EXACTLY wp::vec2d hit(wp::vec3f o, wp::vec3f d, wp::vec3f a, wp::vec3f b, wp::vec3f c) {
        double x = edge(o, d, b, c), y = edge(o, d, c, a), z = edge(o, d, a, b);
        bool some_below = x < 0.0 || y < 0.0 || z < 0.0, some_above = x > 0.0 || y > 0.0 || z > 0.0;
        if (some_below && some_above) return wp::vec2d(-1.0, 0.0);
        wp::vec2d t = distance(o, d, a, b, c);
        return t[0] > 0.0 && (x != 0.0 || y != 0.0 || z != 0.0) ? t : wp::vec2d(-1.0, 0.0);
    }
};
#undef EXACTLY
"""


@wp.func_native(DISTIL + "return Exactly::hit(o, d, a, b, c);")
def exact_hit(o: wp.vec3f, d: wp.vec3f, a: wp.vec3f, b: wp.vec3f, c: wp.vec3f) -> wp.vec2d:
    """t > 0 at which the ray o + t d exactly meets the closed triangle, in two numbers that add up to it; -1: none."""


@wp.func_native(DISTIL + "return Exactly::distance(o, d, a, b, c);")
def exact_distance(o: wp.vec3f, d: wp.vec3f, a: wp.vec3f, b: wp.vec3f, c: wp.vec3f) -> wp.vec2d:
    """t, of any sign, at which the ray exactly meets the triangle's plane, in two numbers that add up to it; of a coplanar
    ray not a finite number."""


@wp.func_native(DISTIL + "return Exactly::height(o, a, b, c)[0];")
def exact_height(o: wp.vec3f, a: wp.vec3f, b: wp.vec3f, c: wp.vec3f) -> wp.float64:
    """n . (a - o) with n = (b - a) x (c - a), rounded once: its sign is exact."""
