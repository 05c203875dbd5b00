/* SPDX-License-Identifier: Apache-2.0 */
/* What is asked of a chunk of points, from their derivatives: normals, curvatures, directions. */
#include "segcore/geom/surface_batch.h"

#include <string.h>

/* Below this sine of the angle between Su and Sv the surface has no normal worth the name. */
static const double LEAST_SINE = 1e-9;

/* How far k_min and k_max are apart, relative to them, where directions begin to mean something;
 * and what rounding leaves of second derivatives that should cancel. */
static const double UMBILIC = 1e-9, ROUNDING = 1e-14;

typedef struct {
    double normal[3][SEG_CHUNK_ROOM];
    double direction_min[3][SEG_CHUNK_ROOM], direction_max[3][SEG_CHUNK_ROOM];
    double gauss[SEG_CHUNK_ROOM], mean[SEG_CHUNK_ROOM], k_min[SEG_CHUNK_ROOM],
        k_max[SEG_CHUNK_ROOM];
    double flags[SEG_CHUNK_ROOM]; /* of the same width as the rest */
} Forms;

static void divide(SegChunk *c, size_t n);
static void fundamental_forms(const SegChunk *c, size_t n, double sign, Forms *f);
static void directions(const SegChunk *c, size_t n, double sign, Forms *f);

static void store(double *const to[3], size_t at, const double *x, const double *y, const double *z,
                  size_t n)
{
    memcpy(to[0] + at, x, n * sizeof(double));
    memcpy(to[1] + at, y, n * sizeof(double));
    memcpy(to[2] + at, z, n * sizeof(double));
}

static void store_derivative(double *const to[3], size_t at, const SegChunk *c, int which, size_t n)
{
    store(to, at, c->d[which][0], c->d[which][1], c->d[which][2], n);
}

static void store_derivatives(const SegChunk *c, size_t n, SegSurfaceBatch *out, size_t at)
{
    if (out->fields & SEG_POSITIONS)
        store_derivative(out->position, at, c, SEG_D, n);
    if (out->fields & SEG_FIRST) {
        store_derivative(out->du, at, c, SEG_DU, n);
        store_derivative(out->dv, at, c, SEG_DV, n);
    }
    if (out->fields & SEG_SECOND) {
        store_derivative(out->duu, at, c, SEG_DUU, n);
        store_derivative(out->duv, at, c, SEG_DUV, n);
        store_derivative(out->dvv, at, c, SEG_DVV, n);
    }
}

void seg_chunk_store(SegChunk *c, size_t n, bool rational, bool reversed, SegSurfaceBatch *out,
                     size_t at)
{
    Forms f;
    size_t whole = seg_whole_strides(n);
    double sign = reversed ? -1 : 1;
    if (rational)
        divide(c, whole);
    store_derivatives(c, n, out, at);
    fundamental_forms(c, whole, sign, &f);
    for (size_t k = 0; k < n; k++)
        out->flags[at + k] = (uint8_t)(int)f.flags[k];
    if (out->fields & SEG_NORMALS)
        store(out->normal, at, f.normal[0], f.normal[1], f.normal[2], n);
    if (out->fields & SEG_CURVATURES) {
        memcpy(out->gauss + at, f.gauss, n * sizeof(double));
        memcpy(out->mean + at, f.mean, n * sizeof(double));
        memcpy(out->k_min + at, f.k_min, n * sizeof(double));
        memcpy(out->k_max + at, f.k_max, n * sizeof(double));
    }
    if (out->fields & SEG_DIRECTIONS) {
        directions(c, whole, sign, &f);
        store(out->direction_min, at, f.direction_min[0], f.direction_min[1], f.direction_min[2],
              n);
        store(out->direction_max, at, f.direction_max[0], f.direction_max[1], f.direction_max[2],
              n);
    }
}

