/* Sweeps of the nonsmooth Gauss-Seidel method over contacts without plates, compiled.

The formulas and their order are those of contactopt.methods.nsgs, which says them in full, so that
both give the same forces but for rounding. Here r (k, dim) changes in place. Q is an array, or has
compressed rows: those entries of row i stand at first[i] <= place < first[i + 1], in the columns
columns[place]. An array has no such places. */

#define PY_SSIZE_T_CLEAN
#include <Python.h>
#include <float.h>
#include <math.h>
#include <stdint.h>
#include <stdlib.h>
#include <string.h>

#define ROOT 1e-14
#define STEPS 60
#define LONGEST 32   /* sweeps that may be remembered */
#define GROWN 2.0    /* a change so many times the least so far ends what is remembered */
#define EASY 50       /* sweeps of which each may be accelerated */
#define LITTLE 1e-13 /* of the identity, beside products of unit vectors */
#define RIDGE 1e-12  /* of the identity, over the mean of the diagonal */
#define CLIPPED 1e-9 /* share of mu r_n that friction may lack and still slip */
#define FEWEST 3     /* sweeps before the states are worth a look */
#define LOCAL 100.0  /* multiplications that a local problem and the acceleration are worth */

typedef struct {
    double compliance, S[4], w[2], tn[2], mu, level;
    int bilateral;
} Local;

typedef struct {
    const double *entries;
    const int64_t *first, *columns;
    Py_ssize_t k;
} Matrix;

/* The block W (dim, dim) of contact i and itself. */
static void own_block(int dim, Py_ssize_t i, const Matrix *Q, double *W)
{
    Py_ssize_t own = i * dim;
    for (int a = 0; a < dim; a++) {
        for (int b = 0; b < dim; b++)
            W[a * dim + b] = Q->first ? 0.0 : Q->entries[(own + a) * Q->k * dim + own + b];
        if (Q->first == NULL)
            continue;
        for (int64_t place = Q->first[own + a]; place < Q->first[own + a + 1]; place++) {
            int64_t b = Q->columns[place] - own;
            if (0 <= b && b < dim)
                W[a * dim + b] += Q->entries[place];
        }
    }
}

/* The least stiffness of a direction, S, keeps the law solvable where W is singular. */
static Local local_of(int dim, const double *W, double mu, int bilateral)
{
    Local at = {.compliance = W[0], .mu = mu, .level = 0.0, .bilateral = bilateral};
    int t = dim - 1;
    double trace = 0.0;
    for (int i = 0; i < dim; i++)
        trace += fabs(W[i * dim + i]);
    double least = 1e-12 * (trace > 0 ? trace : 1.0);
    for (int i = 0; i < t; i++) {
        at.w[i] = at.compliance > 0 ? W[1 + i] / at.compliance : W[1 + i];
        at.tn[i] = W[(1 + i) * dim];
    }
    for (int i = 0; i < t; i++)
        for (int j = 0; j < t; j++)
            at.S[i * t + j] = W[(1 + i) * dim + 1 + j] - at.tn[i] * at.w[j];
    if (t == 1)
        at.S[0] = fmax(at.S[0], least);
    else
        at.S[0] += least, at.S[3] += least;
    return at;
}

static void slip_in_the_plane(const Local *at, double b, double press, double *r)
{
    double t = -b / at->S[0], sign = press > 0 ? 1.0 : -1.0;
    double bound = at->mu * (press - at->w[0] * t);
    if (!(fabs(t) <= (at->bilateral ? fabs(bound) : bound))) {
        double way = t > 0 ? 1.0 : -1.0;
        t = way * at->mu * fabs(press) / (1 + at->mu * sign * at->w[0] * way);
    }
    r[1] = t;
    r[0] = press - at->w[0] * t;
}

