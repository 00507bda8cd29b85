"""The signed distance from a surface as a smooth function: a spline through a grid.

Cubic B-splines on a grid of spacing `h`, with the distances at the grid's nodes as coefficients:

    g(x) = sum_ijk B(x/h - i) B(y/h - j) B(z/h - k) d_ijk

has two continuous derivatives everywhere, however jagged the surface. It is the distance smoothed over about `h`: a
plane stays a plane (splines reproduce linear functions), edges are rounded over two spacings (de Boor, A Practical
Guide to Splines, 2001, chapter IX). Beyond the grid the coefficients go on linearly, and so does `g`.
"""

from functools import cache
from typing import Any

import warp as wp

from warpbrain.kernels.module import Precision, compiled_module

#: Barycentric coordinates below this are rounding.
_ON_SIDE = 1e-6


#: What of a triangle a point is on: 0 the inside, 1 to 3 edges ab, bc, ca, 4 to 6 corners; by which of its barycentric
#: coordinates u, v and w are none, as bits.
_FEATURES = wp.constant(wp.types.vector(8, int)(0, 2, 3, 6, 1, 5, 4, 6))


@cache
def smooth_distance(precision: Precision) -> Any:
    """Device function ``(x, coefficients, origin, spacing) -> g, gradient, Hessian``."""
    scalar, vec3, mat33 = precision.scalar, precision.vec3, precision.mat33
    vec4 = wp.types.vector(4, scalar)

    @wp.func
    def along_axis(s: scalar, n: int):
        """First of four coefficients, their weights, and first and second derivatives of these, at `s` spacings."""
        zero, half, one, two, three = scalar(0.0), scalar(0.5), scalar(1.0), scalar(2.0), scalar(3.0)
        interval = wp.floor(s)
        t = s - interval
        r = one - t
        sixth = scalar(1.0 / 6.0)
        w = sixth * vec4(
            r * r * r,
            three * t * t * t - scalar(6.0) * t * t + scalar(4.0),
            three * r * r * r - scalar(6.0) * r * r + scalar(4.0),
            t * t * t,
        )
        d = vec4(
            -half * r * r, half * t * (three * t - scalar(4.0)), half * r * (scalar(4.0) - three * r), half * t * t
        )
        dd = vec4(r, three * t - two, three * r - two, t)
        first = int(interval) - 1
        base = wp.clamp(first, 0, n - 4)
        W = vec4(zero, zero, zero, zero)
        D = vec4(zero, zero, zero, zero)
        DD = vec4(zero, zero, zero, zero)
        for a in range(4):
            i = first + a
            # a coefficient beyond the grid is what the last two go on to
            near, next, beyond = i - base, i - base, zero
            if i < 0:
                near, next, beyond = 0, 1, scalar(-i)
            if i > n - 1:
                near, next, beyond = 3, 2, scalar(i - n + 1)
            W[near] += (one + beyond) * w[a]
            D[near] += (one + beyond) * d[a]
            DD[near] += (one + beyond) * dd[a]
            W[next] -= beyond * w[a]
            D[next] -= beyond * d[a]
            DD[next] -= beyond * dd[a]
        return base, W, D, DD

    @wp.func
    def distance(x: vec3, coefficients: wp.array3d[scalar], origin: vec3, spacing: scalar):
        s = (x - origin) / spacing
        i, wx, dx, ddx = along_axis(s[0], coefficients.shape[0])
        j, wy, dy, ddy = along_axis(s[1], coefficients.shape[1])
        k, wz, dz, ddz = along_axis(s[2], coefficients.shape[2])
        g = scalar(0.0)
        slope = vec3()
        H = mat33()
        for ab in range(16):
            a, b = ab // 4, ab % 4
            row = vec4()
            for c in range(4):
                row[c] = coefficients[i + a, j + b, k + c]
            f, fz, fzz = wp.dot(row, wz), wp.dot(row, dz), wp.dot(row, ddz)
            g += wx[a] * wy[b] * f
            slope += vec3(dx[a] * wy[b] * f, wx[a] * dy[b] * f, wx[a] * wy[b] * fz)
            xy, xz, yz = dx[a] * dy[b] * f, dx[a] * wy[b] * fz, wx[a] * dy[b] * fz
            xx, yy, zz = ddx[a] * wy[b] * f, wx[a] * ddy[b] * f, wx[a] * wy[b] * fzz
            H += mat33(xx, xy, xz, xy, yy, yz, xz, yz, zz)
        return g, slope / spacing, H / (spacing * spacing)

    return distance


@cache
def distance_kernels(precision: Precision) -> tuple[Any, Any]:
    """Kernels that fill a grid with signed distances, and that evaluate the spline at points.

    ``(mesh, points, corners, normals, rim, spacing, reach) -> grid``, points from its origin, and
    ``(points, coefficients, origin, spacing) -> distances, directions``.
    """
    scalar, vec3 = precision.scalar, precision.vec3
    module = compiled_module(f"distance_field_{precision.name}")
    distance = smooth_distance(precision)

    @wp.kernel(module=module)
    def fill(
        mesh: wp.uint64,
        points: wp.array[vec3],
        corners: wp.array[wp.vec3i],
        normals: wp.array2d[vec3],
        rim: wp.array2d[wp.bool],
        spacing: scalar,
        reach: scalar,
        grid: wp.array3d[scalar],
    ):
        i, j, k = wp.tid()
        x = spacing * vec3(scalar(i), scalar(j), scalar(k))
        # where it is nearest is found in single precision: a distance changes with the square of an error of that
        query = wp.mesh_query_point_no_sign(mesh, wp.vec3f(x), wp.float32(reach))
        c = corners[query.face]
        u = scalar(query.u)
        v = scalar(query.v)
        p = u * points[c[0]] + v * points[c[1]] + (scalar(1.0) - u - v) * points[c[2]]
        sides = int(query.u < _ON_SIDE) | int(query.v < _ON_SIDE) << 1 | int(1.0 - query.u - query.v < _ON_SIDE) << 2
        feature = _FEATURES[sides]
        away = x - p
        along = wp.dot(away, normals[query.face, feature])
        # beyond a rim the wall goes on as the plane of its last triangle
        if feature > 0 and not rim[query.face, feature]:
            along = wp.where(along < scalar(0.0), -wp.length(away), wp.length(away))
        grid[i, j, k] = along

    @wp.kernel(module=module)
    def evaluate(
        points: wp.array[vec3],
        coefficients: wp.array3d[scalar],
        origin: vec3,
        spacing: scalar,
        distances: wp.array[scalar],
        directions: wp.array[vec3],
    ):
        t = wp.tid()
        g, slope, _H = distance(points[t], coefficients, origin, spacing)
        distances[t] = g
        directions[t] = wp.normalize(slope)

    return fill, evaluate
