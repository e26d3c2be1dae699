/* Convolution with a tread's kernels, between its transforms (contact/tread/shear.py). */

// for Python
/* moved (3, n) = the tread's spectra times those of forces, given (3, n), z, x, y, complex: even (4, n) zz, xx, xy, yy, and the imaginary
   parts odd (2, n) zx, zy, or 0. */
void convolve(int n, const double *even, const double *odd, const double *given, double *moved);
// end

void convolve(int n, const double *even, const double *odd, const double *given, double *moved) {
    for (int i = 0; i < n; i++) {
        const double zz = even[i], xx = even[n + i], xy = even[2 * n + i], yy = even[3 * n + i];
        const double *z = given + 2 * i, *x = z + 2 * n, *y = x + 2 * n;
        double *u = moved + 2 * i, *v = u + 2 * n, *w = v + 2 * n;
        for (int d = 0; d < 2; d++) u[d] = zz * z[d], v[d] = xx * x[d] + xy * y[d], w[d] = xy * x[d] + yy * y[d];
        if (!odd) continue;
        const double zx = odd[i], zy = odd[n + i];
        u[0] -= zx * x[1] + zy * y[1], u[1] += zx * x[0] + zy * y[0];
        v[0] += zx * z[1], v[1] -= zx * z[0];
        w[0] += zy * z[1], w[1] -= zy * z[0];
    }
}
