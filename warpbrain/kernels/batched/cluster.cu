// Conjugate gradients of a system in a cluster of multiprocessors: the body of `solve` in cluster.py, which says what it
// does and what its arguments are. REAL, CLUSTER, THREADS, PLACES, IN_REGISTERS, IN_SHARED, ROWS, OUTERS and SEGMENTS are
// put before it: parts.py says what these are.

constexpr int WARPS = THREADS / 32;
// how many rows, and nodes of other blocks, a thread has; and how many warps have rows
constexpr int TURNS = (ROWS + THREADS - 1) / THREADS, OUTER_TURNS = (OUTERS + THREADS - 1) / THREADS;
constexpr int BUSY = (ROWS + 31) / 32 < WARPS ? (ROWS + 31) / 32 : WARPS;
constexpr int TOLD = CLUSTER * BUSY;
// of the same number of neighbouring threads, and one more: numbers of a block are in banks of their own
constexpr int STRIDE = THREADS + 1;
constexpr unsigned ALL = 0xffffffffu, ENDS = 0x8000u;

const int tid = threadIdx.x, lane = tid % 32, warp = tid / 32;
const int me = blockIdx.x % CLUSTER, system = blockIdx.x / CLUSTER;
if (system >= count.data[0])
    return;
const size_t slot = slots.data[system], stride = given.x.shape[2];
const int row0 = given.parts.starts.data[me], rows = given.parts.starts.data[me + 1] - row0;
const int outer0 = given.parts.outer_starts.data[me], outer = given.parts.outer_starts.data[me + 1] - outer0;
const REAL *const matrix = (const REAL *)given.values.data + slot * 9 * given.pair_count;

// -- shared memory
extern __shared__ char dynamic_smem_base[];
// what the warps of all blocks have summed up: p . q, r . r, r . z, b . b
double *const told = (double *)dynamic_smem_base;
REAL *const kept = (REAL *)(told + 4 * TOLD);
REAL *const p = kept + IN_SHARED * 9 * STRIDE;
REAL *const z = p + 3 * (ROWS + OUTERS);
REAL *const r = z + 3 * ROWS;
REAL *const inverse = r + 3 * ROWS;
REAL *const segments = inverse + 6 * ROWS;
unsigned short *const column = (unsigned short *)(segments + 3 * SEGMENTS);
unsigned short *const first = column + PLACES * THREADS;
// and registers
REAL blocks[IN_REGISTERS ? IN_REGISTERS : 1][9], own_x[TURNS][3], q[TURNS][3];
unsigned elsewhere[OUTER_TURNS];

// -- between blocks
auto meet = []() { asm volatile("barrier.cluster.arrive.release;\nbarrier.cluster.wait.acquire;" ::: "memory"); };
auto address_in = [](const void *local, int rank) -> unsigned {
    unsigned address;
    asm("mapa.shared::cluster.u32 %0, %1, %2;" : "=r"(address) : "r"((unsigned)__cvta_generic_to_shared(local)), "r"(rank));
    return address;
};
auto remote = [](unsigned address) -> REAL {
    if (sizeof(REAL) == 8) {
        double v;
        asm volatile("ld.shared::cluster.f64 %0, [%1];" : "=d"(v) : "r"(address) : "memory");
        return REAL(v);
    }
    float v;
    asm volatile("ld.shared::cluster.f32 %0, [%1];" : "=f"(v) : "r"(address) : "memory");
    return REAL(v);
};
auto over_warp = [](double sum) -> double {
    for (int d = 16; d > 0; d /= 2)
        sum += __shfl_xor_sync(ALL, sum, d);
    return sum;
};
// a sum over rows is that of each warp, told to all blocks, each of which adds them up in the same order
auto tell = [&](int which, double sum) {
    sum = over_warp(sum);
    if (lane < CLUSTER && warp < BUSY)
        asm volatile("st.shared::cluster.f64 [%0], %1;" ::"r"(address_in(told + which * TOLD + me * BUSY + warp, lane)),
                     "d"(sum)
                     : "memory");
};
auto hear = [&](int which) -> double {
    double sum = 0.0;
#pragma unroll
    for (int i = lane; i < (TOLD + 31) / 32 * 32; i += 32)
        sum += i < TOLD ? told[which * TOLD + i] : 0.0;
    return over_warp(sum);
};