/* The multiplier `level` of the last sweep is tried before Newton's steps, and kept for the
next. */
static void slip_in_space(Local *at, double b1, double b2, double press, double *r)
{
    double s11 = at->S[0], s12 = at->S[1], s21 = at->S[2], s22 = at->S[3];
    double w1 = at->w[0], w2 = at->w[1], mu = at->mu, t1 = 0.0, t2 = 0.0;
    double low = 0.0, level = 0.0;
    double high = hypot(b1, b2) * (1 + mu * hypot(w1, w2)) / (mu * fabs(press));
    for (int step = 0; step < STEPS && high <= DBL_MAX; step++) {
        double m11 = s11 + level, m22 = s22 + level, det = m11 * m22 - s12 * s21;
        t1 = (s12 * b2 - m22 * b1) / det;
        t2 = (s21 * b1 - m11 * b2) / det;
        double size = sqrt(t1 * t1 + t2 * t2), normal = press - w1 * t1 - w2 * t2;
        double way = at->bilateral && normal < 0 ? -1.0 : 1.0;
        double excess = size - mu * way * normal;
        if ((level == 0.0 && excess <= 0) || fabs(excess) <= ROOT * size)
            break;
        if (excess > 0)
            low = level;
        else
            high = level;
        double d1 = (s12 * t2 - m22 * t1) / det, d2 = (s21 * t1 - m11 * t2) / det;
        double slope = (t1 * d1 + t2 * d2) / size + mu * way * (w1 * d1 + w2 * d2);
        level = slope < 0 ? level - excess / slope : high;
        if (step == 0)
            level = fmax(level, at->level);
        if (!(low < level && level < high))
            level = (low + high) / 2;
    }
    at->level = level;
    r[1] = t1, r[2] = t2;
    r[0] = press - w1 * t1 - w2 * t2;
}

static void solve_local(int dim, Local *at, const double *v, double *r)
{
    for (int i = 0; i < dim; i++)
        r[i] = 0.0;
    if ((v[0] >= 0 && !at->bilateral) || at->compliance <= 0)
        return;
    double press = -v[0] / at->compliance;
    r[0] = press;
    if (!(at->mu > 0) || press == 0)
        return;
    if (dim == 2)
        slip_in_the_plane(at, v[1] + at->tn[0] * press, press, r);
    else
        slip_in_space(at, v[1] + at->tn[0] * press, v[2] + at->tn[1] * press, press, r);
}

/* An over-relaxed force back into the law's bounds. */
static void relax(int dim, const Local *at, double share, const double *old, double *r)
{
    double size = 0.0;
    for (int i = 0; i < dim; i++)
        r[i] = old[i] + share * (r[i] - old[i]);
    if (!at->bilateral && r[0] < 0)
        r[0] = 0.0;
    for (int i = 1; i < dim; i++)
        size += r[i] * r[i];
    size = sqrt(size);
    double bound = at->mu * fabs(r[0]);
    for (int i = 1; i < dim && size > bound; i++)
        r[i] *= bound / size;
}

/* Four sums, which one instruction may add to at once. */
static double dot(const double *a, const double *b, Py_ssize_t n)
{
    double sum[4] = {0.0, 0.0, 0.0, 0.0};
    Py_ssize_t i = 0;
    for (; i + 4 <= n; i += 4)
        for (int j = 0; j < 4; j++)
            sum[j] += a[i + j] * b[i + j];
    for (; i < n; i++)
        sum[0] += a[i] * b[i];
    return (sum[0] + sum[1]) + (sum[2] + sum[3]);
}

/* Row i of Q times x, its sum in four parts, too. */
static double row_times(const Matrix *Q, Py_ssize_t n, Py_ssize_t i, const double *x)
{
    if (Q->first == NULL)
        return dot(Q->entries + i * n, x, n);
    double sum[4] = {0.0, 0.0, 0.0, 0.0};
    int64_t place = Q->first[i], end = Q->first[i + 1];
    for (; place + 4 <= end; place += 4)
        for (int j = 0; j < 4; j++)
            sum[j] += Q->entries[place + j] * x[Q->columns[place + j]];
    for (; place < end; place++)
        sum[0] += Q->entries[place] * x[Q->columns[place]];
    return (sum[0] + sum[1]) + (sum[2] + sum[3]);
}

/* One sweep, from r to its values after it. A contact is moved by all others: its own force is zero
meanwhile. */
static void sweep_once(int dim, double share, const Matrix *Q, const double *q, Local *at,
                       double *r)
{
    Py_ssize_t n = Q->k * dim;
    for (Py_ssize_t i = 0; i < Q->k; i++) {
        double v[3], old[3], *mine = r + i * dim;
        for (int a = 0; a < dim; a++)
            old[a] = mine[a], mine[a] = 0.0;
        for (int a = 0; a < dim; a++)
            v[a] = q[i * dim + a] + row_times(Q, n, i * dim + a, r);
        solve_local(dim, at + i, v, mine);
        if (share != 1.0)
            relax(dim, at + i, share, old, mine);
    }
}

