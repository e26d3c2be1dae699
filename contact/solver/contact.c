/* The contact of one time step: unilateral contact by active sets, stick and slip of the touching points, both
   in turn. contact/solver/active_set.py and stick_slip.py have the equations and their sources. */
#include "products.h"

// for Python
typedef struct {
    void *dgemv, *dgetrf, *dgetrs;
} blas;
extern blas linked;

enum { SOLVED, SINGULAR, NO_SET, NOT_FINITE, UNSOLVED, REFUSED, AGAIN };
enum { LAGS = 40, TURNS = 40 };  /* at most: steps in a row whose normal and tangential forces lag; turns of a step */
enum { LIFT_PATIENCE = 10 };     /* turns, before a point without a bound that comes and goes is lifted by its own bristle */
/* Where a Newton step does not let the residual fall to this share, fewer points are to be found slipping: r, which is that
   of single points, then is too large for displacements of all of them. Any r > 0 has the same solution. */
typedef struct {
    double falls, caution, least_caution;
    double inner; /* residual reduction in a Newton step; which points slip is known no better */
} newton_rules;
extern newton_rules newton;

/* f >= 0, g = A (f - f_ref) + q >= 0, f . g = 0 for a matrix A (n, n), stored by rows and by columns. */
typedef struct {
    int n;
    const double *rows, *columns, *diagonal;
    double *signs, *signs_before, *gap;   /* of the last two solutions; f diag(A) - g, and g */
    uint8_t *active, *base;               /* touching; factorised */
    int again;                            /* whether the last solution is of the same step */
    double residual, penetration;
    long iterations, factorisations;
    struct factor *factor;
} active_set;

void active_set_begin(active_set *s);
void active_set_end(active_set *s);
int active_set_refactor(active_set *s);
int active_set_solve(active_set *s, const double *q, const uint8_t *guess, const double *reference, double *force);

/* The same between the points taken of many, relative to a base that usually touches (contact/solver/active_set.py). */
typedef struct {
    int points, taken, base;
    const int *places;                    /* (taken,) points, those of the base first */
    const double *columns, *unit;         /* M (taken, taken) by columns; (taken,) m/N */
    const double *begun;                  /* (taken,) the offset h where q = 0 */
    active_set *exchanged;                /* the problem in M */
    double *own, *pushed, *value;         /* workspace: (taken,) */
    int *which;
    uint8_t *differ;
} pivot;

int pivot_solve(pivot *s, const double *q, const uint8_t *guess, double *force);

/* Normal forces for the turns of a brush: `all` points at once, the `usual` ones, after which the `others` are looked at, or
   `another` solver. */
typedef int (*normal_solver)(const double *q, const uint8_t *guess, double *force);
typedef int (*look)(const double *q, double *force);  /* SOLVED, the forces exact, or AGAIN with more points */
typedef struct {
    active_set *all;
    pivot *usual;
    look others;
    normal_solver another;
} normal_contact;

/* What moves in the plane of the road, and away from it, under forces in the plane and normal to it: the tire
   between its nodes, and the tread between the points. In arrays (2, n), those of all x come before those of all y. */
typedef struct {
    int points, nodes;
    const int *w_begin, *w_column, *t_begin, *t_column;  /* W (c, p) from nodes to points, and its transpose */
    const double *w_value, *t_value;
    const double *zh, *hz, *hh;           /* by columns: (2p, p), (p, 2p), (2p, 2p); zh, hz may be 0 */
    int tread;                            /* RIGID, GRID or MATRIX */
    int coupled;                          /* whether pressure shears it */
    const double *kernel[5];              /* xx, xy, yy, zx, zy: (2 nx - 1, 2 ny - 1) of the grid and 8 numbers more, or (c, c) */
    int nx, ny, near;                     /* of the grid; cells up to which a Newton step reads the kernels */
    const double *inverse[3];             /* xx, xy, yy of the tread's and the springs' inverse, or 0, */
    int within;                           /* up to so many cells */
    const int *row, *column;              /* (c,) of each point in the grid */
    const double *lift, *beside;          /* all of it between the points, by columns: A_zt (2c, c), [A_tz A_tt]
                                             (3c, 2c); or 0 where that is too much */
    struct plane_work *work;
} plane;

enum { RIGID, GRID, MATRIX };

void plane_begin(plane *s);
void plane_end(plane *s);
void plane_shear(plane *s, const double *force, int count, const int *to, double *moved);
void plane_drag(plane *s, const double *force, const double *pressed, int count, const int *to, double *moved);
int plane_held(const plane *s, int *index);
void plane_hold(plane *s, int count, const int *index);

/* Tangential forces t: B t + c = 0 within the bounds, against the slip on them, at `count` of the points. */
typedef struct {
    plane *compliance;
    int count;
    const int *index;                     /* (count,) points */
    const double *spring;                 /* (count,) m/N in series */
    const double *inverse;                /* (count,) N/m, of B's diagonal */
    const double *constant, *bound;       /* (2, count) m; (count,) N, infinite where nothing slips */
    double *force;                        /* (2, count) N: guess, then solution */
    int near;                             /* cells up to which a Newton step reads the tread's kernels */
    double caution;                       /* share of r = `inverse` by which slipping points are told */
    double off, largest;                  /* residual, and the largest bound or force, N */
    double norm;                          /* an upper bound of the largest singular value of B, m/N */
    normal_contact *normal;               /* whose forces follow the tangential ones in a Newton step, or 0 */
    int touching;                         /* then: how many points, and which, touch */
    const int *touch;
    double friction;                      /* of the bounds that follow with them */
    long products;
} stick_slip;

int stick_slip_solve(stick_slip *s, double tolerance);
int krylov(int n, int (*apply)(void *, const double *, double *), void *of, const double *right, double tolerance,
           double *x);

/* Normal and horizontal forces of a step at once, between the points of a box of a grid (contact/solver/grid_newton.py). */
typedef struct {
    plane *compliance;                    /* the nodes and the tread; the tire's part of it is here: */
    const double *tire;                   /* (3p, 3p) in z, x, y, by columns; */
    const int *n_begin, *n_column;        /* and between nodes near each other, or 0 where that is too little of it */
    const double *n_value;
    const double *pressed;                /* kernel zz of the tread, laid out as the others */
    double friction, caution;             /* negative: nothing slips */
    const double *at_rest;                /* (c,) N */
    const double *own, *beside, *spring;  /* (c,) m/N: diagonals normal to the road and in its plane; in series there */
    int inside, near;                     /* points of the box; cells up to which a Newton step reads the tread's kernels */
    const int *index;
    const double *open, *free, *past, *height; /* of the step: (c,) m gaps over height 0; (2, c) m of nodes, and of bristles; (c,) m */
    const uint8_t *bears;                 /* (c,) whether bristles do */
    double *force, *slope;                /* (3, c) N; (c, 2) of the road under them */
    double *moved, *base, *place;         /* (3, c), (2, c), (2, c) m: by the tire; of the bristles' two ends */
    double *gap, *slip, *trial;           /* (c,) m, (2, c) m, (2, c) N in the box */
    uint8_t *touches;                     /* (c,) in the box */
    double residual, off, most;           /* of gaps, of the largest; N in the plane; the most that a point may bear there, N */
    int reads;                            /* whether the road is read where the points move to */
    int most_secants, *secants;           /* how many at most, and (1,) how many there are */
    double *moves, *changes;              /* (most, 3, c) N, the last one last */
    struct at_once_work *work;
} at_once;

void at_once_begin(at_once *s);
void at_once_end(at_once *s);
void at_once_box(at_once *s);
void at_once_step(at_once *s);
void at_once_push(at_once *s);
void at_once_meet(at_once *s, const double *tread);
int at_once_strays(const at_once *s, const double *place, double tolerance);
void at_once_balance(at_once *s);
void at_once_newton(at_once *s, int normal, int plane, int whole, double tolerance);
void at_once_bound(at_once *s);

/* A brush on the tire: normal and tangential forces of a step. */
typedef struct {
    plane *compliance;
    int spring_kind;                      /* springs fixed at the points */
    double friction;                      /* negative: nothing slips */
    double tolerance;
    const double *stiffness, *slip;       /* (c,) N/m; (2, c) m a step */
    const double *own;                    /* (c,) m/N: the compliance's diagonal, mean of both directions */
    const int *ahead;                     /* (c,) the next point ahead */
    int lines, shift, every;              /* bristles move on by `shift` of their places every so many steps */
    const int *line;                      /* (lines + 1,) first bristle of each, from the front */
    const int *cell, *beside;             /* (b,) points in whose cell a bristle's place is, and nearest but one on its line */
    const double *along, *entry;          /* (b,) its place before that point, in pitches; way from the cell's front, in steps */
    const int *first; const double *weight;  /* (c + 1,), and of the bristles in each cell, side by side from */
    const int *foremost;                  /* (c,) the foremost of them */
    const double *dragged;                /* (2, c) m: displacements in the plane under the static normal forces */
    double norm;
    double *tip;                          /* (2, b) m: where the base of each bristle lies undeflected */
    int *stands;                          /* (b,) whether it stands on the road: FRESH, STANDS, STOOD */
    int *waited;                          /* steps since bristles moved on */
    double *deflection, *moved;           /* (2, c) m in the mean of each cell and of its base, at the end of the last step */
    uint8_t *touched, *slid;              /* (c,) then */
    double *horizontal, *before;          /* (2, c) N of the last two steps */
    long turns, products, all_turns;      /* of the last step; of all steps */
    long lagged, streak;                  /* steps whose forces lag, and how many were the last ones */
    int again;                            /* whether the next solution is of the step of the last one */
    int rough;                            /* whether one turn is enough for it */
    struct brush_work *work;
} brush;

enum { FRESH, STANDS, STOOD };

void brush_begin(brush *s);
void brush_end(brush *s);
void brush_travel(brush *s);
void brush_offer(const brush *s, uint8_t *bears, double *past);
void brush_conclude(brush *s, const double *force, const double *tangential);
double brush_limit(const brush *s, double first, double most);
int brush_solve(brush *s, normal_contact *normal, const double *q, const uint8_t *guess, const double *at_rest,
                const double *free, double *force);

/* Tire at its nodes and contact at the points: what a step needs before and after its solution. */
typedef struct {
    int points, nodes, components;        /* 1, z, or 3, z, x and y, of displacements and forces */
    const int *w_begin, *w_column, *t_begin, *t_column;
    const double *w_value, *t_value;
    const double *answer;                 /* (k, k): same-step displacement of all nodes, by columns */
    const double *gap0, *at_rest, *rest;  /* (c,) m, N; (2, c) N of a static state with friction, or 0 */
    double *normal_force, *tangential;    /* (c,), (2, c) N of the last solution */
    double *q, *free;                     /* (c,) m, (2, c) m: gaps at rest forces; displacements in the plane */
    double *shift;                        /* (2, c) m in the plane by the forces of the last solution */
    double *vertical, *horizontal;        /* (c,), (2, c) N on the tire */
    double *change, *nodal;               /* (components c,) and (components p,) N from the static state */
    double *resultant;                    /* (3,) N */
    double *lifted, *added;               /* workspace: (k,), (3 c,) */
    int *which; double *value;            /* workspace: (k,) */
} meeting;

void meeting_prepare(meeting *s, const double *moved, const double *road, const double *slope, const double *tread);
void meeting_conclude(meeting *s, const double *force, const double *tangential, const double *slope);
void meeting_place(const meeting *s, const double *moved, double *place);
void meeting_shift(meeting *s, const double *moved, const brush *tips);
// end

typedef void (*gemv)(char *, int *, int *, double *, const double *, int *, const double *, int *, double *, double *,
                     int *);
typedef void (*getrf)(int *, int *, double *, int *, int *, int *);
typedef void (*getrs)(char *, int *, int *, const double *, int *, const int *, double *, int *, int *);
blas linked;

static void *room(size_t count, size_t size) {
    void *found = calloc(count ? count : 1, size);
    if (!found) abort();
    return found;
}
#define DOUBLES(n) ((double *)room((n), sizeof(double)))
#define INTS(n) ((int *)room((n), sizeof(int)))

/* ---- Unilateral contact -------------------------------------------------------------------------------------- */

/* A_NN x = r for a touching set N that differs by k points from the factorised set B: bordered by them. */
struct factor {
    int members, changes, entered, count;
    int *member, *enter, *leave, *pivots, *turns, *index, *place;
    double *lu, *columns, *rows, *schur, *rest, *inner, *change, *value, *right, *force, *gap;
    int *which;
    uint8_t *set, *trial;
    int known;                            /* whether `set` has been prepared */
};

enum { SHARE = 16, FEWEST_CHANGES = 4, PATIENCE = 10 };
static const double ROUNDING = 1e-12;

void active_set_begin(active_set *s) {
    const int n = s->n;
    struct factor *f = s->factor = room(1, sizeof *f);
    int **ints[] = {&f->member, &f->enter, &f->leave, &f->pivots, &f->turns, &f->index, &f->place, &f->which};
    for (int i = 0; i < 8; i++) *ints[i] = INTS(n);
    double **doubles[] = {&f->rest, &f->inner, &f->change, &f->value, &f->right, &f->force, &f->gap};
    for (int i = 0; i < 7; i++) *doubles[i] = DOUBLES(n);
    const int k = n / SHARE + FEWEST_CHANGES;
    f->lu = DOUBLES((size_t)n * n);
    f->columns = DOUBLES((size_t)n * k), f->rows = DOUBLES((size_t)n * k), f->schur = DOUBLES((size_t)k * k);
    f->set = room(n, 1), f->trial = room(n, 1);
}

