/* Products that read only the columns of nonzero coefficients. Matrices are stored by columns: column k of n
   numbers begins at k n. Sums are in the order of the columns, so a run that is taken up again has the same bits. */
#include <math.h>
#include <stdint.h>
#include <stdlib.h>
#include <string.h>

/* y (n) += sum_k coefficient[k] column[which[k]] (n), of columns `lead` apart, four at a time: y is read and written once
   for them. */
static void add_columns(int64_t n, int64_t lead, const double *columns, int count, const int *which, const double *coefficient,
                        double *restrict y) {
    int k = 0;
    for (; k + 4 <= count; k += 4) {
        const double *restrict a = columns + which[k] * lead, *restrict b = columns + which[k + 1] * lead;
        const double *restrict c = columns + which[k + 2] * lead, *restrict d = columns + which[k + 3] * lead;
        const double ca = coefficient[k], cb = coefficient[k + 1], cc = coefficient[k + 2], cd = coefficient[k + 3];
        for (int64_t i = 0; i < n; i++) y[i] += ca * a[i] + cb * b[i] + cc * c[i] + cd * d[i];
    }
    for (; k < count; k++) {
        const double *restrict a = columns + which[k] * lead;
        const double ca = coefficient[k];
        for (int64_t i = 0; i < n; i++) y[i] += ca * a[i];
    }
}

/* The nonzero numbers of x (n): their places and values; returns how many. */
static int nonzero(int n, const double *x, int *which, double *value) {
    int count = 0;
    for (int i = 0; i < n; i++)
        if (x[i] != 0.0) which[count] = i, value[count++] = x[i];
    return count;
}

static double dot(int n, const double *restrict a, const double *restrict b) {
    double sum = 0.0;
    for (int i = 0; i < n; i++) sum += a[i] * b[i];
    return sum;
}

static double largest(int n, const double *x) {
    double most = 0.0;
    for (int i = 0; i < n; i++) most = fmax(most, fabs(x[i]));
    return most;
}

/* A sparse matrix of `rows` rows in compressed rows: those of row i are at begin[i] to begin[i + 1]. */
typedef struct {
    int rows;
    const int *begin, *column;
    const double *value;
} sparse;

/* y = A x */
static void multiply(const sparse *a, const double *x, double *restrict y) {
    for (int i = 0; i < a->rows; i++) {
        double sum = 0.0;
        for (int k = a->begin[i]; k < a->begin[i + 1]; k++) sum += a->value[k] * x[a->column[k]];
        y[i] = sum;
    }
}