/* What Anderson's acceleration remembers, all of it in one array of the caller. Of the last sweeps:
the differences `moves` of their results and `changes` of their changes f, both over the norm of the
latter, and the products of these with each other. After the first sweeps, a number of them `between`
two extrapolations finds the states of the contacts that fit; `since` counts them. */
typedef struct {
    double *used, *next, *started, *best, *since, *products, *moves, *changes, *result, *change;
    int most, between;
    Py_ssize_t n;
} Memory;

static Memory memory_in(double *work, int most, int between, Py_ssize_t n)
{
    double *products = work + 5, *moves = products + most * most, *changes = moves + most * n;
    double *result = changes + most * n;
    return (Memory){work, work + 1, work + 2, work + 3, work + 4, products, moves,
                    changes, result, result + n, most, between, n};
}

static Py_ssize_t work_of(int most, Py_ssize_t n)
{
    return most ? 5 + most * most + 2 * (most + 1) * n : 0;
}

static void forget(Memory *past)
{
    *past->used = *past->next = *past->started = 0.0;
}

/* Keep the result r of a sweep and its change f. */
static void remember(Memory *past, const double *r, const double *f)
{
    Py_ssize_t n = past->n, slot = (Py_ssize_t)*past->next;
    double norm = sqrt(dot(f, f, n));
    if (norm > GROWN * *past->best)
        forget(past);
    if (*past->started == 0.0 || norm < *past->best)
        *past->best = norm;
    if (*past->started != 0.0) {
        double *move = past->moves + slot * n, *change = past->changes + slot * n, size = 0.0;
        for (Py_ssize_t i = 0; i < n; i++) {
            move[i] = r[i] - past->result[i];
            change[i] = f[i] - past->change[i];
            size += change[i] * change[i];
        }
        if (size > 0) {
            size = sqrt(size);
            for (Py_ssize_t i = 0; i < n; i++)
                move[i] /= size, change[i] /= size;
            if (*past->used < past->most)
                *past->used += 1;
            *past->next = (slot + 1) % past->most;
            for (int j = 0; j < (int)*past->used; j++)
                past->products[slot * past->most + j] = past->products[j * past->most + slot] =
                    dot(change, past->changes + j * n, n);
        }
    }
    memcpy(past->result, r, n * sizeof(double));
    memcpy(past->change, f, n * sizeof(double));
    *past->started = 1.0;
    *past->since += 1.0;
}

/* r, from the combination of the last results whose changes would add up to the least. Their least
squares are solved by Cholesky factors of the products, with a little of the identity. */
static void extrapolate(Memory *past, double *r)
{
    int used = (int)*past->used, most = past->most;
    *past->since = 0.0;
    double L[LONGEST][LONGEST], c[LONGEST];
    for (int i = 0; i < used; i++) {
        for (int j = 0; j <= i; j++) {
            double sum = past->products[i * most + j] + (i == j ? LITTLE : 0.0);
            for (int l = 0; l < j; l++)
                sum -= L[i][l] * L[j][l];
            if (i == j && !(sum > 0)) {
                forget(past);
                return;
            }
            L[i][j] = i == j ? sqrt(sum) : sum / L[j][j];
        }
        c[i] = dot(past->changes + i * past->n, past->change, past->n);
        for (int l = 0; l < i; l++)
            c[i] -= L[i][l] * c[l];
        c[i] /= L[i][i];
    }
    for (int i = used - 1; i >= 0; i--) {
        for (int l = i + 1; l < used; l++)
            c[i] -= L[l][i] * c[l];
        c[i] /= L[i][i];
    }
    for (int j = 0; j < used; j++)
        for (Py_ssize_t i = 0; i < past->n; i++)
            r[i] -= c[j] * past->moves[j * past->n + i];
}

