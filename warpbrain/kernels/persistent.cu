// Preconditioned conjugate gradients in one launch: the body of `solve` in persistent.py, which says what it does and
// what its arguments are. THREADS, LANES, SHARED_BYTES and REAL are put before it there.

constexpr int WARPS = THREADS / 32;
constexpr int ROWS_OF_WARP = 32 / LANES;
constexpr int ROWS_AT_ONCE = THREADS / LANES;
constexpr unsigned ALL = 0xffffffffu;
constexpr int SUMS = 4;
// iterations after which the recurrences start again from the residual itself
constexpr int RENEWED_EVERY = 50;
// [ns]; blocks that do not hear from each other for so long give up
constexpr unsigned long long PATIENCE = 2000000000ull;

extern __shared__ char dynamic_smem_base[];

const int tid = threadIdx.x, lane = tid % 32, warp = tid / 32, sub = lane % LANES;
const int grid = gridDim.x, me = blockIdx.x;
const int row0 = starts.data[me], rows = starts.data[me + 1] - row0;
const int block0 = offsets.data[row0], blocks = offsets.data[row0 + rows] - block0;
const int nodes = x.shape[0];
const REAL *const all_values = (const REAL *)values.data;
const REAL *const b_of = (const REAL *)b.data;
REAL *const x_of = (REAL *)x.data;

// -- what is kept on the chip: vectors and inverse diagonal blocks first, then as much of the matrix as there is room for
enum { X, R, U, W, P, S, Q, Z, INVERSE, VECTORS = INVERSE + 3 };
double(*const partial)[SUMS] = (double(*)[SUMS])dynamic_smem_base;
double(*const totals)[SUMS] = partial + 32;
int *const quit = (int *)(totals + 32);
char *room = (char *)(quit + 4);
int left = SHARED_BYTES - (int)(room - dynamic_smem_base);
const int length = 3 * rows;
double *vectors = (double *)room;
if (VECTORS * length * 8 <= left) {
    room += VECTORS * length * 8;
    left -= VECTORS * length * 8;
} else {
    vectors = scratch.data + size_t(VECTORS) * 3 * row0;
}
int *first = (int *)room;
const int offset_bytes = (4 * (rows + 1) + 7) / 8 * 8;
const bool keeps_offsets = offset_bytes <= left;
if (keeps_offsets) {
    room += offset_bytes;
    left -= offset_bytes;
}
const int kept = keeps_offsets ? min(blocks, left / (int)(9 * sizeof(REAL) + 4)) : 0;
REAL *const kept_values = (REAL *)room;
int *const kept_columns = (int *)(kept_values + 9 * size_t(kept));

if (tid == 0)
    *quit = control.data[1];
if (keeps_offsets)
    for (int i = tid; i <= rows; i += THREADS)
        first[i] = offsets.data[row0 + i] - block0;
#pragma unroll 4
for (int i = tid; i < 9 * kept; i += THREADS)
    kept_values[i] = all_values[9 * size_t(block0) + i];
for (int i = tid; i < kept; i += THREADS)
    kept_columns[i] = columns.data[block0 + i];
for (int i = tid; i < length; i += THREADS) {
    vectors[X * length + i] = double(x_of[3 * row0 + i]);
    vectors[P * length + i] = vectors[S * length + i] = 0.0;
    vectors[Q * length + i] = vectors[Z * length + i] = 0.0;
}
for (int i = tid; i < rows; i += THREADS) {
    const REAL *const a = all_values + 9 * size_t(diagonal.data[row0 + i]);
    double inverse[9] = {1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0};
    if (jacobi) {
        const double c0 = double(a[4]) * a[8] - double(a[5]) * a[7];
        const double c1 = double(a[5]) * a[6] - double(a[3]) * a[8];
        const double c2 = double(a[3]) * a[7] - double(a[4]) * a[6];
        const double d = 1.0 / (a[0] * c0 + a[1] * c1 + a[2] * c2);
        inverse[0] = d * c0;
        inverse[1] = d * (double(a[2]) * a[7] - double(a[1]) * a[8]);
        inverse[2] = d * (double(a[1]) * a[5] - double(a[2]) * a[4]);
        inverse[3] = d * c1;
        inverse[4] = d * (double(a[0]) * a[8] - double(a[2]) * a[6]);
        inverse[5] = d * (double(a[2]) * a[3] - double(a[0]) * a[5]);
        inverse[6] = d * c2;
        inverse[7] = d * (double(a[1]) * a[6] - double(a[0]) * a[7]);
        inverse[8] = d * (double(a[0]) * a[4] - double(a[1]) * a[3]);
    }
    for (int k = 0; k < 9; ++k)
        vectors[INVERSE * length + 9 * i + k] = inverse[k];
}
// the same for all blocks: each reads it before the first meeting, and it is written after the last
unsigned epoch = (unsigned)control.data[0];
__syncthreads();
if (*quit)
    return;

