/* SPDX-License-Identifier: Apache-2.0 */
#include "nc/toolpath/stepover.h"
#include "nc/toolpath/strategy.h"

/* Lines are stepped by what so many places along them ask for, and by no less than this share of
 * the median of these. */
#define PLACES 48
#define LEAST_SHARE 0.125
/* Lines stay this share of the face's range inside its border, where "inside" is decided. */
#define INSET 1e-6
/* A flat bottom moves its contact out to the rim over this much slope, so that the path has no jump
 * where the ground is level. */
#define RIM_SLOPE 0.02
#define LINES_MOST 20000

/* Lines of one face: `along` 0 runs in u at constant v, 1 runs in v at constant u. */
typedef struct {
    const NcJob *job;
    int32_t face;
    int along;
    SegLoopPolygon *loops;
    size_t n_loops;
    double wall_side;    /* where it is a wall: 1, or -1 if the part's normal points inside */
    double lo[2], hi[2]; /* bounds of the loops in (u,v) */
    double domain[2][2]; /* of the surface */
    double shift_mm;     /* walls are kept off by this */
} Face;

typedef struct {
    const Face *face;
    double at;   /* the constant parameter */
    double step; /* to the next line */
} Line;

static bool face_init(Face *face, const NcJob *job, const SegPiece *piece);
static void find_wall_side(Face *face);
static void face_clear(Face *face);
static double lay_lines(const Face *face, GArray *lines);
static double locate(const void *curves, size_t pass, double t, SegVec3 *tip);
static void add_passes(const Face *face, const GArray *lines, size_t from, GArray *passes);

bool nc_iso_parametric_can(const NcRegion *region, const SegPart *part)
{
    for (size_t i = 0; i < region->n_pieces; i++)
        if (part->faces[region->pieces[i]->face].surface.n_u == 0)
            return false;
    return region->n_pieces > 0;
}

NcCuts nc_iso_parametric(const NcJob *job)
{
    const NcRegion *region = job->region;
    g_autofree Face *faces = g_new0(Face, region->n_pieces + 1);
    g_autoptr(GArray) lines = g_array_new(FALSE, FALSE, sizeof(Line));
    g_autoptr(GArray) passes = g_array_new(FALSE, FALSE, sizeof(NcPass));
    size_t n = 0;
    for (size_t i = 0; i < region->n_pieces; i++) {
        Face *face = &faces[n];
        if (!face_init(face, job, region->pieces[i]))
            continue;
        n++;
        double length[2];
        for (int along = 0; along < 2; along++) {
            g_autoptr(GArray) trial = g_array_new(FALSE, FALSE, sizeof(Line));
            face->along = along;
            length[along] = lay_lines(face, trial);
        }
        face->along = length[1] < length[0];
        size_t from = lines->len;
        lay_lines(face, lines);
        add_passes(face, lines, from, passes);
    }
    NcCuts cuts = {.pieces = nc_trace(&job->trace, (NcPass *)(void *)passes->data, passes->len,
                                      locate, lines->data)};
    double length = 0;
    for (guint i = 0; i < cuts.pieces->len; i++) {
        const NcPiece *piece = &g_array_index(cuts.pieces, NcPiece, i);
        for (size_t k = 1; k < piece->n; k++)
            length += seg_distance(piece->tips[k - 1], piece->tips[k]);
    }
    cuts.stepover_mm = length > 0 ? region->area_mm2 / length : 0;
    for (size_t i = 0; i < n; i++)
        face_clear(&faces[i]);
    return cuts;
}

/* -------------------------------------------------------------------------- faces */

static bool face_init(Face *face, const NcJob *job, const SegPiece *piece)
{
    const SegPart *part = job->part;
    const SegFace *from = &part->faces[piece->face];
    *face = (Face){.job = job, .face = piece->face};
    face->shift_mm = job->trace.chord_mm + job->tessellation_mm;
    if (from->surface.n_u == 0)
        return false;
    seg_face_domain(part, piece->face, &face->domain[0][0], &face->domain[0][1],
                    &face->domain[1][0], &face->domain[1][1]);
    face->n_loops = piece->n_loops > 0 ? piece->n_loops : (size_t)from->n_loops;
    face->loops = g_new0(SegLoopPolygon, face->n_loops + 1);
    for (int k = 0; k < 2; k++) {
        face->lo[k] = INFINITY;
        face->hi[k] = -INFINITY;
    }
    for (size_t i = 0; i < face->n_loops; i++) {
        SegLoopPolygon *loop = &face->loops[i];
        *loop = piece->n_loops > 0
                    ? piece->loops[i]
                    : seg_loop_polygon(part, from->first_loop + (int32_t)i, job->trace.chord_mm);
        if (piece->n_loops > 0)
            loop->uv = g_memdup2(loop->uv, loop->n * sizeof *loop->uv);
        for (size_t p = 0; p < loop->n; p++)
            for (int k = 0; k < 2; k++) {
                face->lo[k] = fmin(face->lo[k], loop->uv[p][k]);
                face->hi[k] = fmax(face->hi[k], loop->uv[p][k]);
            }
    }
    for (int k = 0; k < 2; k++) {
        face->lo[k] =
            face->n_loops > 0 ? fmax(face->lo[k], face->domain[k][0]) : face->domain[k][0];
        face->hi[k] =
            face->n_loops > 0 ? fmin(face->hi[k], face->domain[k][1]) : face->domain[k][1];
    }
    find_wall_side(face);
    return true;
}

