/* SPDX-License-Identifier: Apache-2.0 */
#include "nc/stock/probe.h"

#include <stdlib.h>
#include <string.h>

#include "nc/motion.h"
#include "nc/stock/sweep.h"

/* A move is looked up by the square that its middle lies in; longer ones are cut up, so that they
 * lie near it. */
#define CELLS_A_RADIUS 4
#define CELLS_MOST 4000000
#define PIECES_MOST 200000000

/* Two sweeps this near to each other leave nothing between them that could stand. */
#define FILM_MM 1e-6

/* A straight move, or a bit of one, of the tip; with what rejects it fast. */
typedef struct {
    SegVec3 a, b;
    double dx, dy, over_length2; /* level direction; 1 / |d|², 0 where it is vertical */
    double bottom;               /* its lower end */
    size_t move;
    uint32_t cell;
} Piece;

/* The moves of one tool. */
typedef struct {
    int number;
    NcBody body;
    double length_mm;
    double longest; /* level length of a piece at most */
    double x0, y0, cell;
    size_t nx, ny;
    size_t *first; /* piece of each cell; nx · ny + 1 */
    GArray *pieces;
} Layer;

struct NcProbing {
    GArray *layers;
};

/* One line, while it is being cut. */
typedef struct {
    SegVec3 point, normal;
    double reach;  /* only what comes this near to the point counts */
    double inward; /* where the material begins again, <= 0 */
    double outward;
    bool gone; /* there is none at the point */
    size_t move;
    const Piece *lowest; /* over the point; NULL: none is */
    const Layer *lowest_layer;
    double lowest_mm;
    double support_mm; /* of the layer being visited: the normal's least product with its body */
} Line;

static Layer *layer_of(NcProbing *probing, const NcMove *move, const CfgToolTable *tools,
                       GError **error);
static bool add_move(Layer *layer, const NcMove *move, size_t index, SegVec3 zero, GError **error);
static void sort_into_cells(Layer *layer);
static void visit(const Layer *layer, Line *line,
                  void (*meet)(const Layer *, const Piece *, Line *));
static double support(const NcBody *body, SegVec3 n);
static void find_lowest(const Layer *layer, const Piece *piece, Line *line);
static void meet_outward(const Layer *layer, const Piece *piece, Line *line);
static void meet_inward(const Layer *layer, const Piece *piece, Line *line);

static void layer_clear(void *data)
{
    Layer *layer = data;
    g_array_unref(layer->pieces);
    g_free(layer->first);
}

NcProbing *nc_probing_new(const NcMove *moves, size_t n, SegVec3 zero, const CfgToolTable *tools,
                          GError **error)
{
    g_autoptr(NcProbing) probing = g_new0(NcProbing, 1);
    probing->layers = g_array_new(FALSE, TRUE, sizeof(Layer));
    g_array_set_clear_func(probing->layers, layer_clear);
    for (size_t i = 0; i < n; i++) {
        const NcMove *move = &moves[i];
        bool travels =
            move->kind == NC_MOVE_RAPID || move->kind == NC_MOVE_FEED || move->kind == NC_MOVE_ARC;
        if (!travels || move->tool == 0)
            continue;
        Layer *layer = layer_of(probing, move, tools, error);
        if (!layer || !add_move(layer, move, i, zero, error))
            return NULL;
    }
    for (guint i = 0; i < probing->layers->len; i++)
        sort_into_cells(&g_array_index(probing->layers, Layer, i));
    return g_steal_pointer(&probing);
}

void nc_probing_free(NcProbing *probing)
{
    if (!probing)
        return;
    g_array_unref(probing->layers);
    g_free(probing);
}

