/* The states of a tire over one time step (greens/recursion.py has the equations), and products with columns. */
#include "products.h"

// for Python
typedef struct {
    void *dgemv;
} blas;
extern blas linked;

typedef struct {
    int states, forces, outputs;          /* q, k, r + 3 */
    const double *decay, *old_, *new_;    /* (q,) complex: e^{sh}, b0, b1 */
    const double *output;                 /* (r + 3, 2 q) */
    const double *input;                  /* (k, 2 q): P, a row a force */
    const double *into_rate;              /* (3, k) */
    double last_part, before_part;        /* of f_{n-1} and f_{n-2} in the earlier force */
    double *state, *moved;                /* (q,) complex: z_n; z_{n+1} without the next force */
    double *push, *before;                /* (q,) complex: P f of the last two steps */
    double *force;                        /* (k,) the last force */
    double *out, *rate;                   /* (r + 3,), (3,) */
    int *which; double *value;            /* (k,) workspace */
} states;

void take(states *s);
void move(states *s);
void see(states *s);
void advance(states *s);
void add_loaded(int columns, int rows, const double *matrix, const double *x, int *which, double *value, double *y);
// end

typedef void (*gemv)(char *, int *, int *, double *, const double *, int *, const double *, int *, double *, double *,
                      int *);
blas linked;

/* y (rows,) += A x, A stored by columns; which and value (columns,) are workspace. */
void add_loaded(int columns, int rows, const double *matrix, const double *x, int *which, double *value, double *y) {
    int count = nonzero(columns, x, which, value);
    add_columns(rows, rows, matrix, count, which, value, y);
}

/* z_n = y_n + b1 P f_n with the force that `advance` left. */
void take(states *s) {
    const int q = s->states;
    memcpy(s->before, s->push, 2 * q * sizeof(double));
    memset(s->push, 0, 2 * q * sizeof(double));
    add_loaded(s->forces, 2 * q, s->input, s->force, s->which, s->value, s->push);
    const double *restrict b = s->new_, *restrict p = s->push, *restrict y = s->moved;
    double *restrict z = s->state;
    for (int i = 0; i < 2 * q; i += 2) {
        z[i] = y[i] + b[i] * p[i] - b[i + 1] * p[i + 1];
        z[i + 1] = y[i + 1] + b[i] * p[i + 1] + b[i + 1] * p[i];
    }
}

/* y_{n+1} = e^{sh} z_n + b0 P l, l the earlier force. */
void move(states *s) {
    const double *restrict e = s->decay, *restrict b = s->old_, *restrict p = s->push, *restrict a = s->before;
    const double *restrict z = s->state, u = s->last_part, v = s->before_part;
    double *restrict y = s->moved;
    for (int i = 0; i < 2 * s->states; i += 2) {
        const double re = u * p[i] + v * a[i], im = u * p[i + 1] + v * a[i + 1];
        y[i] = e[i] * z[i] - e[i + 1] * z[i + 1] + b[i] * re - b[i + 1] * im;
        y[i + 1] = e[i] * z[i + 1] + e[i + 1] * z[i] + b[i] * im + b[i + 1] * re;
    }
}

/* The outputs of y_{n+1}: the rows of a row-major matrix are the columns of its transpose. */
void see(states *s) {
    int n = 2 * s->states, m = s->outputs, step = 1;
    double one = 1.0, none = 0.0;
    if (n) ((gemv)linked.dgemv)("T", &n, &m, &one, s->output, &n, s->moved, &step, &none, s->out, &step);
    else memset(s->out, 0, m * sizeof(double));
    memcpy(s->rate, s->out + m - 3, 3 * sizeof(double));
}

/* The rate of momentum with the force at the end of the step. */
void advance(states *s) {
    for (int d = 0; d < 3; d++) s->rate[d] += dot(s->forces, s->into_rate + (int64_t)d * s->forces, s->force);
}
