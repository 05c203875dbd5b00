/* SPDX-License-Identifier: Apache-2.0 */
#include "tests/lib/form.h"

#include <string.h>

Form *form_new(void)
{
    Form *form = g_new0(Form, 1);
    form->faces = g_array_new(FALSE, FALSE, sizeof(SegFace));
    form->loops = g_array_new(FALSE, FALSE, sizeof(SegLoop));
    form->coedges = g_array_new(FALSE, FALSE, sizeof(SegCoedge));
    form->edges = g_array_new(FALSE, FALSE, sizeof(SegEdge));
    form->iges_curves = g_array_new(FALSE, FALSE, sizeof(SegIgesEntity));
    form->vertices = g_array_new(FALSE, FALSE, sizeof(SegVertex));
    form->triangles = g_array_new(FALSE, FALSE, sizeof(SegTriangle));
    form->reals = g_array_new(FALSE, FALSE, sizeof(double));
    return form;
}

void form_free(Form *form)
{
    GArray *tables[] = {form->faces,       form->loops,    form->coedges,   form->edges,
                        form->iges_curves, form->vertices, form->triangles, form->reals};
    for (size_t i = 0; i < G_N_ELEMENTS(tables); i++)
        g_array_unref(tables[i]);
    g_free(form);
}

SegCurve form_curve(Form *form, int degree, int n, int dim, const double *knots,
                    const double *poles, const double *weights)
{
    SegCurve curve = {form->reals->len, degree, n, dim, weights != NULL};
    g_array_append_vals(form->reals, knots, (guint)(n + degree + 1));
    g_array_append_vals(form->reals, poles, (guint)(n * dim));
    if (weights)
        g_array_append_vals(form->reals, weights, (guint)n);
    return curve;
}

SegSurface form_surface(Form *form, int degree_u, int n_u, int degree_v, int n_v,
                        const double *knots_u, const double *knots_v, const double *poles,
                        const double *weights)
{
    SegSurface surface = {form->reals->len, degree_u, degree_v, n_u, n_v, weights != NULL, 0};
    g_array_append_vals(form->reals, knots_u, (guint)(n_u + degree_u + 1));
    g_array_append_vals(form->reals, knots_v, (guint)(n_v + degree_v + 1));
    g_array_append_vals(form->reals, poles, (guint)(3 * n_u * n_v));
    if (weights)
        g_array_append_vals(form->reals, weights, (guint)(n_u * n_v));
    return surface;
}

/* ------------------------------------------------------------------ a whole surface */

/* The row of poles of side 0 (v lowest), 1 (u highest), 2 (v highest) or 3 (u lowest). */
static void side_poles(const Form *form, const SegSurface *s, int side, double *poles,
                       double *weights)
{
    const double *reals = (const double *)(const void *)form->reals->data + s->data;
    const double *all = reals + s->n_u + s->degree_u + 1 + s->n_v + s->degree_v + 1;
    int n = side % 2 ? s->n_v : s->n_u;
    for (int i = 0; i < n; i++) {
        int at_u = side % 2 ? (side == 1 ? s->n_u - 1 : 0) : i;
        int at_v = side % 2 ? i : (side == 2 ? s->n_v - 1 : 0);
        int k = at_u * s->n_v + at_v;
        memcpy(poles + 3 * i, all + 3 * k, 3 * sizeof *poles);
        weights[i] = s->rational ? all[3 * s->n_u * s->n_v + k] : 1;
    }
}

static void add_side(Form *form, const SegSurface *s, int side, const double domain[4])
{
    int32_t face = (int32_t)form->faces->len;
    int n = side % 2 ? s->n_v : s->n_u, degree = side % 2 ? s->degree_v : s->degree_u;
    g_autofree double *poles = g_new(double, 3 * n), *weights = g_new(double, n),
                      *knots = g_new(double, n + degree + 1);
    side_poles(form, s, side, poles, weights);
    memcpy(knots,
           (double *)(void *)form->reals->data + s->data +
               (side % 2 ? s->n_u + s->degree_u + 1 : 0),
           (size_t)(n + degree + 1) * sizeof *knots);
    double t0 = side % 2 ? domain[2] : domain[0], t1 = side % 2 ? domain[3] : domain[1];
    double fixed = side == 0   ? domain[2]
                   : side == 1 ? domain[1]
                   : side == 2 ? domain[3]
                               : domain[0];

    SegEdge edge = {.t_first = t0, .t_last = t1, .face = {face, -1}};
    edge.curve = form_curve(form, degree, n, 3, knots, poles, s->rational ? weights : NULL);
    memcpy(&edge.ends[0], poles, sizeof edge.ends[0]);
    memcpy(&edge.ends[1], poles + 3 * (n - 1), sizeof edge.ends[1]);
    const double line_knots[4] = {t0, t0, t1, t1};
    const double along_u[4] = {t0, fixed, t1, fixed}, along_v[4] = {fixed, t0, fixed, t1};
    SegCoedge coedge = {
        .t_first = t0, .t_last = t1, .edge = (int32_t)form->edges->len, .reversed = side >= 2};
    coedge.pcurve = form_curve(form, 1, 2, 2, line_knots, side % 2 ? along_v : along_u, NULL);
    g_array_append_val(form->edges, edge);
    g_array_append_val(form->coedges, coedge);
}

