/* SPDX-License-Identifier: Apache-2.0 */
#include "nc/stock/probe.h"

#include <stdlib.h>

#include "nc/motion.h"
#include "nc/stock/chords.h"
#include "nc/stock/ray.h"
#include "nc/stock/sweep.h"

/* A move is looked up by the square that its middle lies in; longer ones are cut up, so that they
 * lie near it. A square holds about so many, and is no wider than a share of the tool's radius. */
#define CELL_PIECES 16
#define CELL_SHARE 0.25
#define CELLS_MOST 4000000

/* Of all tools together: 96 bytes each. */
#define PIECES_MOST 20000000

/* A straight move, or a bit of one, of the tip; with what rejects it fast. */
typedef struct {
    SegVec3 a, b;
    double dx, dy, over_length2; /* level direction; 1 / |d|², 0 where it is vertical */
    double bottom;               /* its lower end */
    size_t move;
    uint32_t cell;
} Piece;

/* The pieces [first, that of the next cell), and the box around their tips. */
typedef struct {
    size_t first;
    SegVec3 low, high;
} Cell;

/* The moves of one tool. */
typedef struct {
    int number;
    NcToolBody body;
    double length_mm;
    double longest; /* level length of a piece at most */
    double x0, y0, side;
    size_t nx, ny;
    Cell *cells; /* nx · ny, and one behind them */
    GArray *pieces;
} Layer;

struct NcProbing {
    GArray *layers;
    size_t n_pieces;
};

/* One line, while it is being cut. */
typedef struct {
    SegVec3 point, normal;
    double inward;  /* where the material begins again, <= 0 */
    double outward; /* where it ends, >= 0 */
    double most;    /* of both */
    bool gone;      /* there is none at the point */
    size_t move;
} Line;

/* What a line is to a tool: how far inward it reaches from its tip along the line's normal. */
typedef struct {
    double support_mm; /* least product of the normal with a point of the body */
    SegVec3 at;        /* that point, from the tip */
} Support;

static Layer *layer_of(NcProbing *probing, const NcMove *move, const CfgToolTable *tools);
static bool add_move(NcProbing *probing, Layer *layer, const NcMove *move, size_t index,
                     SegVec3 zero, GError **error);
static void sort_into_cells(Layer *layer);
static void bound_cells(Layer *layer);
static Support support_of(const NcToolBody *body, SegVec3 n);
static const Piece *likely(const Layer *layer, const Support *support, const Line *line);
static void visit(const Layer *layer, const Support *support, Line *line);
static void meet(const Layer *layer, const Piece *piece, Line *line);

static void layer_clear(void *data)
{
    Layer *layer = data;
    g_array_unref(layer->pieces);
    g_free(layer->cells);
}

NcProbing *nc_probing_new(const NcMove *moves, size_t n, SegVec3 zero, const CfgToolTable *tools,
                          GError **error)
{
    if (!nc_chords_check(moves, n, tools, error))
        return NULL;
    g_autoptr(NcProbing) probing = g_new0(NcProbing, 1);
    probing->layers = g_array_new(FALSE, TRUE, sizeof(Layer));
    g_array_set_clear_func(probing->layers, layer_clear);
    for (size_t i = 0; i < n; i++)
        if (nc_chords_wanted(&moves[i]) &&
            !add_move(probing, layer_of(probing, &moves[i], tools), &moves[i], i, zero, error))
            return NULL;
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
                            double stock_mm, double most_mm)
{
    const GArray *layers = probing->layers;
    Line line = {.point = point, .normal = normal, .most = most_mm, .move = NC_PROBING_UNCUT};
    line.outward = CLAMP(stock_mm, 0, most_mm);
    line.inward = CLAMP(stock_mm, -most_mm, 0);
    line.gone = stock_mm <= 0;
    /* The move that most likely made the surface rules most others out. */
    for (guint i = 0; i < layers->len; i++) {
        const Layer *layer = &g_array_index(layers, Layer, i);
        const Support support = support_of(&layer->body, normal);
        const Piece *first = likely(layer, &support, &line);
        if (first)
            meet(layer, first, &line);
    }
    double before;
    bool was_gone;
    do {
        before = line.inward;
        was_gone = line.gone;
        for (guint i = 0; i < layers->len; i++) {
            const Layer *layer = &g_array_index(layers, Layer, i);
            const Support support = support_of(&layer->body, normal);
            visit(layer, &support, &line);
        }
    } while (line.gone && (!was_gone || line.inward < before));
    return (NcProbed){line.gone ? fmax(line.inward, -most_mm) : line.outward, line.move};
}