void active_set_end(active_set *s) {
    struct factor *f = s->factor;
    void *all[] = {f->member, f->enter, f->leave, f->pivots, f->turns, f->index, f->place, f->which,
                   f->rest, f->inner, f->change, f->value, f->right, f->force, f->gap, f->lu, f->columns, f->rows,
                   f->schur, f->set, f->trial, f};
    for (size_t i = 0; i < sizeof all / sizeof *all; i++) free(all[i]);
}

/* Factorise A between the points of `base`. */
static int factorise(active_set *s) {
    struct factor *f = s->factor;
    const int n = s->n;
    f->members = f->changes = f->known = 0;
    for (int i = 0; i < n; i++)
        if (s->base[i]) f->place[i] = f->members, f->member[f->members++] = i;
    const int b = f->members;
    s->factorisations++;
    for (int j = 0; j < b; j++) {
        const double *column = s->columns + (size_t)f->member[j] * n;
        for (int i = 0; i < b; i++) f->lu[(size_t)j * b + i] = column[f->member[i]];
    }
    int size = b, info = 0;
    if (b) ((getrf)linked.dgetrf)(&size, &size, f->lu, &size, f->pivots, &info);
    if (info) f->members = 0;
    return info ? SINGULAR : SOLVED;
}

/* The Schur complement of the points that entered and left the factorised set. */
static int border(active_set *s, const uint8_t *active) {
    struct factor *f = s->factor;
    const int n = s->n;
    int b = f->members, left = 0, info = 0;
    f->entered = 0;
    for (int i = 0; i < n; i++)
        if (active[i] != s->base[i]) {
            if (active[i]) f->enter[f->entered++] = i;
            else f->leave[left++] = i;
        }
    int k = f->changes = f->entered + left;
    if (!k) return SOLVED;
    memset(f->columns, 0, sizeof(double) * b * k), memset(f->rows, 0, sizeof(double) * b * k);
    for (int j = 0; j < f->entered; j++) {
        const double *column = s->columns + (size_t)f->enter[j] * n, *row = s->rows + (size_t)f->enter[j] * n;
        for (int i = 0; i < b; i++) f->columns[(size_t)j * b + i] = column[f->member[i]];
        for (int i = 0; i < b; i++) f->rows[(size_t)j * b + i] = row[f->member[i]];
    }
    for (int j = 0; j < left; j++) f->columns[(size_t)(f->entered + j) * b + f->place[f->leave[j]]] = 1.0;
    ((getrs)linked.dgetrs)("N", &b, &k, f->lu, &b, f->pivots, f->columns, &b, &info);
    for (int j = 0; j < k; j++) {
        const double *column = f->columns + (size_t)j * b;
        for (int i = 0; i < k; i++) {
            const int own = i < f->entered;
            double sum = own ? dot(b, f->rows + (size_t)i * b, column) : column[f->place[f->leave[i - f->entered]]];
            if (own && j < f->entered) sum -= s->columns[(size_t)f->enter[j] * n + f->enter[i]];
            f->schur[(size_t)j * k + i] = -sum;
        }
    }
    ((getrf)linked.dgetrf)(&k, &k, f->schur, &k, f->turns, &info);
    if (info) f->members = 0;
    return info ? SINGULAR : SOLVED;
}

/* Prepare for a touching set. */
static int prepare(active_set *s, const uint8_t *active) {
    struct factor *f = s->factor;
    const int n = s->n;
    if (f->known && !memcmp(f->set, active, n)) return SOLVED;
    f->known = f->count = 0;
    int changes = 0, failed;
    for (int i = 0; i < n; i++) {
        if (active[i]) f->index[f->count++] = i;
        changes += active[i] != s->base[i];
    }
    if (changes > f->members / SHARE + FEWEST_CHANGES || !f->members) {
        memcpy(s->base, active, n);
        failed = factorise(s);
    } else
        failed = border(s, active);
    if (failed) return failed;
    memcpy(f->set, active, n);
    f->known = 1;
    return SOLVED;
}

int active_set_refactor(active_set *s) {
    int failed = factorise(s);
    if (failed) return failed;
    struct factor *f = s->factor;
    memcpy(f->set, s->base, s->n);
    memcpy(f->index, f->member, f->members * sizeof(int));
    f->count = f->members, f->known = 1;
    return SOLVED;
}

/* x (n,) on the touching points: the right side becomes the solution. */
static void solve_factor(struct factor *f, double *x) {
    int one = 1, info, b = f->members, k = f->changes;
    if (!k) {
        for (int i = 0; i < b; i++) f->inner[i] = x[f->member[i]];
        if (b) ((getrs)linked.dgetrs)("N", &b, &one, f->lu, &b, f->pivots, f->inner, &b, &info);
        for (int i = 0; i < b; i++) x[f->member[i]] = f->inner[i];
        return;
    }
    for (int i = 0; i < b; i++) f->inner[i] = f->set[f->member[i]] ? x[f->member[i]] : 0.0;
    ((getrs)linked.dgetrs)("N", &b, &one, f->lu, &b, f->pivots, f->inner, &b, &info);
    for (int i = 0; i < k; i++)
        f->rest[i] = i < f->entered ? x[f->enter[i]] - dot(b, f->rows + (size_t)i * b, f->inner)
                                    : -f->inner[f->place[f->leave[i - f->entered]]];
    ((getrs)linked.dgetrs)("N", &k, &one, f->schur, &k, f->turns, f->rest, &k, &info);
    for (int j = 0; j < k; j++) {
        const double *restrict column = f->columns + (size_t)j * b, share = f->rest[j];
        double *restrict inner = f->inner;
        for (int i = 0; i < b; i++) inner[i] -= share * column[i];
    }
    for (int i = 0; i < b; i++)
        if (f->set[f->member[i]]) x[f->member[i]] = f->inner[i];
    for (int j = 0; j < f->entered; j++) x[f->enter[j]] = f->rest[j];
}

/* Forces and gaps where exactly the active points touch: g = 0 there, f = 0 elsewhere. */
static void touch(active_set *s, const uint8_t *active, const double *q, const double *reference, double *force,
                  double *gap) {
    struct factor *f = s->factor;
    const int n = s->n;
    int lifted = 0;
    memset(f->change, 0, n * sizeof(double));
    if (reference)
        for (int i = 0; i < n; i++)
            if (!active[i] && reference[i] != 0.0) {
                f->which[lifted] = i, f->value[lifted++] = reference[i];
                f->change[i] = -reference[i];
            }
    if (lifted) {
        memset(f->right, 0, n * sizeof(double));
        add_columns(n, n, s->columns, lifted, f->which, f->value, f->right);
    }
    for (int t = 0; t < f->count; t++) {
        const int i = f->index[t];
        f->change[i] = -q[i] + (lifted ? f->right[i] : 0.0);
    }
    solve_factor(f, f->change);
    memcpy(gap, q, n * sizeof(double));
    add_columns(n, n, s->columns, nonzero(n, f->change, f->which, f->value), f->which, f->value, gap);
    for (int i = 0; i < n; i++) force[i] = active[i] ? (reference ? reference[i] : 0.0) + f->change[i] : 0.0;
}

int active_set_solve(active_set *s, const double *q, const uint8_t *guess, const double *reference, double *force) {
    struct factor *f = s->factor;
    const int n = s->n;
    const double *d = s->diagonal;
    double *gap = f->gap, most = 0.0, widest = largest(n, d);
    uint8_t *active = f->trial;
    for (int i = 0; i < n; i++) {
        if (!isfinite(q[i])) return NOT_FINITE;
        most = fmax(most, fabs(q[i]));
        /* Without points about to lift off and with those about to touch: right in four steps of five. */
        const double ahead = 2.0 * s->signs[i] - s->signs_before[i];
        active[i] = guess ? guess[i] : ahead > 0.0 || (ahead == 0.0 && s->active[i]);
    }
    int best = n + 1, patience = PATIENCE, failed;
    for (s->iterations = 1; s->iterations < 20L * n + 100; s->iterations++) {
        if ((failed = prepare(s, active))) return failed;
        touch(s, active, q, reference, force, gap);
        const double scale = most + widest * largest(n, force), least = -ROUNDING * scale;
        int wrong = 0, last = 0;
        for (int i = 0; i < n; i++)
            if ((active[i] ? force[i] * d[i] : gap[i]) < least) wrong++, last = i;
        if (!wrong) {
            double worst = 0.0, deepest = 0.0;
            for (int i = 0; i < n; i++) {
                force[i] = fmax(force[i], 0.0);
                worst = fmax(worst, fabs(fmin(force[i] * d[i], gap[i])));
                deepest = fmin(deepest, gap[i]);
                if (active[i]) gap[i] = 0.0;
                if (!s->again) s->signs_before[i] = s->signs[i];
                s->signs[i] = force[i] * d[i] - gap[i];
            }
            s->residual = scale > 0.0 ? worst / scale : worst;
            s->penetration = -deepest;
            memcpy(s->active, active, n), memcpy(s->gap, gap, n * sizeof(double));
            return isfinite(s->residual) ? SOLVED : NOT_FINITE;
        }
        if (wrong < best) best = wrong, patience = PATIENCE;
        else patience--;
        if (patience < 0) active[last] ^= 1; /* Murty's rule: finite for every P-matrix */
        else
            for (int i = 0; i < n; i++)
                if ((active[i] ? force[i] * d[i] : gap[i]) < least) active[i] ^= 1;
    }
    return NO_SET;
}

static void product(int rows, int columns, double factor, const double *a, int leading, const double *x, double keep,
                    double *y) {
    int one = 1;
    if (rows && columns)
        ((gemv)linked.dgemv)("N", &rows, &columns, &factor, a, &leading, x, &one, &keep, y, &one);
}

int pivot_solve(pivot *s, const double *q, const uint8_t *guess, double *force) {
    const int b = s->base, c = s->taken;
    for (int i = 0; i < c; i++) {
        s->own[i] = q[s->places[i]];
        s->differ[i] = guess[s->places[i]] ^ (i < b);
    }
    memset(s->pushed, 0, c * sizeof(double));
    product(c, b, -1.0, s->columns, c, s->own, 1.0, s->pushed);
    for (int i = 0; i < c; i++) s->own[i] = s->begun[i] + ((i < b ? 0.0 : s->own[i]) + s->pushed[i]);
    s->exchanged->again = 1; /* its guess is given */
    const int failed = active_set_solve(s->exchanged, s->own, s->differ, 0, s->value);
    if (failed) return failed;
    memset(force, 0, s->points * sizeof(double));
    for (int i = 0; i < c; i++) force[s->places[i]] = fmax(i < b ? s->exchanged->gap[i] : s->value[i], 0.0) / s->unit[i];
    return SOLVED;
}

/* force (c,) N at the points that touch, 0 elsewhere, that holds them on the road when they are lifted by (c,) m, 0 elsewhere. */
static void follow(const normal_contact *s, const double *lifted, double *force) {
    if (s->all) {
        const struct factor *f = s->all->factor;
        memset(force, 0, s->all->n * sizeof(double));
        for (int k = 0; k < f->count; k++) force[f->index[k]] = -lifted[f->index[k]];
        solve_factor(s->all->factor, force);
        return;
    }
    pivot *u = s->usual;
    struct factor *f = u->exchanged->factor;
    const int b = u->base, c = u->taken;
    for (int i = 0; i < b; i++) u->own[i] = -lifted[u->places[i]];
    memset(u->pushed, 0, b * sizeof(double));
    const int lifts = nonzero(b, u->own, u->which, u->value);
    add_columns(b, c, u->columns, lifts, u->which, u->value, u->pushed);
    for (int k = 0; k < f->count; k++) {
        const int i = f->index[k];
        if (i >= b) u->pushed[i] = lifted[u->places[i]] + dot(b, u->exchanged->rows + (size_t)i * c, u->own);
    }
    for (int k = 0; k < f->count; k++) u->value[f->index[k]] = -u->pushed[f->index[k]];
    solve_factor(f, u->value);
    memset(force, 0, u->points * sizeof(double));
    for (int k = 0; k < f->count; k++) {
        const int i = f->index[k];
        if (i >= b) force[u->places[i]] = u->value[i] / u->unit[i];
        u->which[k] = i, u->own[k] = u->value[i];
    }
    add_columns(b, c, u->columns, f->count, u->which, u->own, u->pushed);
    for (int i = 0; i < b; i++)
        if (!f->set[i]) force[u->places[i]] = u->pushed[i] / u->unit[i];
}

/* ---- Displacements in the plane and away from it --------------------------------------------------------------- */

struct plane_work {
    double *nodal, *nodes, *value, *field, *given, *compact, *down;
    int *which, *first, *last, *some, *carried;
    uint8_t *bears, *kept;
    int carriers;                         /* m nodes between which `compact` (3m, 2m) has [hh; zh], `down` (2m, m) hz */
    double *lifted, *follows;             /* (c,) m and N of a Newton step in which the normal forces follow */
    /* Of a dense compliance: the part between the points in `slots`, by columns; components x, y side by side. */
    int slots, *slot, *point;
    double *tt, *zt, *tz, *t, *z, *u;     /* (2s, 2s), (2s, s), (s, 2s) of leading dimensions 2c, c, 2c; vectors */
};