/* A4.4 written out for two orders: A = wS, so S_u = (A_u - w_u S)/w and so on. */
SEG_VECTOR_CLONES
static void divide(SegChunk *c, size_t n)
{
    for (int x = 0; x < 3; x++) {
#pragma omp simd
        for (size_t k = 0; k < n; k++) {
            double r = 1 / c->d[SEG_D][3][k], wu = c->d[SEG_DU][3][k], wv = c->d[SEG_DV][3][k];
            double s = c->d[SEG_D][x][k] * r;
            double su = (c->d[SEG_DU][x][k] - wu * s) * r;
            double sv = (c->d[SEG_DV][x][k] - wv * s) * r;
            double uu = c->d[SEG_DUU][x][k] - 2 * wu * su - c->d[SEG_DUU][3][k] * s;
            double uv = c->d[SEG_DUV][x][k] - wv * su - wu * sv - c->d[SEG_DUV][3][k] * s;
            double vv = c->d[SEG_DVV][x][k] - 2 * wv * sv - c->d[SEG_DVV][3][k] * s;
            c->d[SEG_D][x][k] = s;
            c->d[SEG_DU][x][k] = su;
            c->d[SEG_DV][x][k] = sv;
            c->d[SEG_DUU][x][k] = uu * r;
            c->d[SEG_DUV][x][k] = uv * r;
            c->d[SEG_DVV][x][k] = vv * r;
        }
    }
}

static inline double size(const SegChunk *c, int which, size_t k)
{
    return fabs(c->d[which][0][k]) + fabs(c->d[which][1][k]) + fabs(c->d[which][2][k]);
}

/*
 * The second fundamental form in the orthonormal basis e1 along Su, e2 = n × e1 of the tangent
 * plane is a symmetric matrix of entries a, b, c, whose eigenvalues are the principal curvatures:
 * H² - K, which cancels where they are nearly equal, never appears. Leaves the eigenvector of k_max
 * in e1, e2 for directions().
 */
SEG_VECTOR_CLONES
static void fundamental_forms(const SegChunk *s, size_t count, double sign, Forms *out)
{
#pragma omp simd
    for (size_t k = 0; k < count; k++) {
        double xu = s->d[SEG_DU][0][k], yu = s->d[SEG_DU][1][k], zu = s->d[SEG_DU][2][k];
        double xv = s->d[SEG_DV][0][k], yv = s->d[SEG_DV][1][k], zv = s->d[SEG_DV][2][k];
        double e = xu * xu + yu * yu + zu * zu, f = xu * xv + yu * yv + zu * zv;
        double g = xv * xv + yv * yv + zv * zv;
        double x = yu * zv - zu * yv, y = zu * xv - xu * zv, z = xu * yv - yu * xv;
        double j2 = x * x + y * y + z * z; /* EG - F² without its cancellation */
        double noise_u = s->noise[SEG_NOISE_U][k], noise_v = s->noise[SEG_NOISE_V][k];
        bool good = j2 > LEAST_SINE * LEAST_SINE * e * g && j2 <= DBL_MAX &&
                    e > noise_u * noise_u && g > noise_v * noise_v;
        double r = good ? 1 / sqrt(j2) : 0, e1 = good ? 1 / e : 0, e2 = e * r * r;
        x *= sign * r, y *= sign * r, z *= sign * r;
        double l = x * s->d[SEG_DUU][0][k] + y * s->d[SEG_DUU][1][k] + z * s->d[SEG_DUU][2][k];
        double m = x * s->d[SEG_DUV][0][k] + y * s->d[SEG_DUV][1][k] + z * s->d[SEG_DUV][2][k];
        double n = x * s->d[SEG_DVV][0][k] + y * s->d[SEG_DVV][1][k] + z * s->d[SEG_DVV][2][k];
        double q = f * e1;
        double a = l * e1, b = (m - q * l) * r, c = (n - 2 * q * m + q * q * l) * e2;
        double mean = 0.5 * (a + c), half = 0.5 * (a - c), root = sqrt(half * half + b * b);
        bool finite = good && fabs(mean) + root <= DBL_MAX;
        double noise = (s->noise[SEG_NOISE_UU][k] + ROUNDING * size(s, SEG_DUU, k)) * e1 +
                       (s->noise[SEG_NOISE_VV][k] + ROUNDING * size(s, SEG_DVV, k)) * e2;
        bool equal = root <= UMBILIC * fabs(mean) + noise;
        out->flags[k] = !finite ? SEG_POINT_DEGENERATE : equal ? SEG_POINT_UMBILIC : 0;
        out->normal[0][k] = finite ? x : 0;
        out->normal[1][k] = finite ? y : 0;
        out->normal[2][k] = finite ? z : 0;
        out->mean[k] = finite ? mean : 0;
        out->gauss[k] = finite ? a * c - b * b : 0;
        out->k_min[k] = finite ? mean - root : 0;
        out->k_max[k] = finite ? mean + root : 0;
        double t = root + fabs(half);
        out->direction_max[0][k] = equal ? 1 : half >= 0 ? t : b;
        out->direction_max[1][k] = equal ? 0 : half >= 0 ? b : t;
    }
}