/* ------------------------------------------------------------------------- lines */

/* Only what sweeps a place further inward than this can change the line. */
static double bound_of(const Line *line)
{
    return line->gone ? line->inward : line->outward;
}

/* No further is looked. */
static bool is_done(const Line *line)
{
    return line->gone && line->inward <= -line->most;
}

/* And only what comes this near to its point. */
static double reach_of(const Line *line)
{
    return line->gone ? NC_FILM_MM - line->inward : line->outward;
}

static Support support_of(const NcToolBody *body, SegVec3 n)
{
    double level = sqrt(n.x * n.x + n.y * n.y);
    SegVec3 out = level > 0 ? seg_vec3(n.x / level, n.y / level, 0) : seg_vec3(0, 0, 0);
    const NcRoundedDisc *r = &body->rounded;
    Support support = {INFINITY, {0, 0, 0}};
    if (r->round > 0) {
        SegVec3 rim = seg_along(seg_vec3(0, 0, r->centre), out, -r->disc);
        support = (Support){seg_dot(n, rim) - r->round, seg_along(rim, n, -r->round)};
    }
    for (int i = 0; i < 2 * body->n_frusta; i++) {
        const NcFrustum *f = &body->frustum[i / 2];
        SegVec3 rim =
            seg_along(seg_vec3(0, 0, i % 2 ? f->z1 : f->z0), out, i % 2 ? -f->r1 : -f->r0);
        if (seg_dot(n, rim) < support.support_mm)
            support = (Support){seg_dot(n, rim), rim};
    }
    return support;
}

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

/* Can a body whose tip is no lower than `bottom`, this far from the point, come within reach? */
static bool comes_near(const NcToolBody *body, double bottom, double distance2, SegVec3 p,
                       double reach)
{
    double height = p.z + reach - bottom, most = body->radius + reach;
    if (height < 0 || distance2 > most * most)
        return false;
    most = nc_body_radius_mm(body, height) + reach;
    return distance2 <= most * most;
}

static void meet(const Layer *layer, const Piece *piece, Line *line)
{
    double from, to;
    if (!nc_swept_interval(&layer->body, piece->a, piece->b, line->point, line->normal, &from, &to,
                           NULL))
        return;
    if (!line->gone) {
        if (to <= 0)
            return;
        if (from <= 0) {
            line->gone = true;
        } else if (from < line->outward || (from == line->outward && piece->move < line->move)) {
            line->outward = from;
            line->move = piece->move;
        }
        if (!line->gone)
            return;
        line->move = piece->move;
    }
    /* The stretch without material around the point grows inward. */
    if (to < line->inward - NC_FILM_MM || from > line->inward)
        return;
    if (from < line->inward || piece->move < line->move) {
        line->inward = from;
        line->move = piece->move;
    }
}

static void visit_cell(const Layer *layer, const Support *support, size_t cell, Line *line)
{
    SegVec3 n = line->normal, p = line->point;
    const Piece *pieces = (const Piece *)(const void *)layer->pieces->data;
    for (size_t k = layer->cells[cell].first; k < layer->cells[cell + 1].first && !is_done(line);
         k++) {
        const Piece *piece = &pieces[k];
        double a = seg_dot(n, seg_sub(piece->a, p)), b = seg_dot(n, seg_sub(piece->b, p));
        if ((a < b ? a : b) + support->support_mm <= bound_of(line) &&
            comes_near(&layer->body, piece->bottom, level_distance2(piece, p), p, reach_of(line)))
            meet(layer, piece, line);
    }
}

