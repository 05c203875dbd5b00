/* SPDX-License-Identifier: Apache-2.0 */
/*
 * Batches of surface points against Open CASCADE's GeomLProp_SLProps (tests/judges/occ_surface) on
 * the B-spline surfaces of real files: equal within 1e-9, absolute plus relative, away from
 * degenerate points. There the sine of the angle between Su and Sv is small, and the condition of
 * everything behind the normal with it.
 */
#include <float.h>
#include <math.h>

#include "segcore/geom/bspline.h"
#include "tests/lib/surface_judge.h"
#include "tests/lib/test.h"
#include "tests/lib/waves.h"

enum { POINTS = 25, MOST_FACES = 150 };

static const double TOLERANCE = 1e-9, LEAST_SINE = 1e-3;

typedef struct {
    double position, derivative, normal, curvature, direction;
    size_t compared, degenerate, umbilic;
} Worst;

static SegVec3 at(double *const from[3], size_t i)
{
    return seg_vec3(from[0][i], from[1][i], from[2][i]);
}

/* `terms` is how large what was summed is: both sides lose its last digits. */
static double off(SegVec3 ours, SegVec3 theirs, double terms)
{
    double lost = 16 * DBL_EPSILON * terms;
    return fmax(seg_distance(ours, theirs) - lost, 0) / (1 + seg_norm(theirs));
}

/* The largest coordinate of the poles times the sums of |N|, |N'| and |N''| in u and in v. */
typedef struct {
    double u, v, uu, uv, vv;
} Terms;

static Terms terms_at(const SegPart *part, int32_t face, double u, double v)
{
    const SegSurface *s = &part->faces[face].surface;
    SegSurfaceTables t = seg_surface_tables(part->reals, s);
    double basis[3][SEG_MAX_DEGREE + 1], sum[2][3] = {{0}}, largest = 0;
    for (int i = 0; i < 3 * s->n_u * s->n_v; i++)
        largest = fmax(largest, fabs(t.poles[i]));
    seg_basis(t.knots_u, s->degree_u, seg_knot_span(t.knots_u, s->degree_u, s->n_u, u), u, 2,
              basis);
    for (int o = 0; o < 3; o++)
        for (int i = 0; i <= s->degree_u; i++)
            sum[0][o] += fabs(basis[o][i]);
    seg_basis(t.knots_v, s->degree_v, seg_knot_span(t.knots_v, s->degree_v, s->n_v, v), v, 2,
              basis);
    for (int o = 0; o < 3; o++)
        for (int i = 0; i <= s->degree_v; i++)
            sum[1][o] += fabs(basis[o][i]);
    return (Terms){largest * sum[0][1], largest * sum[1][1], largest * sum[0][2],
                   largest * sum[0][1] * sum[1][1], largest * sum[1][2]};
}

/* How much larger than the curvatures themselves the numbers are that they are made from: the part
 * of second derivatives that lies in the tangent plane cancels. */
static double curvature_scale(const JudgedPoint *j)
{
    double sine = seg_norm(seg_cross(j->du, j->dv)) / (seg_norm(j->du) * seg_norm(j->dv));
    double e = seg_dot(j->du, j->du), g = seg_dot(j->dv, j->dv);
    return (seg_norm(j->duu) / e + seg_norm(j->duv) / sqrt(e * g) + seg_norm(j->dvv) / g) /
           (sine * sine);
}

static void compare_directions(const SegSurfaceBatch *b, size_t i, const JudgedPoint *j,
                               double scale, Worst *w)
{
    double apart = j->k_max - j->k_min;
    if (b->flags[i] & SEG_POINT_UMBILIC || isnan(j->direction_max.x) || apart < 1e-6 * scale) {
        w->umbilic++;
        return;
    }
    /* Directions turn by what is wrong in the curvatures over their distance. */
    double turn = seg_norm(seg_cross(at(b->direction_max, i), j->direction_max));
    double turn_min = seg_norm(seg_cross(at(b->direction_min, i), j->direction_min));
    w->direction = fmax(w->direction, fmax(turn, turn_min) * apart / scale);
}

static void compare(const SegSurfaceBatch *b, size_t i, const JudgedPoint *j, Terms terms, Worst *w)
{
    w->position = fmax(w->position, off(at(b->position, i), j->p, 0));
    w->derivative = fmax(w->derivative, off(at(b->du, i), j->du, terms.u));
    w->derivative = fmax(w->derivative, off(at(b->dv, i), j->dv, terms.v));
    w->derivative = fmax(w->derivative, off(at(b->duu, i), j->duu, terms.uu));
    w->derivative = fmax(w->derivative, off(at(b->duv, i), j->duv, terms.uv));
    w->derivative = fmax(w->derivative, off(at(b->dvv, i), j->dvv, terms.vv));
    double sine = seg_norm(seg_cross(j->du, j->dv)) / (seg_norm(j->du) * seg_norm(j->dv));
    if (!(sine > LEAST_SINE) || isnan(j->normal.x)) {
        w->degenerate++;
        return;
    }
    g_assert_false(b->flags[i] & SEG_POINT_DEGENERATE);
    w->normal = fmax(w->normal, off(at(b->normal, i), j->normal, 0));
    double scale = 1 + curvature_scale(j);
    w->curvature = fmax(w->curvature, fabs(b->mean[i] - j->mean) / scale);
    w->curvature = fmax(w->curvature, fabs(b->k_min[i] - fmin(j->k_min, j->k_max)) / scale);
    w->curvature = fmax(w->curvature, fabs(b->k_max[i] - fmax(j->k_min, j->k_max)) / scale);
    w->curvature = fmax(w->curvature, fabs(b->gauss[i] - j->gauss) / (scale * scale));
    compare_directions(b, i, j, scale, w);
    w->compared++;
}