/* In the plane the states of contacts in r, unless others follow, make their forces linear: r = 0
where they are open, else u_n = 0, and u_t = 0 where they stick, r_t = +-mu r_n where they slip.
x, the forces that solve this, by elimination. A little of the identity keeps forces that move
nothing as they are in r. Returns whether this took at most `most` multiplications and worked. */
static int settle(const Matrix *Q, const double *q, const Local *at, const double *r, double most,
                  double *x)
{
    Py_ssize_t n = 2 * Q->k, m = 0;
    Py_ssize_t *row = malloc(2 * n * sizeof(Py_ssize_t) + 1), *column = row + n;
    for (Py_ssize_t j = 0; row && j < n; j++) {
        double bound = at[j / 2].mu * r[j - j % 2];
        int fixed = !(r[j - j % 2] > 0) || (j % 2 && fabs(r[j]) >= bound * (1 - CLIPPED));
        column[j] = fixed ? -1 : m;
        if (!fixed)
            row[m++] = j;
        if (at[j / 2].bilateral)
            most = 0.0;
    }
    Py_ssize_t wide = m + 1;
    double *A = row && m * m * (m / 3.0 + 1) <= most ? calloc(m * wide + 1, sizeof(double)) : NULL;
    int fine = A != NULL;
    double sum = 0.0;
    for (Py_ssize_t a = 0; fine && a < m; a++) {
        int64_t j = row[a], from = Q->first ? Q->first[j] : j * n;
        int64_t to = Q->first ? Q->first[j + 1] : from + n;
        double *line = A + a * wide;
        for (int64_t place = from; place < to; place++) {
            int64_t c = Q->first ? Q->columns[place] : place - from;
            if (column[c] >= 0)
                line[column[c]] += Q->entries[place];
            else if (r[c - c % 2] > 0)
                line[column[c - 1]] += Q->entries[place] * copysign(at[c / 2].mu, r[c]);
        }
        line[m] = -(q[j] + row_times(Q, n, j, r));
        sum += fabs(line[a]);
    }
    for (Py_ssize_t a = 0; fine && a < m; a++)
        A[a * wide + a] += RIDGE * sum / m;
    for (Py_ssize_t a = 0; fine && a < m; a++) {
        double *lead = A + a * wide;
        Py_ssize_t best = a;
        for (Py_ssize_t b = a + 1; b < m; b++)
            best = fabs(A[b * wide + a]) > fabs(A[best * wide + a]) ? b : best;
        for (Py_ssize_t c = a; best > a && c <= m; c++) {
            double other = A[best * wide + c];
            A[best * wide + c] = lead[c], lead[c] = other;
        }
        fine = lead[a] != 0;
        for (Py_ssize_t b = a + 1; fine && b < m; b++) {
            double *line = A + b * wide, share = line[a] / lead[a];
            for (Py_ssize_t c = a + 1; share != 0 && c <= m; c++)
                line[c] -= share * lead[c];
        }
    }
    memcpy(x, r, n * sizeof(double));
    for (Py_ssize_t a = m - 1; fine && a >= 0; a--) {
        double *line = A + a * wide, step = line[m];
        for (Py_ssize_t c = a + 1; c < m; c++)
            step -= line[c] * A[c * wide + m];
        line[m] = step / line[a];
        x[row[a]] += line[m];
    }
    for (Py_ssize_t i = 0; fine && i < n; i += 2)
        if (column[i] >= 0 && column[i + 1] < 0)
            x[i + 1] = x[i] * copysign(at[i / 2].mu, r[i + 1]);
    free(A), free(row);
    return fine;
}

/* One sweep from r, and its changes f; their norm over that of the forces. */
static double changed(int dim, double share, const Matrix *Q, const double *q, Local *at, double *r,
                      double *f)
{
    Py_ssize_t n = Q->k * dim;
    memcpy(f, r, n * sizeof(double));
    sweep_once(dim, share, Q, q, at, r);
    for (Py_ssize_t i = 0; i < n; i++)
        f[i] = r[i] - f[i];
    double moved = dot(f, f, n), size = dot(r, r, n);
    return size == 0 && moved == 0 ? 0.0 : sqrt(moved / size);
}