/* Can any piece of the cell change the line? */
static bool cell_matters(const Layer *layer, const Support *support, const Cell *cell,
                         const Line *line)
{
    SegVec3 n = line->normal, p = line->point;
    double innermost = n.x * ((n.x > 0 ? cell->low.x : cell->high.x) - p.x) +
                       n.y * ((n.y > 0 ? cell->low.y : cell->high.y) - p.y) +
                       n.z * ((n.z > 0 ? cell->low.z : cell->high.z) - p.z) + support->support_mm;
    if (innermost > bound_of(line))
        return false;
    double dx = p.x < cell->low.x ? cell->low.x - p.x : p.x > cell->high.x ? p.x - cell->high.x : 0;
    double dy = p.y < cell->low.y ? cell->low.y - p.y : p.y > cell->high.y ? p.y - cell->high.y : 0;
    return comes_near(&layer->body, cell->low.z, dx * dx + dy * dy, p, reach_of(line));
}

static size_t cell_of(double at, double from, double side, size_t n)
{
    double i = floor((at - from) / side);
    return (size_t)fmin(fmax(i, 0), (double)(n - 1));
}

typedef struct {
    size_t i0, i1, j0, j1;
} Window;

/* The cells around a place; false where it is too far from all of them. */
static bool window_of(const Layer *layer, SegVec3 p, double around, Window *window)
{
    if (p.x + around < layer->x0 || p.x - around > layer->x0 + layer->side * (double)layer->nx ||
        p.y + around < layer->y0 || p.y - around > layer->y0 + layer->side * (double)layer->ny)
        return false;
    window->i0 = cell_of(p.x - around, layer->x0, layer->side, layer->nx);
    window->i1 = cell_of(p.x + around, layer->x0, layer->side, layer->nx);
    window->j0 = cell_of(p.y - around, layer->y0, layer->side, layer->ny);
    window->j1 = cell_of(p.y + around, layer->y0, layer->side, layer->ny);
    return true;
}

/* Meets every piece that can change the line. */
static void visit(const Layer *layer, const Support *support, Line *line)
{
    Window w;
    double around = layer->body.radius + layer->longest / 2 + reach_of(line);
    if (is_done(line))
        return;
    if (!window_of(layer, line->point, around, &w))
        return;
    for (size_t i = w.i0; i <= w.i1; i++)
        for (size_t cell = i * layer->ny + w.j0; cell <= i * layer->ny + w.j1 && !is_done(line);
             cell++)
            if (layer->cells[cell].first < layer->cells[cell + 1].first &&
                cell_matters(layer, support, &layer->cells[cell], line))
                visit_cell(layer, support, cell, line);
}

/* A tool that touches the point square to the line has its tip at one place; the piece nearest to
 * that, or NULL where none is near. */
static const Piece *likely(const Layer *layer, const Support *support, const Line *line)
{
    SegVec3 tip = seg_sub(line->point, support->at);
    Window w;
    if (!window_of(layer, tip, layer->side, &w))
        return NULL;
    const Piece *pieces = (const Piece *)(const void *)layer->pieces->data, *best = NULL;
    double least = INFINITY;
    for (size_t i = w.i0; i <= w.i1; i++)
        for (size_t k = layer->cells[i * layer->ny + w.j0].first;
             k < layer->cells[i * layer->ny + w.j1 + 1].first; k++) {
            double dz = pieces[k].bottom - tip.z;
            double distance2 = level_distance2(&pieces[k], tip) + dz * dz;
            if (distance2 < least) {
                least = distance2;
                best = &pieces[k];
            }
        }
    return best;
}