void plane_begin(plane *s) {
    const int p = s->nodes, c = s->points, most = p > c ? p : c;
    struct plane_work *w = s->work = room(1, sizeof *w);
    w->nodal = DOUBLES(2 * p), w->nodes = DOUBLES(3 * p), w->value = DOUBLES(3 * most), w->given = DOUBLES(2 * c);
    w->field = DOUBLES(2 * (size_t)s->nx * (s->ny + 8)), w->lifted = DOUBLES(c), w->follows = DOUBLES(c);
    if (s->hh && !s->lift) w->compact = DOUBLES(6 * (size_t)p * p), w->down = DOUBLES(2 * (size_t)p * p);
    w->which = INTS(3 * most), w->first = INTS(s->nx), w->last = INTS(s->nx), w->some = INTS(c);
    w->carried = INTS(p), w->bears = room(p, 1), w->kept = room(p, 1);
    if (s->lift) {
        w->slot = INTS(c), w->point = INTS(c);
        w->tt = DOUBLES(4 * (size_t)c * c), w->zt = DOUBLES(2 * (size_t)c * c), w->tz = DOUBLES(2 * (size_t)c * c);
        w->t = DOUBLES(2 * c), w->z = DOUBLES(c), w->u = DOUBLES(2 * c);
        for (int i = 0; i < c; i++) w->slot[i] = -1;
    }
}

void plane_end(plane *s) {
    struct plane_work *w = s->work;
    void *all[] = {w->nodal, w->nodes, w->value, w->given, w->field, w->compact, w->down, w->lifted, w->follows, w->which, w->first, w->last, w->some,
                   w->carried, w->bears, w->kept, w->slot, w->point, w->tt, w->zt, w->tz, w->t, w->z, w->u, w};
    for (size_t i = 0; i < sizeof all / sizeof *all; i++) free(all[i]);
}

static void enter(plane *s, int point) {
    struct plane_work *w = s->work;
    const int c = s->points, k = w->slots++, j = point;
    w->slot[point] = k, w->point[k] = point;
    for (int m = 0; m <= k; m++) {
        const int i = w->point[m];
        for (int e = 0; e < 2; e++) {
            const double *own = s->beside + (size_t)(c + e * c + j) * 2 * c, *other = s->beside + (size_t)(c + e * c + i) * 2 * c;
            for (int d = 0; d < 2; d++) {
                w->tt[(size_t)(2 * k + e) * 2 * c + 2 * m + d] = own[d * c + i];
                w->tt[(size_t)(2 * m + e) * 2 * c + 2 * k + d] = other[d * c + j];
            }
            w->zt[(size_t)(2 * k + e) * c + m] = s->lift[(size_t)(e * c + j) * c + i];
            w->zt[(size_t)(2 * m + e) * c + k] = s->lift[(size_t)(e * c + i) * c + j];
            w->tz[(size_t)k * 2 * c + 2 * m + e] = s->beside[(size_t)j * 2 * c + e * c + i];
            w->tz[(size_t)m * 2 * c + 2 * k + e] = s->beside[(size_t)i * 2 * c + e * c + j];
        }
    }
}

/* Hold the compliance between these points, with at most half as many others that touched before. */
static void hold(plane *s, int count, const int *index) {
    struct plane_work *w = s->work;
    int more = 0;
    for (int a = 0; a < count; a++) more += w->slot[index[a]] < 0;
    if (w->slots + more > count + count / 2 + 8) {
        for (int k = 0; k < w->slots; k++) w->slot[w->point[k]] = -1;
        w->slots = 0;
    }
    for (int a = 0; a < count; a++)
        if (w->slot[index[a]] < 0) enter(s, index[a]);
}

/* The points held (c,), in the order of their slots; returns how many. */
int plane_held(const plane *s, int *index) {
    if (!s->lift) return 0;
    memcpy(index, s->work->point, s->work->slots * sizeof(int));
    return s->work->slots;
}

/* Hold these points and no others. */
void plane_hold(plane *s, int count, const int *index) {
    struct plane_work *w = s->work;
    if (!s->lift) return;
    for (int k = 0; k < w->slots; k++) w->slot[w->point[k]] = -1;
    w->slots = 0;
    hold(s, count, index);
}

/* Forces (2, count) of some points side by side in the slots; and displacements back from `u`. */
static void to_slots(plane *s, int count, const int *index, const double *force) {
    struct plane_work *w = s->work;
    memset(w->t, 0, 2 * w->slots * sizeof(double));
    for (int a = 0; a < count; a++) {
        const int k = w->slot[index[a]];
        w->t[2 * k] = force[a], w->t[2 * k + 1] = force[count + a];
    }
}

static void from_slots(plane *s, int count, const int *index, double *moved) {
    struct plane_work *w = s->work;
    for (int a = 0; a < count; a++) {
        const int k = w->slot[index[a]];
        moved[a] = w->u[2 * k], moved[count + a] = w->u[2 * k + 1];
    }
}

static void to_nodes(const plane *s, const double *points, double *nodes) {
    sparse down = {s->nodes, s->t_begin, s->t_column, s->t_value};
    multiply(&down, points, nodes);
}

/* The columns j0 to j1 of the outputs on each row of the grid, from the points at which they are read. */
static void bounds(const plane *s, int count, const int *index) {
    struct plane_work *w = s->work;
    for (int i = 0; i < s->nx; i++) w->first[i] = s->ny, w->last[i] = -1;
    for (int a = 0; a < count; a++) {
        const int i = s->row[index[a]], j = s->column[index[a]];
        if (j < w->first[i]) w->first[i] = j;
        if (j > w->last[i]) w->last[i] = j;
    }
}

/* Fields on the grid have rows a vector longer, and kernels end with one more: columns are taken by eights. */
enum { VECTOR = 8 };
static int pitch(const plane *s) { return s->ny + VECTOR; }
static size_t cells(const plane *s) { return (size_t)s->nx * pitch(s); }
static size_t cell(const plane *s, int point) { return (size_t)s->row[point] * pitch(s) + s->column[point]; }

/* On the grid, between `bounds` and at least `reach` cells from each force: ux, uy += kernels times forces; what else is
   in the fields is not to be read. With three kernels both components of both, with two and fy one of both, else both
   of one; with one kernel, given twice, one of one. Forces of one row of the grid are taken by fours, so that displacements are read and written once for them. */
static void spread(const plane *s, int reach, int count, const int *index, const double *fx, const double *fy,
                   const double *const *kernel, int kernels, double *ux, double *uy) {
    enum { TOGETHER = 4 };
    const struct plane_work *w = s->work;
    const int wide = 2 * s->ny - 1;
    for (int a = 0, some; a < count; a += some) {
        const int row = s->row[index[a]];
        int begin = s->column[index[a]], end = begin;
        for (some = 1; some < TOGETHER && a + some < count && s->row[index[a + some]] == row; some++) {
            const int column = s->column[index[a + some]];
            begin = column < begin ? column : begin, end = column > end ? column : end;
        }
        double p[TOGETHER] = {0.0}, q[TOGETHER] = {0.0};
        for (int k = 0; k < some; k++) p[k] = fx[a + k], q[k] = fy ? fy[a + k] : 0.0;
        const int top = row - reach > 0 ? row - reach : 0, bottom = row + reach < s->nx - 1 ? row + reach : s->nx - 1;
        for (int i = top; i <= bottom; i++) {
            const int low = w->first[i] > begin - reach ? w->first[i] : begin - reach;
            const int n = (w->last[i] < end + reach ? w->last[i] : end + reach) - low + 1;
            if (n <= 0) continue;
            const int most = (n + VECTOR - 1) / VECTOR * VECTOR;
            double *restrict x = ux + (size_t)i * pitch(s) + low, *restrict y = uy ? uy + (size_t)i * pitch(s) + low : 0;
            size_t at[TOGETHER];
            for (int k = 0; k < TOGETHER; k++) /* those beyond `some` read the first one's kernel, times nothing */
                at[k] = (size_t)(i - row + s->nx - 1) * wide + (s->ny - 1 - s->column[index[a + (k < some ? k : 0)]] + low);
            const double *restrict a0 = kernel[0] + at[0], *restrict a1 = kernel[0] + at[1], *restrict a2 = kernel[0] + at[2];
            const double *restrict a3 = kernel[0] + at[3], *restrict b0 = kernel[1] + at[0], *restrict b1 = kernel[1] + at[1];
            const double *restrict b2 = kernel[1] + at[2], *restrict b3 = kernel[1] + at[3];
            if (kernels == 3) {
                const double *restrict c0 = kernel[2] + at[0], *restrict c1 = kernel[2] + at[1];
                const double *restrict c2 = kernel[2] + at[2], *restrict c3 = kernel[2] + at[3];
#pragma GCC ivdep
                for (int j = 0; j < most; j++) {
                    x[j] += a0[j] * p[0] + a1[j] * p[1] + a2[j] * p[2] + a3[j] * p[3] + b0[j] * q[0] + b1[j] * q[1] +
                            b2[j] * q[2] + b3[j] * q[3];
                    y[j] += b0[j] * p[0] + b1[j] * p[1] + b2[j] * p[2] + b3[j] * p[3] + c0[j] * q[0] + c1[j] * q[1] +
                            c2[j] * q[2] + c3[j] * q[3];
                }
            } else if (fy)
#pragma GCC ivdep
                for (int j = 0; j < most; j++)
                    x[j] += a0[j] * p[0] + a1[j] * p[1] + a2[j] * p[2] + a3[j] * p[3] + b0[j] * q[0] + b1[j] * q[1] +
                            b2[j] * q[2] + b3[j] * q[3];
            else if (!uy)
#pragma GCC ivdep
                for (int j = 0; j < most; j++) x[j] += a0[j] * p[0] + a1[j] * p[1] + a2[j] * p[2] + a3[j] * p[3];
            else
#pragma GCC ivdep
                for (int j = 0; j < most; j++) {
                    x[j] += a0[j] * p[0] + a1[j] * p[1] + a2[j] * p[2] + a3[j] * p[3];
                    y[j] += b0[j] * p[0] + b1[j] * p[1] + b2[j] * p[2] + b3[j] * p[3];
                }
        }
    }
}

static int everywhere(const plane *s) { return s->nx > s->ny ? s->nx : s->ny; }

/* Displacements of the tread at the points `to` (n,), within `reach` cells of forces at the points `index` (count,): in the
   plane under forces in it, moved (2, n) +=; away from the road under them, moved (n,) +=; in the plane under normal
   forces, moved (2, n) -=, the transpose of the second. */
static void shear_tread(plane *s, int reach, int count, const int *index, const double *force, int n, const int *to,
                        double *moved) {
    struct plane_work *w = s->work;
    const double *x = force, *y = force + count;
    if (s->tread == GRID) {
        bounds(s, n, to);
        memset(w->field, 0, 2 * cells(s) * sizeof(double));
        spread(s, reach, count, index, x, y, s->kernel, 3, w->field, w->field + cells(s));
        for (int a = 0; a < n; a++) {
            const size_t at = cell(s, to[a]);
            moved[a] += w->field[at], moved[n + a] += w->field[cells(s) + at];
        }
    } else if (s->tread == MATRIX)
        for (int a = 0; a < n; a++) {
            const size_t at = (size_t)to[a] * s->points;
            const double *xx = s->kernel[0] + at, *xy = s->kernel[1] + at, *yy = s->kernel[2] + at;
            double across = 0.0, along = 0.0;
            for (int b = 0; b < count; b++) {
                const int j = index[b];
                along += xx[j] * x[b] + xy[j] * y[b], across += xy[j] * x[b] + yy[j] * y[b];
            }
            moved[a] += along, moved[n + a] += across;
        }
}

static void lift_tread(plane *s, int reach, int count, const int *index, const double *force, int n, const int *to,
                       double *moved) {
    struct plane_work *w = s->work;
    if (s->tread == RIGID || !s->coupled) return;
    if (s->tread == GRID) {
        bounds(s, n, to);
        memset(w->field, 0, cells(s) * sizeof(double));
        spread(s, reach, count, index, force, force + count, s->kernel + 3, 2, w->field, 0);
        for (int a = 0; a < n; a++) moved[a] += w->field[cell(s, to[a])];
    } else
        for (int a = 0; a < n; a++) {
            const double *zx = s->kernel[3] + (size_t)to[a] * s->points, *zy = s->kernel[4] + (size_t)to[a] * s->points;
            for (int b = 0; b < count; b++) moved[a] += zx[index[b]] * force[b] + zy[index[b]] * force[count + b];
        }
}

static void drag_tread(plane *s, int reach, int count, const int *index, const double *force, int n, const int *to,
                       double *moved) {
    struct plane_work *w = s->work;
    if (s->tread == RIGID || !s->coupled) return;
    if (s->tread == GRID) {
        bounds(s, n, to);
        memset(w->field, 0, 2 * cells(s) * sizeof(double));
        spread(s, reach, count, index, force, 0, s->kernel + 3, 2, w->field, w->field + cells(s));
        for (int a = 0; a < n; a++) {
            const size_t at = cell(s, to[a]);
            moved[a] -= w->field[at], moved[n + a] -= w->field[cells(s) + at];
        }
    } else
        for (int a = 0; a < n; a++) {
            const double *zx = s->kernel[3] + (size_t)to[a] * s->points, *zy = s->kernel[4] + (size_t)to[a] * s->points;
            for (int b = 0; b < count; b++) moved[a] -= zx[index[b]] * force[b], moved[n + a] -= zy[index[b]] * force[b];
        }
}