NcProbed nc_probing_measure(const NcProbing *probing, SegVec3 point, SegVec3 normal,
                            double stock_mm)
{
    const GArray *layers = probing->layers;
    Line line = {.point = point, .normal = normal, .move = NC_PROBING_UNCUT, .lowest_mm = INFINITY};
    line.outward = fmax(stock_mm, 0);
    line.inward = fmin(stock_mm, 0);
    line.gone = stock_mm <= 0;
    /* The move that lies lowest over the point is likely to be it, and rules most others out. */
    for (guint i = 0; i < layers->len; i++)
        visit(&g_array_index(layers, Layer, i), &line, find_lowest);
    if (line.lowest) {
        line.support_mm = support(&line.lowest_layer->body, normal);
        meet_outward(line.lowest_layer, line.lowest, &line);
    }
    for (guint i = 0; i < layers->len && !line.gone; i++) {
        line.reach = line.outward;
        visit(&g_array_index(layers, Layer, i), &line, meet_outward);
    }
    if (!line.gone)
        return (NcProbed){line.outward, line.move};
    double before;
    do {
        before = line.inward;
        for (guint i = 0; i < layers->len; i++)
            visit(&g_array_index(layers, Layer, i), &line, meet_inward);
    } while (line.inward < before);
    return (NcProbed){line.inward, line.move};
}

/* ------------------------------------------------------------------------- lines */

static double level_distance2(const Piece *piece, SegVec3 p)
{
    double px = p.x - piece->a.x, py = p.y - piece->a.y;
    double t = (px * piece->dx + py * piece->dy) * piece->over_length2;
    /* No fmin and fmax: they are calls. */
    t = t < 0 ? 0 : t > 1 ? 1 : t;
    px -= t * piece->dx;
    py -= t * piece->dy;
    return px * px + py * py;
}

/* Can the sweep come within `reach` of the point? */
static bool comes_near(const Layer *layer, const Piece *piece, SegVec3 p, double reach)
{
    double height = p.z + reach - piece->bottom, most = layer->body.radius + reach;
    if (height < 0)
        return false;
    double distance2 = level_distance2(piece, p);
    if (distance2 > most * most)
        return false;
    most = nc_body_radius_mm(&layer->body, height) + reach;
    return distance2 <= most * most;
}

/* No point of the sweep lies further inward along the line than this: its plane of support. */
static double innermost(const Piece *piece, const Line *line)
{
    SegVec3 n = line->normal;
    double a = seg_dot(n, seg_sub(piece->a, line->point));
    double b = seg_dot(n, seg_sub(piece->b, line->point));
    return (a < b ? a : b) + line->support_mm;
}

/* The least product of the unit vector n with a point of the body. */
static double support(const NcBody *body, SegVec3 n)
{
    double level = sqrt(n.x * n.x + n.y * n.y), least = INFINITY;
    const NcRoundedDisc *r = &body->rounded;
    if (r->round > 0)
        least = n.z * r->centre - level * r->disc - r->round;
    for (int i = 0; i < body->n_frusta; i++) {
        const NcFrustum *f = &body->frustum[i];
        least = fmin(least, fmin(n.z * f->z0 - level * f->r0, n.z * f->z1 - level * f->r1));
    }
    return least;
}

static void find_lowest(const Layer *layer, const Piece *piece, Line *line)
{
    double distance2 = level_distance2(piece, line->point), radius = layer->body.radius;
    if (piece->bottom >= line->lowest_mm || distance2 > radius * radius)
        return;
    double z = piece->bottom + nc_body_height_mm(&layer->body, sqrt(distance2));
    if (z >= line->lowest_mm)
        return;
    line->lowest_mm = z;
    line->lowest = piece;
    line->lowest_layer = layer;
}

static void meet_outward(const Layer *layer, const Piece *piece, Line *line)
{
    double from, to;
    if (line->gone || innermost(piece, line) > line->outward ||
        !comes_near(layer, piece, line->point, line->outward) ||
        !nc_swept_interval(&layer->body, piece->a, piece->b, line->point, line->normal, &from, &to,
                           NULL))
        return;
    if (to <= 0)
        return;
    if (from <= 0) {
        line->gone = true;
        line->reach = 0;
        line->move = piece->move;
    } else if (from < line->outward || (from == line->outward && piece->move < line->move)) {
        line->outward = from;
        line->move = piece->move;
    }
}

