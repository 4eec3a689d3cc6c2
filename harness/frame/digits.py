"""More digits than float64 has: sums and products with what each of them loses, and exact triple products.

The error-free transformations of Knuth and Dekker: a sum, a difference or a product of float64 is a rounded one and an
error, which are exact together. With them the dot product of Ogita, Rump and Oishi (2005, "Accurate sum and dot product")
has twice the digits, and the expansions of Shewchuk (1997, "Adaptive precision floating-point arithmetic and fast robust
geometric predicates") have all.
"""

import warp as wp

from .geometry import Corners, Ray
from .vectors import to_float64

CANCELLED = wp.constant(wp.float64(2.0**-46))
"""Share of the sizes of its terms below which a triple product is found exactly: with twice the digits it is known to 2^-98
of them.
"""


@wp.func_native("return fma(a, b, c);")
def fused(a: wp.float64, b: wp.float64, c: wp.float64) -> wp.float64: ...


@wp.func_native("""
#if defined(__CUDA_ARCH__)
    return __dmul_rn(a, b);
#else
    return a * b;
#endif
""")
def rounded(a: wp.float64, b: wp.float64) -> wp.float64:
    """a b, rounded: a GPU's compiler would fuse it with a sum, whose error would not be the one computed here."""


@wp.func
def rounded_product(a: wp.vec3d, b: wp.vec3d) -> wp.vec3d:
    return wp.vec3d(rounded(a[0], b[0]), rounded(a[1], b[1]), rounded(a[2], b[2]))


@wp.func
def lost_in_sum(a: wp.vec3d, b: wp.vec3d, sum: wp.vec3d) -> wp.vec3d:
    """a + b - sum, where sum is a + b rounded."""
    of_b = sum - a
    return (a - (sum - of_b)) + (b - of_b)


@wp.func
def lost_in_product(a: wp.vec3d, b: wp.vec3d, product: wp.vec3d) -> wp.vec3d:
    """a b - product, component by component, where product is :func:`rounded_product`."""
    return wp.vec3d(fused(a[0], b[0], -product[0]), fused(a[1], b[1], -product[1]), fused(a[2], b[2], -product[2]))


@wp.func
def products_of_normal(e: wp.vec3d, f: wp.vec3d) -> wp.vec3d:
    """The sizes of the products of which the components of e x f are differences, added."""
    return wp.vec3d(
        wp.abs(e[1] * f[2]) + wp.abs(e[2] * f[1]),
        wp.abs(e[2] * f[0]) + wp.abs(e[0] * f[2]),
        wp.abs(e[0] * f[1]) + wp.abs(e[1] * f[0]),
    )


@wp.func
def sum_of_sizes(products: wp.vec3d, w: wp.vec3d) -> wp.float64:
    return products[0] * wp.abs(w[0]) + products[1] * wp.abs(w[1]) + products[2] * wp.abs(w[2])


@wp.func
def precise_product(ab: wp.vec3d, ac: wp.vec3d, w: wp.vec3d, w_lost: wp.vec3d) -> wp.float64:
    """(ab x ac) . (w + w_lost), with what every rounding lost."""
    ab_yzx = wp.vec3d(ab[1], ab[2], ab[0])
    ab_zxy = wp.vec3d(ab[2], ab[0], ab[1])
    ac_yzx = wp.vec3d(ac[1], ac[2], ac[0])
    ac_zxy = wp.vec3d(ac[2], ac[0], ac[1])
    left = rounded_product(ab_yzx, ac_zxy)
    right = rounded_product(ab_zxy, ac_yzx)
    n = left - right
    n_lost = lost_in_sum(left, -right, n) + (
        lost_in_product(ab_yzx, ac_zxy, left) - lost_in_product(ab_zxy, ac_yzx, right)
    )
    # n . w, likewise.
    products = rounded_product(n, w)
    terms = lost_in_product(n, w, products)
    first = products[0] + products[1]
    height = first + products[2]
    of_first = first - products[0]
    of_height = height - first
    height += (
        (products[0] - (first - of_first)) + (products[1] - of_first)
        + (first - (height - of_height)) + (products[2] - of_height)
        + (terms[0] + terms[1] + terms[2])
        + wp.dot(n_lost, w) + wp.dot(n, w_lost)
    )  # fmt: skip
    return height


