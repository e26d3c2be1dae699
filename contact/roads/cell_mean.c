/* The road under the contact points (contact/roads/cell_mean.py has the equations): means over rectangles at fixed
   positions, and what lies between the positions. All that is known at a position is computed by loops over the lines,
   so its bits do not depend on which positions are computed with it. */
#include "products.h"

// for Python
typedef struct {
    int lines, strips;                    /* lines along the road, strips across each */
    int reach;                            /* positions before and after one that are in its means */
    const int *column;                    /* (strips, lines) the strip's column among the heights */
    const double *across;                 /* (4, strips, lines): weights of WIDTHS means and slopes across */
    const double *along;                  /* (2, 2 reach + 1, lines): weights of both WIDTHS */
    const int *line;                      /* (c,) the line of each point */
    double step;                          /* m between positions */
} rectangles;

void sum_across(const rectangles *s, int positions, int columns, const double *height, double *sums);
void mean_along(const rectangles *s, int positions, const double *sums, double *means);
void heights_at(const rectangles *s, int count, int points, const double *x, long first, const double *means,
                double *height);
void slopes_at(const rectangles *s, int count, int points, const double *x, long first, const double *means,
               double *slope);
// end

enum { WIDTHS = 2 };                      /* one width of the rectangle, and two */

/* sums (positions, 4, lines), means and slopes across of both widths, from heights (positions, columns) m. */
void sum_across(const rectangles *s, int positions, int columns, const double *height, double *sums) {
    const int r = s->lines, each = s->strips * r;
    memset(sums, 0, sizeof(double) * positions * 2 * WIDTHS * r);
    for (int i = 0; i < positions; i++, height += columns, sums += 2 * WIDTHS * r)
        for (int k = 0; k < s->strips; k++) {
            const int *column = s->column + k * r;
            const double *weight = s->across + k * r;
            for (int l = 0; l < r; l++) {
                const double z = height[column[l]];
                for (int q = 0; q < 2 * WIDTHS; q++) sums[q * r + l] += weight[q * each + l] * z;
            }
        }
}

/* means (positions, 2, lines), smoothed heights (m) and slopes across, from sums (positions + 2 reach, 4, lines). */
void mean_along(const rectangles *s, int positions, const double *sums, double *means) {
    const int r = s->lines, length = 2 * s->reach + 1;
    memset(means, 0, sizeof(double) * positions * 2 * r);
    for (int i = 0; i < positions; i++, means += 2 * r)
        for (int k = 0; k < length; k++)
            for (int w = 0; w < WIDTHS; w++) {
                const double *restrict part = sums + ((i + k) * WIDTHS + w) * 2 * r;
                const double *restrict weight = s->along + (w * length + k) * r;
                double *restrict mean = means, *restrict slope = means + r;
                for (int l = 0; l < r; l++) mean[l] += weight[l] * part[l], slope[l] += weight[l] * part[r + l];
            }
}

/* Heights (count, points) m at x (count, points) m, cubic between the positions, of which `means` begin at `first`. */
void heights_at(const rectangles *s, int count, int points, const double *x, long first, const double *means,
                double *height) {
    const int r = s->lines;
    for (int i = 0; i < count; i++, x += points, height += points)
        for (int p = 0; p < points; p++) {
            const double place = x[p] / s->step, before = floor(place), t = place - before;
            const double *m = means + ((int)(before - first) - 1) * 2 * r + s->line[p];
            height[p] = t * (t * (2.0 - t) - 1.0) / 2.0 * m[0] + (t * t * (3.0 * t - 5.0) + 2.0) / 2.0 * m[2 * r]
                        + t * (t * (4.0 - 3.0 * t) + 1.0) / 2.0 * m[4 * r] + t * t * (t - 1.0) / 2.0 * m[6 * r];
        }
}

/* Slopes (count, points, 2) there: along, the derivative of the cubic; across, linear between the positions. */
void slopes_at(const rectangles *s, int count, int points, const double *x, long first, const double *means,
               double *slope) {
    const int r = s->lines;
    for (int i = 0; i < count; i++, x += points, slope += 2 * points)
        for (int p = 0; p < points; p++) {
            const double place = x[p] / s->step, before = floor(place), t = place - before;
            const double *m = means + ((int)(before - first) - 1) * 2 * r + s->line[p];
            const double sum = (t * (4.0 - 3.0 * t) - 1.0) * m[0] + t * (9.0 * t - 10.0) * m[2 * r]
                               + (t * (8.0 - 9.0 * t) + 1.0) * m[4 * r] + t * (3.0 * t - 2.0) * m[6 * r];
            slope[2 * p] = 0.5 * sum / s->step;
            slope[2 * p + 1] = m[3 * r] + t * (m[5 * r] - m[3 * r]);
        }
}