/* [hh; zh] and hz between the nodes that carry some points, kept while they have all of them and not twice as many. */
static void carry(plane *s, int count, const int *index) {
    struct plane_work *w = s->work;
    const int p = s->nodes;
    int needed = 0, lacking = 0;
    memset(w->bears, 0, p);
    for (int a = 0; a < count; a++)
        for (int k = s->w_begin[index[a]]; k < s->w_begin[index[a] + 1]; k++) w->bears[s->w_column[k]] = 1;
    for (int k = 0; k < p; k++) needed += w->bears[k], lacking += w->bears[k] && !w->kept[k];
    if (!lacking && w->carriers <= 2 * needed) return;
    memcpy(w->kept, w->bears, p);
    int m = 0;
    for (int k = 0; k < p; k++)
        if (w->kept[k]) w->carried[m++] = k;
    w->carriers = m;
    for (int j = 0; j < 2 * m; j++) {
        const size_t at = w->carried[j % m] + (j / m) * p;
        const double *from = s->hh + at * 2 * p, *up = s->zh ? s->zh + at * p : 0;
        double *to = w->compact + (size_t)j * 3 * m;
        for (int i = 0; i < m; i++) {
            const int k = w->carried[i];
            to[i] = from[k], to[m + i] = from[p + k], to[2 * m + i] = up ? up[k] : 0.0;
        }
    }
    for (int j = 0; j < m && s->hz; j++) {
        const double *from = s->hz + (size_t)w->carried[j] * 2 * p;
        double *to = w->down + (size_t)j * 2 * m;
        for (int i = 0; i < m; i++) to[i] = from[w->carried[i]], to[m + i] = from[p + w->carried[i]];
    }
}

/* From forces (count,) of some points to the nodes that carry them (m,); and from these to the displacements of points. */
static void to_carriers(plane *s, int count, const int *index, const double *force, double *nodes) {
    struct plane_work *w = s->work;
    double *full = w->value;
    memset(full, 0, s->nodes * sizeof(double));
    for (int a = 0; a < count; a++)
        for (int k = s->w_begin[index[a]]; k < s->w_begin[index[a] + 1]; k++) full[s->w_column[k]] += s->w_value[k] * force[a];
    for (int i = 0; i < w->carriers; i++) nodes[i] = full[w->carried[i]];
}

static void from_carriers(plane *s, const double *nodes, int count, const int *index, double *moved) {
    struct plane_work *w = s->work;
    double *full = w->value;
    for (int i = 0; i < w->carriers; i++) full[w->carried[i]] = nodes[i];
    for (int a = 0; a < count; a++) {
        double sum = 0.0;
        for (int k = s->w_begin[index[a]]; k < s->w_begin[index[a] + 1]; k++) sum += s->w_value[k] * full[s->w_column[k]];
        moved[a] = sum;
    }
}

/* moved (2, count) = the displacements in the plane between some points, those of the tread within `reach` cells; after
   `carry` of these. */
static void shear_some(plane *s, int reach, int count, const int *index, const double *force, double *moved) {
    struct plane_work *w = s->work;
    const int m = w->carriers, c = s->points;
    if (s->lift) {
        to_slots(s, count, index, force);
        product(2 * w->slots, 2 * w->slots, 1.0, w->tt, 2 * c, w->t, 0.0, w->u);
        from_slots(s, count, index, moved);
        return;
    }
    for (int d = 0; d < 2; d++) to_carriers(s, count, index, force + d * count, w->nodal + d * m);
    memset(w->nodes, 0, 2 * m * sizeof(double));
    add_columns(2 * m, 3 * m, w->compact, nonzero(2 * m, w->nodal, w->which, w->value), w->which, w->value, w->nodes);
    for (int d = 0; d < 2; d++) from_carriers(s, w->nodes + d * m, count, index, moved + d * count);
    shear_tread(s, reach, count, index, force, count, index, moved);
}

/* The points with a force, and their forces side by side in `given`. */
static int loaded(plane *s, const double *force, int components) {
    struct plane_work *w = s->work;
    const int c = s->points;
    int count = 0;
    for (int i = 0; i < c; i++)
        if (force[i] != 0.0 || (components == 2 && force[c + i] != 0.0)) w->some[count++] = i;
    for (int d = 0; d < components; d++)
        for (int a = 0; a < count; a++) w->given[d * count + a] = force[d * c + w->some[a]];
    return count;
}

static double from_nodes(const plane *s, const double *nodes, int point) {
    double sum = 0.0;
    for (int k = s->w_begin[point]; k < s->w_begin[point + 1]; k++) sum += s->w_value[k] * nodes[s->w_column[k]];
    return sum;
}

/* moved (2, count) = the displacements in the plane of the points `to` under forces in the plane (2, c). */
void plane_shear(plane *s, const double *force, int count, const int *to, double *moved) {
    struct plane_work *w = s->work;
    const int c = s->points, p = s->nodes;
    for (int d = 0; d < 2; d++) to_nodes(s, force + d * c, w->nodal + d * p);
    memset(w->nodes, 0, 2 * p * sizeof(double));
    add_columns(2 * p, 2 * p, s->hh, nonzero(2 * p, w->nodal, w->which, w->value), w->which, w->value, w->nodes);
    for (int d = 0; d < 2; d++)
        for (int a = 0; a < count; a++) moved[d * count + a] = from_nodes(s, w->nodes + d * p, to[a]);
    const int loads = loaded(s, force, 2);
    shear_tread(s, everywhere(s), loads, w->some, w->given, count, to, moved);
}

/* moved (count,) = the displacements away from the road of the points `to` under forces in the plane (2, c). */
static void plane_lift(plane *s, const double *force, int count, const int *to, double *moved) {
    struct plane_work *w = s->work;
    const int c = s->points, p = s->nodes;
    for (int d = 0; d < 2; d++) to_nodes(s, force + d * c, w->nodal + d * p);
    memset(w->nodes, 0, p * sizeof(double));
    if (s->zh) add_columns(p, p, s->zh, nonzero(2 * p, w->nodal, w->which, w->value), w->which, w->value, w->nodes);
    for (int a = 0; a < count; a++) moved[a] = from_nodes(s, w->nodes, to[a]);
    const int loads = loaded(s, force, 2);
    lift_tread(s, everywhere(s), loads, w->some, w->given, count, to, moved);
}

/* moved (2, count) = the displacements in the plane of the points `to`: the tire's under normal forces (c,) and the
   tread's under `pressed` (c,). */
void plane_drag(plane *s, const double *force, const double *pressed, int count, const int *to, double *moved) {
    struct plane_work *w = s->work;
    const int p = s->nodes;
    to_nodes(s, force, w->nodal);
    memset(w->nodes, 0, 2 * p * sizeof(double));
    if (s->hz) add_columns(2 * p, 2 * p, s->hz, nonzero(p, w->nodal, w->which, w->value), w->which, w->value, w->nodes);
    for (int d = 0; d < 2; d++)
        for (int a = 0; a < count; a++) moved[d * count + a] = from_nodes(s, w->nodes + d * p, to[a]);
    const int loads = loaded(s, pressed, 1);
    drag_tread(s, everywhere(s), loads, w->some, w->given, count, to, moved);
}

/* ---- Stick and slip ---------------------------------------------------------------------------------------------- */

newton_rules newton = {.falls = 0.7, .caution = 0.1, .least_caution = 1e-4, .inner = 1e-1};
enum { NEWTON_STEPS = 30, GRADIENT_STEPS = 5000, FEW = 200, SHORT = 40 };

/* One cycle of GMRES of at most `most` steps from x = 0: x (n,) with |A x - b| <= tolerance |b| if that is enough. */
static int cycle(int n, int most, int (*apply)(void *, const double *, double *), void *of, const double *right,
                 double tolerance, double *x, int *done) {
    const int lead = most + 1;
    double *basis = malloc((size_t)lead * n * sizeof(double)), *h = malloc((size_t)lead * most * sizeof(double));
    double *e = DOUBLES(lead), *cosine = DOUBLES(most), *sine = DOUBLES(most);
    if (!basis || !h) abort();
    const double size = e[0] = sqrt(dot(n, right, right));
    memset(x, 0, n * sizeof(double));
    *done = !(size > 0.0);
    int k = 0;
    for (int i = 0; i < n && !*done; i++) basis[i] = right[i] / size;
    for (; k < most && !*done; k++) {
        double *v = basis + (size_t)k * n, *restrict w = v + n, *column = h + (size_t)k * lead;
        apply(of, v, w);
        for (int l = 0; l <= k; l++) {
            const double *restrict u = basis + (size_t)l * n, part = column[l] = dot(n, u, w);
            for (int i = 0; i < n; i++) w[i] -= part * u[i];
        }
        const double length = sqrt(dot(n, w, w));
        if (length > 0.0)
            for (int i = 0; i < n; i++) w[i] /= length;
        for (int l = 0; l < k; l++) {
            const double a = column[l], b = column[l + 1];
            column[l] = cosine[l] * a + sine[l] * b, column[l + 1] = -sine[l] * a + cosine[l] * b;
        }
        const double radius = hypot(column[k], length);
        cosine[k] = radius > 0.0 ? column[k] / radius : 1.0, sine[k] = radius > 0.0 ? length / radius : 0.0;
        column[k] = radius;
        e[k + 1] = -sine[k] * e[k], e[k] *= cosine[k];
        *done = !(fabs(e[k + 1]) > tolerance * size) || !(length > 0.0);
    }
    for (int l = k - 1; l >= 0; l--) {
        for (int m = l + 1; m < k; m++) e[l] -= h[(size_t)m * lead + l] * e[m];
        e[l] = h[(size_t)l * lead + l] != 0.0 ? e[l] / h[(size_t)l * lead + l] : 0.0;
    }
    for (int l = 0; l < k; l++)
        for (int i = 0; i < n; i++) x[i] += e[l] * basis[(size_t)l * n + i];
    free(basis), free(h), free(e), free(cosine), free(sine);
    return k;
}

/* x (n,) by GMRES. A cycle of n steps yields the solution for any A and the rest is rounding, so x is returned; with
   many unknowns a short cycle, which takes less memory, is tried first. Returns the products taken. */
int krylov(int n, int (*apply)(void *, const double *, double *), void *of, const double *right, double tolerance,
           double *x) {
    int done, taken = cycle(n, n > FEW ? SHORT : n, apply, of, right, tolerance, x, &done);
    if (!done && n > FEW) taken += cycle(n, n, apply, of, right, tolerance, x, &done);
    return taken;
}

/* B t (2, a) m for t (2, a) N. */
static void stiffness(stick_slip *s, int reach, const double *force, double *moved) {
    const int a = s->count;
    s->products++;
    shear_some(s->compliance, reach, a, s->index, force, moved);
    for (int d = 0; d < 2; d++)
        for (int i = 0; i < a; i++) moved[d * a + i] += s->spring[i] * force[d * a + i];
}

/* The force (x, y) cut down to its bound. */
static void onto_disc(double bound, double *x, double *y) {
    const double length = hypot(*x, *y);
    if (length > bound) *x *= bound / length, *y *= bound / length;
}

static void onto_discs(int a, const double *bound, double *force) {
    for (int i = 0; i < a; i++) onto_disc(bound[i], force + i, force + a + i);
}

static double most_force(const stick_slip *s) {
    double most = 0.0;
    for (int i = 0; i < s->count; i++) {
        if (isfinite(s->bound[i])) most = fmax(most, s->bound[i]);
        most = fmax(most, hypot(s->force[i], s->force[s->count + i]));
    }
    return most;
}

/* The trial forces t - k r (B t + c), k = `caution`, and the residual t - P(trial) of the present forces; r (B t + c) where
   they stick. Returns the largest residual with k = 1. */
static double residual(stick_slip *s, double *trial, double *off) {
    const int a = s->count;
    const double *t = s->force, k = s->caution;
    double worst = 0.0;
    stiffness(s, everywhere(s->compliance), t, trial);
    for (int i = 0; i < a; i++) {
        const double x = s->inverse[i] * (trial[i] + s->constant[i]), y = s->inverse[i] * (trial[a + i] + s->constant[a + i]);
        const double bound = s->bound[i], whole = hypot(t[i] - x, t[a + i] - y), part = whole > bound ? bound / whole : 1.0;
        worst = fmax(worst, hypot(t[i] - part * (t[i] - x), t[a + i] - part * (t[a + i] - y)));
        trial[i] = t[i] - k * x, trial[a + i] = t[a + i] - k * y;
        const double length = hypot(trial[i], trial[a + i]), share = bound / length;
        const int slips = length > bound;
        off[i] = slips ? t[i] - share * trial[i] : x, off[a + i] = slips ? t[a + i] - share * trial[a + i] : y;
    }
    return worst;
}

struct newton {
    stick_slip *problem;
    double *normal, *share;               /* (2, a), (a,): the projection's derivative b/|t| (I - n n^T) */
    double *step;                         /* workspace: (2, a) */
};