@wp.func_native("""
double sum[64];
int count = 0;
auto add = [&](double term) {
    // Grow-Expansion: terms that do not overlap, the smallest first, without zeros.
    int kept = 0;
    for (int i = 0; i < count; i++) {
        double both = term + sum[i], back = both - term;
        double lost = (term - (both - back)) + (sum[i] - back);
        if (lost != 0.0) sum[kept++] = lost;
        term = both;
    }
    if (term != 0.0) sum[kept++] = term;
    count = kept;
};
auto add_product = [&](double p, double q) {
#if defined(__CUDA_ARCH__)
    double product = __dmul_rn(p, q);
#else
    double product = p * q;
#endif
    add(fma(p, q, -product));
    add(product);
};
for (int i = 0; i < 3; i++) {
    int j = (i + 1) % 3, k = (i + 2) % 3;
    // Component i of b x c + c x a + a x b: products of two float32 numbers are exact.
    double terms[6] = {
        (double)b[j] * c[k], -(double)b[k] * c[j], (double)c[j] * a[k], -(double)c[k] * a[j], (double)a[j] * b[k],
        -(double)a[k] * b[j],
    };
    for (int n = 0; n < 6; n++) add_product(terms[n], x[i]);
    if (affine) for (int n = 0; n < 2; n++) add_product(-terms[n], a[i]);
}
double value = 0.0, rest = 0.0;
for (int i = 0; i < count; i++) value += sum[i];
add(-value);
for (int i = 0; i < count; i++) rest += sum[i];
return {value, rest};
""")
def exact_product(a: wp.vec3f, b: wp.vec3f, c: wp.vec3f, x: wp.vec3d, affine: wp.bool) -> wp.vec2d:
    """((b - a) x (c - a)) . (x - a), or . x where it is not ``affine``: rounded, and the rest of it, rounded. Its sign is
    right, and 0 is exact.
    """


@wp.func
def wide_product(a: wp.vec3f, b: wp.vec3f, c: wp.vec3f, w: wp.vec3d, w_lost: wp.vec3d) -> wp.float64:
    """((b - a) x (c - a)) . (w + w_lost) in twice the digits; 0 where that leaves less than :data:`CANCELLED` of it."""
    a64 = to_float64(a)
    ab = to_float64(b) - a64
    ac = to_float64(c) - a64
    # Products with what the edges lose need no digits of their own.
    ab_lost = lost_in_sum(to_float64(b), -a64, ab)
    ac_lost = lost_in_sum(to_float64(c), -a64, ac)
    value = precise_product(ab, ac, w, w_lost) + wp.dot(wp.cross(ab_lost, ac) + wp.cross(ab, ac_lost), w)
    least = CANCELLED * sum_of_sizes(products_of_normal(ab, ac), w)
    return wp.where(wp.abs(value) <= least, wp.float64(0.0), value)


@wp.func
def wide_side(a: wp.vec3f, b: wp.vec3f, c: wp.vec3f, x: wp.vec3d) -> wp.float64:
    """On which side of the plane of a, b and c the point x lies: ((b - a) x (c - a)) . (x - a) to 2^-51 of itself."""
    a64 = to_float64(a)
    w = x - a64
    value = wide_product(a, b, c, w, lost_in_sum(x, -a64, w))
    if value == wp.float64(0.0):
        value = exact_product(a, b, c, x, True)[0]
    return value


@wp.func
def wide_slope(a: wp.vec3f, b: wp.vec3f, c: wp.vec3f, d: wp.vec3d) -> wp.float64:
    """((b - a) x (c - a)) . d to 2^-51 of itself, where d holds float32 numbers."""
    value = wide_product(a, b, c, d, wp.vec3d())
    if value == wp.float64(0.0):
        value = exact_product(a, b, c, d, False)[0]
    return value


@wp.func
def wide_hit_point(ray: Ray, corners: Corners) -> wp.vec3d:
    """Where a ray meets the plane of a triangle: o + t d with t in twice the digits, each coordinate rounded once."""
    o = to_float64(ray.origin)
    d = to_float64(ray.direction)
    over = -exact_product(corners.a, corners.b, corners.c, o, True)
    under = exact_product(corners.a, corners.b, corners.c, d, False)
    t = over[0] / under[0]
    t_lost = (fused(-t, under[0], over[0]) + (over[1] - t * under[1])) / under[0]
    t3 = wp.vec3d(t, t, t)
    way = rounded_product(d, t3)
    p = o + way
    return p + (lost_in_sum(o, way, p) + (lost_in_product(d, t3, way) + d * t_lost))
