/* SPDX-License-Identifier: Apache-2.0 */
/* What runs remove: only what was executed, as far as it was. */
#include "sim/material.h"
#include "tests/unit/sim_rig.h"

/* A box of 40 x 40 x 10 whose top is at Z0; the tools are 50 long and the machine's zero is G54's,
 * so that Z is the tip's height once G43 is on. */
static const char program[] = "G21 G90 G94 G17\n"
                              "T1 M6\n"
                              "G43 H1\n"
                              "S1000 M3\n"
                              "G0 X-10 Y20\n"
                              "G0 Z-2\n"
                              "G1 X50 F600\n"
                              "G0 Z40\n"
                              "M30\n";

typedef struct {
    Rig rig;
    SimMaterial *material;
    guint collisions, calls;
    uint32_t line; /* of the last collision */
    char *error;
} Cell;

static void cell_init(Cell *cell, const char *stock, const char *model)
{
    *cell = (Cell){0};
    rig_init(&cell->rig, 1, 1000);
    cell->rig.machine.tool_change_mm[2] = 200;
    for (int i = 0; i < 2; i++) {
        cell->rig.tools[i].flute_length_mm = 20;
        cell->rig.tools[i].stickout_mm = 40;
        cell->rig.tools[i].shank_diameter_mm = 6;
        cell->rig.tools[i].holder_diameter_mm = 20;
    }
    const SimMaterialOptions options = {.machine = &cell->rig.machine,
                                        .tools = &cell->rig.table,
                                        .stock = stock,
                                        .model = model,
                                        .pitch_mm = 0.5};
    g_autoptr(GError) error = NULL;
    cell->material = sim_material_new(&options, &error);
    g_assert_no_error(error);
    const SimControllerOptions how = {.machine = &cell->rig.machine,
                                      .speed = 1,
                                      .moves_per_step = 1000,
                                      .course = sim_material_course(cell->material)};
    sim_controller_free(cell->rig.controller);
    cell->rig.controller = sim_controller_new(&how);
}

static void cell_clear(Cell *cell)
{
    rig_clear(&cell->rig);
    sim_material_free(cell->material);
    g_free(cell->error);
}

static void removed(const SimRemoval *removal, void *data)
{
    Cell *cell = data;
    cell->calls++;
    cell->collisions += removal->collisions->len;
    for (guint i = 0; i < removal->collisions->len; i++)
        cell->line = g_array_index(removal->collisions, NcCollision, i).line;
    if (removal->error)
        cell->error = g_strdup(removal->error->message);
}

static double left_mm3(Cell *cell)
{
    sim_material_remove(cell->material, removed, cell);
    sim_material_settle(cell->material);
    g_autoptr(NcStock) stock = sim_material_copy(cell->material);
    g_autoptr(NcMesh) mesh = nc_stock_mesh(stock);
    double volume = 0;
    for (size_t t = 0; t < mesh->n_triangles; t++) {
        const int32_t *v = mesh->triangles[t].vertex;
        volume +=
            seg_dot(mesh->vertices[v[0]], seg_cross(mesh->vertices[v[1]], mesh->vertices[v[2]])) /
            6;
    }
    return volume;
}

#define BOX "box:0,0,-10,40,40,0"
#define WHOLE (40 * 40 * 10.0)

static void to_its_end(void)
{
    Cell cell;
    cell_init(&cell, BOX, NULL);
    rig_load(&cell.rig, program, NULL, 0);
    rig_do(&cell.rig, SIM_START);
    rig_run(&cell.rig, 100000, 1000);
    test_near(left_mm3(&cell), WHOLE - 40 * 6 * 2, 1, 0);
    g_assert_cmpuint(cell.calls, ==, 1);
    g_assert_cmpuint(cell.collisions, ==, 0);
    g_autofree char *summary = sim_material_summary(cell.material);
    g_assert_true(g_str_has_prefix(summary, "material: "));
    g_assert_true(g_str_has_suffix(summary, "\ncollisions: none\n"));
    cell_clear(&cell);
}

