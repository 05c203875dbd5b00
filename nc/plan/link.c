/* SPDX-License-Identifier: Apache-2.0 */
#include "nc/plan/link.h"

#define RESOLUTION_MM 0.05
/* Moves of a lead's quarter circle. */
#define LEAD_MOVES 6
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

/* A way between two pieces. */
typedef struct {
    SegVec3 from, to;
    const NcPiece *surface; /* the way along the surface, NULL: lift */
} Join;

/* From the air to the end of a piece: a quarter circle that ends in the piece's own direction, or
 * nothing where that would touch the part: then the tool comes straight down. */
typedef struct {
    SegVec3 tips[LEAD_MOVES + 1]; /* the last is the piece's */
    int n;
} Lead;

static void join_along_surface(const NcLinker *linker, Join *joins, size_t n, GArray **pieces);
static Lead lead_to(const Way *way, const NcPiece *piece, bool start);
static void lead_in(Way *way, const Lead *lead, double z);
static void lead_out(Way *way, const Lead *lead, double z);
static void lift(Way *way, const Lead *out, const Lead *in);

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

    Lead in = lead_to(&way, &p[0], true);
    go_at(&way, in.tips[0], top, NC_RAPID);
    lead_in(&way, &in, top);
    for (size_t i = 0; i < n; i++) {
        for (size_t k = 1; k < p[i].n; k++)
            go(&way, p[i].tips[k], NC_CUT);
        const NcPiece *surface = joins[i].surface;
        if (i + 1 < n && surface) {
            for (size_t k = 1; k + 1 < surface->n; k++)
                go(&way, surface->tips[k], NC_LINK);
            go(&way, joins[i].to, NC_LINK);
            continue;
        }
        Lead out = lead_to(&way, &p[i], false);
        if (i + 1 < n) {
            in = lead_to(&way, &p[i + 1], true);
            lift(&way, &out, &in);
        } else {
            lead_out(&way, &out, top);
        }
    }
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

static void lift(Way *way, const Lead *out, const Lead *in)
{
    double top = way->linker->clearance_mm - way->linker->trace->body.leave_mm;
    SegVec3 from = out->tips[0], to = in->tips[0];
    double high = fmax(safe_z(way, from), safe_z(way, to));
    double z = clear_height(way, from, to, fmin(high, top), top);
    lead_out(way, out, z);
    go_at(way, to, z, NC_RAPID);
    lead_in(way, in, z);
}

/* ----------------------------------------------------------------------- leads */

/* Clear of the part, with shank and holder? */
static bool is_clear(const NcTrace *trace, const Lead *lead)
{
    for (int i = 0; i < lead->n; i++)
        if (!nc_sweep_clear(trace->terrain, trace->body.cutter, lead->tips[i], lead->tips[i + 1],
                            trace->chord_mm) ||
            !nc_body_clear(trace->terrain, &trace->body, lead->tips[i]))
            return false;
    return true;
}

static Lead lead_to(const Way *way, const NcPiece *piece, bool start)
{
    const NcTrace *trace = way->linker->trace;
    SegVec3 end = piece->tips[start ? 0 : piece->n - 1];
    Lead straight = {.tips = {end}, .n = 0}, lead = {.n = LEAD_MOVES};
    if (piece->n < 2)
        return straight;
    SegVec3 back = seg_unit(seg_sub(end, piece->tips[start ? 1 : piece->n - 2]));
    double level = hypot(back.x, back.y), radius = way->linker->allowance_mm + NC_SAFETY_MM;
    if (level < 0.5) /* up or down a wall: the straight way is its direction */
        return straight;
    SegVec3 up = seg_vec3(-back.x * back.z / level, -back.y * back.z / level, level);
    for (int i = 0; i <= LEAD_MOVES; i++) {
        double angle = G_PI / 2 * (LEAD_MOVES - i) / LEAD_MOVES;
        SegVec3 tip = seg_along(end, back, radius * sin(angle));
        lead.tips[i] = seg_along(tip, up, radius * (1 - cos(angle)));
    }
    return is_clear(trace, &lead) ? lead : straight;
}

/* Down to the lead by rapid as far as that is safe, from height z. */
static void lead_in(Way *way, const Lead *lead, double z)
{
    double safe = fmin(safe_z(way, lead->tips[0]), z);
    if (safe < z)
        go_at(way, lead->tips[0], safe, NC_RAPID);
    for (int i = 0; i <= lead->n; i++)
        go(way, lead->tips[i], NC_LEAD);
}

static void lead_out(Way *way, const Lead *lead, double z)
{
    for (int i = lead->n - 1; i >= 0; i--)
        go(way, lead->tips[i], NC_LEAD);
    double safe = fmin(safe_z(way, lead->tips[0]), z);
    go_at(way, lead->tips[0], safe, NC_LEAD);
    if (z > safe)
        go_at(way, lead->tips[0], z, NC_RAPID);
}