// -- meetings of all blocks
double sums[SUMS];
// What threads stored before is seen by all after it, and their four shares are added in an order that is always the
// same. False if a block is missing: then every thread has to return.
auto meet = [&](double s0, double s1, double s2, double s3) -> bool {
    double s[SUMS] = {s0, s1, s2, s3};
    for (int d = 16; d > 0; d /= 2)
        for (int k = 0; k < SUMS; ++k)
            s[k] += __shfl_xor_sync(ALL, s[k], d);
    if (lane == 0)
        for (int k = 0; k < SUMS; ++k)
            partial[warp][k] = s[k];
    __syncthreads();
    ++epoch;
    // a message is half a number and the epoch, which a single store of eight bytes cannot tear apart; a place is
    // written again only two meetings later, when all have read it
    unsigned long long *const mail = (unsigned long long *)messages.data + size_t(epoch % 2) * grid * 2 * SUMS;
    if (warp == 0) {
        for (int k = 0; k < SUMS; ++k)
            s[k] = lane < WARPS ? partial[lane][k] : 0.0;
        for (int d = 16; d > 0; d /= 2)
            for (int k = 0; k < SUMS; ++k)
                s[k] += __shfl_xor_sync(ALL, s[k], d);
        asm volatile("fence.acq_rel.gpu;" ::: "memory");
        if (lane < 2 * SUMS) {
            const double mine = lane < 4 ? (lane < 2 ? s[0] : s[1]) : (lane < 6 ? s[2] : s[3]);
            const unsigned long long bits = __double_as_longlong(mine);
            const unsigned long long half = lane % 2 ? bits >> 32 : bits & 0xffffffffull;
            const unsigned long long message = half << 32 | epoch;
            asm volatile("st.relaxed.gpu.global.u64 [%0], %1;" ::"l"(mail + 2 * SUMS * me + lane), "l"(message)
                         : "memory");
        }
    }
    if (warp < (grid + 31) / 32) {
        for (int k = 0; k < SUMS; ++k)
            s[k] = 0.0;
        if (tid < grid) {
            const unsigned long long *const from = mail + 2 * SUMS * tid;
            unsigned long long begun = 0, now;
            for (unsigned tries = 1;; ++tries) {
                bool all_there = true;
                for (int k = 0; k < SUMS; ++k) {
                    unsigned long long low, high;
                    asm volatile("ld.relaxed.gpu.global.v2.u64 {%0, %1}, [%2];"
                                 : "=l"(low), "=l"(high)
                                 : "l"(from + 2 * k)
                                 : "memory");
                    all_there = all_there && (unsigned)low == epoch && (unsigned)high == epoch;
                    s[k] = __longlong_as_double((long long)(high >> 32 << 32 | low >> 32));
                }
                if (all_there)
                    break;
                if (tries % 1024 == 0) {
                    asm volatile("mov.u64 %0, %globaltimer;" : "=l"(now));
                    begun = begun == 0 ? now : begun;
                    if (now - begun > PATIENCE || *(volatile int *)(control.data + 1)) {
                        *(volatile int *)(control.data + 1) = 1;
                        *(volatile int *)quit = 1;
                        break;
                    }
                }
            }
            asm volatile("fence.acq_rel.gpu;" ::: "memory");
        }
        for (int d = 16; d > 0; d /= 2)
            for (int k = 0; k < SUMS; ++k)
                s[k] += __shfl_xor_sync(ALL, s[k], d);
        if (lane == 0)
            for (int k = 0; k < SUMS; ++k)
                totals[warp][k] = s[k];
    }
    __syncthreads();
    for (int k = 0; k < SUMS; ++k) {
        sums[k] = 0.0;
        for (int w = 0; w < (grid + 31) / 32; ++w)
            sums[k] += totals[w][k];
    }
    return *(volatile int *)quit == 0;
};

