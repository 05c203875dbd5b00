/* SPDX-License-Identifier: Apache-2.0 */
#include "nc/plan/link.h"

#define RESOLUTION_MM 0.05
#define RAISES 8
/* A way along the surface may be longer than the straight one by this factor, plus the radius. */
#define DETOUR 3

typedef struct {
    const NcLinker *linker;
    NcCutter wide;  /* the tool grown by allowance and safety */
    double wide_mm; /* its tip lies so far below the grown cutter's */
    NcCutter holder;
    GArray *out; /* NcLocation */
} Way;

typedef struct {
    SegVec3 from, to;
    const NcPiece *surface; /* the way along the surface, NULL: lift */
} Join;

static void join_along_surface(const NcLinker *linker, Join *joins, size_t n, GArray **pieces);
static void lift(Way *way, SegVec3 from, SegVec3 to);

static double safe_z(const Way *way, SegVec3 tip)
{
    double z = nc_drop(way->linker->trace->terrain, way->wide, tip.x, tip.y, NULL, NULL);
    return fmax(z + way->wide_mm, tip.z + NC_SAFETY_MM);
}

static void go(Way *way, SegVec3 tip, NcMotionClass motion)
{
    tip.z += way->linker->trace->body.leave_mm;
    NcLocation location = {.tip = tip, .axis = {0, 0, 1}, .motion = motion};
    g_array_append_val(way->out, location);
}

static void go_at(Way *way, SegVec3 tip, double z, NcMotionClass motion)
{
    go(way, seg_vec3(tip.x, tip.y, z), motion);
}

static Way way_new(const NcLinker *linker)
{
    const NcBody *body = &linker->trace->body;
    double off = linker->allowance_mm + NC_SAFETY_MM;
    return (Way){.linker = linker,
                 .wide = {body->tool.radius_mm + off, body->tool.corner_radius_mm + off},
                 .wide_mm = off - body->leave_mm,
                 .holder = body->holder,
                 .out = g_array_new(FALSE, FALSE, sizeof(NcLocation))};
}

NcToolpath nc_link(const NcLinker *linker, const GArray *pieces)
{
    Way way = way_new(linker);
    const NcPiece *p = (const NcPiece *)(void *)pieces->data;
    size_t n = pieces->len;
    if (n == 0)
        return (NcToolpath){way.out};
    double top = linker->clearance_mm - linker->trace->body.leave_mm;
    g_autofree Join *joins = g_new0(Join, n);
    for (size_t i = 0; i + 1 < n; i++)
        joins[i] = (Join){.from = p[i].tips[p[i].n - 1], .to = p[i + 1].tips[0]};
    GArray *surfaces;
    join_along_surface(linker, joins, n - 1, &surfaces);

    SegVec3 start = p[0].tips[0], end = p[n - 1].tips[p[n - 1].n - 1];
    go_at(&way, start, top, NC_RAPID);
    go_at(&way, start, fmin(safe_z(&way, start), top), NC_RAPID);
    go(&way, start, NC_LEAD);
    for (size_t i = 0; i < n; i++) {
        for (size_t k = 1; k < p[i].n; k++)
            go(&way, p[i].tips[k], NC_CUT);
        if (i + 1 == n)
            break;
        const NcPiece *surface = joins[i].surface;
        if (!surface) {
            lift(&way, joins[i].from, joins[i].to);
            continue;
        }
        for (size_t k = 1; k + 1 < surface->n; k++)
            go(&way, surface->tips[k], NC_LINK);
        go(&way, joins[i].to, NC_LINK);
    }
    go_at(&way, end, fmin(safe_z(&way, end), top), NC_LEAD);
    go_at(&way, end, top, NC_RAPID);
    nc_pieces_free(surfaces);
    return (NcToolpath){way.out};
}

/* ------------------------------------------------------------- along the surface */

static double locate(const void *curves, size_t pass, double t, SegVec3 *tip)
{
    const Join *join = *((const Join *const *)curves + pass);
    SegVec3 at = seg_lerp(join->from, join->to, t);
    *tip = seg_vec3(at.x, at.y, -INFINITY);
    return 0;
}

/* Unbroken, and neither a detour nor a climb. */
static bool is_short_way(const NcTrace *trace, const Join *join, const NcPiece *piece)
{
    SegVec3 a = piece->tips[0], b = piece->tips[piece->n - 1];
    if (hypot(a.x - join->from.x, a.y - join->from.y) > 1e-9 ||
        hypot(b.x - join->to.x, b.y - join->to.y) > 1e-9)
        return false;
    /* At its ends the way may not lie above the pieces it joins. */
    if (a.z > join->from.z + trace->chord_mm || b.z > join->to.z + trace->chord_mm)
        return false;
    double length = 0;
    for (size_t i = 1; i < piece->n; i++)
        length += seg_distance(piece->tips[i - 1], piece->tips[i]);
    return length <= DETOUR * seg_distance(join->from, join->to) + trace->body.tool.radius_mm;
}

static void join_along_surface(const NcLinker *linker, Join *joins, size_t n, GArray **pieces)
{
    NcTrace trace = *linker->trace;
    trace.region = NULL;
    double pitch = nc_trace_pitch_mm(&trace);
    g_autofree NcPass *passes = g_new(NcPass, n + 1);
    g_autofree const Join **near = g_new(const Join *, n + 1);
    size_t n_near = 0;
    for (size_t i = 0; i < n; i++) {
        double level = hypot(joins[i].to.x - joins[i].from.x, joins[i].to.y - joins[i].from.y);
        if (level > linker->direct_mm)
            continue;
        near[n_near] = &joins[i];
        passes[n_near++] = (NcPass){.t0 = 0, .t1 = 1, .n = (size_t)ceil(level / pitch) + 1};
    }
    *pieces = nc_trace(&trace, passes, n_near, locate, near);
    for (guint k = 0; k < (*pieces)->len; k++) {
        const NcPiece *piece = &g_array_index(*pieces, NcPiece, k);
        Join *join = (Join *)near[piece->pass];
        if (is_short_way(&trace, join, piece))
            join->surface = piece;
    }
}

/* ----------------------------------------------------------------------- lifting */

/* The least height at which tool and holder go from one to the other, clear of the stock. */
static double clear_height(const Way *way, SegVec3 from, SegVec3 to, double z, double top)
{
    const NcTrace *trace = way->linker->trace;
    for (int i = 0; i < RAISES && z < top; i++) {
        SegVec3 a = {from.x, from.y, z - way->wide_mm}, b = {to.x, to.y, z - way->wide_mm};
        double gouge = nc_sweep_gouge_mm(trace->terrain, way->wide, a, b, RESOLUTION_MM);
        a.z = b.z = z + trace->body.holder_mm;
        gouge = fmax(gouge, nc_sweep_gouge_mm(trace->terrain, way->holder, a, b, RESOLUTION_MM));
        if (gouge + RESOLUTION_MM <= 0)
            return z;
        z += gouge + 2 * RESOLUTION_MM;
    }
    return top;
}

static void lift(Way *way, SegVec3 from, SegVec3 to)
{
    double top = way->linker->clearance_mm - way->linker->trace->body.leave_mm;
    double up = fmin(safe_z(way, from), top), down = fmin(safe_z(way, to), top);
    double z = clear_height(way, from, to, fmax(up, down), top);
    go_at(way, from, up, NC_LEAD);
    if (z > up)
        go_at(way, from, z, NC_RAPID);
    go_at(way, to, z, NC_RAPID);
    if (down < z)
        go_at(way, to, down, NC_RAPID);
    go(way, to, NC_LEAD);
}