static void face_clear(Face *face)
{
    for (size_t i = 0; i < face->n_loops; i++)
        g_free(face->loops[i].uv);
    g_free(face->loops);
}

static bool contains(const Face *face, double u, double v)
{
    if (face->n_loops == 0)
        return u >= face->lo[0] && u <= face->hi[0] && v >= face->lo[1] && v <= face->hi[1];
    return seg_polygons_contain(face->loops, face->n_loops, u, v);
}

/* The surface in workpiece coordinates, its normal turned to the side the tool comes from; beyond
 * the surface its tangent plane. */
typedef struct {
    SegVec3 p, normal, along, across; /* the last two: derivatives by the two parameters */
    double bend;                      /* normal curvature at right angles to the line */
    bool regular;
} Ground;

static Ground ground_at(const Face *face, double t_wish, double at_wish)
{
    const SegPart *part = face->job->part;
    const NcSetup *setup = face->job->setup;
    int a = face->along;
    double t = fmin(fmax(t_wish, face->domain[a][0]), face->domain[a][1]);
    double at = fmin(fmax(at_wish, face->domain[1 - a][0]), face->domain[1 - a][1]);
    SegSurfacePoint s = seg_face_evaluate(part, face->face, a ? at : t, a ? t : at);
    Ground g = {.p = nc_setup_point(setup, s.p),
                .along = nc_setup_direction(setup, a ? s.pv : s.pu),
                .across = nc_setup_direction(setup, a ? s.pu : s.pv)};
    g.p = seg_along(seg_along(g.p, g.along, t_wish - t), g.across, at_wish - at);
    SegVec3 normal;
    g.regular = seg_surface_normal(&part->faces[face->face], &s, &normal);
    g.normal = nc_setup_direction(setup, normal);
    bool wall = fabs(g.normal.z) < NC_WALL_UP;
    if (wall ? face->wall_side < 0 : g.normal.z < 0)
        g.normal = seg_scale(g.normal, -1);
    /* Euler and Meusnier: the second fundamental form along q = x·Su + y·Sv, which is at right
     * angles to the line, over its first. */
    SegVec3 line = seg_unit(g.along);
    double skew = seg_dot(g.across, line), run = seg_norm(g.along);
    double x = run > 0 ? -skew / run : 0;
    SegVec3 tt = a ? s.pvv : s.puu, ww = a ? s.puu : s.pvv;
    SegVec3 second = seg_add(seg_add(seg_scale(tt, x * x), seg_scale(s.puv, 2 * x)), ww);
    SegVec3 q = seg_along(g.across, line, -skew);
    double q2 = seg_dot(q, q);
    g.bend = q2 > 0 ? seg_dot(nc_setup_direction(setup, second), g.normal) / q2 : 0;
    g.across = q;
    return g;
}

/* By vote of the walls in it. */
static void find_wall_side(Face *face)
{
    double votes = 0;
    face->along = 0;
    face->wall_side = 1;
    for (int i = 0; i < 49; i++) {
        double u = face->lo[0] + (face->hi[0] - face->lo[0]) * (i / 7 + 0.5) / 7;
        double v = face->lo[1] + (face->hi[1] - face->lo[1]) * (i % 7 + 0.5) / 7;
        Ground g = ground_at(face, u, v);
        if (g.regular && fabs(g.normal.z) < NC_WALL_UP && contains(face, u, v))
            votes += nc_wall_side(face->job->trace.terrain, g.p, g.normal);
    }
    face->wall_side = votes < 0 ? -1 : 1;
}

/* -------------------------------------------------------------------------- lines */

static int ascending(const void *a, const void *b)
{
    double x = *(const double *)a, y = *(const double *)b;
    return (x > y) - (x < y);
}

/* The parameter step that the line at `at` allows, and its length inside the loops. Where it is
 * nowhere inside, all of its places have a say. */
static double step_at(const Face *face, double at, double *length)
{
    const NcJob *job = face->job;
    int t = face->along, w = 1 - t;
    double steps[2][PLACES], range = face->hi[w] - face->lo[w];
    size_t n[2] = {0, 0};
    *length = 0;
    for (int i = 0; i < PLACES; i++) {
        double s = ((double)i + 0.5) / PLACES;
        double place = face->lo[t] + s * (face->hi[t] - face->lo[t]);
        Ground g = ground_at(face, place, at);
        double across = seg_norm(g.across);
        if (!g.regular || !(across > 0))
            continue;
        double mm =
            nc_contact_step_mm(job->trace.body.tool, job->scallop_mm, job->trace.body.depth_mm,
                               g.normal, g.bend, seg_scale(g.across, 1 / across));
        bool inside = contains(face, t ? at : place, t ? place : at);
        steps[inside][n[inside]++] = mm / across;
        if (inside)
            *length += seg_norm(g.along) * (face->hi[t] - face->lo[t]) / PLACES;
    }
    int from = n[1] > 0;
    if (n[from] == 0)
        return range / PLACES;
    qsort(steps[from], n[from], sizeof(double), ascending);
    double least = LEAST_SHARE * steps[from][n[from] / 2];
    return fmax(fmax(steps[from][0], least), range / LINES_MOST);
}