// -- what all blocks read of each other: two places that take turns, four numbers a node
int turn = 0;
auto outgoing = [&]() -> double * { return exchange.data + size_t(turn) * 4 * nodes; };
auto incoming = [&](int node, double value[3]) {
    const double *const from = exchange.data + (size_t(turn ^ 1) * nodes + node) * 4;
    asm volatile("ld.global.cg.v2.f64 {%0, %1}, [%2];" : "=d"(value[0]), "=d"(value[1]) : "l"(from));
    asm volatile("ld.global.cg.f64 %0, [%1];" : "=d"(value[2]) : "l"(from + 2));
};
auto initial = [&](int node, double value[3]) {
    for (int c = 0; c < 3; ++c)
        value[c] = double(x_of[3 * size_t(node) + c]);
};

// -- rows: LANES threads for each, of which the first three have its three components
auto each_row = [&](auto &&act) {
#pragma unroll 1
    for (int base = warp * ROWS_OF_WARP; base < rows; base += ROWS_AT_ONCE) {
        const int row = base + lane / LANES;
        // threads without a component go along: they take part in shuffles
        act(min(row, rows - 1), row < rows && sub < 3, 3 * min(row, rows - 1) + min(sub, 2));
    }
};
// Component `sub` of a row of `A v`, and if asked for of `|A| |v|`.
auto product = [&](auto &&get, int row, double *size) -> double {
    const int end = keeps_offsets ? first[row + 1] : offsets.data[row0 + row + 1] - block0;
    double y[3] = {0.0, 0.0, 0.0}, z[3] = {0.0, 0.0, 0.0};
    auto add = [&](int place, const double v[3]) {
        const REAL *const a = place < kept ? kept_values + 9 * place : all_values + 9 * (size_t(block0) + place);
        for (int c = 0; c < 3; ++c) {
            y[c] += double(a[3 * c]) * v[0] + double(a[3 * c + 1]) * v[1] + double(a[3 * c + 2]) * v[2];
            if (size)
                for (int k = 0; k < 3; ++k)
                    z[c] += fabs(double(a[3 * c + k]) * v[k]);
        }
    };
    auto column = [&](int place) { return place < kept ? kept_columns[place] : columns.data[block0 + place]; };
    int place = (keeps_offsets ? first[row] : offsets.data[row0 + row] - block0) + sub;
    // two at a time: both are on their way before the first is needed
#pragma unroll 1
    for (; place + LANES < end; place += 2 * LANES) {
        double v[3], w[3];
        get(column(place), v);
        get(column(place + LANES), w);
        add(place, v);
        add(place + LANES, w);
    }
    if (place < end) {
        double v[3];
        get(column(place), v);
        add(place, v);
    }
    for (int d = LANES / 2; d > 0; d /= 2)
        for (int c = 0; c < 3; ++c) {
            y[c] += __shfl_xor_sync(ALL, y[c], d);
            if (size)
                z[c] += __shfl_xor_sync(ALL, z[c], d);
        }
    if (size)
        *size = sub == 0 ? z[0] : sub == 1 ? z[1] : z[2];
    return sub == 0 ? y[0] : sub == 1 ? y[1] : y[2];
};
// Component `sub` of the inverse diagonal block times what the first three threads of the row have.
auto precondition = [&](int row, double v) -> double {
    const double *const inverse = vectors + INVERSE * length + 9 * row + 3 * min(sub, 2);
    double y = 0.0;
    for (int k = 0; k < 3; ++k)
        y += inverse[k] * __shfl_sync(ALL, v, k, LANES);
    return y;
};
auto vector = [&](int which) -> double * { return vectors + which * length; };
auto give = [&](int row, double v) { outgoing()[4 * size_t(row0 + row) + sub] = v; };

const double infinity = __longlong_as_double(0x7ff0000000000000ll);
int iteration = 0;
double gamma_before = 1.0, alpha = 1.0, least = infinity, before = infinity;
double rr = 0.0, goal = 0.0, updated = infinity;
bool fresh = true, ended = false;