SEG_VECTOR_CLONES
static void directions(const SegChunk *s, size_t count, double sign, Forms *out)
{
#pragma omp simd
    for (size_t k = 0; k < count; k++) {
        double xu = s->d[SEG_DU][0][k], yu = s->d[SEG_DU][1][k], zu = s->d[SEG_DU][2][k];
        double e = xu * xu + yu * yu + zu * zu;
        double r = out->flags[k] != SEG_POINT_DEGENERATE ? 1 / sqrt(e) : 0;
        double x1 = xu * r, y1 = yu * r, z1 = zu * r;
        double nx = sign * out->normal[0][k], ny = sign * out->normal[1][k];
        double nz = sign * out->normal[2][k];
        double x2 = ny * z1 - nz * y1, y2 = nz * x1 - nx * z1, z2 = nx * y1 - ny * x1;
        double p = out->direction_max[0][k], q = out->direction_max[1][k];
        double unit = 1 / sqrt(p * p + q * q);
        p *= unit, q *= unit;
        out->direction_max[0][k] = p * x1 + q * x2;
        out->direction_max[1][k] = p * y1 + q * y2;
        out->direction_max[2][k] = p * z1 + q * z2;
        out->direction_min[0][k] = p * x2 - q * x1;
        out->direction_min[1][k] = p * y2 - q * y1;
        out->direction_min[2][k] = p * z2 - q * z1;
    }
}

double seg_largest_coordinate(const double *reals, const SegSurface *surface)
{
    const double *poles = seg_surface_tables(reals, surface).poles;
    double largest = 0;
    for (ptrdiff_t i = 0; i < 3 * (ptrdiff_t)surface->n_u * surface->n_v; i++)
        largest = fmax(largest, fabs(poles[i]));
    return largest;
}

/* ------------------------------------------------------------------ batches */

static void place(double *to[3], double **next, size_t n)
{
    for (int i = 0; i < 3; i++, *next += n)
        to[i] = *next;
}

SegSurfaceBatch *seg_surface_batch_new(size_t n, unsigned fields)
{
    static const unsigned arrays_of[] = {3, 6, 9, 3, 4, 6};
    size_t arrays = 0;
    for (unsigned i = 0; i < G_N_ELEMENTS(arrays_of); i++)
        arrays += fields & (1u << i) ? arrays_of[i] : 0;
    SegSurfaceBatch *b = g_new0(SegSurfaceBatch, 1);
    b->n = n;
    b->fields = fields;
    b->flags = g_new0(uint8_t, n);
    b->storage = g_malloc0_n(n, arrays * sizeof(double));
    double *next = b->storage;
    if (fields & SEG_POSITIONS)
        place(b->position, &next, n);
    if (fields & SEG_FIRST)
        place(b->du, &next, n), place(b->dv, &next, n);
    if (fields & SEG_SECOND)
        place(b->duu, &next, n), place(b->duv, &next, n), place(b->dvv, &next, n);
    if (fields & SEG_NORMALS)
        place(b->normal, &next, n);
    if (fields & SEG_CURVATURES) {
        b->gauss = next, b->mean = next + n, b->k_min = next + 2 * n, b->k_max = next + 3 * n;
        next += 4 * n;
    }
    if (fields & SEG_DIRECTIONS)
        place(b->direction_min, &next, n), place(b->direction_max, &next, n);
    return b;
}

void seg_surface_batch_free(SegSurfaceBatch *batch)
{
    if (!batch)
        return;
    g_free(batch->storage);
    g_free(batch->flags);
    g_free(batch);
}
