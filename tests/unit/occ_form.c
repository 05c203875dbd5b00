/* SPDX-License-Identifier: Apache-2.0 */
/* Do the numbers of a part form agree with each other, and with Open CASCADE? */
#include "tests/unit/occ_run.h"

enum { SAMPLES = 16 };

#define CHORD "0.05"
static const double CHORD_MM = 0.05;

/* A file, and how far its own curves, surfaces and mesh may lie apart. */
typedef struct {
    char *path;
    double edge_mm, mesh_mm;
} Subject;

static SegVec3 on_face(const SegPart *part, int32_t face, const SegCoedge *coedge, double t)
{
    SegVec3 uv = seg_curve_evaluate(part, &coedge->pcurve, t, NULL);
    return seg_face_evaluate(part, face, uv.x, uv.y).p;
}

/* The edge's curve and its image on the face are one curve with one parameter; ends are ends. */
static void check_coedge(const SegPart *part, int32_t face, const SegCoedge *coedge,
                         double tolerance)
{
    const SegEdge *edge = &part->edges[coedge->edge];
    for (int k = 0; k <= SAMPLES; k++) {
        double t = coedge->t_first + (coedge->t_last - coedge->t_first) * k / SAMPLES;
        SegVec3 on = on_face(part, face, coedge, t);
        SegVec3 at =
            edge->curve.n_poles ? seg_curve_evaluate(part, &edge->curve, t, NULL) : edge->ends[0];
        test_near(seg_distance(on, at), 0, tolerance, 0);
    }
    g_assert_true(edge->face[0] == face || edge->face[1] == face);
    if (edge->curve.n_poles == 0)
        return;
    test_near(coedge->t_first, edge->t_first, 0, 0);
    test_near(coedge->t_last, edge->t_last, 0, 0);
    for (int k = 0; k < 2; k++) {
        SegVec3 end =
            seg_curve_evaluate(part, &edge->curve, k ? edge->t_last : edge->t_first, NULL);
        test_near(seg_distance(end, edge->ends[k]), 0, 1e-9, 1e-12 * seg_norm(end));
    }
}

/* Each coedge begins where the one before it ends; twice the signed area in (u,v) is returned. */
static double check_loop(const SegPart *part, int32_t face, const SegLoop *loop, double tolerance)
{
    double twice = 0;
    for (int32_t i = 0; i < loop->n_coedges; i++) {
        const SegCoedge *c = &part->coedges[loop->first_coedge + i];
        const SegCoedge *next = &part->coedges[loop->first_coedge + (i + 1) % loop->n_coedges];
        check_coedge(part, face, c, tolerance);
        double from = c->reversed ? c->t_last : c->t_first;
        double to = c->reversed ? c->t_first : c->t_last;
        double start = next->reversed ? next->t_last : next->t_first;
        test_near(seg_distance(on_face(part, face, c, to), on_face(part, face, next, start)), 0,
                  tolerance, 0);
        for (int k = 0; k < SAMPLES; k++) {
            SegVec3 a =
                seg_curve_evaluate(part, &c->pcurve, from + (to - from) * k / SAMPLES, NULL);
            SegVec3 b =
                seg_curve_evaluate(part, &c->pcurve, from + (to - from) * (k + 1) / SAMPLES, NULL);
            twice += a.x * b.y - a.y * b.x;
        }
    }
    return twice;
}

/* Vertices lie on the surface at their (u,v); normals are its; triangles turn with them. */
static void check_mesh(const SegPart *part, int32_t index, double tolerance)
{
    const SegFace *face = &part->faces[index];
    g_assert_cmpint(face->n_triangles, >, 0);
    for (int32_t t = face->first_triangle; t < face->first_triangle + face->n_triangles; t++) {
        const SegTriangle *triangle = &part->triangles[t];
        const SegVertex *v[3];
        for (int k = 0; k < 3; k++) {
            v[k] = &part->vertices[triangle->vertex[k]];
            SegSurfacePoint at = seg_face_evaluate(part, index, v[k]->u, v[k]->v);
            test_near(seg_distance(at.p, v[k]->position), 0, tolerance, 0);
            test_near(seg_norm(v[k]->normal), 1, 1e-9, 0);
            SegVec3 normal = seg_cross(at.pu, at.pv);
            double size = seg_norm(at.pu) * seg_norm(at.pv);
            if (seg_norm(normal) > 1e-6 * size && size > 1e-12)
                test_near(seg_dot(seg_unit(normal), v[k]->normal), face->reversed ? -1 : 1, 1e-9,
                          0);
        }
        SegVec3 turn = seg_cross(seg_sub(v[1]->position, v[0]->position),
                                 seg_sub(v[2]->position, v[0]->position));
        SegVec3 mean = seg_add(v[0]->normal, seg_add(v[1]->normal, v[2]->normal));
        double longest = fmax(seg_distance(v[0]->position, v[1]->position),
                              fmax(seg_distance(v[1]->position, v[2]->position),
                                   seg_distance(v[2]->position, v[0]->position)));
        if (seg_norm(turn) > CHORD_MM * longest) /* a sliver lower than the chord may fold */
            g_assert_cmpfloat(seg_dot(turn, mean), >, 0);
    }
}

