// Native functions of the kernel that assembles a patch of a sample's mesh; patch_assembly.py says what they are for
// and what their arguments are. REAL, THREADS, WIDTH, FIRST, BITS and SPOKES are put before each, and what all of them have:

constexpr int SECOND = 0x8000, AHEAD = 8;
extern __shared__ char dynamic_smem_base[];
// threads take some items at a time, so that what they wait for is on its way for all of these
auto in_turns = [](int count, auto &&work) {
    for (int i0 = threadIdx.x; i0 < count; i0 += AHEAD * THREADS)
        work([&](auto &&with) {
#pragma unroll
            for (int k = 0; k < AHEAD; ++k)
                if (i0 + k * THREADS < count)
                    with(k, i0 + k * THREADS);
        });
};

//// enter
// the matrix of the patch is zero, and its nodes' displacements are there
double *const displacements = (double *)dynamic_smem_base;
REAL *const sums = (REAL *)(displacements + front);
for (int i = threadIdx.x; i < 9 * (edges + 1); i += THREADS)
    sums[i] = REAL(0);
const int first = of.tables.node_starts.data[patch], count = of.tables.node_starts.data[patch + 1] - first;
in_turns(3 * count, [&](auto each) {
    int node[AHEAD];
    double v[AHEAD];
    each([&](int k, int i) { node[k] = of.tables.nodes.data[first + i / 3]; });
    each([&](int k, int i) { v[k] = of.u.data[(3 * size_t(node[k]) + i % 3) * of.u.shape[2] + slot]; });
    each([&](int k, int i) { displacements[i] = v[k]; });
});
__syncthreads();

//// edge
const double *const a = (const double *)dynamic_smem_base + 3 * from_, *const b = (const double *)dynamic_smem_base + 3 * to;
return wp::vec_t<3, double>(b[0] - a[0], b[1] - a[1], b[2] - a[2]);

//// add
// one round after the other; two blocks at a time, the other is on its way while one is added
REAL *const sums = (REAL *)((double *)dynamic_smem_base + front);
auto add = [&](int at, const wp::mat_t<3, 3, double> &A, const wp::mat_t<3, 3, double> &B) {
    REAL *const a = sums + 9 * (at & 0xffff), *const b = sums + 9 * (at >> 16);
    REAL both[18];
#pragma unroll
    for (int e = 0; e < 9; ++e)
        both[e] = a[e] + REAL(A.data[e / 3][e % 3]), both[9 + e] = b[e] + REAL(B.data[e / 3][e % 3]);
#pragma unroll
    for (int e = 0; e < 9; ++e)
        a[e] = both[e], b[e] = both[9 + e];
};
#pragma unroll 1
for (int turn = 0; turn < THREADS / WIDTH; ++turn) {
    if (threadIdx.x / WIDTH == turn) {
        add(first, K01, K02);
        add(second, K03, K12);
        add(third, K13, K23);
    }
    __syncthreads();
}

//// leave
// spokes take the place of the displacements
const REAL *const sums = (const REAL *)((const double *)dynamic_smem_base + front);
const int row0 = of.tables.row_starts.data[patch];
const int first = of.tables.node_starts.data[patch], count = of.tables.node_starts.data[patch + 1] - first;
const int spoke0 = of.tables.spoke_starts.data[first], spoke_count = of.tables.spoke_starts.data[first + count] - spoke0;
unsigned short *const spoke = (unsigned short *)dynamic_smem_base, *const spoke_start = spoke + spoke_count;
in_turns(spoke_count, [&](auto each) {
    int found[AHEAD];
    each([&](int k, int i) { found[k] = of.tables.spokes.data[spoke0 + i]; });
    each([&](int k, int i) { spoke[i] = found[k] < 0 ? SECOND | (-1 - found[k]) : found[k]; });
});
in_turns(count + 1, [&](auto each) {
    each([&](int, int i) { spoke_start[i] = of.tables.spoke_starts.data[first + i] - spoke0; });
});
REAL *const own = (REAL *)of.values.data + slot * 9 * size_t(of.values.shape[0]);
REAL *const extra = (REAL *)of.extras.data + slot * 9 * size_t(of.extras.shape[0]);
auto at = [&](int row, int e) -> REAL & {
    return row < of.values.shape[0] ? own[9 * size_t(row) + e] : extra[9 * size_t(row - of.values.shape[0]) + e];
};
in_turns(9 * edges, [&](auto each) {
    int row[AHEAD];
    each([&](int k, int i) { row[k] = of.tables.rows.data[row0 + i / 9]; });
    each([&](int k, int i) { at(row[k] >> BITS, i % 9) = row[k] >> i % 9 & 1 ? stiffness * sums[i] : REAL(0); });
});
__syncthreads();
in_turns(9 * count, [&](auto each) {
    int row[AHEAD];
    REAL own_mass[AHEAD];
    each([&](int k, int i) {
        row[k] = of.tables.rows.data[row0 + edges + i / 9];
        own_mass[k] = of.mass.data[of.tables.nodes.data[first + i / 9]];
    });
    each([&](int k, int i) {
        const int node = i / 9, e = i % 9, turned = 3 * (e % 3) + e / 3;
        REAL sum = REAL(0);
        for (int s = spoke_start[node]; s < spoke_start[node + 1]; s += SPOKES) {
            REAL v[SPOKES];
#pragma unroll
            for (int j = 0; j < SPOKES; ++j) {
                const int which = spoke[s + j];
                v[j] = sums[9 * (which & ~SECOND) + (which & SECOND ? turned : e)];
            }
#pragma unroll
            for (int j = 0; j < SPOKES; ++j)
                sum += v[j];
        }
        const bool is_free = row[k] >> e & 1;
        REAL value = is_free ? -stiffness * sum : REAL(0);
        if (e % 4 == 0 && row[k] & FIRST)
            value += is_free ? inertia * own_mass[k] : REAL(1);
        at(row[k] >> BITS, e) = value;
    });
});
