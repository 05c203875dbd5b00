/* SPDX-License-Identifier: Apache-2.0 */
#include "sim/material.h"

#include <gio/gio.h>
#include <math.h>

/* Pieces of a whole turn that a broken-off arc is cut in. */
#define PIECES_PER_TURN 256

struct SimMaterial {
    SimMaterialOptions options;
    NcStock *stock; /* of the thread, while one is at work */
    SimCourse *course;
    GQueue waiting; /* Removal, the first of them at work; changed under the lock */
    GMutex lock;
    GCond changed;
    bool modelled; /* a model has been asked for */
    double whole_mm3;
    unsigned collisions[NC_COLLISION_SPINDLE + 1];
};

/* What one call is to do, and has done. */
typedef struct {
    SimMaterial *material;
    GArray *stretches;
    SimRemoved removed;
    void *data;
    GArray *collisions;
    GError *error;
} Removal;

static NcStock *read_box(const char *numbers, const NcStockOptions *options, GError **error);
static void begin_next(SimMaterial *material);
static void wait_for_all(SimMaterial *material);
static void remove_in_thread(GTask *task, void *source, void *data, GCancellable *cancellable);
static void done(GObject *source, GAsyncResult *result, void *data);
static bool cut(SimMaterial *material, const SimStretch *stretch, Removal *removal);

SimMaterial *sim_material_new(const SimMaterialOptions *options, GError **error)
{
    NcStockOptions grid = NC_STOCK_DEFAULTS;
    grid.pitch_mm = options->pitch_mm;
    NcStock *stock = g_str_has_prefix(options->stock, "box:")
                         ? read_box(options->stock, &grid, error)
                         : nc_stock_load(options->stock, &grid, error);
    if (!stock)
        return NULL;
    SimMaterial *material = g_new0(SimMaterial, 1);
    material->options = *options;
    material->stock = stock;
    material->course = sim_course_new();
    material->whole_mm3 = nc_stock_volume_mm3(stock);
    g_queue_init(&material->waiting);
    g_mutex_init(&material->lock);
    g_cond_init(&material->changed);
    return material;
}

void sim_material_free(SimMaterial *material)
{
    if (!material)
        return;
    wait_for_all(material);
    sim_course_free(material->course);
    nc_stock_free(material->stock);
    g_mutex_clear(&material->lock);
    g_cond_clear(&material->changed);
    g_free(material);
}

SimCourse *sim_material_course(SimMaterial *material)
{
    return material->course;
}

static NcStock *read_box(const char *text, const NcStockOptions *options, GError **error)
{
    g_auto(GStrv) words = g_strsplit(strchr(text, ':') + 1, ",", 0);
    double at[6] = {0};
    bool good = g_strv_length(words) == 6;
    for (int i = 0; i < 6 && good; i++) {
        char *end;
        at[i] = g_ascii_strtod(words[i], &end);
        good = *words[i] != '\0' && *end == '\0' && isfinite(at[i]);
    }
    if (good)
        return nc_stock_new_box(seg_vec3(at[0], at[1], at[2]), seg_vec3(at[3], at[4], at[5]),
                                options, error);
    g_set_error(error, G_OPTION_ERROR, G_OPTION_ERROR_BAD_VALUE,
                "--stock %s: give box:X0,Y0,Z0,X1,Y1,Z1 in mm, or a file", text);
    return NULL;
}

/* --------------------------------------------------------------------------- removal */

void sim_material_remove(SimMaterial *material, SimRemoved removed, void *data)
{
    Removal *removal = g_new0(Removal, 1);
    removal->material = material;
    removal->stretches = sim_course_take(material->course);
    removal->removed = removed;
    removal->data = data;
    removal->collisions = g_array_new(FALSE, FALSE, sizeof(NcCollision));
    material->modelled = true;
    g_mutex_lock(&material->lock);
    g_queue_push_tail(&material->waiting, removal);
    g_mutex_unlock(&material->lock);
    if (material->waiting.length == 1)
        begin_next(material);
}

static void begin_next(SimMaterial *material)
{
    Removal *removal = g_queue_peek_head(&material->waiting);
    if (!removal)
        return;
    g_autoptr(GTask) task = g_task_new(NULL, NULL, done, removal);
    g_task_set_task_data(task, removal, NULL);
    g_task_run_in_thread(task, remove_in_thread);
}

static void remove_in_thread(GTask *task, void *source, void *data, GCancellable *cancellable)
{
    (void)source, (void)cancellable;
    Removal *removal = data;
    SimMaterial *material = removal->material;
    bool good = true;
    for (guint i = 0; i < removal->stretches->len && good; i++)
        good = cut(material, &g_array_index(removal->stretches, SimStretch, i), removal);
    if (material->options.model) {
        g_autoptr(NcMesh) model = nc_stock_mesh(material->stock);
        nc_mesh_write(model, material->options.model, removal->error ? NULL : &removal->error);
    }
    g_task_return_boolean(task, good);
}

static void done(GObject *source, GAsyncResult *result, void *data)
{
    (void)source, (void)result;
    Removal *removal = data;
    SimMaterial *material = removal->material;
    const SimRemoval what = {removal->collisions, removal->error};
    for (guint i = 0; i < removal->collisions->len; i++)
        material->collisions[g_array_index(removal->collisions, NcCollision, i).kind]++;
    g_mutex_lock(&material->lock);
    g_queue_pop_head(&material->waiting);
    g_cond_broadcast(&material->changed);
    g_mutex_unlock(&material->lock);
    begin_next(material);
    removal->removed(&what, removal->data);
    g_array_unref(removal->stretches);
    g_array_unref(removal->collisions);
    g_clear_error(&removal->error);
    g_free(removal);
}

