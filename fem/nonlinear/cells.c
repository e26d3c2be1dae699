// Element tensors of chosen cells, by the compiled kernels of a form.

#include <stddef.h>
#include <stdint.h>
#include <string.h>

// for Python
typedef struct {
    int cells, size, width, own, points, facets; // lengths: of the tensor, the coefficients, the motion's part of
                                                 // them and the coordinates of a cell; facets of all cells
    const int *slot;                             // (own) places of the cell's motion among its coefficients
    const int *place;                            // (cells, own) its values in the motion; -1: held, 0
    double *coefficients;                        // (cells, width), the motion's part overwritten
    const double *coordinates;                   // (cells, points) m
    const double *constants;
    const int *facet;                            // (facets, 2) cell and its local facet
    void *cell_kernel, *facet_kernel;            // of UFCx; 0: none
} forms;
void element_tensors(const forms *form, const double *motion, double *out);
void summed_forces(const forms *form, const double *motion, const double *weights, double *work, double *out);
// end

// The last argument is one of later releases of UFCx only; those before do not look at it.
typedef void kernel(double *, const double *, const double *, const double *, const int *, const uint8_t *, void *);

// out (cells, size): the tensors at a motion.
void element_tensors(const forms *form, const double *motion, double *out) {
    const forms f = *form;
    kernel *cell = (kernel *)f.cell_kernel, *facet = (kernel *)f.facet_kernel;
    memset(out, 0, sizeof(double) * (size_t)f.cells * f.size);
    for (int c = 0; c < f.cells; c++) {
        double *w = f.coefficients + (size_t)c * f.width;
        for (int i = 0; i < f.own; i++) {
            const int place = f.place[(size_t)c * f.own + i];
            w[f.slot[i]] = place < 0 ? 0.0 : motion[place];
        }
        if (cell)
            cell(out + (size_t)c * f.size, w, f.constants, f.coordinates + (size_t)c * f.points, NULL, NULL, NULL);
    }
    for (int k = 0; facet && k < f.facets; k++) {
        const int c = f.facet[2 * k], side = f.facet[2 * k + 1];
        const uint8_t turned = 0;
        facet(out + (size_t)c * f.size, f.coefficients + (size_t)c * f.width, f.constants,
              f.coordinates + (size_t)c * f.points, &side, &turned, NULL);
    }
}

// out += the forces of the cells at their nodes, times their weights (cells); work (cells, size).
void summed_forces(const forms *form, const double *motion, const double *weights, double *work, double *out) {
    const forms f = *form;
    element_tensors(form, motion, work);
    for (int c = 0; c < f.cells; c++)
        for (int i = 0; i < f.own; i++) {
            const int place = f.place[(size_t)c * f.own + i];
            if (place >= 0) out[place] += weights[c] * work[(size_t)c * f.size + i];
        }
}
