/* Sweeps of the nonsmooth Gauss-Seidel method over contacts without plates, compiled.

The formulas and their order are those of contactopt.methods.nsgs, which says them in full, so that
both give the same forces but for rounding. Here r (k, dim) changes in place. Q is an array, or
known by its blocks of dim x dim, row after row. Those of contact i are first[i] <= place <
first[i + 1]; columns[place] is the contact that the block couples it to, and home[i] the place of
its own block. An array has no columns. */

#define PY_SSIZE_T_CLEAN
#include <Python.h>
#include <float.h>
#include <math.h>
#include <stdint.h>
#include <stdlib.h>

#define ROOT 1e-14
#define STEPS 60

typedef struct {
    double compliance, S[4], w[2], tn[2], mu, level;
    int bilateral;
} Local;

typedef struct {
    const double *entries;
    const int64_t *first, *columns, *home;
    Py_ssize_t k;
} Matrix;

/* The least stiffness of a direction, S, keeps the law solvable where W is singular. */
static Local local_of(int dim, const double *W, Py_ssize_t row, double mu, int bilateral)
{
    Local at = {.compliance = W[0], .mu = mu, .level = 0.0, .bilateral = bilateral};
    int t = dim - 1;
    double trace = 0.0;
    for (int i = 0; i < dim; i++)
        trace += fabs(W[i * row + i]);
    double least = 1e-12 * (trace > 0 ? trace : 1.0);
    for (int i = 0; i < t; i++) {
        at.w[i] = at.compliance > 0 ? W[1 + i] / at.compliance : W[1 + i];
        at.tn[i] = W[(1 + i) * row];
    }
    for (int i = 0; i < t; i++)
        for (int j = 0; j < t; j++)
            at.S[i * t + j] = W[(1 + i) * row + 1 + j] - at.tn[i] * at.w[j];
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

/* v += what all contacts but i move contact i by. */
static void add_motion(int dim, Py_ssize_t i, const Matrix *Q, const double *force, double *v)
{
    if (Q->columns == NULL) {
        Py_ssize_t n = Q->k * dim, own = i * dim;
        for (int a = 0; a < dim; a++) {
            const double *row = Q->entries + (own + a) * n;
            double sum = 0.0;
            for (Py_ssize_t c = 0; c < own; c++)
                sum += row[c] * force[c];
            for (Py_ssize_t c = own + dim; c < n; c++)
                sum += row[c] * force[c];
            v[a] += sum;
        }
        return;
    }
    for (int64_t place = Q->first[i]; place < Q->first[i + 1]; place++) {
        const double *B = Q->entries + place * dim * dim, *other = force + Q->columns[place] * dim;
        if (place == Q->home[i])
            continue;
        for (int a = 0; a < dim; a++)
            for (int b = 0; b < dim; b++)
                v[a] += B[a * dim + b] * other[b];
    }
}

/* `count` sweeps; the change of the last one over the forces, infinite if these have vanished. */
static double sweep_over(int dim, int count, double share, const Matrix *Q, const double *q,
                         Local *at, double *r)
{
    double moved = 0.0, size = 0.0;
    for (int pass = 0; pass < count; pass++) {
        moved = size = 0.0;
        for (Py_ssize_t i = 0; i < Q->k; i++) {
            double v[3], old[3], *mine = r + i * dim;
            for (int a = 0; a < dim; a++)
                v[a] = q[i * dim + a], old[a] = mine[a];
            add_motion(dim, i, Q, r, v);
            solve_local(dim, at + i, v, mine);
            if (share != 1.0)
                relax(dim, at + i, share, old, mine);
            for (int a = 0; a < dim; a++) {
                moved += (mine[a] - old[a]) * (mine[a] - old[a]);
                size += mine[a] * mine[a];
            }
        }
    }
    return size == 0 && moved == 0 ? 0.0 : sqrt(moved / size);
}

static PyObject *sweep(PyObject *self, PyObject *args)
{
    int dim, count;
    double share, change = 0.0;
    Py_buffer first, columns, home, blocks, mu, bilateral, q, r;
    if (!PyArg_ParseTuple(args, "iy*y*y*y*y*y*y*w*id", &dim, &first, &columns, &home, &blocks, &mu,
                          &bilateral, &q, &r, &count, &share))
        return NULL;
    Matrix Q = {blocks.buf, first.buf, columns.len ? columns.buf : NULL, home.buf,
                mu.len / (Py_ssize_t)sizeof(double)};
    Local *at = malloc((Q.k ? Q.k : 1) * sizeof(Local));
    if (at != NULL) {
        Py_BEGIN_ALLOW_THREADS;
        for (Py_ssize_t i = 0; i < Q.k; i++) {
            Py_ssize_t own = Q.columns ? Q.home[i] * dim * dim : i * dim * (Q.k * dim + 1);
            const double *W = Q.entries + own;
            at[i] = local_of(dim, W, Q.columns ? dim : Q.k * dim, ((double *)mu.buf)[i],
                             ((uint8_t *)bilateral.buf)[i]);
        }
        change = sweep_over(dim, count, share, &Q, q.buf, at, r.buf);
        Py_END_ALLOW_THREADS;
        free(at);
    }
    PyBuffer_Release(&first), PyBuffer_Release(&columns), PyBuffer_Release(&home);
    PyBuffer_Release(&blocks), PyBuffer_Release(&mu), PyBuffer_Release(&bilateral);
    PyBuffer_Release(&q), PyBuffer_Release(&r);
    return at == NULL ? PyErr_NoMemory() : PyFloat_FromDouble(change);
}

static PyMethodDef functions[] = {
    {"sweep", sweep, METH_VARARGS,
     "Sweep `count` times over all contacts; the last sweep's change over the forces."},
    {NULL, NULL, 0, NULL}};

static struct PyModuleDef module = {PyModuleDef_HEAD_INIT, "sweeps", NULL, -1, functions};

PyMODINIT_FUNC PyInit_sweeps(void) { return PyModule_Create(&module); }