/* moved (2, a) = B t, and with the normal forces `follows` (c,) = -A_NN^-1 A_Nt t that follow t, also A_tN of them. */
static void followed(stick_slip *s, const double *step, double *moved, double *follows) {
    plane *c = s->compliance;
    struct plane_work *w = c->work;
    const int a = s->count, n = c->points;
    s->products++;
    memset(w->lifted, 0, n * sizeof(double));
    if (c->lift) {
        to_slots(c, a, s->index, step);
        product(w->slots, 2 * w->slots, 1.0, w->zt, n, w->t, 0.0, w->z);
        for (int k = 0; k < s->touching; k++) w->lifted[s->touch[k]] = w->z[w->slot[s->touch[k]]];
        follow(s->normal, w->lifted, follows);
        product(2 * w->slots, 2 * w->slots, 1.0, w->tt, 2 * n, w->t, 0.0, w->u);
        memset(w->z, 0, w->slots * sizeof(double));
        for (int k = 0; k < s->touching; k++) w->z[w->slot[s->touch[k]]] = follows[s->touch[k]];
        product(2 * w->slots, w->slots, 1.0, w->tz, 2 * n, w->z, 1.0, w->u);
        from_slots(c, a, s->index, moved);
    } else {
        const int m = w->carriers, t = s->touching;
        for (int d = 0; d < 2; d++) to_carriers(c, a, s->index, step + d * a, w->nodal + d * m);
        memset(w->nodes, 0, 3 * m * sizeof(double));
        add_columns(3 * m, 3 * m, w->compact, nonzero(2 * m, w->nodal, w->which, w->value), w->which, w->value, w->nodes);
        double *some = w->given; /* side by side at the points that touch */
        from_carriers(c, w->nodes + 2 * m, t, s->touch, some);
        lift_tread(c, s->near, a, s->index, step, t, s->touch, some);
        for (int k = 0; k < t; k++) w->lifted[s->touch[k]] = some[k];
        follow(s->normal, w->lifted, follows);
        for (int k = 0; k < t; k++) some[k] = follows[s->touch[k]];
        to_carriers(c, t, s->touch, some, w->nodal);
        add_columns(2 * m, 2 * m, w->down, nonzero(m, w->nodal, w->which, w->value), w->which, w->value, w->nodes);
        for (int d = 0; d < 2; d++) from_carriers(c, w->nodes + d * m, a, s->index, moved + d * a);
        shear_tread(c, s->near, a, s->index, step, a, s->index, moved);
        drag_tread(c, s->near, t, s->touch, some, a, s->index, moved);
    }
    for (int d = 0; d < 2; d++)
        for (int i = 0; i < a; i++) moved[d * a + i] += s->spring[i] * step[d * a + i];
}

/* step (2, a) = about the forces that move the sticking points by given (2, a) of the displacements r B: a preconditioner. */
static void precondition(const struct newton *s, const double *given, double *step) {
    const stick_slip *problem = s->problem;
    plane *c = problem->compliance;
    struct plane_work *w = c->work;
    const int a = problem->count;
    memcpy(step, given, 2 * a * sizeof(double));
    if (!c->inverse[0]) return;
    int *index = w->some, count = 0;
    double *force = w->given;
    for (int i = 0; i < a; i++) count += s->share[i] == 1.0;
    for (int i = 0, k = 0; i < a; i++)
        if (s->share[i] == 1.0) {
            index[k] = problem->index[i];
            force[k] = given[i] / problem->inverse[i], force[count + k++] = given[a + i] / problem->inverse[i];
        }
    bounds(c, count, index);
    memset(w->field, 0, 2 * cells(c) * sizeof(double));
    spread(c, c->within, count, index, force, force + count, c->inverse, 3, w->field, w->field + cells(c));
    for (int i = 0; i < a; i++)
        if (s->share[i] == 1.0) {
            const size_t at = cell(c, problem->index[i]);
            step[i] = w->field[at], step[a + i] = w->field[cells(c) + at];
        }
}

static int derivative(void *of, const double *given, double *out) {
    struct newton *s = of;
    stick_slip *problem = s->problem;
    const int a = problem->count;
    const double *inverse = problem->inverse, *n = s->normal, *step = s->step;
    precondition(s, given, s->step);
    double *follows = problem->normal ? problem->compliance->work->follows : 0;
    if (follows) followed(problem, step, out, follows);
    else stiffness(problem, problem->near, step, out);
    for (int i = 0; i < a; i++) {
        const double r = (s->share[i] < 1.0 ? problem->caution : 1.0) * inverse[i];
        double x = r * out[i] - step[i], y = r * out[a + i] - step[a + i];
        const double along = n[i] * x + n[a + i] * y;
        x = s->share[i] * (x - n[i] * along), y = s->share[i] * (y - n[a + i] * along);
        if (follows) /* the bound of a point that slips follows its normal force */
            x -= n[i] * problem->friction * follows[problem->index[i]], y -= n[a + i] * problem->friction * follows[problem->index[i]];
        out[i] = step[i] + x, out[a + i] = step[a + i] + y;
    }
    return 0;
}

/* A semismooth Newton step from the trial forces and their residual: d + P' (r B d - d) = -residual. */
static void newton_step(stick_slip *s, const double *trial, double *off, double tolerance) {
    const int a = s->count;
    double *normal = DOUBLES(2 * a), *share = DOUBLES(a), *step = DOUBLES(2 * a), *before = DOUBLES(2 * a);
    for (int i = 0; i < a; i++) {
        const double length = hypot(trial[i], trial[a + i]);
        const int slips = length > s->bound[i];
        share[i] = slips ? s->bound[i] / length : 1.0;
        normal[i] = slips ? trial[i] / length : 0.0, normal[a + i] = slips ? trial[a + i] / length : 0.0;
    }
    for (int i = 0; i < 2 * a; i++) off[i] = -off[i];
    struct newton given = {s, normal, share, step};
    krylov(2 * a, derivative, &given, off, tolerance, before);
    precondition(&given, before, step);
    for (int i = 0; i < 2 * a; i++) s->force[i] += step[i];
    free(normal), free(share), free(step), free(before);
}

/* Projected gradients with Nesterov's momentum, restarted where it points uphill: slow but safe for symmetric B. */
static int gradients(stick_slip *s, double tolerance) {
    const int a = s->count;
    const double rate = 1.0 / s->norm;
    double *ahead = DOUBLES(2 * a), *new = DOUBLES(2 * a), *moved = DOUBLES(2 * a), weight = 1.0;
    int found = UNSOLVED;
    memcpy(ahead, s->force, 2 * a * sizeof(double));
    for (int step = 0; step < GRADIENT_STEPS && found != SOLVED; step++) {
        stiffness(s, everywhere(s->compliance), ahead, moved);
        for (int i = 0; i < 2 * a; i++) new[i] = ahead[i] - rate * (moved[i] + s->constant[i]);
        onto_discs(a, s->bound, new);
        double worst = 0.0, uphill = 0.0;
        for (int i = 0; i < 2 * a; i++) {
            worst = fmax(worst, fabs(new[i] - ahead[i]) * s->inverse[i % a] / rate);
            uphill += (ahead[i] - new[i]) * (new[i] - s->force[i]);
        }
        if (uphill > 0.0) weight = 1.0;
        const double later = 0.5 + sqrt(0.25 + weight * weight), share = (weight - 1.0) / later;
        for (int i = 0; i < 2 * a; i++) ahead[i] = new[i] + share * (new[i] - s->force[i]);
        memcpy(s->force, new, 2 * a * sizeof(double));
        weight = later;
        if (worst <= tolerance * most_force(s)) found = SOLVED;
    }
    free(ahead), free(new), free(moved);
    return found;
}

/* The forces to `tolerance` of the largest, by Newton; where it cycles by projected gradients. */
int stick_slip_solve(stick_slip *s, double tolerance) {
    const int a = s->count;
    double *trial = DOUBLES(2 * a), *off = DOUBLES(2 * a), *begun = DOUBLES(2 * a);
    int found = UNSOLVED;
    if (!s->compliance->lift) carry(s->compliance, a, s->index);
    memcpy(begun, s->force, 2 * a * sizeof(double));
    onto_discs(a, s->bound, s->force);
    s->near = everywhere(s->compliance), s->caution = 1.0;
    double before = INFINITY;
    for (int step = 0; step < NEWTON_STEPS; step++) {
        s->off = residual(s, trial, off);
        s->largest = most_force(s);
        if (s->off > newton.falls * before) s->caution = fmax(newton.caution * s->caution, newton.least_caution);
        before = s->off;
        if (s->off <= tolerance * s->largest) {
            found = SOLVED;
            break;
        }
        newton_step(s, trial, off, newton.inner);
    }
    if (found != SOLVED) {
        memcpy(s->force, begun, 2 * a * sizeof(double));
        found = gradients(s, tolerance);
    }
    onto_discs(a, s->bound, s->force);
    free(trial), free(off), free(begun);
    return found;
}

/* ---- Both at once, on a grid ---------------------------------------------------------------------------------------- */

enum { CHANGED = 5 };                 /* points that touch or slip otherwise, up to which two Newton steps make a secant */
static const double DEPENDENT = 1e-4; /* share of a secant that is not of later ones, below which it is none */

/* Of a Newton step's problem between `count` points: their numbers, and what follows in arrays (count,) or (2, count). */
struct at_once_work {
    int count, *index, whole;
    double *direction, *share, *right, *step;
    uint8_t *kept, *sets, *last_sets;     /* the latter two (c,): what touches and slips, now and a Newton step before */
    double *last, *last_step, *now;       /* (3, c) N of the Newton step before: its forces and itself; this one */
    double *basis, *reduced, *part;       /* of the secants: (most, 3c), (most, most), (most,) */
    int follows;                          /* whether the last Newton step was of the same problem */
    double *nodal, *nodes, *value, *force, *field; /* (3p,), (3p,), (3p,), (c,), three fields on the grid */
    int *which, carriers, *carrier, *place; /* nodes that carry points of the box, and the place of each among them, or -1 */
    double *compact;                      /* (3m, 3m) of the tire between these, by columns, once it is needed */
};

void at_once_begin(at_once *s) {
    const int c = s->compliance->points, p = s->compliance->nodes, m = s->most_secants;
    struct at_once_work *w = s->work = room(1, sizeof *w);
    w->index = INTS(c), w->direction = DOUBLES(2 * c), w->share = DOUBLES(c), w->right = DOUBLES(3 * c), w->step = DOUBLES(3 * c);
    w->kept = room(2 * c, 1), w->sets = room(c, 1), w->last_sets = room(c, 1);
    w->last = DOUBLES(3 * c), w->last_step = DOUBLES(3 * c), w->now = DOUBLES(3 * c);
    w->basis = DOUBLES((size_t)m * 3 * c), w->reduced = DOUBLES(m * m), w->part = DOUBLES(m);
    w->nodal = DOUBLES(3 * p), w->nodes = DOUBLES(3 * p), w->value = DOUBLES(3 * p), w->force = DOUBLES(c);
    w->field = DOUBLES(3 * cells(s->compliance)), w->which = INTS(3 * p), w->carrier = INTS(p), w->place = INTS(p);
}

void at_once_end(at_once *s) {
    struct at_once_work *w = s->work;
    void *all[] = {w->index, w->direction, w->share, w->right, w->step, w->kept, w->sets,
                   w->last_sets, w->last, w->last_step, w->now, w->basis, w->reduced, w->part, w->nodal, w->nodes, w->value,
                   w->force, w->field, w->which, w->carrier, w->place, w->compact, w};
    for (size_t i = 0; i < sizeof all / sizeof *all; i++) free(all[i]);
}

/* The box has other points: find the nodes that carry them. */
void at_once_box(at_once *s) {
    const plane *c = s->compliance;
    struct at_once_work *w = s->work;
    free(w->compact), w->compact = 0, w->carriers = 0;
    for (int i = 0; i < c->nodes; i++) w->place[i] = -1;
    for (int k = 0; k < s->inside; k++)
        for (int l = c->w_begin[s->index[k]]; l < c->w_begin[s->index[k] + 1]; l++) w->place[c->w_column[l]] = 0;
    for (int i = 0; i < c->nodes; i++)
        if (!w->place[i]) w->place[i] = w->carriers, w->carrier[w->carriers++] = i;
}

/* Another step begins. */
void at_once_step(at_once *s) { s->work->follows = 0; }

static void between_carriers(at_once *s) {
    struct at_once_work *w = s->work;
    const int p = s->compliance->nodes, m = w->carriers;
    w->compact = DOUBLES(9 * (size_t)m * m);
    for (int d = 0; d < 3; d++)
        for (int j = 0; j < m; j++)
            for (int e = 0; e < 3; e++) {
                const double *restrict column = s->tire + (size_t)(d * p + w->carrier[j]) * 3 * p + e * p;
                double *restrict to = w->compact + (size_t)(d * m + j) * 3 * m + e * m;
                for (int i = 0; i < m; i++) to[i] = column[w->carrier[i]];
            }
}

/* Forces (3, c) N on the tire, in z, x, y, by points on a sloping road. */
static void on_nodes(const plane *c, int point, double f, double x, double y, const double *slope, double *nodal) {
    const double px = x - f * slope[0], py = y - f * slope[1], pz = f + x * slope[0] + y * slope[1];
    const int p = c->nodes;
    for (int k = c->w_begin[point]; k < c->w_begin[point + 1]; k++) {
        double *at = nodal + c->w_column[k];
        at[0] += c->w_value[k] * pz, at[p] += c->w_value[k] * px, at[2 * p] += c->w_value[k] * py;
    }
}

/* `moved`: the displacements of all points with the tire, by the change of forces from those at rest. */
void at_once_push(at_once *s) {
    const plane *c = s->compliance;
    struct at_once_work *w = s->work;
    const int n = c->points, size = 3 * c->nodes;
    const double *f = s->force, *x = f + n, *y = x + n;
    memset(w->nodal, 0, size * sizeof(double)), memset(w->nodes, 0, size * sizeof(double));
    for (int i = 0; i < n; i++) {
        if (f[i] != 0.0 || x[i] != 0.0 || y[i] != 0.0) on_nodes(c, i, f[i], x[i], y[i], s->slope + 2 * i, w->nodal);
        if (s->at_rest[i] != 0.0)
            for (int k = c->w_begin[i]; k < c->w_begin[i + 1]; k++) w->nodal[c->w_column[k]] -= c->w_value[k] * s->at_rest[i];
    }
    add_columns(size, size, s->tire, nonzero(size, w->nodal, w->which, w->value), w->which, w->value, w->nodes);
    for (int i = 0; i < n; i++) {
        for (int d = 0; d < 3; d++) s->moved[d * n + i] = from_nodes(c, w->nodes + d * c->nodes, i);
        for (int d = 0; d < 2; d++) s->place[d * n + i] = s->base[d * n + i] = s->free[d * n + i] + s->moved[(d + 1) * n + i];
    }
}

