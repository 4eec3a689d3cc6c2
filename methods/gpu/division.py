"""Divisions in float64 that share a reciprocal, with the quotients that rounded divisions give; reciprocals and roots in
float32.

A GPU divides in float64 by an approximate reciprocal, two steps that refine it, and one that corrects the quotient; then
it tests whether a number was out of range, and calls a function if so. Of numbers that are certainly in range that test
and the call are left out, and several quotients by one divisor share its reciprocal.
"""

import warp as wp

LEAST_DIVISOR, LARGEST_DIVISOR = wp.constant(wp.float32(2.0**-125)), wp.constant(wp.float32(2.0**125))
"""What :func:`about_inverse` divides by."""


# One instruction of a GPU; a rounded division takes ten, and a call in doubt.
@wp.func_native("""
#if defined(__CUDA_ARCH__)
float inverse;
asm("rcp.approx.ftz.f32 %0, %1;" : "=f"(inverse) : "f"(x));
return inverse;
#else
return 1.0f / x;
#endif
""")
def about_inverse(x: wp.float32) -> wp.float32:
    """1 / x to 2 u of itself (u = 2^-24), so that a / x by one multiplication is known to 3 u; |x| from
    :data:`LEAST_DIVISOR` to :data:`LARGEST_DIVISOR`.
    """


@wp.func_native("""
#if defined(__CUDA_ARCH__)
double y;
asm("rcp.approx.ftz.f64 %0, %1;" : "=d"(y) : "d"(b));
double e = fma(-b, y, 1.0);
y = fma(y, fma(e, e, e), y);
return fma(y, fma(-b, y, 1.0), y);
#else
return 1.0 / b;
#endif
""")
def reciprocal(b: wp.float64) -> wp.float64:
    """1 / b, to about half a unit in the last place, for :func:`quotient`; |b| in 2^-1000..2^1000."""


@wp.func_native("""
#if defined(__CUDA_ARCH__)
double q = __dmul_rn(a, inverse);
return fma(inverse, fma(-b, q, a), q);
#else
return a / b;
#endif
""")
def quotient(a: wp.float64, b: wp.float64, inverse: wp.float64) -> wp.float64:
    """a / b, rounded as a division rounds it (Markstein 1990), with ``inverse`` = reciprocal(b).

    a and a / b are 0 or in 2^-900..2^900, as of sums of products of three float32 numbers. The sign of a zero may differ
    from a division's; a quotient by 0 is not a number.
    """


@wp.func_native("""
#if defined(__CUDA_ARCH__)
float root;
asm("sqrt.approx.ftz.f32 %0, %1;" : "=f"(root) : "f"(x));
return root;
#else
return sqrtf(x);
#endif
""")
def about_root(x: wp.float32) -> wp.float32:
    """The square root of x to 4 u of itself; x from 2^-125 to 2^125."""