/* The removed stretch around the point grows inward. */
static void meet_inward(const Layer *layer, const Piece *piece, Line *line)
{
    double from, to;
    if (innermost(piece, line) > line->inward ||
        !comes_near(layer, piece, line->point, FILM_MM - line->inward) ||
        !nc_swept_interval(&layer->body, piece->a, piece->b, line->point, line->normal, &from, &to,
                           NULL))
        return;
    if (to < line->inward - FILM_MM || from > line->inward)
        return;
    if (from < line->inward || piece->move < line->move) {
        line->inward = from;
        line->move = piece->move;
    }
}

static size_t cell_of(double at, double from, double cell, size_t n)
{
    double i = floor((at - from) / cell);
    return (size_t)fmin(fmax(i, 0), (double)(n - 1));
}

/* Meets every piece that can come within the line's reach of its point. */
static void visit(const Layer *layer, Line *line,
                  void (*meet)(const Layer *, const Piece *, Line *))
{
    double reach = fmax(line->reach, FILM_MM - line->inward);
    double around = layer->body.radius + layer->longest / 2 + reach;
    SegVec3 p = line->point;
    if (p.x + around < layer->x0 || p.x - around > layer->x0 + layer->cell * (double)layer->nx ||
        p.y + around < layer->y0 || p.y - around > layer->y0 + layer->cell * (double)layer->ny)
        return;
    line->support_mm = support(&layer->body, line->normal);
    size_t i0 = cell_of(p.x - around, layer->x0, layer->cell, layer->nx);
    size_t i1 = cell_of(p.x + around, layer->x0, layer->cell, layer->nx);
    size_t j0 = cell_of(p.y - around, layer->y0, layer->cell, layer->ny);
    size_t j1 = cell_of(p.y + around, layer->y0, layer->cell, layer->ny);
    const Piece *pieces = (const Piece *)(const void *)layer->pieces->data;
    for (size_t i = i0; i <= i1; i++) {
        const size_t *first = &layer->first[i * layer->ny];
        for (size_t k = first[j0], end = first[j1 + 1]; k < end; k++)
            meet(layer, &pieces[k], line);
    }
}

/* ------------------------------------------------------------------------- moves */

static Layer *layer_of(NcProbing *probing, const NcMove *move, const CfgToolTable *tools,
                       GError **error)
{
    for (guint i = probing->layers->len; i > 0; i--) {
        Layer *layer = &g_array_index(probing->layers, Layer, i - 1);
        if (layer->number == move->tool)
            return layer;
    }
    const CfgTool *tool = cfg_tools_find(tools, move->tool);
    if (!tool) {
        g_set_error(error, NC_ERROR, NC_ERROR_PROGRAM,
                    "line %u: tool %d is not in the tool table, so its shape is not known",
                    nc_move_block_line(move), move->tool);
        return NULL;
    }
    Layer layer = {
        .number = move->tool, .body = nc_body_cutting(tool), .length_mm = tool->length_mm};
    layer.pieces = g_array_new(FALSE, FALSE, sizeof(Piece));
    layer.longest = layer.body.radius / CELLS_A_RADIUS;
    g_array_append_val(probing->layers, layer);
    return &g_array_index(probing->layers, Layer, probing->layers->len - 1);
}

static bool is_tilted(const NcMove *move)
{
    for (int i = 0; i < 3; i++)
        if (move->from_deg[i] != 0 || move->to_deg[i] != 0)
            return true;
    return false;
}