/* Where bristles begin and end, and gaps over height 0, with the `tread` (3, inside) m; after `at_once_push`. */
void at_once_meet(at_once *s, const double *tread) {
    const int n = s->compliance->points, a = s->inside;
    for (int k = 0; k < a; k++) {
        const int i = s->index[k];
        s->gap[i] = s->open[i] + s->moved[i] + tread[k];
        for (int d = 0; d < 2; d++) {
            double *base = s->base + d * n + i;
            *base += tread[(d + 1) * a + k];
            s->place[d * n + i] = *base + s->force[(d + 1) * n + i] * s->spring[i];
        }
    }
}

/* Whether places since `place` (2, c) m have moved gaps, in the mean square, by more than `tolerance` of deflections. */
int at_once_strays(const at_once *s, const double *place, double tolerance) {
    const int n = s->compliance->points;
    double moved = 0.0, size = 0.0;
    for (int i = 0; i < n; i++) {
        const double f = s->force[i];
        if (!(f > 0.0)) continue;
        const double shift = fabs(s->slope[2 * i] * (s->place[i] - place[i])) + fabs(s->slope[2 * i + 1] * (s->place[n + i] - place[n + i]));
        moved += shift * shift, size += s->own[i] * f * s->own[i] * f;
    }
    return sqrt(moved) > tolerance * sqrt(size);
}

static double bound_of(const at_once *s, double f) { return s->friction < 0.0 ? INFINITY : s->friction * fmax(f, 0.0); }

/* Residuals of gaps over the road and of slips of the box's points, and which of them touch; after `at_once_meet`. */
void at_once_balance(at_once *s) {
    const int n = s->compliance->points;
    double widest = 0.0, deepest = 0.0, worst = 0.0, off = 0.0, most = 0.0;
    for (int k = 0; k < s->inside; k++) {
        const int i = s->index[k];
        const double f = s->force[i], pressed = s->own[i] * f, gap = s->gap[i] -= s->height[i];
        const double wrong = fabs(gap > pressed ? pressed : gap); /* NAN where gap is */
        widest = fmax(widest, fabs(gap)), deepest = fmax(deepest, pressed);
        if (!(wrong <= worst)) worst = wrong;
        s->touches[i] = pressed - gap > 0.0;
        const double bound = bound_of(s, f), r = 1.0 / s->beside[i];
        double whole[2];
        for (int d = 0, l = i; d < 2; d++, l += n) {
            const double t = s->force[n + l];
            s->slip[l] = s->base[l] + s->spring[i] * t + s->past[l];
            s->trial[l] = t - s->caution * r * s->slip[l];
            whole[d] = t - r * s->slip[l];
        }
        const double x = s->force[n + i], y = s->force[2 * n + i];
        if (isfinite(bound)) most = fmax(most, bound);
        most = fmax(most, hypot(x, y));
        if (!s->touches[i] || !s->bears[i]) continue;
        onto_disc(bound, whole, whole + 1);
        off = fmax(off, hypot(x - whole[0], y - whole[1]));
    }
    const double scale = widest + deepest;
    s->residual = scale > 0.0 || isnan(worst) ? worst / scale : 0.0, s->off = off, s->most = most;
}

/* The displacements under forces (3, a), z, x, y, in units of the forces: of a Newton step's problem. */
static int both(void *of, const double *given, double *out) {
    at_once *s = of;
    plane *c = s->compliance;
    struct at_once_work *w = s->work;
    const int a = w->count, p = c->nodes, size = 3 * p, whole = w->whole;
    const int reach = whole ? everywhere(c) : s->near;
    const double *f = given, *x = given + a, *y = given + 2 * a, *n = w->direction;
    const double *const pressed[] = {s->pressed, s->pressed};
    double *uz = w->field, *ux = uz + cells(c), *uy = ux + cells(c);
    memset(w->field, 0, 3 * cells(c) * sizeof(double));
    spread(c, reach, a, w->index, f, 0, pressed, 1, uz, 0);
    spread(c, reach, a, w->index, x, y, c->kernel, 3, ux, uy);
    if (c->coupled) {
        for (int k = 0; k < a; k++) w->force[k] = -f[k];
        spread(c, reach, a, w->index, x, y, c->kernel + 3, 2, uz, 0);
        spread(c, reach, a, w->index, w->force, 0, c->kernel + 3, 2, ux, uy);
    }
    memset(w->nodal, 0, size * sizeof(double));
    for (int k = 0; k < a; k++) on_nodes(c, w->index[k], f[k], x[k], y[k], s->slope + 2 * w->index[k], w->nodal);
    if (whole || !s->n_value) {
        const int m = w->carriers;
        if (!w->compact) between_carriers(s);
        int count = 0;
        for (int d = 0; d < 3; d++)
            for (int j = 0; j < m; j++) {
                const double value = w->nodal[d * p + w->carrier[j]];
                if (value != 0.0) w->which[count] = d * m + j, w->value[count++] = value;
            }
        memset(w->nodal, 0, size * sizeof(double));
        add_columns(3 * m, 3 * m, w->compact, count, w->which, w->value, w->nodal);
        for (int d = 0; d < 3; d++)
            for (int j = 0; j < m; j++) w->nodes[d * p + w->carrier[j]] = w->nodal[d * m + j];
    } else {
        for (int i = 0; i < size; i++) { /* of nodes that carry some of the points */
            if (!c->work->bears[i % p]) continue;
            double sum = 0.0;
            for (int k = s->n_begin[i]; k < s->n_begin[i + 1]; k++) sum += s->n_value[k] * w->nodal[s->n_column[k]];
            w->nodes[i] = sum;
        }
    }
    for (int k = 0; k < a; k++) {
        const int i = w->index[k], slips = w->share[k] < 1.0;
        const size_t at = cell(c, i);
        const double tx = ux[at] + from_nodes(c, w->nodes + p, i) + s->spring[i] * x[k];
        const double ty = uy[at] + from_nodes(c, w->nodes + 2 * p, i) + s->spring[i] * y[k];
        double z = uz[at] + from_nodes(c, w->nodes, i);
        if (slips && s->reads) z -= s->slope[2 * i] * tx + s->slope[2 * i + 1] * ty; /* what slips meets the road elsewhere */
        out[k] = w->kept[k] ? f[k] : z / s->own[i];
        if (w->kept[a + k]) {
            out[a + k] = x[k], out[2 * a + k] = y[k];
            continue;
        }
        const double r = (slips ? s->caution : 1.0) / s->beside[i];
        double dx = r * tx - x[k], dy = r * ty - y[k];
        const double along = n[k] * dx + n[a + k] * dy, follows = slips ? s->friction * f[k] : 0.0;
        dx = w->share[k] * (dx - n[k] * along) - n[k] * follows, dy = w->share[k] * (dy - n[a + k] * along) - n[a + k] * follows;
        out[a + k] = x[k] + dx, out[2 * a + k] = y[k] + dy;
    }
    return 0;
}

/* The part of the last steps that this one, `step` (3, c) N from `force`, is best followed by: where a step d belongs to forces p, those
   with the secants dP and dD are p + dP a + d + dD a, a that of the least |d + dD a|. */
static void follow_secants(at_once *s) {
    struct at_once_work *w = s->work;
    const int n = s->compliance->points, a = w->count, size = 3 * a, had = *s->secants;
    const size_t whole = 3 * (size_t)n;
    double *rest = w->right; /* which is not needed any more */
    memcpy(rest, w->step, size * sizeof(double));
    for (int k = 0; k < 2 * a; k++)
        if (w->kept[k]) {
            rest[k] = 0.0;
            if (k >= a) rest[a + k] = 0.0;
        }
    int count = 0, which[had + 1];
    for (int j = had - 1; j >= 0; j--) { /* Gram and Schmidt, the last one first */
        const double *change = s->changes + j * whole;
        double *restrict q = w->basis + (size_t)count * size, *r = w->reduced + (size_t)count * s->most_secants;
        for (int d = 0; d < 3; d++)
            for (int k = 0; k < a; k++) q[d * a + k] = w->kept[(d > 0) * a + k] ? 0.0 : change[d * n + w->index[k]];
        const double length = sqrt(dot(size, q, q));
        for (int l = 0; l < count; l++) {
            const double *restrict u = w->basis + (size_t)l * size, part = r[l] = dot(size, u, q);
            for (int k = 0; k < size; k++) q[k] -= part * u[k];
        }
        const double left = sqrt(dot(size, q, q));
        if (!(left > DEPENDENT * length)) continue;
        for (int k = 0; k < size; k++) q[k] /= left;
        r[count] = left, which[count] = j, w->part[count++] = -dot(size, q, rest);
    }
    for (int l = count - 1; l >= 0; l--) {
        for (int m = l + 1; m < count; m++) w->part[l] -= w->reduced[(size_t)m * s->most_secants + l] * w->part[m];
        w->part[l] /= w->reduced[(size_t)l * s->most_secants + l];
        const double *move = s->moves + which[l] * whole, *change = s->changes + which[l] * whole;
        for (int d = 0; d < 3; d++)
            for (int k = 0; k < a; k++)
                if (!w->kept[(d > 0) * a + k]) {
                    const size_t at = (size_t)d * n + w->index[k];
                    w->step[d * a + k] += w->part[l] * (move[at] + change[at]);
                }
    }
}

/* A secant of the Newton step before and this one, if both are of the same problem; the step is then the one before. */
static void take_secant(at_once *s) {
    struct at_once_work *w = s->work;
    const int n = s->compliance->points, a = w->count;
    const size_t whole = 3 * (size_t)n;
    int other = 0;
    for (int i = 0; i < n; i++) other += w->sets[i] != w->last_sets[i];
    double *now = w->now;
    memset(now, 0, whole * sizeof(double));
    for (int d = 0; d < 3; d++)
        for (int k = 0; k < a; k++) now[d * n + w->index[k]] = w->step[d * a + k];
    if (s->most_secants && w->follows && !s->reads && other <= CHANGED) {
        if (*s->secants == s->most_secants) {
            memmove(s->moves, s->moves + whole, (s->most_secants - 1) * whole * sizeof(double));
            memmove(s->changes, s->changes + whole, (s->most_secants - 1) * whole * sizeof(double));
            --*s->secants;
        }
        double *restrict move = s->moves + *s->secants * whole, *restrict change = s->changes + *s->secants * whole;
        for (size_t i = 0; i < whole; i++) move[i] = s->force[i] - w->last[i], change[i] = now[i] - w->last_step[i];
        ++*s->secants;
    }
    memcpy(w->last, s->force, whole * sizeof(double)), memcpy(w->last_step, now, whole * sizeof(double));
    memcpy(w->last_sets, w->sets, n);
    w->follows = !s->reads;
}

/* Forces that balance gaps and slips where they are linear, `normal` to the road and in its `plane`, with the `whole` compliance or
   what is near, to the `tolerance` of what they are out of balance; those of points that leave the road go. */
void at_once_newton(at_once *s, int normal, int plane_too, int whole, double tolerance) {
    plane *c = s->compliance;
    struct at_once_work *w = s->work;
    const int n = c->points;
    const double *f = s->force, *x = f + n, *y = x + n;
    memset(w->sets, 0, n);
    int a = 0, done;
    for (int k = 0; k < s->inside; k++) {
        const int i = s->index[k], touches = normal ? s->touches[i] : f[i] > 0.0;
        if (touches || f[i] != 0.0 || x[i] != 0.0 || y[i] != 0.0) w->sets[i] = touches, w->index[a++] = i;
    }
    if (!(w->count = a)) return;
    for (int k = 0; k < a; k++) {
        const int i = w->index[k], touches = w->sets[i], bears = touches && s->bears[i];
        const double bound = bound_of(s, f[i]), length = hypot(s->trial[i], s->trial[n + i]);
        const int slips = bears && length > bound;
        w->share[k] = slips ? bound / length : 1.0;
        w->sets[i] |= slips << 1;
        w->kept[k] = !(touches && normal), w->kept[a + k] = !(bears && plane_too);
        w->right[k] = !normal ? 0.0 : touches ? -s->gap[i] / s->own[i] : -f[i];
        for (int d = 0, l = i, at = k; d < 2; d++, l += n, at += a) {
            const double t = s->force[n + l], way = w->direction[at] = slips ? s->trial[l] / length : 0.0;
            w->right[a + at] = !plane_too ? 0.0 : !bears ? -t : slips ? bound * way - t : -s->slip[l] / s->beside[i];
        }
    }
    bounds(c, a, w->index);
    memset(c->work->bears, 0, c->nodes);
    for (int k = 0; k < a; k++)
        for (int l = c->w_begin[w->index[k]]; l < c->w_begin[w->index[k] + 1]; l++) c->work->bears[c->w_column[l]] = 1;
    w->whole = whole;
    cycle(3 * a, SHORT, both, s, w->right, tolerance, w->step, &done);
    if (normal && plane_too && !whole) {
        take_secant(s);
        follow_secants(s);
    } else
        w->follows = 0;
    for (int k = 0; k < a; k++) {
        const int i = w->index[k], touches = w->sets[i] & 1;
        for (int d = 0; d < 3; d++) s->force[d * n + i] += w->step[d * a + k];
        if (normal && !touches) s->force[i] = 0.0;
        if (plane_too && !(touches && s->bears[i])) s->force[n + i] = s->force[2 * n + i] = 0.0;
    }
}

