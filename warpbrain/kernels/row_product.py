"""The product of a block matrix and a vector on a GPU: eight threads for a row, which wait for memory together."""

from functools import cache
from typing import Any

import warp as wp

from warpbrain.kernels.module import Precision, compiled_module

#: Threads of a row.
LANES = 8

_CODE = """
const int row = thread / LANES, sub = thread % LANES;
// the threads of this row, in their warp
const unsigned mask = 0xffu << (threadIdx.x % 32 / LANES * LANES);
REAL s[3] = {0, 0, 0};
for (int k = offsets.data[row] + sub; k < offsets.data[row + 1]; k += LANES) {
    const REAL *const a = (const REAL *)(values.data + k), *const v = (const REAL *)(x.data + columns.data[k]);
    for (int c = 0; c < 3; ++c)
        s[c] += a[3 * c] * v[0] + a[3 * c + 1] * v[1] + a[3 * c + 2] * v[2];
}
for (int d = LANES / 2; d > 0; d /= 2)
    for (int c = 0; c < 3; ++c)
        s[c] += __shfl_xor_sync(mask, s[c], d);
if (sub == 0)
    for (int c = 0; c < 3; ++c)
        ((REAL *)z.data)[3 * row + c] = s[c];
"""


@cache
def row_product_kernel(precision: Precision) -> Any:
    """Make (once) the kernel of ``z = A x``, launched over `LANES` threads a row."""
    vec3, mat33 = precision.vec3, precision.mat33
    module = compiled_module(f"row_product_{precision.name}")

    @wp.func_native(f"using REAL = {precision.native};\nconstexpr int LANES = {LANES};\n" + _CODE)
    def row_product(
        thread: int,
        offsets: wp.array[int],
        columns: wp.array[int],
        values: wp.array[mat33],
        x: wp.array[vec3],
        z: wp.array[vec3],
    ): ...

    @wp.kernel(module=module, grid_stride=False)
    def multiply(
        offsets: wp.array[int], columns: wp.array[int], values: wp.array[mat33], x: wp.array[vec3], z: wp.array[vec3]
    ):
        row_product(wp.tid(), offsets, columns, values, x, z)

    return multiply
