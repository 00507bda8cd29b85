// Preconditioned conjugate gradients in one launch: the body of `solve` in persistent.py, which says what it does and what
// its arguments are. THREADS, LANES, MESSAGES, SHARED_BYTES, REAL and ROUNDING are put before it.
//
// All warps of a block but the last have rows. The last adds up the sums of all blocks and decides what is next, while
// the others already multiply what their neighbours have given them.
//
// Nothing that blocks tell each other needs a fence: each sixteen bytes have the number of the phase in which they were
// written, and no store or load of sixteen bytes is ever torn apart. Who reads an older number reads again.

typedef unsigned long long word;
constexpr int WORKERS = THREADS - 32, WARPS = WORKERS / 32;
constexpr int ROWS_OF_WARP = 32 / LANES;
constexpr int ROWS_AT_ONCE = WORKERS / LANES;
constexpr unsigned ALL = 0xffffffffu;
constexpr int SUMS = 4;
// iterations after which the recurrences start again from the residual itself
constexpr int RENEWED_EVERY = 50;
// and after which rounding begins to cost more iterations than meetings cost time
constexpr int PIPELINED = 200;
// ratio of squared residual norms, now to when it was last measured, below which recurrences hold only rounding errors
constexpr double CARRIED = 1e-20;
// part of a residual along the last direction, relative to u . r, with which the next one begins afresh
constexpr double ALONG = 0.1;
// [ns]; blocks that do not hear from each other for so long give up
constexpr word PATIENCE = 2000000000ull;

extern __shared__ char dynamic_smem_base[];

const auto offsets = given.offsets, columns = given.columns, diagonal = given.diagonal;
const int max_iterations = given.max_iterations;
const bool watch = given.watch;
const int tid = threadIdx.x, lane = tid % 32, warp = tid / 32, sub = lane % LANES;
const bool adds_up = warp == WARPS;
const int grid = gridDim.x, me = blockIdx.x;
const int row0 = given.starts.data[me], rows = given.starts.data[me + 1] - row0;
const int block0 = offsets.data[row0], blocks = offsets.data[row0 + rows] - block0;
const int nodes = given.x.shape[0];
const REAL *const all_values = (const REAL *)given.values.data;
const REAL *const b_of = (const REAL *)given.b.data;
REAL *const x_of = (REAL *)given.x.data;
int *const state = given.control.data;
word *const mailbox = (word *)given.messages.data;
// two places that take turns, by the number of the phase, and one for the solution
word *const places = (word *)given.exchange.data, *const solution = places + 8 * size_t(nodes);
// number k of the block in a place of these rows
auto entry = [&](int place, int k) -> REAL { return all_values[9 * (size_t(block0) + place) + k]; };