/* Straight moves are as many pieces as their level length needs, arcs as their sagitta. */
static size_t pieces_of(const Layer *layer, const NcMove *move)
{
    double level = hypot(move->to.x - move->from.x, move->to.y - move->from.y);
    double n = ceil(level / layer->longest);
    if (move->kind == NC_MOVE_ARC) {
        double length = nc_move_length_mm(move);
        double radius =
            fmax(seg_distance(move->from, move->centre), seg_distance(move->to, move->centre));
        n = ceil(length / fmin(sqrt(8 * radius * NC_PROBING_CHORD_MM), layer->longest));
    }
    return (size_t)fmax(fmin(n, PIECES_MOST), 1);
}

static bool add_move(Layer *layer, const NcMove *move, size_t index, SegVec3 zero, GError **error)
{
    if (is_tilted(move)) {
        g_set_error(error, NC_ERROR, NC_ERROR_PROGRAM,
                    "line %u: a rotary axis is away from zero; only what is cut in three axes can "
                    "be measured",
                    nc_move_block_line(move));
        return false;
    }
    size_t n = pieces_of(layer, move);
    if (n + layer->pieces->len > PIECES_MOST) {
        g_set_error(error, NC_ERROR, NC_ERROR_PROGRAM,
                    "line %u: the program is too long to be measured (%d pieces of moves)",
                    nc_move_block_line(move), PIECES_MOST);
        return false;
    }
    zero.z += layer->length_mm;
    SegVec3 a = seg_sub(nc_move_point(move, 0), zero);
    for (size_t i = 0; i < n; i++) {
        SegVec3 b = seg_sub(nc_move_point(move, (double)(i + 1) / (double)n), zero);
        Piece piece = {.a = a, .b = b, .dx = b.x - a.x, .dy = b.y - a.y, .move = index};
        double length2 = piece.dx * piece.dx + piece.dy * piece.dy;
        piece.over_length2 = length2 > 0 ? 1 / length2 : 0;
        piece.bottom = fmin(a.z, b.z);
        g_array_append_val(layer->pieces, piece);
        a = b;
    }
    return true;
}

static int by_cell(const void *a, const void *b)
{
    const Piece *p = a, *q = b;
    return p->cell != q->cell ? (p->cell > q->cell) - (p->cell < q->cell)
                              : (p->move > q->move) - (p->move < q->move);
}

static void sort_into_cells(Layer *layer)
{
    Piece *pieces = (Piece *)(void *)layer->pieces->data;
    size_t n = layer->pieces->len;
    double x0 = INFINITY, x1 = -INFINITY, y0 = INFINITY, y1 = -INFINITY;
    for (size_t i = 0; i < n; i++) {
        x0 = fmin(x0, fmin(pieces[i].a.x, pieces[i].b.x));
        x1 = fmax(x1, fmax(pieces[i].a.x, pieces[i].b.x));
        y0 = fmin(y0, fmin(pieces[i].a.y, pieces[i].b.y));
        y1 = fmax(y1, fmax(pieces[i].a.y, pieces[i].b.y));
    }
    double width = fmax(x1 - x0, 1e-3), depth = fmax(y1 - y0, 1e-3);
    layer->x0 = x0;
    layer->y0 = y0;
    layer->cell = fmax(layer->body.radius / CELLS_A_RADIUS, sqrt(width * depth / CELLS_MOST));
    layer->nx = (size_t)ceil(width / layer->cell);
    layer->ny = (size_t)ceil(depth / layer->cell);
    layer->first = g_new0(size_t, layer->nx * layer->ny + 1);
    for (size_t i = 0; i < n; i++) {
        SegVec3 middle = seg_lerp(pieces[i].a, pieces[i].b, 0.5);
        pieces[i].cell = (uint32_t)(cell_of(middle.x, x0, layer->cell, layer->nx) * layer->ny +
                                    cell_of(middle.y, y0, layer->cell, layer->ny));
        layer->first[pieces[i].cell + 1]++;
    }
    for (size_t c = 0; c < layer->nx * layer->ny; c++)
        layer->first[c + 1] += layer->first[c];
    qsort(pieces, n, sizeof *pieces, by_cell);
}