static void wait_for_all(SimMaterial *material)
{
    while (material->waiting.length > 0)
        g_main_context_iteration(NULL, TRUE);
}

/* The model of what no run has touched. */
static void untouched(const SimRemoval *removal, void *data)
{
    (void)data;
    sim_material_report(removal, NULL);
}

void sim_material_settle(SimMaterial *material)
{
    if (!material->modelled && material->waiting.length == 0)
        sim_material_remove(material, untouched, NULL);
    wait_for_all(material);
}

NcStock *sim_material_copy(SimMaterial *material)
{
    g_mutex_lock(&material->lock);
    while (material->waiting.length > 0)
        g_cond_wait(&material->changed, &material->lock);
    NcStock *copy = nc_stock_copy(material->stock);
    g_mutex_unlock(&material->lock);
    return copy;
}

/* It does not move with what a program sets: the material stays where it is clamped. */
static SegVec3 zero_of(const SimMaterial *material)
{
    const double *zero = material->options.machine->work_offset_mm[0];
    return seg_vec3(zero[0], zero[1], zero[2]);
}

bool sim_material_cut(const SimMaterial *material, NcStock *stock, const NcMove *moves, size_t n,
                      GArray *collisions, GError **error)
{
    return nc_stock_cut(stock, moves, n, zero_of(material), material->options.tools, collisions,
                        error);
}

bool sim_material_probe(const SimMaterial *material, const NcStock *stock, const NcMove *move,
                        bool away, SegVec3 *where)
{
    return nc_stock_probe(stock, move, zero_of(material), material->options.tools, away, where);
}

static bool cut_moves(SimMaterial *material, const NcMove *moves, size_t n, Removal *removal)
{
    return sim_material_cut(material, material->stock, moves, n, removal->collisions,
                            &removal->error);
}

/* Of a move that was broken off: straight pieces, as far as it came. */
static bool cut_broken(SimMaterial *material, const NcMove *move, double part, Removal *removal)
{
    const int n = move->kind == NC_MOVE_ARC ? abs(move->turn) * PIECES_PER_TURN : 1;
    bool good = true;
    for (int i = 0; i < n && good; i++) {
        NcMove piece = *move;
        piece.kind = move->kind == NC_MOVE_ARC ? NC_MOVE_FEED : move->kind;
        piece.from = nc_move_point(move, part * i / n);
        piece.to = nc_move_point(move, part * (i + 1) / n);
        good = cut_moves(material, &piece, 1, removal);
    }
    return good;
}

static bool cut(SimMaterial *material, const SimStretch *stretch, Removal *removal)
{
    const NcMove *moves = stretch->program->moves;
    const size_t end = stretch->part < 1 ? stretch->end - 1 : stretch->end;
    return cut_moves(material, moves + stretch->first, end - stretch->first, removal) &&
           (end == stretch->end || cut_broken(material, &moves[end], stretch->part, removal));
}

/* ------------------------------------------------------------------------------ texts */

void sim_material_report(const SimRemoval *removal, SimLog *log)
{
    for (guint i = 0; i < removal->collisions->len; i++) {
        const NcCollision *collision = &g_array_index(removal->collisions, NcCollision, i);
        g_autofree char *text = sim_collision_text(collision);
        g_printerr("vcnc: %s\n", text);
        if (log)
            sim_log_collision(log, collision);
    }
    if (removal->error)
        g_printerr("vcnc: %s\n", removal->error->message);
    if (removal->error && log)
        sim_log_material(log, removal->error->message);
    if (log)
        sim_log_release(log);
}

char *sim_material_summary(const SimMaterial *material)
{
    GString *text = g_string_new(NULL);
    const double left_mm3 = nc_stock_volume_mm3(material->stock);
    g_string_append_printf(text, "material: %.0f mm3 removed of %.0f\ncollisions:",
                           material->whole_mm3 - left_mm3, material->whole_mm3);
    bool any = false;
    for (guint kind = 0; kind < G_N_ELEMENTS(material->collisions); kind++)
        if (material->collisions[kind] > 0) {
            g_string_append_printf(text, "%s %s %u", any ? "," : "",
                                   nc_collision_name((NcCollisionKind)kind),
                                   material->collisions[kind]);
            any = true;
        }
    g_string_append(text, any ? "\n" : " none\n");
    return g_string_free(text, FALSE);
}

char *sim_collision_text(const NcCollision *collision)
{
    static const char *const what[] = {[NC_COLLISION_RAPID] = "rapid through material",
                                       [NC_COLLISION_HOLDER] = "the holder meets material",
                                       [NC_COLLISION_SHANK] = "the shank meets material",
                                       [NC_COLLISION_SPINDLE] =
                                           "cutting, but the spindle does not turn that way"};
    return g_strdup_printf("line %u: %s: %.3f mm of it at X%.3f Y%.3f Z%.3f", collision->line,
                           what[collision->kind], collision->depth_mm, collision->position.x,
                           collision->position.y, collision->position.z);
}