/* ------------------------------------------------------------------------- moves */

static Layer *layer_of(NcProbing *probing, const NcMove *move, const CfgToolTable *tools)
{
    for (guint i = probing->layers->len; i > 0; i--) {
        Layer *layer = &g_array_index(probing->layers, Layer, i - 1);
        if (layer->number == move->tool)
            return layer;
    }
    const CfgTool *tool = cfg_tools_find(tools, move->tool);
    Layer layer = {.number = move->tool,
                   .body = nc_body_cutting(tool),
                   .length_mm = tool->length_mm,
                   .pieces = g_array_new(FALSE, FALSE, sizeof(Piece))};
    layer.longest = CELL_SHARE * layer.body.radius;
    g_array_append_val(probing->layers, layer);
    return &g_array_index(probing->layers, Layer, probing->layers->len - 1);
}

/* Its chords, or more where they were too long. */
static size_t pieces_of(const Layer *layer, const NcMove *move)
{
    double level = move->kind == NC_MOVE_ARC
                       ? nc_move_length_mm(move)
                       : hypot(move->to.x - move->from.x, move->to.y - move->from.y);
    return MAX(nc_chords_of(move), (size_t)fmin(ceil(level / layer->longest), PIECES_MOST + 1.0));
}

static bool add_move(NcProbing *probing, Layer *layer, const NcMove *move, size_t index,
                     SegVec3 zero, GError **error)
{
    size_t n = pieces_of(layer, move);
    if (n + probing->n_pieces > PIECES_MOST) {
        g_set_error(error, NC_ERROR, NC_ERROR_PROGRAM,
                    "line %u: the program is too long to be measured: its moves are more than %d "
                    "pieces of a quarter of the tool's radius; verify it in parts",
                    nc_move_block_line(move), PIECES_MOST);
        return false;
    }
    probing->n_pieces += n;
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
    double side = sqrt(width * depth * CELL_PIECES / (double)n);
    layer->x0 = x0;
    layer->y0 = y0;
    layer->side =
        fmax(fmin(side, CELL_SHARE * layer->body.radius), sqrt(width * depth / CELLS_MOST));
    layer->nx = (size_t)ceil(width / layer->side);
    layer->ny = (size_t)ceil(depth / layer->side);
    for (size_t i = 0; i < n; i++) {
        SegVec3 middle = seg_lerp(pieces[i].a, pieces[i].b, 0.5);
        pieces[i].cell = (uint32_t)(cell_of(middle.x, x0, layer->side, layer->nx) * layer->ny +
                                    cell_of(middle.y, y0, layer->side, layer->ny));
    }
    qsort(pieces, n, sizeof *pieces, by_cell);
    bound_cells(layer);
}

static void bound_cells(Layer *layer)
{
    const Piece *pieces = (const Piece *)(const void *)layer->pieces->data;
    size_t n_cells = layer->nx * layer->ny, k = 0;
    layer->cells = g_new0(Cell, n_cells + 1);
    for (size_t c = 0; c < n_cells; c++) {
        Cell *cell = &layer->cells[c];
        *cell = (Cell){k, {INFINITY, INFINITY, INFINITY}, {-INFINITY, -INFINITY, -INFINITY}};
        for (; k < layer->pieces->len && pieces[k].cell == c; k++) {
            SegVec3 a = pieces[k].a, b = pieces[k].b;
            cell->low =
                seg_vec3(fmin(cell->low.x, fmin(a.x, b.x)), fmin(cell->low.y, fmin(a.y, b.y)),
                         fmin(cell->low.z, fmin(a.z, b.z)));
            cell->high =
                seg_vec3(fmax(cell->high.x, fmax(a.x, b.x)), fmax(cell->high.y, fmax(a.y, b.y)),
                         fmax(cell->high.z, fmax(a.z, b.z)));
        }
    }
    layer->cells[n_cells].first = layer->pieces->len;
}
