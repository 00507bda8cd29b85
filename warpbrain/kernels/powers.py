"""Powers of stretches and their difference quotient, exact at coincident arguments."""

from typing import Any

import warp as wp


@wp.func
def expm1_ratio(x: Any):
    """`(exp(x) - 1) / x`, 1 at x = 0, to a few rounding errors for every x."""
    one = type(x)(1.0)
    if wp.abs(x) > type(x)(0.5):
        return (wp.exp(x) - one) / x
    # (exp(x) - 1) / x = exp(x/2) sinh(x/2) / (x/2); six terms of the sinh series are exact to 1e-17 for |x| <= 1/2
    y = type(x)(0.25) * x * x
    series = one + y / type(x)(156.0)
    series = one + y / type(x)(110.0) * series
    series = one + y / type(x)(72.0) * series
    series = one + y / type(x)(42.0) * series
    series = one + y / type(x)(20.0) * series
    series = one + y / type(x)(6.0) * series
    return wp.exp(type(x)(0.5) * x) * series


@wp.func
def power_minus_one(log_l: Any, alpha: Any):
    """`l^alpha - 1` from `ln l`, without cancellation near l = 1."""
    x = alpha * log_l
    return x * expm1_ratio(x)


@wp.func
def power_quotient(log_a: Any, log_b: Any, n: Any):
    """`(a^n - b^n) / (a - b)`, and `n b^(n-1)` where a = b.

    Written as `b^(n-1) n r(n x) / r(x)` with `x = ln(a/b)` and `r(x) = (exp(x) - 1)/x`: no difference of nearly equal
    numbers and no threshold between two formulas. An error of one rounding in `x` changes the quotient by `(n-1)/2`
    roundings.
    """
    x = log_a - log_b
    return wp.exp((n - type(n)(1.0)) * log_b) * n * expm1_ratio(n * x) / expm1_ratio(x)