/* At most `count` sweeps, fewer where one changes the forces by no more than `enough` of them; r is
the result of the last one. Returns its change over the forces, infinite if these have vanished, and
sets `count` to the number of sweeps. Accelerated ones in the plane may end by `settle`, which never
costs more than the sweeps before, and a third of them after it was in vain. */
static double sweep_over(int dim, Py_ssize_t *count, double share, double enough, const Matrix *Q,
                         const double *q, Local *at, double *r, double *f, Memory *past)
{
    double change = INFINITY, spent = 0.0, patience = 1.0;
    Py_ssize_t n = Q->k * dim, done = 0;
    double cost = (Q->first ? (double)Q->first[n] : (double)n * n) + LOCAL * Q->k;
    double *x = dim == 2 && past->most && enough >= 0 ? malloc(n * sizeof(double) + 1) : NULL;
    while (done < *count && change > enough) {
        if (past->most && (done < EASY || *past->since >= past->between))
            extrapolate(past, r);
        change = changed(dim, share, Q, q, at, r, f);
        if (past->most)
            remember(past, r, f);
        done++, spent += cost;
        if (x == NULL || done < FEWEST || change <= enough ||
            !settle(Q, q, at, r, spent / patience, x))
            continue;
        double after = changed(dim, share, Q, q, at, x, f);
        spent = 0.0;
        if (after < change / 2) {
            memcpy(r, x, n * sizeof(double));
            change = after, patience = 1.0;
            forget(past);
        } else
            patience *= 3;
    }
    free(x);
    *count = done;
    return change;
}

static PyObject *sweep(PyObject *self, PyObject *args)
{
    int dim, most, between = 1;
    Py_ssize_t count;
    double share, enough, change = 0.0;
    Py_buffer first, columns, entries, mu, bilateral, q, work, r;
    if (!PyArg_ParseTuple(args, "iy*y*y*y*y*y*w*iw*ndd|i", &dim, &first, &columns, &entries, &mu,
                          &bilateral, &q, &work, &most, &r, &count, &share, &enough, &between))
        return NULL;
    Matrix Q = {entries.buf, first.len ? first.buf : NULL, columns.buf,
                mu.len / (Py_ssize_t)sizeof(double)};
    int fits = most <= LONGEST && work.len >= work_of(most, Q.k * dim) * (Py_ssize_t)sizeof(double);
    Local *at = fits ? malloc((Q.k ? Q.k : 1) * (sizeof(Local) + dim * sizeof(double))) : NULL;
    if (at != NULL) {
        Py_BEGIN_ALLOW_THREADS;
        Memory past = memory_in(work.buf, most, between, Q.k * dim);
        for (Py_ssize_t i = 0; i < Q.k; i++) {
            double W[9] = {0.0};
            own_block(dim, i, &Q, W);
            at[i] = local_of(dim, W, ((double *)mu.buf)[i], ((uint8_t *)bilateral.buf)[i]);
        }
        change = sweep_over(dim, &count, share, enough, &Q, q.buf, at, r.buf,
                            (double *)(at + Q.k), &past);
        Py_END_ALLOW_THREADS;
        free(at);
    }
    PyBuffer_Release(&first), PyBuffer_Release(&columns), PyBuffer_Release(&entries);
    PyBuffer_Release(&mu), PyBuffer_Release(&bilateral);
    PyBuffer_Release(&q), PyBuffer_Release(&work), PyBuffer_Release(&r);
    return at == NULL ? PyErr_NoMemory() : Py_BuildValue("dn", change, count);
}

#define NOISE 1e-13 /* relative size of what rounding leaves of a zero */

/* The largest entry of row i of Q. */
static double row_size(const Matrix *Q, Py_ssize_t n, Py_ssize_t i)
{
    int64_t from = Q->first ? Q->first[i] : i * n, to = Q->first ? Q->first[i + 1] : from + n;
    double most = 0.0;
    for (int64_t place = from; place < to; place++)
        most = fmax(most, fabs(Q->entries[place]));
    return most;
}

/* The mean positive diagonal of a block, or 0; `highest` is the largest diagonal entry. */
static double compliance_of(int dim, const double *diag, double highest)
{
    double total = 0.0;
    int counted = 0;
    for (int a = 0; a < dim; a++)
        if (diag[a] > NOISE * highest)
            total += diag[a], counted++;
    return total / (counted ? counted : 1);
}