// -- rows and products
auto each_row = [&](auto &&work) {
#pragma unroll
    for (int turn = 0; turn < TURNS; ++turn)
        if (turn * THREADS + tid < rows)
            work(turn, turn * THREADS + tid);
};
// the last threads first: they have fewer rows
auto each_outer = [&](auto &&work) {
#pragma unroll
    for (int turn = 0; turn < OUTER_TURNS; ++turn)
        if (turn * THREADS + THREADS - 1 - tid < outer)
            work(turn, turn * THREADS + THREADS - 1 - tid);
};
const int segment0 = given.parts.segment_starts.data[me * THREADS + tid];
// A p, of which each thread leaves the sums of its runs of a row in `segments`
auto multiply = [&]() {
    __syncthreads();
    REAL y[3] = {REAL(0), REAL(0), REAL(0)};
    REAL *segment = segments + 3 * segment0;
    auto add = [&](const REAL a[9], unsigned what) {
        const REAL *const v = p + 3 * (what & ~ENDS);
        const REAL v0 = v[0], v1 = v[1], v2 = v[2];
        for (int i = 0; i < 3; ++i)
            y[i] += a[3 * i] * v0 + a[3 * i + 1] * v1 + a[3 * i + 2] * v2;
        if (what & ENDS) {
            for (int i = 0; i < 3; ++i)
                segment[i] = y[i], y[i] = REAL(0);
            segment += 3;
        }
    };
#pragma unroll
    for (int k = 0; k < IN_REGISTERS; ++k)
        add(blocks[k], column[k * THREADS + tid]);
#pragma unroll 2
    for (int k = 0; k < IN_SHARED; ++k) {
        REAL a[9];
        for (int e = 0; e < 9; ++e)
            a[e] = kept[(9 * k + e) * STRIDE + tid];
        add(a, column[(IN_REGISTERS + k) * THREADS + tid]);
    }
    __syncthreads();
};
auto product_of = [&](int row, REAL y[3]) {
    y[0] = y[1] = y[2] = REAL(0);
    for (int s = first[row]; s < first[row + 1]; ++s)
        for (int c = 0; c < 3; ++c)
            y[c] += segments[3 * s + c];
};
// p = z + beta p, of these rows and of those that they share an element with
auto turn_to = [&](REAL beta) {
    each_outer([&](int turn, int k) {
        REAL *const to = p + 3 * (rows + k);
        for (int c = 0; c < 3; ++c) {
            const REAL there = remote(elsewhere[turn] + c * sizeof(REAL));
            to[c] = beta == REAL(0) ? there : there + beta * to[c];
        }
    });
    each_row([&](int, int i) {
        for (int c = 0; c < 3; ++c)
            p[3 * i + c] = beta == REAL(0) ? z[3 * i + c] : z[3 * i + c] + beta * p[3 * i + c];
    });
};
double rr, rz;
// z = D^-1 r, and sums
auto precondition = [&](int i) {
    const REAL *const d = inverse + 6 * i, *const v = r + 3 * i;
    const REAL y[3] = {d[0] * v[0] + d[1] * v[1] + d[2] * v[2], d[1] * v[0] + d[3] * v[1] + d[4] * v[2],
                       d[2] * v[0] + d[4] * v[1] + d[5] * v[2]};
    for (int c = 0; c < 3; ++c) {
        z[3 * i + c] = y[c];
        rr += double(v[c]) * v[c];
        rz += double(v[c]) * y[c];
    }
};

// -- load
const int *const pairs = given.parts.pairs.data + size_t(me) * PLACES * THREADS;
auto fetch = [&](int from, int to) {
    const int wide = to - from;
#pragma unroll 9
    for (int i = tid; i < wide * 9 * THREADS; i += THREADS) {
        const int place = i / 9, e = i - 9 * place, t = place / wide, k = place - t * wide;
        const int pair = pairs[t * PLACES + from + k];
        // left of the diagonal it is the transpose of what is stored
        const int entry = pair < 0 ? 3 * (e % 3) + e / 3 : e;
        const unsigned there = (unsigned)__cvta_generic_to_shared(kept + (9 * k + e) * STRIDE + t);
        asm volatile("cp.async.ca.shared.global [%0], [%1], %2;" ::"r"(there),
                     "l"(matrix + 9 * size_t(pair < 0 ? -1 - pair : pair) + entry), "n"(sizeof(REAL))
                     : "memory");
    }
};
// through the place of others
#pragma unroll
for (int from = 0; from < IN_REGISTERS; from += IN_SHARED) {
    const int to = from + IN_SHARED < IN_REGISTERS ? from + IN_SHARED : IN_REGISTERS;
    fetch(from, to);
    asm volatile("cp.async.wait_all;" ::: "memory");
    __syncthreads();
#pragma unroll
    for (int k = 0; k < IN_SHARED; ++k)
        if (from + k < to)
#pragma unroll
            for (int e = 0; e < 9; ++e)
                blocks[from + k < IN_REGISTERS ? from + k : 0][e] = kept[(9 * k + e) * STRIDE + tid];
    __syncthreads();
}
fetch(IN_REGISTERS, PLACES);
for (int i = tid; i < PLACES * THREADS; i += THREADS)
    column[i] = (unsigned short)given.parts.columns.data[size_t(me) * PLACES * THREADS + i];