/* No point pulls at the road or bears more than friction holds. */
void at_once_bound(at_once *s) {
    const int n = s->compliance->points;
    for (int i = 0; i < n; i++) {
        double *f = s->force + i, *x = f + n, *y = x + n;
        *f = fmax(*f, 0.0);
        onto_disc(bound_of(s, *f), x, y);
        if (!(*f > 0.0)) *x = *y = 0.0;
    }
}

/* ---- Both in turn -------------------------------------------------------------------------------------------------- */

/* Turns in which the normal forces follow in a Newton step; after which stick and slip are solved in each. */
enum { FOLLOWED = 8, FLAT = 30, MIXED = 4 };
static const double ENOUGH = 0.1; /* of the tolerance: stick and slip within a turn */
static const double LEAST = 1e-9; /* share of a cell on which bristles stand that bear */
static const double HELD = 1e-6; /* of its bound that a point which sticks has left at least */
static const double SHRUNK = 0.03, SMALL = 1e-6; /* of the first residual of a step, down to a share of the largest bound */

struct brush_work {
    double *past, *trial, *moved, *some, *found, *q, *mixed;
    double *spring, *inverse, *constant, *bound, *force, *ahead, *off;
    double *results[MIXED], *residuals[MIXED];
    double *horizontal; /* (2, c) N at the end of the step before */
    int *index, *every;
    int touches, *touch, reaches, *reach; /* the points that touch, and with those next ahead of them; ascending */
    uint8_t *bears, *lifted, *touching, *set;
};

void brush_begin(brush *s) {
    const int c = s->compliance->points;
    struct brush_work *w = s->work = room(1, sizeof *w);
    double **doubles[] = {&w->past, &w->trial, &w->moved, &w->some, &w->found, &w->q,
                          &w->mixed, &w->spring, &w->inverse, &w->constant, &w->bound, &w->force,
                          &w->ahead, &w->off, &w->horizontal};
    for (int i = 0; i < 15; i++) *doubles[i] = DOUBLES(2 * c);
    for (int i = 0; i < MIXED; i++) w->results[i] = DOUBLES(2 * c), w->residuals[i] = DOUBLES(2 * c);
    w->index = INTS(c), w->every = INTS(c), w->touch = INTS(c), w->reach = INTS(c);
    for (int i = 0; i < c; i++) w->every[i] = i;
    w->bears = room(c, 1), w->lifted = room(c, 1), w->touching = room(c, 1), w->set = room(c, 1);
}

void brush_end(brush *s) {
    struct brush_work *w = s->work;
    for (int i = 0; i < MIXED; i++) free(w->results[i]), free(w->residuals[i]);
    void *all[] = {w->bears, w->past, w->trial, w->moved, w->some, w->found, w->q, w->mixed, w->spring, w->inverse,
                   w->constant, w->bound, w->force, w->ahead, w->off, w->index, w->every, w->touch, w->reach, w->lifted, w->touching, w->set,
                   w->horizontal, w};
    for (size_t i = 0; i < sizeof all / sizeof *all; i++) free(all[i]);
}

/* Residual (N) of the forces in the plane that a step may leave, of the `first` one and the `most` that a point may bear. Small
   changes are not to be lost step by step: bristles would carry the error through the patch. */
double brush_limit(const brush *s, double first, double most) {
    return fmin(s->tolerance * most, fmax(SHRUNK * first, SMALL * most));
}

/* The mean of the tips (2,) of a point's bristles that stand on the road; whether any do. */
static int mean_tip(const brush *s, int point, int bristles, double *tip) {
    double share = 0.0, x = 0.0, y = 0.0;
    for (int k = s->first[point], b = s->foremost[point]; k < s->first[point + 1]; k++, b++) {
        const double weight = s->stands[b] == STANDS ? s->weight[k] : 0.0;
        share += weight, x += weight * s->tip[b], y += weight * s->tip[bristles + b];
    }
    const int any = share > LEAST;
    tip[0] = any ? x / share : 0.0, tip[1] = any ? y / share : 0.0;
    return any;
}

/* Before a step: tips follow what slid in the last one, bristles of points that touch now stand on the road, and all move on. */
void brush_travel(brush *s) {
    if (s->spring_kind) return;
    const int c = s->compliance->points, n = s->line[s->lines];
    double *mean = s->work->some, *led = s->work->trial; /* (2, c) m: of the tips, NAN where none are; how far they slid */
    for (int i = 0; i < c; i++) {
        double tip[2];
        if (!s->touched[i]) continue;
        const int any = mean_tip(s, i, n, tip), slid = any && s->slid[i];
        for (int k = i, d = 0; d < 2; d++, k += c) {
            led[k] = slid ? s->moved[k] - s->deflection[k] - tip[d] : 0.0;
            mean[k] = any ? tip[d] + led[k] : NAN;
        }
    }
    for (int b = 0; b < n; b++) {
        const int i = s->cell[b], next = s->ahead[i];
        if (!s->touched[i]) {
            if (s->stands[b] == STANDS && !s->touched[s->beside[b]]) s->stands[b] = STOOD;
            continue;
        }
        for (int d = 0; d < 2; d++) {
            const double *u = s->moved + d * c, with = mean[d * c + i];
            if (s->stands[b] == STANDS) s->tip[d * n + b] += led[d * c + i];
            else s->tip[d * n + b] = isnan(with) ? u[i] + s->along[b] * (u[next] - u[i]) : with;
        }
        s->stands[b] = STANDS;
    }
    if (s->shift && ++*s->waited >= s->every) {
        *s->waited = 0;
        for (int l = 0; l < s->lines; l++) {
            const int first = s->line[l], count = s->line[l + 1] - first, new = s->shift < count ? s->shift : count;
            for (int d = 0; d < 2 * n; d += n)
                memmove(s->tip + d + first + new, s->tip + d + first, (count - new) * sizeof(double));
            memmove(s->stands + first + new, s->stands + first, (count - new) * sizeof(int));
            for (int b = first; b < first + new; b++) s->stands[b] = FRESH;
        }
    }
    for (int b = 0; b < n; b++) {
        const int i = s->cell[b], next = s->ahead[i], stood = s->stands[b];
        if (stood != STANDS && !s->touched[i]) continue;
        for (int d = 0; d < 2; d++) {
            const double *u = s->moved + d * c, with = mean[d * c + i], slip = s->slip[d * c + i];
            double *tip = s->tip + d * n + b;
            if (stood == FRESH || (stood == STOOD && isnan(with))) *tip = 0.5 * (u[i] + u[next]) - s->entry[b] * slip;
            else *tip = (stood == STOOD ? with : *tip) - slip;
        }
        s->stands[b] = STANDS;
    }
}

/* Which points have bristles that bear (c,), and past (2, c) of their e = u + past at the end of the step (contact.tread.brush), after
   `brush_travel`. */
void brush_offer(const brush *s, uint8_t *bears, double *past) {
    const int c = s->compliance->points, n = s->line[s->lines];
    for (int i = 0; i < c; i++) {
        double tip[2] = {0.0, 0.0};
        bears[i] = s->spring_kind || mean_tip(s, i, n, tip);
        past[i] = -tip[0], past[c + i] = -tip[1];
    }
}

/* Which points touch, which of them slide, and the deflections, after a step with normal (c,) and tangential forces (2, c). */
void brush_conclude(brush *s, const double *force, const double *tangential) {
    const int c = s->compliance->points;
    for (int i = 0; i < c; i++) {
        const double x = tangential[i], y = tangential[c + i], t = hypot(x, y);
        const double bound = s->friction < 0.0 ? INFINITY : s->friction * force[i];
        s->touched[i] = force[i] > 0.0;
        s->slid[i] = t == 0.0 || t >= (1.0 - HELD) * bound;
        s->deflection[i] = -x / s->stiffness[i], s->deflection[c + i] = -y / s->stiffness[i];
    }
}

/* Anderson's acceleration of t = G(t): the next t from `given` t and `result` G(t); `held` earlier ones are kept. */
static int mix(brush *s, int held, const double *given, const double *result, double *next) {
    struct brush_work *w = s->work;
    const int n = 2 * s->compliance->points;
    double worst = 0.0, before = 0.0;
    double *spare = w->mixed;
    for (int i = 0; i < n; i++) spare[i] = result[i] - given[i], worst = fmax(worst, fabs(spare[i]));
    if (held) before = largest(n, w->residuals[held - 1]);
    if (held && worst > before) held = 0;
    if (held == MIXED) { /* the oldest goes */
        double *r = w->results[0], *o = w->residuals[0];
        for (int i = 1; i < MIXED; i++) w->results[i - 1] = w->results[i], w->residuals[i - 1] = w->residuals[i];
        w->results[MIXED - 1] = r, w->residuals[MIXED - 1] = o;
        held--;
    }
    memcpy(w->results[held], result, n * sizeof(double)), memcpy(w->residuals[held], spare, n * sizeof(double));
    memcpy(next, result, n * sizeof(double));
    const double *last = w->residuals[held];
    /* Least squares of the last residual by its differences to the earlier ones. */
    double share[MIXED] = {0};
    double gram[MIXED][MIXED], right[MIXED], size = 0.0;
    for (int a = 0; a < held; a++) {
        for (int b = 0; b <= a; b++) {
            double sum = 0.0;
            for (int i = 0; i < n; i++) sum += (last[i] - w->residuals[a][i]) * (last[i] - w->residuals[b][i]);
            gram[a][b] = gram[b][a] = sum;
        }
        double sum = 0.0;
        for (int i = 0; i < n; i++) sum += (last[i] - w->residuals[a][i]) * last[i];
        right[a] = sum, size = fmax(size, gram[a][a]);
    }
    /* Elimination with diagonal pivots; directions below rounding take no share. */
    uint8_t used[MIXED] = {0};
    int order[MIXED], rank = 0;
    for (; rank < held; rank++) {
        int best = -1;
        for (int a = 0; a < held; a++)
            if (!used[a] && (best < 0 || gram[a][a] > gram[best][best])) best = a;
        if (!(gram[best][best] > 1e-12 * size)) break;
        used[best] = 1, order[rank] = best;
        for (int a = 0; a < held; a++) {
            if (used[a]) continue;
            const double factor = gram[a][best] / gram[best][best];
            for (int b = 0; b < held; b++) gram[a][b] -= factor * gram[best][b];
            right[a] -= factor * right[best];
        }
    }
    for (int k = rank - 1; k >= 0; k--) {
        const int a = order[k];
        double sum = right[a];
        for (int l = k + 1; l < rank; l++) sum -= gram[a][order[l]] * share[order[l]];
        share[a] = sum / gram[a][a];
    }
    for (int a = 0; a < held; a++)
        if (share[a] != 0.0)
            for (int i = 0; i < n; i++) next[i] -= share[a] * (result[i] - w->results[a][i]);
    return held + 1;
}

/* The points whose bristles bear, and their problem with the normal forces `force`; after `drag`. */
static stick_slip sticking(brush *s, const double *force) {
    struct brush_work *w = s->work;
    const int c = s->compliance->points;
    int a = 0;
    for (int k = 0; k < w->touches; k++) {
        const int i = w->touch[k];
        if (!w->lifted[i] && w->bears[i]) w->index[a++] = i;
    }
    for (int k = 0; k < a; k++) {
        const int i = w->index[k];
        w->spring[k] = 1.0 / s->stiffness[i];
        w->inverse[k] = 1.0 / (s->own[i] + w->spring[k]);
        w->bound[k] = s->friction < 0.0 ? INFINITY : s->friction * force[i];
        for (int d = 0; d < 2; d++) w->constant[d * a + k] = w->moved[d * c + i] + w->past[d * c + i];
    }
    stick_slip problem = {s->compliance, a, w->index, w->spring, w->inverse, w->constant, w->bound, w->force, s->compliance->near, 1.0};
    problem.norm = s->norm + (a ? largest(a, w->spring) : 0.0);
    return problem;
}

/* moved (2, c) = the displacements in the plane under normal forces (c,) where points touch; on a grid too large to be
   dense also at those next ahead of them. Both are listed. */
static void drag(brush *s, const double *force, const double *free, double *moved) {
    plane *compliance = s->compliance;
    struct plane_work *p = compliance->work;
    struct brush_work *w = s->work;
    const int c = compliance->points;
    w->touches = w->reaches = 0;
    for (int i = 0; i < c; i++)
        if (force[i] > 0.0) w->touch[w->touches++] = i;
    if (compliance->lift) { /* between the points that touch: the others are read once, in `finish` */
        hold(compliance, w->touches, w->touch);
        memset(p->z, 0, p->slots * sizeof(double));
        for (int a = 0; a < w->touches; a++) p->z[p->slot[w->touch[a]]] = force[w->touch[a]];
        product(2 * p->slots, p->slots, 1.0, p->tz, 2 * c, p->z, 0.0, p->u);
        for (int a = 0; a < w->touches; a++) {
            const int i = w->touch[a], k = p->slot[i];
            moved[i] = p->u[2 * k], moved[c + i] = p->u[2 * k + 1];
            for (int d = 0; d < 2 * c; d += c) moved[d + i] += free[d + i] - s->dragged[d + i];
        }
        return;
    }
    memset(w->set, 0, c);
    for (int a = 0; a < w->touches; a++) w->set[w->touch[a]] = w->set[s->ahead[w->touch[a]]] = 1;
    for (int i = 0; i < c; i++)
        if (w->set[i]) w->reach[w->reaches++] = i;
    carry(compliance, w->touches, w->touch);
    plane_drag(compliance, force, force, w->reaches, w->reach, w->some);
    for (int d = 0; d < 2; d++)
        for (int a = 0; a < w->reaches; a++) {
            const int at = d * c + w->reach[a];
            moved[at] = w->some[d * w->reaches + a] + free[at] - s->dragged[at];
        }
}