/* Aborted in the slot: as far as it came, with the round end of the tool. */
static void broken_off(void)
{
    Cell cell;
    cell_init(&cell, BOX, NULL);
    rig_load(&cell.rig, program, NULL, 0);
    rig_do(&cell.rig, SIM_START);
    for (int i = 0; i < 10000 && rig_see(&cell.rig).position_mm[0] < 15; i++)
        rig_tick(&cell.rig, 10000);
    rig_do(&cell.rig, SIM_ABORT);
    rig_run(&cell.rig, 10000, 100);
    const double x = rig_see(&cell.rig).position_mm[0];
    g_assert_cmpfloat(x, >, 15);
    g_assert_cmpfloat(x, <, 20);
    test_near(left_mm3(&cell), WHOLE - 2 * (6 * x + G_PI * 9 / 2), 1, 0);
    test_near(left_mm3(&cell), WHOLE - 2 * (6 * x + G_PI * 9 / 2), 1, 0); /* nothing is new */
    cell_clear(&cell);
}

/* Of an arc, too: half of a full circle. */
static void broken_arc(void)
{
    Cell cell;
    cell_init(&cell, BOX, NULL);
    rig_load(&cell.rig,
             "G21 G90 G94 G17 G91.1\nT1 M6\nG43 H1\nS1000 M3\nG0 X10 Y20\nG1 Z-2 F600\n"
             "G2 X10 Y20 I10 J0\nG0 Z40\nM30\n",
             NULL, 0);
    rig_do(&cell.rig, SIM_START);
    for (int i = 0; i < 10000 && rig_see(&cell.rig).position_mm[0] < 29; i++)
        rig_tick(&cell.rig, 10000);
    rig_do(&cell.rig, SIM_ABORT);
    rig_run(&cell.rig, 10000, 100);
    const double *at = rig_see(&cell.rig).position_mm;
    const double angle = atan2(20 - at[1], at[0] - 20) + G_PI; /* from X10, clockwise, upwards */
    g_assert_cmpfloat(angle, >, 2);
    g_assert_cmpfloat(angle, <, 3.6);
    test_near(left_mm3(&cell), WHOLE - 2 * (6 * 10 * angle + G_PI * 9), 2, 0);
    cell_clear(&cell);
}

static void collisions(void)
{
    Cell cell;
    cell_init(&cell, BOX, NULL);
    rig_load(&cell.rig,
             "G21 G90 G94 G17\nT1 M6\nG43 H1\nS1000 M3\nG0 X-10 Y20\nG0 Z-2\nG0 X50\nG0 Z40\nM30\n",
             NULL, 0);
    rig_do(&cell.rig, SIM_START);
    rig_run(&cell.rig, 100000, 1000);
    left_mm3(&cell);
    g_assert_cmpuint(cell.collisions, ==, 1);
    g_assert_cmpuint(cell.line, ==, 7);
    g_autofree char *summary = sim_material_summary(cell.material);
    g_assert_true(g_str_has_suffix(summary, "\ncollisions: rapid 1\n"));
    cell_clear(&cell);
}

/* What cannot be written is said, and the next run is none the worse for it. */
static void no_model(void)
{
    Cell cell;
    cell_init(&cell, BOX, "/absent/model.stl");
    sim_material_remove(cell.material, removed, &cell);
    sim_material_settle(cell.material);
    g_assert_true(cell.error && strstr(cell.error, "/absent/model.stl"));
    cell_clear(&cell);
}

static void bad_stocks(void)
{
    static const char *const bad[] = {"box:",
                                      "box:1,2,3,4,5",
                                      "box:0,0,0,1,1,x",
                                      "box:0,0,0,1,1,1,1",
                                      "box:0,0,0,0,1,1",
                                      "/absent/stock.stl"};
    Rig rig;
    rig_init(&rig, 1, 1000);
    for (size_t i = 0; i < G_N_ELEMENTS(bad); i++) {
        const SimMaterialOptions options = {
            .machine = &rig.machine, .tools = &rig.table, .stock = bad[i], .pitch_mm = 0.5};
        g_autoptr(GError) error = NULL;
        g_assert_null(sim_material_new(&options, &error));
        g_assert_nonnull(error);
    }
    rig_clear(&rig);
}

static void add(void)
{
    g_test_add_func("/sim/material/to-its-end", to_its_end);
    g_test_add_func("/sim/material/broken-off", broken_off);
    g_test_add_func("/sim/material/broken-arc", broken_arc);
    g_test_add_func("/sim/material/collisions", collisions);
    g_test_add_func("/sim/material/no-model", no_model);
    g_test_add_func("/sim/material/bad-stocks", bad_stocks);
}

int main(int argc, char **argv)
{
    return test_main(argc, argv, add);
}
