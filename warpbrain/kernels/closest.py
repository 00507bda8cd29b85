"""The point of a triangle that is closest to another point, and which feature of the triangle it is on.

Regions as in Ericson, Real-Time Collision Detection (2005), section 5.1.5.
"""

from typing import Any

import warp as wp


@wp.func
def closest_on_triangle(x: Any, a: Any, b: Any, c: Any):
    """Closest point and its feature: 0 (inside), 1 to 3 (edges ab, bc, ca) and 4 to 6 (corners)."""
    feature = 0
    zero = a.dtype(0.0)
    one = a.dtype(1.0)
    ab = b - a
    ac = c - a
    ax = x - a
    bx = x - b
    cx = x - c
    d1 = wp.dot(ab, ax)
    d2 = wp.dot(ac, ax)
    d3 = wp.dot(ab, bx)
    d4 = wp.dot(ac, bx)
    d5 = wp.dot(ab, cx)
    d6 = wp.dot(ac, cx)
    va = d3 * d6 - d5 * d4
    vb = d5 * d2 - d1 * d6
    vc = d1 * d4 - d3 * d2
    p = a
    if d1 <= zero and d2 <= zero:
        feature = 4
    elif d3 >= zero and d4 <= d3:
        p = b
        feature = 5
    elif d6 >= zero and d5 <= d6:
        p = c
        feature = 6
    elif vc <= zero and d1 >= zero and d3 <= zero:
        p = a + d1 / (d1 - d3) * ab
        feature = 1
    elif vb <= zero and d2 >= zero and d6 <= zero:
        p = a + d2 / (d2 - d6) * ac
        feature = 3
    elif va <= zero and (d4 - d3) >= zero and (d5 - d6) >= zero:
        p = b + (d4 - d3) / ((d4 - d3) + (d5 - d6)) * (c - b)
        feature = 2
    else:
        share = one / (va + vb + vc)
        p = a + vb * share * ab + vc * share * ac
    return p, feature