for (;;) {
    // the residual itself, of the solution as it will be stored
    double s0 = 0.0, s1 = 0.0, s2 = 0.0;
    if (!fresh) {
        each_row([&](int row, bool mine, int i) {
            if (mine) {
                vector(X)[i] = double(REAL(vector(X)[i]));
                give(row, vector(X)[i]);
            }
        });
        if (!meet(0.0, 0.0, 0.0, 0.0))
            return;
        turn ^= 1;
    }
    each_row([&](int row, bool mine, int i) {
        double size = 0.0;
        const double Ax = fresh ? product(initial, row, &size) : product(incoming, row, &size);
        const double bi = double(b_of[3 * size_t(row0) + i]), r = bi - Ax;
        const double u = precondition(row, r);
        if (mine) {
            vector(R)[i] = r;
            vector(U)[i] = u;
            give(row, u);
            s0 += r * r;
            s1 += bi * bi;
            size += fabs(bi);
            s2 += size * size;
        }
    });
    if (!meet(s0, s1, s2, 0.0))
        return;
    turn ^= 1;
    rr = sums[0];
    goal = tolerance * tolerance * sums[1];
    const double rounding = 16.0 * ROUNDING * ROUNDING * sums[2];
    if (!(rr > goal) || iteration >= max_iterations || ended)
        break;
    if (!(updated > goal)) {
        // what is carried along says that this is the end, and is wrong
        if (rr <= rounding) {
            rr = updated;
            break;
        }
        if (rr > 0.25 * before)
            break;
        before = rr;
    }
    // what else follows from it and from the search direction: w = A u, s = A p, q = M s, z = A q
    each_row([&](int row, bool mine, int i) {
        const double w = product(incoming, row, nullptr);
        if (mine) {
            vector(W)[i] = w;
            if (!fresh)
                give(row, vector(P)[i]);
        }
    });
    if (!fresh) {
        if (!meet(0.0, 0.0, 0.0, 0.0))
            return;
        turn ^= 1;
        each_row([&](int row, bool mine, int i) {
            const double s = product(incoming, row, nullptr), q = precondition(row, s);
            if (mine) {
                vector(S)[i] = s;
                vector(Q)[i] = q;
                give(row, q);
            }
        });
        if (!meet(0.0, 0.0, 0.0, 0.0))
            return;
        turn ^= 1;
        each_row([&](int row, bool mine, int i) {
            const double z = product(incoming, row, nullptr);
            if (mine)
                vector(Z)[i] = z;
        });
    }

    // one meeting an iteration (Ghysels and Vanroose 2014, algorithm 4)
    bool updates = false;
    double beta = 0.0;
    for (int since = 0;; ++since) {
        double t0 = 0.0, t1 = 0.0, t2 = 0.0, t3 = 0.0;
        each_row([&](int row, bool mine, int i) {
            const double n = updates ? product(incoming, row, nullptr) : 0.0;
            double m_before = 0.0, w = vector(W)[i];
            if (updates) {
                m_before = precondition(row, w);
                if (mine) {
                    const double z = n + beta * vector(Z)[i], q = m_before + beta * vector(Q)[i];
                    const double s = w + beta * vector(S)[i], p = vector(U)[i] + beta * vector(P)[i];
                    vector(Z)[i] = z;
                    vector(Q)[i] = q;
                    vector(S)[i] = s;
                    vector(P)[i] = p;
                    vector(X)[i] += alpha * p;
                    vector(R)[i] -= alpha * s;
                    vector(U)[i] -= alpha * q;
                    w -= alpha * z;
                    vector(W)[i] = w;
                }
            }
            const double m = precondition(row, w);
            if (mine) {
                give(row, m);
                const double r = vector(R)[i], u = vector(U)[i], p = vector(P)[i];
                t0 += r * r;
                t1 += r * u;
                t2 += w * u;
                t3 += p * p;
            }
        });
        if (!meet(t0, t1, t2, t3))
            return;
        turn ^= 1;
        updated = sums[0];
        const double gamma = sums[1];
        // p . A p is gamma / alpha
        if (updates && sums[3] > 0.0)
            least = fmin(least, gamma_before / alpha / sums[3]);
        ended = iteration >= max_iterations || (watch && least <= 0.0);
        if (ended || !(updated > goal) || since == RENEWED_EVERY)
            break;
        beta = iteration > 0 ? gamma / gamma_before : 0.0;
        alpha = gamma / (sums[2] - beta * gamma / alpha);
        gamma_before = gamma;
        updates = true;
        ++iteration;
    }
    fresh = false;
}

for (int i = tid; i < length; i += THREADS)
    x_of[3 * size_t(row0) + i] = REAL(vectors[X * length + i]);
if (me == 0 && tid == 0) {
    control.data[0] = (int)epoch;
    outcome.data[0] = double(iteration);
    outcome.data[1] = sqrt(rr);
    outcome.data[2] = sqrt(goal);
    outcome.data[3] = least;
}