for (int i = tid; i <= rows; i += THREADS)
    first[i] = (unsigned short)given.parts.row_segments.data[row0 + me + i];
const REAL *const b_of = (const REAL *)given.b.data, *const v_of = (const REAL *)given.v.data, *const free_of = (const REAL *)given.free.data;
REAL *const x_of = (REAL *)given.x.data;
auto at = [&](int node, int c) -> size_t { return (3 * size_t(node) + c) * stride + slot; };
each_row([&](int, int i) {
    const int node = given.parts.nodes.data[row0 + i];
    const REAL *const d = matrix + 9 * size_t(given.diagonal.data[node]);
    const double a = d[0], b = d[1], c = d[2], e = d[4], f = d[5], g = d[8];
    const double A = e * g - f * f, B = c * f - b * g, C = b * f - c * e, per = 1.0 / (a * A + b * B + c * C);
    REAL *const to = inverse + 6 * i;
    to[0] = A * per, to[1] = B * per, to[2] = C * per;
    to[3] = (a * g - c * c) * per, to[4] = (b * c - a * f) * per, to[5] = (a * e - b * b) * per;
    for (int k = 0; k < 3; ++k) {
        p[3 * i + k] = v_of[at(node, k)];
        r[3 * i + k] = b_of[at(node, k)];
        z[3 * i + k] = x_of[at(node, k)];
    }
});
each_outer([&](int turn, int k) {
    const int where = given.parts.outer_places.data[outer0 + k];
    elsewhere[turn] = address_in(z + 3 * (where & 0xffff), where >> 16);
    for (int c = 0; c < 3; ++c)
        p[3 * (rows + k) + c] = v_of[at(given.parts.outer_nodes.data[outer0 + k], c)];
});
asm volatile("cp.async.wait_all;" ::: "memory");
// the matrix of the system that is next here is on its way to the second-level cache meanwhile
if (warp == WARPS - 1 && system + given.ahead < count.data[0]) {
    const size_t bytes = 9 * sizeof(REAL) * size_t(given.pair_count), part = bytes / (32 * CLUSTER);
    const char *const next = (const char *)given.values.data + slots.data[system + given.ahead] * bytes + (32 * me + lane) * part;
    asm volatile("cp.async.bulk.prefetch.L2.global [%0], %1;" ::"l"((size_t)next & ~size_t(15)),
                 "r"((unsigned)part & ~15u)
                 : "memory");
}

// -- the residual of the guess, which is in the place of z
multiply();
double bb = 0.0;
each_row([&](int, int i) {
    REAL y[3];
    product_of(i, y);
    for (int c = 0; c < 3; ++c) {
        const REAL now = r[3 * i + c] - free_of[3 * size_t(given.parts.nodes.data[row0 + i]) + c] * y[c];
        r[3 * i + c] = now;
        bb += double(now) * now;
    }
});
meet();
turn_to(REAL(0));
tell(3, bb);
multiply();
meet();
rr = rz = 0.0;
each_row([&](int turn, int i) {
    REAL y[3];
    product_of(i, y);
    for (int c = 0; c < 3; ++c) {
        own_x[turn][c] = p[3 * i + c];
        r[3 * i + c] -= y[c];
    }
    precondition(i);
});
tell(1, rr);
tell(2, rz);
meet();
const double goal = tolerance * tolerance * hear(3);
rr = hear(1), rz = hear(2);

// -- iterations: what is not a number ends them
REAL beta = REAL(0);
int iteration = 0;
for (; rr > goal && iteration < given.max_iterations; ++iteration) {
    turn_to(beta);
    multiply();
    double pq = 0.0;
    each_row([&](int turn, int i) {
        product_of(i, q[turn]);
        for (int c = 0; c < 3; ++c)
            pq += double(p[3 * i + c]) * q[turn][c];
    });
    tell(0, pq);
    meet();
    const double before = rz;
    const REAL alpha = REAL(rz / hear(0));
    rr = rz = 0.0;
    each_row([&](int turn, int i) {
        for (int c = 0; c < 3; ++c) {
            own_x[turn][c] += alpha * p[3 * i + c];
            r[3 * i + c] -= alpha * q[turn][c];
        }
        precondition(i);
    });
    tell(1, rr);
    tell(2, rz);
    meet();
    rr = hear(1), rz = hear(2);
    beta = REAL(rz / before);
}

each_row([&](int turn, int i) {
    for (int c = 0; c < 3; ++c)
        x_of[at(given.parts.nodes.data[row0 + i], c)] = own_x[turn][c];
});
if (me == 0 && tid == 0) {
    given.outcome.data[3 * slot] = double(iteration);
    given.outcome.data[3 * slot + 1] = sqrt(rr);
    given.outcome.data[3 * slot + 2] = sqrt(goal);
}