/* Local problems of Coulomb's law, as contactopt.problem.scaling has them: a component that nothing
moves gets the mean compliance, so that it bears no force. diag (n,) is room. */
static void prepare(int dim, const Matrix *Q, const double *q, const double *mu, double *diag,
                    Local *at)
{
    Py_ssize_t n = Q->k * dim, positive = 0;
    double sum = 0.0, largest = 0.0, farthest = 0.0;
    for (Py_ssize_t i = 0; i < n; i++) {
        double W[9] = {0.0};
        own_block(dim, i / dim, Q, W);
        diag[i] = W[(i % dim) * (dim + 1)];
        if (diag[i] > 0)
            sum += diag[i], positive++;
        largest = fmax(largest, fabs(diag[i])), farthest = fmax(farthest, fabs(q[i]));
    }
    for (Py_ssize_t i = 0; i < Q->k; i++) {
        double W[9] = {0.0};
        own_block(dim, i, Q, W);
        for (Py_ssize_t a = 0, j = i * dim; a < dim; a++, j++)
            if (fabs(diag[j]) <= NOISE * largest && fabs(q[j]) <= NOISE * farthest &&
                row_size(Q, n, j) <= NOISE * largest)
                W[a * (dim + 1)] = positive ? sum / positive : 1.0;
        at[i] = local_of(dim, W, mu[i], 0);
    }
}

/* Numbers of contactopt.problem.certificate. */
#define ACTS 1e-6
#define ROUNDED 1e-6
#define DUST 1e-5
#define ROUNDING DBL_EPSILON
#define UNSEEN 1e4
#define STIFFEST 1e4

static double length_of(const double *v, int d)
{
    return d == 1   ? fabs(v[0])
           : d == 2 ? sqrt(v[0] * v[0] + v[1] * v[1])
                    : sqrt(v[0] * v[0] + v[1] * v[1] + v[2] * v[2]);
}

/* The least length of u = d + q where a contact bears force or overlaps; 0 without any. */
static double least_displacement(int dim, Py_ssize_t k, const double *r, const double *d,
                                 const double *q)
{
    double least = INFINITY;
    for (Py_ssize_t i = 0; i < k * dim; i += dim) {
        double u[3];
        for (int a = 0; a < dim; a++)
            u[a] = d[i + a] + q[i + a];
        double size = length_of(u, dim);
        if ((length_of(r + i, dim) > 0 || u[0] < 0) && size > 0)
            least = fmin(least, size);
    }
    return isfinite(least) ? least : 0.0;
}

/* The certificate of contactopt.problem.certificate, in the letters of its head, without plates and
for Coulomb's law. diag (n,) is that of Q; d (n,) is room for Q r. */
static double certificate(int dim, const Matrix *Q, const double *q, const double *mu,
                          const double *diag, const double *r, double *d)
{
    Py_ssize_t k = Q->k, n = k * dim;
    double F0 = 0.0, L = 0.0, narrow = INFINITY, overlap = -INFINITY, highest = 0.0, worst = 0.0;
    double size = 0.0, work = 0.0, movable = 0.0, stiffness = 0.0;
    for (Py_ssize_t i = 0; i < n; i++) {
        d[i] = row_times(Q, n, i, r);
        if (!isfinite(r[i]) || !isfinite(d[i]))
            return INFINITY;
        highest = fmax(highest, diag[i]);
    }
    for (Py_ssize_t i = 0; i < n; i += dim)
        F0 = fmax(F0, length_of(r + i, dim));
    for (Py_ssize_t i = 0; i < n; i += dim) {
        double bears = length_of(r + i, dim), c = compliance_of(dim, diag + i, highest);
        double weight = F0 > 0 ? fmin(1.0, bears / (ACTS * F0)) : 0.0;
        L = fmax(L, weight * fmax(length_of(d + i, dim), ROUNDED * length_of(q + i, dim)));
        narrow = fmin(narrow, fabs(q[i])), overlap = fmax(overlap, -q[i]);
        work += bears * c, stiffness += c;
        size += c > 0 ? bears : 0.0, movable += c > 0;
    }
    L = fmax(L, fmax(narrow, overlap));
    double mean = size > 0 ? work / size : movable > 0 ? stiffness / movable : 0.0;
    if (L == 0)
        L = least_displacement(dim, k, r, d, q);
    double natural = mean > 0 ? L / mean : 0.0;
    double F = natural > 0 ? fmax(fmin(F0, natural), DUST * natural) : F0;
    F = F == 0 ? 1.0 : F;
    for (Py_ssize_t i = 0; i < n; i += dim) {
        double c = compliance_of(dim, diag + i, highest), y[3], error[3];
        double stiff = fmin(fmax(c > 0 ? mean / c : 0.0, 1.0), STIFFEST);
        double rho = L == 0 ? 0.0 : stiff * (F / L);
        for (int a = 0; a < dim; a++)
            y[a] = r[i + a] - rho * (d[i + a] + q[i + a]);
        double bound = mu[i / dim] * fmax(y[0], 0.0), slip = length_of(y + 1, dim - 1);
        double shrink = slip > bound ? bound / slip : 1.0;
        error[0] = r[i] - fmax(y[0], 0.0);
        for (int a = 1; a < dim; a++)
            error[a] = r[i + a] - y[a] * shrink;
        double off = length_of(error, dim) / F;
        double beyond = (length_of(r + i + 1, dim - 1) - mu[i / dim] * fmax(r[i], 0.0)) / F;
        if (!isfinite(off) || !isfinite(beyond))
            return INFINITY;
        worst = fmax(worst, fmax(off, beyond));
    }
    worst = fmax(worst, F0 / F > UNSEEN ? ROUNDING * (F0 / F) : 0.0);
    return isfinite(worst) ? worst : INFINITY;
}