// -- what is kept on the chip: vectors and inverse diagonal blocks, then as much of the matrix as there is room for
enum { X, R, U, W, P, S, Q, Z, M, PRODUCT, INVERSE, VECTORS = INVERSE + 2 };
double(*const partial)[SUMS] = (double(*)[SUMS])dynamic_smem_base;
// what is next: two factors and a phase; and whether a block is missing
double *const factors = (double *)(partial + WARPS);
int *const next = (int *)(factors + 2);
volatile int *const quit = next + 1;
char *room = (char *)(next + 2);
int left = SHARED_BYTES - (int)(room - dynamic_smem_base);
const int length = 3 * rows;
double *vectors = (double *)room;
if (VECTORS * length * 8 <= left) {
    room += VECTORS * length * 8;
    left -= VECTORS * length * 8;
} else {
    vectors = given.scratch.data + size_t(VECTORS) * 3 * row0;
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
    *quit = state[1];
if (keeps_offsets)
    for (int i = tid; i <= rows; i += THREADS)
        first[i] = offsets.data[row0 + i] - block0;
for (int i = tid; i < kept; i += THREADS)
    kept_columns[i] = columns.data[block0 + i];
// the same for all blocks: each reads it before the first meeting, and it is written after the last
unsigned epoch = (unsigned)state[0];
__syncthreads();
if (*quit)
    return;

// -- what blocks tell each other
auto store = [](word *to, word first, word second) {
    asm volatile("{.reg .b128 t; mov.b128 t, {%1, %2}; st.relaxed.gpu.global.b128 [%0], t;}" ::"l"(to), "l"(first),
                 "l"(second));
};
auto load = [](const word *from, word &first, word &second) {
    asm volatile("{.reg .b128 t; ld.relaxed.gpu.global.b128 t, [%2]; mov.b128 {%0, %1}, t;}"
                 : "=l"(first), "=l"(second)
                 : "l"(from));
};
// Gives a row's vector, of whose components the first three threads of the row have one each, to all blocks: two times
// twelve bytes.
auto publish = [&](word *place, int row, double v, bool mine) {
    const word bits = __double_as_longlong(v), other = __double_as_longlong(__shfl_sync(ALL, v, (sub + 1) % LANES, LANES));
    // the second component is halved between both
    if (mine && sub < 2)
        store(place + 4 * size_t(row0 + row) + 2 * sub, sub ? other : bits, (sub ? bits >> 32 : other) << 32 | epoch);
};
// Sums over a warp of four numbers: lane 8 k has the k-th, in an order that is always the same. Halves of the warp send
// each other what the other one sums.
auto warp_sums = [&](const double s[SUMS]) -> double {
    const bool upper = lane & 16, odd = lane & 8;
    double low = upper ? s[2] : s[0], high = upper ? s[3] : s[1];
    low += __shfl_xor_sync(ALL, upper ? s[0] : s[2], 16);
    high += __shfl_xor_sync(ALL, upper ? s[1] : s[3], 16);
    double sum = odd ? high : low;
    sum += __shfl_xor_sync(ALL, odd ? low : high, 8);
    for (int d = 4; d > 0; d /= 2)
        sum += __shfl_xor_sync(ALL, sum, d);
    return sum;
};
double sums[SUMS] = {0.0, 0.0, 0.0, 0.0};
// Of the last warp: adds up what the warps of all blocks have left in `partial`, in an order that is always the same. A
// place is written again only two meetings later, when all have read it.
auto meet = [&]() {
    // thread t has sum t % 4, of every eighth warp and block
    const int k = lane % SUMS;
    auto over_warp = [&](double sum) -> double {
        for (int d = SUMS; d < 32; d *= 2)
            sum += __shfl_xor_sync(ALL, sum, d);
        return sum;
    };
    double sum = 0.0;
#pragma unroll
    for (int w = lane / SUMS; w < (WARPS + 7) / 8 * 8; w += 32 / SUMS)
        sum += w < WARPS ? partial[w][k] : 0.0;
    sum = over_warp(sum);
    word *const mail = mailbox + size_t(epoch % 2) * grid * 2 * SUMS;
    if (lane < SUMS)
        store(mail + 2 * (SUMS * me + k), __double_as_longlong(sum), epoch);
    word begun = 0, now;
    for (unsigned tries = 1;; ++tries) {
        bool all_there = true;
        sum = 0.0;
#pragma unroll
        for (int m = 0; m < MESSAGES; ++m) {
            const int from = 32 / SUMS * m + lane / SUMS;
            word bits, written;
            load(mail + 2 * (SUMS * min(from, grid - 1) + k), bits, written);
            all_there = all_there && (unsigned)written == epoch;
            sum += from < grid ? __longlong_as_double(bits) : 0.0;
        }
        if (__all_sync(ALL, all_there))
            break;
        if (tries % 1024 == 0) {
            asm volatile("mov.u64 %0, %globaltimer;" : "=l"(now));
            begun = begun == 0 ? now : begun;
            if (__any_sync(ALL, now - begun > PATIENCE || *(volatile int *)(state + 1))) {
                *(volatile int *)(state + 1) = 1;
                *quit = 1;
                break;
            }
        }
    }
    sum = over_warp(sum);
    for (int j = 0; j < SUMS; ++j)
        sums[j] = __shfl_sync(ALL, sum, j, 32);
};

// -- rows: LANES threads for each; of every four the first three have its components, of which those of the first four
// count
const int component = min(sub % 4, 2);
// Component of a row of `A v`, of what was given in a phase; where the residual is measured of `A x` and `|A| |x|`, of
// what has been reached or of the guess.
bool of_guess;
double size;
auto product = [&](int row, const word *given, unsigned when, bool measured) -> double {
    auto ask = [&](int node, word v[4]) {
        if (measured && of_guess) {
            for (int c = 0; c < 3; ++c)
                v[c] = __double_as_longlong(double(x_of[3 * size_t(node) + c]));
        } else {
            load(given + 4 * size_t(node), v[0], v[1]);
            load(given + 4 * size_t(node) + 2, v[2], v[3]);
        }
    };
    auto get = [&](int node, word v[4], double x[3]) {
        if (!(measured && of_guess)) {
            for (unsigned tries = 1; (unsigned)v[1] != when || (unsigned)v[3] != when; ++tries) {
                if (tries % 1024 == 0 && *quit)
                    break;
                ask(node, v);
            }
            v[1] = v[3] >> 32 << 32 | v[1] >> 32;
        }
        for (int c = 0; c < 3; ++c)
            x[c] = __longlong_as_double(v[c]);
    };
    double y[3] = {0.0, 0.0, 0.0}, z[3] = {0.0, 0.0, 0.0};
    auto add = [&](int place, const double v[3]) {
        double entries[9];
        for (int k = 0; k < 9; ++k)
            entries[k] = double(place < kept ? kept_values[9 * place + k] : entry(place, k));
        for (int c = 0; c < 3; ++c)
            for (int k = 0; k < 3; ++k)
                y[c] += entries[3 * c + k] * v[k];
        if (measured)
            for (int c = 0; c < 3; ++c)
                for (int k = 0; k < 3; ++k)
                    z[c] += fabs(entries[3 * c + k] * v[k]);
    };
    auto column = [&](int place) { return place < kept ? kept_columns[place] : columns.data[block0 + place]; };
    const int end = keeps_offsets ? first[row + 1] : offsets.data[row0 + row + 1] - block0;
    int place = (keeps_offsets ? first[row] : offsets.data[row0 + row] - block0) + sub;
    // two at a time: both are on their way before the first is needed
#pragma unroll 1
    for (; place < end; place += 2 * LANES) {
        word asked[2][4];
        double v[3];
        const bool two = place + LANES < end;
        const int node = column(place), other = two ? column(place + LANES) : 0;
        ask(node, asked[0]);
        if (two)
            ask(other, asked[1]);
        get(node, asked[0], v);
        add(place, v);
        if (two) {
            get(other, asked[1], v);
            add(place + LANES, v);
        }
    }
    // halves go different ways here, too: thread k of four has component k
    auto component_sum = [&](const double v[3]) -> double {
        const bool last = sub & 2, odd = sub & 1;
        double low = last ? v[2] : v[0], high = last ? 0.0 : v[1];
        low += __shfl_xor_sync(ALL, last ? v[0] : v[2], 2);
        high += __shfl_xor_sync(ALL, last ? v[1] : 0.0, 2);
        double sum = odd ? high : low;
        sum += __shfl_xor_sync(ALL, odd ? low : high, 1);
        for (int d = 4; d < LANES; d *= 2)
            sum += __shfl_xor_sync(ALL, sum, d);
        return sum;
    };
    if (measured)
        size = component_sum(z);
    return component_sum(y);
};
// Component of the inverse diagonal block times what the first three threads of the row have.
auto precondition = [&](int row, double v) -> double {
    // of which the six entries on and above the diagonal are kept
    const double *const inverse = vectors + INVERSE * length + 6 * row;
    double y = 0.0;
    for (int k = 0; k < 3; ++k)
        y += inverse[component + k + (component * k > 0)] * __shfl_sync(ALL, v, k, LANES);
    return y;
};

// What is done between two meetings. An iteration has one (Ghysels and Vanroose 2014, algorithm 4); what comes before
// the first and after the last, and every so often between, is the residual itself and what follows from it and from
// the search direction: u = M r, w = A u, s = A p, q = M s, z = A q. Long solves, and those whose end was none, go on
// with textbook conjugate gradients, of three meetings an iteration: p = u + beta p; s = A p; x, r and u. These keep the
// direction only if the residual hardly has a part along it: where rounding has ruled, they would go astray for good.
enum Phase { RESIDUAL, GET_W, GET_S, GET_Z, BEGIN, RESTART, ITERATE, DIRECTION, CURVATURE, UPDATE, END };
const double infinity = __longlong_as_double(0x7ff0000000000000ll);
int iteration = 0, since = 0;
double gamma_before = 1.0, alpha = 1.0, beta = 0.0, least = infinity, before = infinity;
double rr = 0.0, goal = 0.0, updated = infinity;
bool ended = false, textbook = false, afresh = false;
int phase = RESIDUAL;
of_guess = true;
#pragma unroll 4
for (int i = tid; i < 9 * kept; i += THREADS)
    kept_values[i] = entry(i / 9, i % 9);
for (int i = tid; i < length; i += THREADS) {
    vectors[X * length + i] = double(x_of[3 * size_t(row0) + i]);
    vectors[P * length + i] = vectors[S * length + i] = 0.0;
    vectors[Q * length + i] = vectors[Z * length + i] = 0.0;
}
for (int i = tid; i < rows; i += THREADS) {
    double a[9];
    for (int k = 0; k < 9; ++k)
        a[k] = double(all_values[9 * size_t(diagonal.data[row0 + i]) + k]);
    const double c0 = a[4] * a[8] - a[5] * a[7];
    const double c1 = a[5] * a[6] - a[3] * a[8];
    const double c2 = a[3] * a[7] - a[4] * a[6];
    const double d = 1.0 / (a[0] * c0 + a[1] * c1 + a[2] * c2);
    const double inverse[6] = {d * c0,
                               d * (a[2] * a[7] - a[1] * a[8]),
                               d * (a[1] * a[5] - a[2] * a[4]),
                               d * (a[0] * a[8] - a[2] * a[6]),
                               d * (a[2] * a[3] - a[0] * a[5]),
                               d * (a[0] * a[4] - a[1] * a[3])};
    for (int k = 0; k < 6; ++k)
        vectors[INVERSE * length + 6 * i + k] = inverse[k];
}
__syncthreads();

// Of the last warp, after a meeting: the next phase and its factors.
auto decide = [&](double per_gamma, double per_alpha) {
    if (phase == RESIDUAL) {
        rr = sums[0];
        goal = tolerance * tolerance * sums[1];
        phase = END;
        if (!(rr > goal) || ended || iteration >= max_iterations)
            return;
        if (!(updated > goal)) {
            // what is carried along says that this is the end, and is wrong, or as right as rounding allows
            if (rr <= 256.0 * ROUNDING * ROUNDING * sums[2])
                rr = updated;
            if (rr > 0.25 * before || rr == updated)
                return;
            before = rr;
            textbook = true;
        }
        textbook = textbook || iteration >= PIPELINED;
        phase = textbook ? RESTART : of_guess ? BEGIN : GET_W;
        of_guess = false;
        since = 0;
    } else if (phase == GET_W) {
        phase = GET_S;
    } else if (phase == GET_S) {
        phase = GET_Z;
    } else if (phase == DIRECTION) {
        phase = CURVATURE;
    } else if (phase == CURVATURE) {
        if (sums[1] > 0.0)
            least = fmin(least, sums[0] / sums[1]);
        alpha = gamma_before / sums[0];
        ++iteration;
        phase = UPDATE;
    } else {
        updated = sums[0];
        const double gamma = sums[1];
        // p . A p is gamma / alpha
        if (watch && phase == ITERATE && sums[3] > 0.0)
            least = fmin(least, gamma_before * per_alpha / sums[3]);
        ended = iteration >= max_iterations || (watch && least <= 0.0);
        since += phase == ITERATE;
        const bool rounded = !textbook && updated > goal && updated < CARRIED * rr;
        textbook = textbook || rounded;
        afresh = afresh || rounded;
        if (ended || !(updated > goal) || rounded || (since == RENEWED_EVERY && !textbook)) {
            phase = RESIDUAL;
            return;
        }
        if (phase == RESTART)
            afresh = afresh || fabs(sums[2]) > ALONG * gamma_before;
        beta = iteration > 0 && !afresh ? gamma * per_gamma : 0.0;
        afresh = false;
        if (textbook) {
            phase = DIRECTION;
        } else {
            phase = ITERATE;
            alpha = gamma / (sums[2] - beta * gamma * per_alpha);
            ++iteration;
        }
        gamma_before = gamma;
    }
};
while (phase < END) {
    ++epoch;
    word *const outgoing = places + size_t(epoch % 2) * 4 * nodes;
    const bool tells_solution = phase >= GET_Z && phase <= ITERATE || phase == UPDATE;
    for (int k = 0; k < SUMS; ++k)
        sums[k] = 0.0;
#pragma unroll 1
    for (int base = warp * ROWS_OF_WARP; !adds_up && base < rows; base += ROWS_AT_ONCE) {
        // threads without a component go along: they take part in shuffles
        const int row = min(base + lane / LANES, rows - 1), i = 3 * row + component;
        const bool mine = base + lane / LANES < rows && sub < 3;
        auto vector = [&](int which) -> double & { return vectors[which * length + i]; };
        const double y = phase == RESIDUAL ? product(row, solution, epoch - 1, true) : vector(PRODUCT);
        double x = vector(X), r = vector(R), u = vector(U), p = vector(P), v = y, bi = 0.0;
        if (phase == ITERATE) {
            const double w = vector(W), z = y + beta * vector(Z), q = vector(M) + beta * vector(Q);
            const double s = w + beta * vector(S);
            v = w - alpha * z;
            p = u + beta * p;
            x += alpha * p;
            r -= alpha * s;
            u -= alpha * q;
            if (mine) {
                vector(Z) = z;
                vector(Q) = q;
                vector(S) = s;
                vector(P) = p;
                vector(X) = x;
                vector(R) = r;
                vector(U) = u;
                vector(W) = v;
            }
        } else if (phase == RESIDUAL) {
            bi = double(b_of[3 * size_t(row0) + i]);
            r = v = bi - y;
            x = double(REAL(x));
            if (mine) {
                vector(X) = x;
                vector(R) = r;
            }
        } else if (phase == UPDATE) {
            x += alpha * p;
            r = v = r - alpha * vector(S);
            if (mine) {
                vector(X) = x;
                vector(R) = r;
            }
        } else if (phase == GET_Z || phase == RESTART) {
            v = vector(W);
            if (mine && phase == GET_Z)
                vector(Z) = y;
        } else if (phase == DIRECTION) {
            p = u + beta * p;
            if (mine)
                vector(P) = p;
        } else if (mine && phase != GET_S && phase != CURVATURE) {
            vector(W) = y;
        }
        double give = p;
        if (phase != GET_W && phase != DIRECTION && phase != CURVATURE)
            give = precondition(row, v);
        publish(outgoing, row, give, mine);
        // as it will be stored, should this be the end
        if (tells_solution)
            publish(solution, row, double(REAL(x)), mine);
        if (!mine)
            continue;
        if (phase == RESIDUAL) {
            vector(U) = give;
            const double magnitude = size + fabs(bi);
            sums[0] += r * r;
            sums[1] += bi * bi;
            sums[2] += magnitude * magnitude;
        } else if (phase == GET_S) {
            vector(S) = y;
            vector(Q) = give;
        } else if (phase == CURVATURE) {
            vector(S) = y;
            sums[0] += p * y;
            sums[1] += p * p;
        } else if (phase == UPDATE) {
            vector(U) = give;
            sums[0] += r * r;
            sums[1] += r * give;
        } else if (tells_solution) {
            vector(M) = give;
            sums[0] += r * r;
            sums[1] += r * u;
            sums[2] += phase == RESTART ? r * p : v * u;
            sums[3] += p * p;
        }
    }
    if (!adds_up) {
        of_guess = false;
        const double sum = warp_sums(sums);
        if (lane % 8 == 0)
            partial[warp][lane / 8] = sum;
    }
    __syncthreads();
    if (adds_up) {
        // what the next factors need is on its way while others are waited for
        const double per_gamma = 1.0 / gamma_before, per_alpha = 1.0 / alpha;
        asm volatile("" ::"d"(per_gamma), "d"(per_alpha));
        meet();
        decide(per_gamma, per_alpha);
        if (lane == 0)
            factors[0] = alpha, factors[1] = beta, *next = phase;
    } else if (phase != CURVATURE && phase != UPDATE) {
#pragma unroll 1
        for (int base = warp * ROWS_OF_WARP; base < rows; base += ROWS_AT_ONCE) {
            const int row = min(base + lane / LANES, rows - 1);
            const double y = product(row, outgoing, epoch, false);
            if (base + lane / LANES < rows && sub < 3)
                vectors[PRODUCT * length + 3 * row + sub] = y;
        }
    }
    __syncthreads();
    if (*quit)
        return;
    alpha = factors[0], beta = factors[1], phase = *next;
}

for (int i = tid; i < length; i += THREADS)
    x_of[3 * size_t(row0) + i] = REAL(vectors[X * length + i]);
if (me == 0 && adds_up && lane == 0) {
    given.outcome.data[0] = double(iteration);
    given.outcome.data[1] = sqrt(rr);
    given.outcome.data[2] = sqrt(goal);
    given.outcome.data[3] = least;
}
if (me == 0 && tid == 0)
    state[0] = (int)epoch;