static void check_subject(gconstpointer data)
{
    const Subject *subject = data;
    g_autoptr(SegPart) part = occ_read(subject->path, CHORD);
    g_autoptr(GArray) judged = occ_judge(subject->path);
    g_assert_cmpint(part ? part->n_faces : -1, ==, (int)judged->len);
    for (int32_t i = 0; part && i < part->n_faces && i < (int32_t)judged->len; i++) {
        const SegFace *face = &part->faces[i];
        const OccFace *judge = &g_array_index(judged, OccFace, i);
        g_assert_cmpstr(seg_surface_type_name((SegSurfaceType)face->type), ==, judge->type);
        double slack = judge->gap * (judge->box[3] - judge->box[0] + judge->box[4] - judge->box[1] +
                                     judge->box[5] - judge->box[2]);
        test_near(seg_face_area_mm2(part, i), judge->area, slack, 1e-5);
        g_assert_cmpint(face->n_loops, >, 0);
        for (int32_t l = face->first_loop; l < face->first_loop + face->n_loops; l++) {
            const SegLoop *loop = &part->loops[l];
            double twice = check_loop(part, i, loop, subject->edge_mm);
            g_assert_cmpint(loop->outer, ==, l == face->first_loop);
            g_assert_true(loop->outer ? twice > 0 : twice < 0);
        }
        check_mesh(part, i, subject->mesh_mm);
    }
}

/* A closed solid: every edge has two faces, and the mesh encloses the solid's volume. */
static void closed_solids(void)
{
    g_autofree char *path = occ_part("analytic.step");
    g_autoptr(SegPart) part = occ_read(path, "0.01");
    if (!part)
        return;
    for (int32_t i = 0; i < part->n_edges; i++)
        if (part->edges[i].curve.n_poles > 0)
            g_assert_cmpint(part->edges[i].face[1], >=, 0);
    double volume = 0;
    for (int32_t t = 0; t < part->n_triangles; t++) {
        const int32_t *v = part->triangles[t].vertex;
        volume += seg_dot(part->vertices[v[0]].position,
                          seg_cross(part->vertices[v[1]].position, part->vertices[v[2]].position)) /
                  6;
    }
    double exact = 10 * 20 * 30 + G_PI * 25 * 20 + G_PI * 12 * (64 + 24 + 9) / 3 +
                   G_PI * 4 / 3 * 343 + 2 * G_PI * G_PI * 10 * 9 + 5 * (1200 - G_PI * (16 + 6.25));
    test_near(volume, exact, 0, 2e-3);
}

static void deterministic(void)
{
    g_autofree char *path = occ_part("p0_piece.igs");
    const char *argv[] = {"segmill-cad", "read", path, "--chord", "0.05", NULL};
    g_auto(OccRun) a = occ_run(argv), b = occ_run(argv);
    g_assert_cmpint(a.status, ==, 0);
    g_assert_true(g_bytes_equal(a.out, b.out));
}

static void add(void)
{
    static const Subject ours[] = {{"analytic.step", 1e-6, 1e-6},
                                   {"analytic.igs", 2e-5, 2e-5},
                                   {"p0_piece.igs", 1e-4, 1e-4},
                                   {"blade.igs", 1e-4, 1e-4},
                                   {"impeller.igs", 2e-3, 2e-3}};
    static const Subject theirs[] = {{"freeform/rounded_cube.iges", 1e-6, 1e-6},
                                     {"freeform/propeller_blade_root.iges", 1e-3, 1e-3},
                                     {"freeform/wavy_cube.stp", 1e-3, 1e-3},
                                     {"freeform/gmsh_t20.step", 2e-2, 2e-2},
                                     {"freeform/canrec_008.stp", 1e-3, 1e-3},
                                     {"asitus_features/shoulder_04.step", 5e-3, 5e-3},
                                     {"nist/nist_ftc_06_ap203_geom.stp", 2e-2, 2e-2}};
    static Subject all[G_N_ELEMENTS(ours) + G_N_ELEMENTS(theirs)];
    size_t n = 0;
    for (size_t i = 0; i < G_N_ELEMENTS(ours); i++, n++) {
        all[n] = ours[i];
        all[n].path = occ_part(ours[i].path);
    }
    for (size_t i = 0; i < G_N_ELEMENTS(theirs); i++) {
        all[n] = theirs[i];
        all[n].path = test_data(theirs[i].path);
        n += all[n].path != NULL;
    }
    for (size_t i = 0; i < n; i++) {
        g_autofree char *base = g_path_get_basename(all[i].path);
        g_autofree char *name = g_strdup_printf("/occ/form/%s", base);
        g_test_add_data_func(name, &all[i], check_subject);
    }
    g_test_add_func("/occ/form/closed-solids", closed_solids);
    g_test_add_func("/occ/form/deterministic", deterministic);
}

int main(int argc, char **argv)
{
    return test_main(argc, argv, add);
}