/* Asks about a grid of points of each face; both evaluations of ours answer. */
static void judge_part(SegPart *part, GRand *random, Worst *worst)
{
    g_autoptr(GByteArray) question = g_byte_array_new();
    int32_t faces = MIN(part->n_faces, MOST_FACES);
    double(*u)[POINTS] = g_malloc_n((size_t)faces, sizeof *u);
    double(*v)[POINTS] = g_malloc_n((size_t)faces, sizeof *v);
    for (int32_t f = 0; f < faces; f++) {
        double u0, u1, v0, v1;
        seg_face_domain(part, f, &u0, &u1, &v0, &v1);
        for (int i = 0; i < POINTS; i++) {
            u[f][i] = g_rand_double_range(random, u0, u1);
            v[f][i] = g_rand_double_range(random, v0, v1);
        }
        surface_judge_ask(question, part->reals, &part->faces[f].surface, u[f], v[f], POINTS);
    }
    g_autoptr(GBytes) answer = surface_judge_answer(question);
    g_assert_nonnull(answer);
    size_t expected = (size_t)faces * POINTS * sizeof(JudgedPoint);
    g_assert_cmpuint(answer ? g_bytes_get_size(answer) : 0, ==, expected);
    const JudgedPoint *judged =
        answer && g_bytes_get_size(answer) == expected ? g_bytes_get_data(answer, NULL) : NULL;
    g_autoptr(SegSurfaceBatch) b = seg_surface_batch_new(POINTS, SEG_ALL_FIELDS);
    g_autoptr(SegSurfaceBatch) line = seg_surface_batch_new(POINTS * POINTS, SEG_ALL_FIELDS);
    for (int32_t f = 0; judged && f < faces; f++) {
        /* The judge knows nothing of a face's orientation. */
        bool reversed = part->faces[f].reversed;
        seg_face_points(part, f, u[f], v[f], POINTS, b);
        seg_face_grid(part, f, u[f], POINTS, v[f], POINTS, line);
        for (size_t i = 0; i < POINTS; i++) {
            JudgedPoint j = judged[(size_t)f * POINTS + i];
            Terms terms = terms_at(part, f, u[f][i], v[f][i]);
            if (reversed) {
                double k = j.k_min;
                SegVec3 d = j.direction_min;
                j.normal = seg_scale(j.normal, -1);
                j.mean = -j.mean, j.k_min = -j.k_max, j.k_max = -k;
                j.direction_min = j.direction_max, j.direction_max = d;
            }
            compare(b, i, &j, terms, worst);
            compare(line, i * POINTS + i, &j, terms, worst);
        }
    }
    g_free(u);
    g_free(v);
}

static void report(const char *of, const Worst *w)
{
    g_test_message("%s: %zu points compared, %zu nearly degenerate, %zu umbilic: positions %.2g, "
                   "derivatives %.2g, normals %.2g, curvatures %.2g, directions %.2g",
                   of, w->compared, w->degenerate, w->umbilic, w->position, w->derivative,
                   w->normal, w->curvature, w->direction);
    g_assert_cmpuint(w->compared, >, 0);
    g_assert_cmpfloat(w->position, <, TOLERANCE);
    g_assert_cmpfloat(w->derivative, <, TOLERANCE);
    g_assert_cmpfloat(w->normal, <, TOLERANCE);
    g_assert_cmpfloat(w->curvature, <, TOLERANCE);
    g_assert_cmpfloat(w->direction, <, TOLERANCE);
}

static void judge_files(const void *folder)
{
    static const char *const suffixes[] = {".igs", ".iges", ".IGS", ".stp", ".step", ".STEP", NULL};
    g_autoptr(GPtrArray) files = test_data_files(folder, suffixes);
    int wanted = (int)files->len / (g_str_has_prefix(folder, "mf") ? 20 : 1);
    guint step = MAX(files->len / (guint)MAX(test_trials(wanted), 1), 1);
    g_autofree char *helper = test_program("segmill-cad");
    SegLoadOptions options = SEG_LOAD_DEFAULTS;
    options.helper = helper;
    options.chord_mm = 1; /* triangles are not what is judged here */
    GRand *random = g_rand_new_with_seed(20261122);
    Worst worst = {0};
    for (guint i = 0; i < files->len; i += step) {
        g_autoptr(SegPart) part = seg_part_load(files->pdata[i], &options, NULL);
        if (part && part->n_faces > 0)
            judge_part(part, random, &worst);
    }
    g_rand_free(random);
    if (files->len > 0)
        report(folder, &worst);
}

static void judge_waves(void)
{
    GRand *random = g_rand_new_with_seed(20261123);
    Worst worst = {0};
    for (int degree = 1; degree <= 8; degree++)
        for (int rational = 0; rational < 2; rational++) {
            g_autoptr(SegPart) part = waves_part(degree, degree + 12, rational);
            judge_part(part, random, &worst);
        }
    g_rand_free(random);
    report("waves", &worst);
}

static void add(void)
{
    static const char *const folders[] = {"asitus_features", "freeform", "mfcad",
                                          "mfcadpp",         "mftrcad",  "nist"};
    g_test_add_func("/segcore/surface_judge/waves", judge_waves);
    for (size_t i = 0; i < G_N_ELEMENTS(folders); i++) {
        g_autofree char *path = g_strconcat("/segcore/surface_judge/", folders[i], NULL);
        g_test_add_data_func(path, folders[i], judge_files);
    }
}

int main(int argc, char **argv)
{
    return test_main(argc, argv, add);
}