/* Set the state of the bristles: their deflections, the displacements of their bases, which points touched. */
static void finish(brush *s, const double *force, const double *free) {
    struct brush_work *w = s->work;
    plane *compliance = s->compliance;
    const int c = compliance->points;
    memcpy(s->before, w->horizontal, 2 * c * sizeof(double));
    memcpy(s->horizontal, w->found, 2 * c * sizeof(double));
    if (compliance->lift) { /* of all points: where the road is met */
        struct plane_work *p = compliance->work;
        int count = nonzero(c, force, p->which, p->value);
        for (int k = 0; k < 2 * c; k++)
            if (w->found[k] != 0.0) p->which[count] = c + k, p->value[count++] = w->found[k];
        for (int i = 0; i < 2 * c; i++) s->moved[i] = free[i] - s->dragged[i];
        add_columns(2 * c, 2 * c, compliance->beside, count, p->which, p->value, s->moved);
    } else {
        plane_shear(compliance, w->found, w->reaches, w->reach, w->some);
        for (int d = 0; d < 2; d++)
            for (int a = 0; a < w->reaches; a++) {
                const int at = d * c + w->reach[a];
                s->moved[at] = w->moved[at] + w->some[d * w->reaches + a];
            }
    }
    brush_conclude(s, force, w->found);
}

/* w->q (c,) = gaps with the points of `to` lifted by the bristles' forces. */
static void lifted_by(brush *s, const double *q, const double *forces, int count, const int *to) {
    struct brush_work *w = s->work;
    plane *compliance = s->compliance;
    struct plane_work *p = compliance->work;
    const int c = compliance->points;
    memcpy(w->q, q, c * sizeof(double));
    if (compliance->lift) {
        add_columns(c, c, compliance->lift, nonzero(2 * c, forces, p->which, p->value), p->which, p->value, w->q);
        return;
    }
    plane_lift(compliance, forces, count, to, w->some);
    for (int a = 0; a < count; a++) w->q[to[a]] += w->some[a];
}

static int normal_forces(const normal_contact *n, int turn, const double *q, const uint8_t *guess, const double *reference,
                         double *force) {
    if (n->usual) return pivot_solve(n->usual, q, guess, force);
    if (!n->all) return n->another(q, guess, force);
    n->all->again = turn > 1;
    return active_set_solve(n->all, q, guess, reference, force);
}

/* Trial forces (2, c) of the points to be solved for, side by side in `force`; and these back in `found` (2, c), 0 elsewhere. */
static void gather(struct brush_work *w, int a, int c) {
    for (int d = 0; d < 2; d++)
        for (int k = 0; k < a; k++) w->force[d * a + k] = w->trial[d * c + w->index[k]];
}

static void scatter(struct brush_work *w, int a, int c) {
    memset(w->found, 0, 2 * c * sizeof(double));
    for (int d = 0; d < 2; d++)
        for (int k = 0; k < a; k++) w->found[d * c + w->index[k]] = w->force[d * a + k];
}

/* A step whose normal and tangential forces have no solution together that is found: normal forces with the tangential ones of the
   last step, and stick and slip under these, which both have one. */
static int lagging(brush *s, normal_contact *normal, const double *q, const double *at_rest, const double *free,
                   double *force) {
    struct brush_work *w = s->work;
    const int c = s->compliance->points;
    int failed;
    memcpy(w->trial, w->horizontal, 2 * c * sizeof(double));
    do {
        lifted_by(s, q, w->trial, c, w->every);
        if ((failed = normal_forces(normal, s->turns, w->q, w->set, at_rest, force))) return failed;
        failed = normal->others ? normal->others(w->q, force) : SOLVED;
    } while (failed == AGAIN);
    if (failed) return failed;
    drag(s, force, free, w->moved);
    stick_slip problem = sticking(s, force);
    const int a = problem.count;
    gather(w, a, c);
    if ((failed = stick_slip_solve(&problem, ENOUGH * s->tolerance))) return failed;
    scatter(w, a, c);
    s->lagged++, s->streak++;
    finish(s, force, free);
    return SOLVED;
}

int brush_solve(brush *s, normal_contact *normal, const double *q, const uint8_t *guess, const double *at_rest,
                const double *free, double *force) {
    struct brush_work *w = s->work;
    plane *compliance = s->compliance;
    const int c = compliance->points, unbounded = s->friction < 0.0, own = normal->all || normal->usual;
    int held = 0, failed;
    double before = INFINITY, first = INFINITY, caution = 1.0;
    if (!s->again) { /* a step that is solved again begins as it did before */
        brush_travel(s);
        memcpy(w->horizontal, s->horizontal, 2 * c * sizeof(double));
    }
    brush_offer(s, w->bears, w->past);
    memset(w->lifted, 0, c);
    for (int i = 0; i < 2 * c; i++) w->trial[i] = s->again ? s->horizontal[i] : 2.0 * s->horizontal[i] - s->before[i];
    for (s->turns = 1; s->turns <= TURNS; s->turns++) {
        lifted_by(s, q, w->trial, normal->usual ? normal->usual->taken : c, normal->usual ? normal->usual->places : w->every);
        if ((failed = normal_forces(normal, s->turns, w->q, guess, at_rest, force))) return failed;
        drag(s, force, free, w->moved);
        for (int i = 0; i < c; i++) w->set[i] = force[i] > 0.0;
        guess = w->set;
        if (unbounded) /* a point that comes and goes: its own bristle lifts it off */
            for (int i = 0; i < c; i++) {
                if (s->turns > LIFT_PATIENCE && w->set[i] != w->touching[i]) w->lifted[i] = 1;
                w->touching[i] = w->set[i];
            }
        stick_slip problem = sticking(s, force);
        const int a = problem.count, follows = own && s->turns <= FOLLOWED;
        gather(w, a, c);
        onto_discs(a, w->bound, w->force);
        problem.caution = caution;
        problem.off = residual(&problem, w->ahead, w->off);
        problem.largest = most_force(&problem);
        if (!isfinite(problem.off)) return NOT_FINITE;
        if (problem.off > newton.falls * before) caution = fmax(newton.caution * caution, newton.least_caution);
        before = problem.off;
        if (s->turns == 1) first = problem.off;
        const double limit = brush_limit(s, first, problem.largest);
        double cut = 0.0; /* what the bounds have cut off still acted on the normal forces */
        scatter(w, a, c);
        for (int i = 0; i < 2 * c; i++) cut = fmax(cut, fabs(w->found[i] - w->trial[i]));
        if (fmax(problem.off, cut) <= limit) {
            if (normal->others) {
                lifted_by(s, q, w->trial, c, w->every);
                failed = normal->others(w->q, force);
                if (failed == AGAIN) continue; /* with more points */
                if (failed) return failed;
            }
            s->products += problem.products, s->all_turns += s->turns, s->streak = 0;
            finish(s, force, free);
            return SOLVED;
        }
        if (s->turns > (own ? FOLLOWED : FLAT)) failed = stick_slip_solve(&problem, problem.largest > 0.0 ? ENOUGH * limit / problem.largest : 0.0);
        else {
            if (follows) {
                problem.normal = normal, problem.friction = unbounded ? 0.0 : s->friction;
                problem.touching = w->touches, problem.touch = w->touch;
            }
            newton_step(&problem, w->ahead, w->off, newton.inner);
            onto_discs(a, w->bound, w->force);
        }
        s->products += problem.products;
        if (failed) return failed;
        scatter(w, a, c);
        if (s->rough) {
            s->all_turns++;
            finish(s, force, free);
            return SOLVED;
        }
        if (follows) memcpy(w->trial, w->found, 2 * c * sizeof(double));
        else held = mix(s, held, w->trial, w->found, w->trial);
    }
    return unbounded || s->streak >= LAGS ? UNSOLVED : lagging(s, normal, q, at_rest, free, force);
}

/* ---- Before and after the solution of a step ------------------------------------------------------------------------ */

/* What a slope adds to normal forces f and bristle forces t: t . r away from the road, -f r along it. */
static void lean(int c, const double *slope, const double *force, const double *tangential, double *added) {
    for (int i = 0; i < c; i++) {
        const double x = slope[2 * i], y = slope[2 * i + 1];
        added[i] = tangential[i] * x + tangential[c + i] * y;
        added[c + i] = -force[i] * x, added[2 * c + i] = -force[i] * y;
    }
}

/* q and the free displacements in the plane, from the displacements (k,) of the nodes without new forces; the slope
   (c, 2) may be 0, and so may the displacements (1 or 3, c) of a tread that creeps. */
void meeting_prepare(meeting *s, const double *moved, const double *road, const double *slope, const double *tread) {
    const int c = s->points, p = s->nodes, size = s->components * p;
    const double *nodes = moved;
    if (slope) {
        sparse down = {p, s->t_begin, s->t_column, s->t_value};
        lean(c, slope, s->normal_force, s->tangential, s->added);
        for (int d = 0; d < 3; d++) multiply(&down, s->added + d * c, s->nodal + d * p);
        memcpy(s->lifted, moved, size * sizeof(double));
        add_columns(size, size, s->answer, nonzero(size, s->nodal, s->which, s->value), s->which, s->value, s->lifted);
        nodes = s->lifted;
    }
    sparse up = {c, s->w_begin, s->w_column, s->w_value};
    multiply(&up, nodes, s->q);
    for (int i = 0; i < c; i++) s->q[i] = s->gap0[i] + s->q[i] + (tread ? tread[i] : 0.0) - road[i];
    if (s->components == 1) return;
    for (int d = 0; d < 2; d++) multiply(&up, nodes + (d + 1) * p, s->free + d * c);
    if (tread)
        for (int i = 0; i < 2 * c; i++) s->free[i] += tread[c + i];
}

/* Forces on the tire from the normal (c,) and bristle forces (2, c) found, the latter 0 without friction. */
void meeting_conclude(meeting *s, const double *force, const double *tangential, const double *slope) {
    const int c = s->points, p = s->nodes;
    memcpy(s->normal_force, force, c * sizeof(double));
    if (tangential) memcpy(s->tangential, tangential, 2 * c * sizeof(double));
    memcpy(s->vertical, force, c * sizeof(double));
    memcpy(s->horizontal, s->tangential, 2 * c * sizeof(double));
    if (slope) {
        lean(c, slope, force, s->tangential, s->added);
        for (int i = 0; i < c; i++) s->vertical[i] += s->added[i];
        for (int i = 0; i < 2 * c; i++) s->horizontal[i] += s->added[c + i];
    }
    for (int i = 0; i < c; i++) s->change[i] = s->vertical[i] - s->at_rest[i];
    if (s->components == 3) memcpy(s->change + c, s->horizontal, 2 * c * sizeof(double));
    if (s->rest)
        for (int i = 0; i < 2 * c; i++) s->horizontal[i] += s->rest[i];
    sparse down = {p, s->t_begin, s->t_column, s->t_value};
    for (int d = 0; d < s->components; d++) multiply(&down, s->change + d * c, s->nodal + d * p);
    double sum[3] = {0.0, 0.0, 0.0};
    for (int i = 0; i < c; i++) sum[0] += s->horizontal[i], sum[1] += s->horizontal[c + i], sum[2] += s->vertical[i];
    memcpy(s->resultant, sum, sizeof sum);
}

/* place (2, c) = where the points lie in the plane, from the displacements (k,) of the nodes without the forces of the
   step: under those of the last solution. */
void meeting_place(const meeting *s, const double *moved, double *place) {
    const int c = s->points, p = s->nodes;
    sparse up = {c, s->w_begin, s->w_column, s->w_value};
    for (int d = 0; d < 2; d++) multiply(&up, moved + (d + 1) * p, place + d * c);
    for (int i = 0; i < 2 * c; i++) place[i] += s->shift[i];
}

/* After `meeting_conclude`: how far its forces shift the points in the plane: with the nodes or, where there are bristles, with
   their `tips`, on a grid too large to be dense where they touch. */
void meeting_shift(meeting *s, const double *moved, const brush *tips) {
    const int c = s->points, p = s->nodes, size = 3 * p, every = tips && tips->compliance->lift;
    sparse up = {c, s->w_begin, s->w_column, s->w_value};
    if (!every) {
        memset(s->lifted, 0, size * sizeof(double));
        add_columns(2 * p, size, s->answer + p, nonzero(size, s->nodal, s->which, s->value), s->which, s->value, s->lifted + p);
        for (int d = 0; d < 2; d++) multiply(&up, s->lifted + (d + 1) * p, s->shift + d * c);
    }
    if (!tips) return;
    for (int d = 0; d < 2; d++) multiply(&up, moved + (d + 1) * p, s->added + d * c);
    for (int d = 0; d < 2 * c; d += c)
        for (int i = 0; i < c; i++)
            if (every || tips->touched[i]) s->shift[d + i] = tips->moved[d + i] - tips->deflection[d + i] - s->added[d + i];
}