/* Lines beyond the border at `at`, as far as the overlap; `way` is -1 or 1. */
static void lay_overlap(const Face *face, double at, int way, GArray *lines)
{
    int t = face->along;
    double length, step = step_at(face, at, &length);
    double speed = seg_norm(ground_at(face, (face->lo[t] + face->hi[t]) / 2, at).across);
    double overlap = speed > 0 ? face->job->trace.overlap_mm / speed : 0;
    for (double beyond = overlap; beyond > 0; beyond -= step) {
        Line line = {face, at + way * beyond, 0};
        g_array_append_val(lines, line);
    }
}

/* Lines from border to border, and into the overlap beyond; the sum of their lengths. */
static double lay_lines(const Face *face, GArray *lines)
{
    int w = 1 - face->along;
    double range = face->hi[w] - face->lo[w], inset = INSET * range, total = 0;
    double first = face->lo[w] + inset, last = face->hi[w] - inset;
    if (!(range > 0))
        return 0;
    lay_overlap(face, first, -1, lines);
    for (double at = first;;) {
        double length, there, step = step_at(face, at, &length);
        Line line = {face, at, step};
        g_array_append_val(lines, line);
        total += length;
        if (at >= last)
            break;
        /* The step may shrink on the way: the line there has a say too. */
        step = fmin(step, fmax(step_at(face, fmin(at + step, last), &there), step / 2));
        at = at + step * 1.05 >= last ? last : at + step;
    }
    lay_overlap(face, last, 1, lines);
    return total;
}

static void add_passes(const Face *face, const GArray *lines, size_t from, GArray *passes)
{
    int t = face->along;
    double pitch = nc_trace_pitch_mm(&face->job->trace);
    for (size_t i = from; i < lines->len; i++) {
        const Line *line = &g_array_index(lines, Line, i);
        double speed = 0;
        for (int k = 0; k <= 8; k++) {
            double place = face->lo[t] + (face->hi[t] - face->lo[t]) * k / 8;
            speed = fmax(speed, seg_norm(ground_at(face, place, line->at).along));
        }
        double beyond = speed > 0 ? (face->job->trace.overlap_mm + pitch) / speed : 0;
        NcPass pass = {.t0 = face->lo[t] - beyond, .t1 = face->hi[t] + beyond, .n = 1};
        pass.n = (size_t)fmax(ceil((pass.t1 - pass.t0) * speed / pitch), 2);
        g_array_append_val(passes, pass);
    }
}

/* The tip that touches the ground there. */
static SegVec3 tip_on(const NcJob *job, const Ground *g, double shift_mm)
{
    double r = job->trace.body.cutter.corner_radius_mm;
    double flat = job->trace.body.cutter.radius_mm - r;
    double slope = hypot(g->normal.x, g->normal.y);
    SegVec3 tip = seg_along(g->p, g->normal, r);
    tip.z -= r;
    double out = shift_mm + (slope > 0 ? flat * fmin(slope / RIM_SLOPE, 1) / slope : 0);
    tip.x += out * g->normal.x;
    tip.y += out * g->normal.y;
    return tip;
}

/* The side of the tool cuts the wall above its corner: is there some within the step, where the
 * line itself runs below the loops? */
static bool serves_above(const Line *line, double t, double z)
{
    const Face *face = line->face;
    for (int i = -4; i <= 4; i++) {
        double at = line->at + line->step * i / 4;
        bool above = contains(face, face->along ? at : t, face->along ? t : at) &&
                     ground_at(face, t, at).p.z > z;
        if (above)
            return true;
    }
    return false;
}

static double locate(const void *curves, size_t pass, double t, SegVec3 *tip)
{
    const Line *line = (const Line *)curves + pass;
    const Face *face = line->face;
    const NcTrace *trace = &face->job->trace;
    Ground g = ground_at(face, t, line->at);
    bool wall = g.regular && fabs(g.normal.z) <= NC_WALL_UP;
    bool wanted =
        g.regular && (contains(face, face->along ? line->at : t, face->along ? t : line->at) ||
                      (wall && serves_above(line, t, g.p.z)));
    *tip = tip_on(face->job, &g, face->shift_mm);
    /* Where table, shank or holder stop the tool, a wall can be touched higher up. */
    double least = wall ? nc_body_least_z(trace->terrain, &trace->body, *tip) : -INFINITY;
    least = fmax(least, trace->floor_mm);
    wanted = wanted && least <= tip->z + (wall ? trace->body.depth_mm : 0);
    tip->z = fmax(tip->z, least);
    if (!wanted) {
        tip->z = -INFINITY;
        return -1;
    }
    return wall ? trace->body.depth_mm : trace->touch_mm;
}