static void add_corners(Form *form, const SegSurface *s, const double domain[4])
{
    int32_t face = (int32_t)form->faces->len, first = (int32_t)form->vertices->len;
    const double *reals = (const double *)(const void *)form->reals->data + s->data;
    const double *poles = reals + s->n_u + s->degree_u + 1 + s->n_v + s->degree_v + 1;
    for (int i = 0; i < 4; i++) {
        int at_u = i == 1 || i == 2 ? s->n_u - 1 : 0, at_v = i >= 2 ? s->n_v - 1 : 0;
        SegVertex vertex = {.u = domain[at_u > 0], .v = domain[2 + (at_v > 0)]};
        memcpy(&vertex.position, poles + 3 * (at_u * s->n_v + at_v), sizeof vertex.position);
        g_array_append_val(form->vertices, vertex);
    }
    const SegTriangle triangles[2] = {{{first, first + 1, first + 2}, face},
                                      {{first, first + 2, first + 3}, face}};
    g_array_append_vals(form->triangles, triangles, 2);
}

void form_patch(Form *form, SegSurfaceType type, SegSurface surface)
{
    const double *reals = (const double *)(const void *)form->reals->data + surface.data;
    const double *knots_v = reals + surface.n_u + surface.degree_u + 1;
    const double domain[4] = {reals[surface.degree_u], reals[surface.n_u],
                              knots_v[surface.degree_v], knots_v[surface.n_v]};
    SegFace face = {.surface = surface,
                    .axis = {0, 0, 1},
                    .x_axis = {1, 0, 0},
                    .radius_mm = 5,
                    .minor_radius_mm = 1,
                    .type = (int32_t)type,
                    .first_loop = (int32_t)form->loops->len,
                    .n_loops = 1,
                    .first_triangle = (int32_t)form->triangles->len,
                    .n_triangles = 2};
    SegLoop loop = {(int32_t)form->coedges->len, 4, 1, 0};
    for (int side = 0; side < 4; side++)
        add_side(form, &surface, side, domain);
    add_corners(form, &surface, domain);
    g_array_append_val(form->loops, loop);
    g_array_append_val(form->faces, face);
}

Form *form_sample(void)
{
    Form *form = form_new();
    const double unit[4] = {0, 0, 1, 1};
    const double plane[] = {0, 0, 0, 1, 4, 0, 6, 0, 0, 7, 4, 0};
    form_patch(form, SEG_SURFACE_PLANE, form_surface(form, 1, 2, 1, 2, unit, unit, plane, NULL));

    const double arc[6] = {0, 0, 0, 1, 1, 1}, up[4] = {0, 0, 10, 10}, h = sqrt(0.5);
    const double wall[] = {5, 0, 0, 5, 0, 10, 5, 5, 0, 5, 5, 10, 0, 5, 0, 0, 5, 10};
    const double weights[] = {1, 1, h, h, 1, 1};
    form_patch(form, SEG_SURFACE_CYLINDER, form_surface(form, 2, 3, 1, 2, arc, up, wall, weights));
    return form;
}

/* ------------------------------------------------------------------ bytes */

GBytes *form_bytes(const Form *form)
{
    SegPartHeader header = {.magic = SEG_FORM_MAGIC,
                            .version = SEG_FORM_VERSION,
                            .byte_order = SEG_FORM_BYTE_ORDER,
                            .chord_mm = 0.1,
                            .unit_mm = 1,
                            .n_faces = form->faces->len,
                            .n_loops = form->loops->len,
                            .n_coedges = form->coedges->len,
                            .n_edges = form->edges->len,
                            .n_iges_curves = form->iges_curves->len,
                            .n_vertices = form->vertices->len,
                            .n_triangles = form->triangles->len,
                            .n_reals = form->reals->len};
    memset(header.sha256, '0', sizeof header.sha256);
    GByteArray *bytes = g_byte_array_new();
    g_byte_array_append(bytes, (const guint8 *)&header, sizeof header);
    const GArray *tables[] = {form->faces,       form->loops,    form->coedges,   form->edges,
                              form->iges_curves, form->vertices, form->triangles, form->reals};
    for (size_t i = 0; i < G_N_ELEMENTS(tables); i++)
        g_byte_array_append(bytes, (const guint8 *)tables[i]->data,
                            tables[i]->len * g_array_get_element_size((GArray *)tables[i]));
    return g_byte_array_free_to_bytes(bytes);
}

SegPart *form_part(const Form *form)
{
    g_autoptr(GError) error = NULL;
    g_autoptr(GBytes) bytes = form_bytes(form);
    SegPart *part = seg_part_from_form(bytes, &error);
    if (!part)
        g_error("%s", error->message);
    return part;
}