static PyObject *solved(PyObject *self, PyObject *args)
{
    int dim, most, between;
    Py_ssize_t count, more;
    double nearly, swept, enough, change, residual = INFINITY, rubs = 0.0;
    Py_buffer first, columns, entries, mu, q, r;
    if (!PyArg_ParseTuple(args, "iy*y*y*y*y*w*iinddd", &dim, &first, &columns, &entries, &mu, &q,
                          &r, &most, &between, &count, &nearly, &swept, &enough))
        return NULL;
    Py_ssize_t k = mu.len / (Py_ssize_t)sizeof(double), n = k * dim;
    Matrix Q = {entries.buf, first.len ? first.buf : NULL, columns.buf, k};
    double *room = most > LONGEST ? NULL : calloc(3 * n + work_of(most, n) + 1, sizeof(double));
    Local *at = room ? malloc((k ? k : 1) * sizeof(Local)) : NULL;
    if (at != NULL) {
        Py_BEGIN_ALLOW_THREADS;
        double *f = room, *d = room + n, *diag = room + 2 * n;
        Memory past = memory_in(room + 3 * n, most, between, n);
        prepare(dim, &Q, q.buf, mu.buf, diag, at);
        change = sweep_over(dim, &count, 1.0, nearly, &Q, q.buf, at, r.buf, f, &past);
        if (change <= nearly || count == 0)
            residual = certificate(dim, &Q, q.buf, mu.buf, diag, r.buf, d);
        if (change <= nearly && !(residual <= enough)) {
            more = 2 * count; /* the last digits take less than the first */
            sweep_over(dim, &more, 1.0, swept, &Q, q.buf, at, r.buf, f, &past);
            residual = certificate(dim, &Q, q.buf, mu.buf, diag, r.buf, d);
        }
        for (Py_ssize_t i = 0; i < n; i++)
            rubs = i % dim && ((double *)r.buf)[i] != 0 ? 1.0 : rubs;
        Py_END_ALLOW_THREADS;
    }
    free(room), free(at);
    PyBuffer_Release(&first), PyBuffer_Release(&columns), PyBuffer_Release(&entries);
    PyBuffer_Release(&mu), PyBuffer_Release(&q), PyBuffer_Release(&r);
    return at == NULL ? PyErr_NoMemory() : Py_BuildValue("dd", residual, rubs);
}

static PyMethodDef functions[] = {
    {"solved", solved, METH_VARARGS, "Sweep a problem in any units until most digits are there,"
     " and, unless the certificate is `enough` then, all; the certificate, infinite where they do"
     " not converge, and 1 if there is friction. Without sweeps, that of r."},
    {"sweep", sweep, METH_VARARGS,
     "Sweep at most `count` times over all contacts; the last change over the forces, the sweeps."},
    {NULL, NULL, 0, NULL}};

static struct PyModuleDef module = {PyModuleDef_HEAD_INIT, "sweeps", NULL, -1, functions};

PyMODINIT_FUNC PyInit_sweeps(void) { return PyModule_Create(&module); }
