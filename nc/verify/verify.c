/* SPDX-License-Identifier: Apache-2.0 */
/* The survey of all faces, the closer looks where it found most, and the sums of both. */
#include <stdlib.h>

#include "nc/toolpath/reach.h"
#include "nc/verify/material.h"
#include "nc/verify/scan.h"

/* The survey: one spot for each square of this side, unless that were more spots than this. */
#define SURVEY_PITCH_MM 0.05
#define SURVEY_MOST 300000
#define SURVEY_LEAST 2000 /* of a region */

/* Faces that nobody asked for are looked at for gouges, at so many times that pitch. */
#define OTHER_PITCH 3

/* Of a region: profiles at even distances through the survey; the worst spots, through which
 * profiles are taken too; and those of spots and profiles from which gouge and excess are climbed.
 * Worst spots lie apart by this many pitches. */
#define PROFILES 500
#define WORST_SPOTS 48
#define APART 4

/* Lines of each lean around a place. */
#define EDGE_LINES 8

/* The spots of a zone: an id of a region, or 0. */
typedef struct {
    int32_t zone;
    size_t region; /* index in the segmentation */
    NcPlace *places;
    NcSpot *spots;
    uint32_t *lines;
    size_t n;
    double pitch_mm;
    NcJudgement judgement;
} Zone;

static bool verifier_init(NcVerifier *verifier, const NcPlanInput *input, const NcMove *moves,
                          size_t n, GError **error);
static void verifier_clear(NcVerifier *verifier);
static double survey_pitch(const NcVerifier *verifier);
static void survey(const NcVerifier *verifier, Zone *zone);
static void look_closer(const NcVerifier *verifier, Zone *zone);
static void sum_up(const NcVerifier *verifier, Zone *zone);
static void sum_whole(NcVerdict *verdict);
static bool collide(NcVerifier *verifier, size_t n, NcVerdict *verdict, GError **error);
static double cutting_s(const NcVerifier *verifier, size_t n);

NcVerdict *nc_verify(const NcPlanInput *input, const NcMove *moves, size_t n, GError **error)
{
    NcVerifier verifier;
    if (!verifier_init(&verifier, input, moves, n, error))
        return NULL;
    g_autoptr(NcVerdict) verdict = g_new0(NcVerdict, 1);
    verdict->collisions = g_array_new(FALSE, FALSE, sizeof(NcCollision));
    verdict->gouge_limit_mm = verifier.gouge_limit_mm;
    verdict->excess_limit_mm = verifier.excess_limit_mm;
    size_t n_regions = input->segmentation->n_regions;
    verdict->regions = g_new0(NcJudgement, n_regions + 1);
    GArray *spots = g_array_new(FALSE, FALSE, sizeof(NcSpot));
    double pitch = survey_pitch(&verifier);
    for (size_t r = 0; r <= n_regions; r++) {
        bool other = r == n_regions;
        Zone zone = {.zone = other ? 0 : input->segmentation->regions[r].id,
                     .region = r,
                     .pitch_mm = other ? OTHER_PITCH * pitch : pitch};
        survey(&verifier, &zone);
        look_closer(&verifier, &zone);
        sum_up(&verifier, &zone);
        g_array_append_vals(spots, zone.spots, (guint)zone.n);
        if (other)
            verdict->whole.gouge_max = zone.judgement.gouge_max;
        else if (zone.n > 0)
            verdict->regions[verdict->n_regions++] = zone.judgement;
        g_free(zone.places);
        g_free(zone.spots);
        g_free(zone.lines);
        if (input->progress)
            input->progress((double)(r + 1) / (double)(n_regions + 2), input->progress_data);
    }
    verdict->spots = g_array_steal(spots, &verdict->n_spots);
    g_array_unref(spots);
    sum_whole(verdict);
    verdict->cut_s = cutting_s(&verifier, n);
    bool ok = collide(&verifier, n, verdict, error);
    verdict->in_tolerance = ok && verdict->collisions->len == 0 &&
                            verdict->whole.gouge_max.depth_mm <= verdict->gouge_limit_mm &&
                            verdict->whole.excess_max.depth_mm <= verdict->excess_limit_mm;
    verifier_clear(&verifier);
    return ok ? g_steal_pointer(&verdict) : NULL;
}

void nc_verdict_free(NcVerdict *verdict)
{
    if (!verdict)
        return;
    g_array_unref(verdict->collisions);
    g_free(verdict->regions);
    g_free(verdict->spots);
    g_free(verdict);
}

/* ---------------------------------------------------------------------- verifier */

static int32_t *zones_of(const NcPlanInput *input);

static bool verifier_init(NcVerifier *verifier, const NcPlanInput *input, const NcMove *moves,
                          size_t n, GError **error)
{
    const CfgRecipe *recipe = input->recipe;
    *verifier = (NcVerifier){.input = input,
                             .moves = moves,
                             .gouge_limit_mm = recipe->tolerance_mm,
                             .excess_limit_mm = recipe->scallop_mm + recipe->tolerance_mm};
    const double *zero = input->machine->work_offset_mm[recipe->wcs - 54];
    verifier->zero = seg_vec3(zero[0], zero[1], zero[2]);
    if (!nc_planner_init(&verifier->planner, input, error))
        return false;
    verifier->tools = g_malloc_n(input->segmentation->n_regions + 1, sizeof *verifier->tools);
    verifier->zones = zones_of(input);
    verifier->surface =
        nc_surface_new(input->part, &verifier->planner.setup, verifier->planner.terrain);
    size_t n_facets;
    const NcPatch *facets = nc_surface_facets(verifier->surface, &n_facets);
    verifier->thickness = nc_thickness_new(facets, n_facets, input->part);
    bool ok = nc_planner_allot(&verifier->planner, verifier->tools, error);
    if (ok)
        verifier->probing = nc_probing_new(moves, n, verifier->zero, input->tools, error);
    if (verifier->probing)
        verifier->stock =
            nc_material_new(input, &verifier->planner.setup, &verifier->pitch_mm, error);
    if (verifier->stock)
        return true;
    verifier_clear(verifier);
    return false;
}

static void verifier_clear(NcVerifier *verifier)
{
    nc_planner_clear(&verifier->planner);
    nc_thickness_free(verifier->thickness);
    nc_surface_free(verifier->surface);
    nc_probing_free(verifier->probing);
    nc_stock_free(verifier->stock);
    g_free(verifier->zones);
    g_free(verifier->tools);
}

static int32_t *zones_of(const NcPlanInput *input)
{
    const SegPart *part = input->part;
    const CfgRecipe *recipe = input->recipe;
    int32_t *zones = g_new0(int32_t, (size_t)part->n_triangles + 1);
    for (size_t r = 0; r < input->segmentation->n_regions; r++) {
        const SegRegion *region = &input->segmentation->regions[r];
        const CfgRegion *wish = cfg_recipe_region(recipe, region->name);
        for (size_t i = 0; i < region->n_triangles && !(wish && wish->skip); i++)
            zones[region->triangles[i]] = region->id;
    }
    g_autofree bool *kept_out = g_new0(bool, (size_t)part->n_faces + 1);
    for (size_t i = 0; i < recipe->n_keep_out; i++)
        if (recipe->keep_out[i] >= 0 && recipe->keep_out[i] < part->n_faces)
            kept_out[recipe->keep_out[i]] = true;
    for (int32_t t = 0; t < part->n_triangles; t++)
        if (kept_out[part->triangles[t].face])
            zones[t] = 0;
    return zones;
}

/* The nearest material from a place where none is left, along lines that lean from its normal; no
 * further than twice the limit, which is all that anybody asks. */
static double nearest_material(const NcVerifier *verifier, const NcPlace *place, double stock_mm)
{
    static const double leans[] = {45, 85};
    SegVec3 n = place->normal;
    SegVec3 x = seg_unit(seg_cross(n, fabs(n.x) < 0.9 ? seg_vec3(1, 0, 0) : seg_vec3(0, 1, 0)));
    SegVec3 y = seg_cross(n, x);
    double nearest = INFINITY, most_mm = 2 * verifier->gouge_limit_mm;
    for (int i = 0; i < EDGE_LINES * (int)G_N_ELEMENTS(leans); i++) {
        double lean = leans[i / EDGE_LINES] * G_PI / 180, turn = 2 * G_PI * i / EDGE_LINES;
        SegVec3 side = seg_add(seg_scale(x, cos(turn)), seg_scale(y, sin(turn)));
        SegVec3 out = seg_add(seg_scale(n, cos(lean)), seg_scale(side, sin(lean)));
        NcProbed probed =
            nc_probing_measure(verifier->probing, place->point, out, stock_mm, most_mm);
        nearest = fmin(nearest, fmax(-probed.deviation_mm, 0));
    }
    return nearest;
}

double nc_verifier_measure(const NcVerifier *verifier, const NcPlace *place, size_t *move)
{
    const CfgRecipe *recipe = verifier->input->recipe;
    double stock_mm = nc_material_end_mm(verifier->stock, recipe, place->point, place->normal);
    double leave = recipe->stock_to_leave_mm, most = NC_VERIFY_MOST_MM + leave;
    NcProbed probed =
        nc_probing_measure(verifier->probing, place->point, place->normal, stock_mm, most);
    if (move)
        *move = probed.move;
    double limit = verifier->gouge_limit_mm;
    double deviation = fmax(probed.deviation_mm - leave, -NC_VERIFY_MOST_MM);
    if (deviation >= -limit / 2 || probed.deviation_mm >= 0)
        return deviation;
    /* At an edge the normal misses what is left: an edge that is broken within the limit is none
     * of a gouge as deep as the face is long. */
    double nearest = nearest_material(verifier, place, stock_mm) + leave;
    if (nearest <= limit || deviation >= -limit)
        return fmax(deviation, -nearest);
    int32_t face = verifier->input->part->triangles[place->triangle].face;
    return -nc_thickness_mm(verifier->thickness, place->point, place->normal, face, -deviation);
}

bool nc_verifier_reaches(const NcVerifier *verifier, size_t region, const NcPlace *place)
{
    const NcPlanner *planner = &verifier->planner;
    const CfgRecipe *recipe = verifier->input->recipe;
    bool reached = false;
    for (int i = 0; i < 2 && !reached && place->normal.z >= -NC_WALL_UP; i++) {
        const CfgTool *tool = verifier->tools[region][i];
        if (!tool)
            continue;
        NcBody body = nc_body(tool, recipe->stock_to_leave_mm, recipe->allowance_mm);
        reached = nc_reach_point(planner->terrain, place->point, place->normal, &body,
                                 planner->floor_mm, recipe->tolerance_mm);
    }
    return reached;
}

SegVec3 nc_verifier_offset(const NcVerifier *verifier, const NcMove *move)
{
    const CfgTool *tool = cfg_tools_find(verifier->input->tools, move->tool);
    return seg_vec3(verifier->zero.x, verifier->zero.y,
                    verifier->zero.z + (tool ? tool->length_mm : 0));
}

uint32_t nc_verifier_line(const NcVerifier *verifier, size_t move)
{
    return move == NC_PROBING_UNCUT ? 0 : nc_move_block_line(&verifier->moves[move]);
}

void nc_worst_take(NcWorst *worst, NcWorst other)
{
    if (other.depth_mm > worst->depth_mm)
        *worst = other;
}

/* ------------------------------------------------------------------------ survey */

static double survey_pitch(const NcVerifier *verifier)
{
    double area = 0;
    const SegSegmentation *segmentation = verifier->input->segmentation;
    for (size_t r = 0; r < segmentation->n_regions; r++)
        area +=
            nc_surface_area_mm2(verifier->surface, verifier->zones, segmentation->regions[r].id);
    return fmax(SURVEY_PITCH_MM, sqrt(area / SURVEY_MOST));
}

static void survey(const NcVerifier *verifier, Zone *zone)
{
    bool asked = zone->zone != 0;
    double area = nc_surface_area_mm2(verifier->surface, verifier->zones, zone->zone);
    if (asked)
        zone->pitch_mm = fmin(zone->pitch_mm, sqrt(area / SURVEY_LEAST));
    zone->places = nc_surface_spread(verifier->surface, verifier->zones, zone->zone,
                                     fmax(zone->pitch_mm, 1e-6), 1, &zone->n);
    zone->spots = g_new(NcSpot, zone->n + 1);
    zone->lines = g_new(uint32_t, zone->n + 1);
#pragma omp parallel for schedule(dynamic, 256)
    for (size_t i = 0; i < zone->n; i++) {
        NcPlace *place = &zone->places[i];
        size_t move;
        bool reached = asked && nc_verifier_reaches(verifier, zone->region, place);
        double deviation = nc_verifier_measure(verifier, place, &move);
        zone->lines[i] = nc_verifier_line(verifier, move);
        zone->spots[i] = (NcSpot){.point = place->point,
                                  .normal = place->normal,
                                  .triangle = place->triangle,
                                  .region = zone->zone,
                                  .reached = reached,
                                  .area_mm2 = area / (double)zone->n,
                                  .deviation_mm = deviation};
    }
}

/* ------------------------------------------------------------------- closer looks */

static double badness_of(const NcSpot *spot, NcClimb towards)
{
    if (towards == NC_CLIMB_GOUGE)
        return -spot->deviation_mm;
    return spot->reached ? spot->deviation_mm : -INFINITY;
}

typedef struct {
    double badness;
    size_t index;
} Ranked;

static int by_badness(const void *a, const void *b)
{
    const Ranked *p = a, *q = b;
    return p->badness != q->badness ? (p->badness < q->badness) - (p->badness > q->badness)
                                    : (p->index > q->index) - (p->index < q->index);
}

static int by_size(const void *a, const void *b)
{
    double x = *(const double *)a, y = *(const double *)b;
    return (x > y) - (x < y);
}

/* The worst spots that lie apart; the result holds WORST_SPOTS at most. */
static size_t find_worst(const Zone *zone, NcClimb towards, size_t worst[WORST_SPOTS])
{
    g_autofree Ranked *ranked = g_new(Ranked, zone->n + 1);
    for (size_t i = 0; i < zone->n; i++)
        ranked[i] = (Ranked){badness_of(&zone->spots[i], towards), i};
    qsort(ranked, zone->n, sizeof *ranked, by_badness);
    size_t n = 0;
    for (size_t i = 0; i < zone->n && n < WORST_SPOTS && ranked[i].badness > 0; i++) {
        SegVec3 p = zone->spots[ranked[i].index].point;
        bool apart = true;
        for (size_t k = 0; k < n && apart; k++)
            apart = seg_distance(p, zone->spots[worst[k]].point) > APART * zone->pitch_mm;
        if (apart)
            worst[n++] = ranked[i].index;
    }
    return n;
}

/* Climbs from the worst of the places; badness says how bad each is. */
static void climb_worst(const NcVerifier *verifier, Zone *zone, NcClimb towards,
                        const NcPlace *places, Ranked *ranked, size_t n, double step_mm)
{
    NcWorst found[WORST_SPOTS];
    qsort(ranked, n, sizeof *ranked, by_badness);
    size_t most = MIN(n, WORST_SPOTS);
#pragma omp parallel for schedule(dynamic, 1)
    for (size_t i = 0; i < most; i++)
        found[i] = nc_climb(verifier, zone->region, &places[ranked[i].index], towards, step_mm);
    NcJudgement *judgement = &zone->judgement;
    for (size_t i = 0; i < most; i++)
        nc_worst_take(towards == NC_CLIMB_GOUGE ? &judgement->gouge_max : &judgement->excess_max,
                      found[i]);
}

static void climb_spots(const NcVerifier *verifier, Zone *zone, NcClimb towards,
                        const size_t *spots, size_t n)
{
    Ranked ranked[WORST_SPOTS];
    for (size_t i = 0; i < n; i++)
        ranked[i] = (Ranked){badness_of(&zone->spots[spots[i]], towards), spots[i]};
    climb_worst(verifier, zone, towards, zone->places, ranked, n, zone->pitch_mm);
}

/* From the profiles' highest and lowest places. */
static void climb_profiles(const NcVerifier *verifier, Zone *zone, NcClimb towards,
                           const NcProfile *profiles, size_t n)
{
    g_autofree NcPlace *places = g_new(NcPlace, n + 1);
    g_autofree Ranked *ranked = g_new(Ranked, n + 1);
    bool gouge = towards == NC_CLIMB_GOUGE;
    for (size_t i = 0; i < n; i++) {
        places[i] = gouge ? profiles[i].bottom : profiles[i].top;
        ranked[i] = (Ranked){gouge ? -profiles[i].bottom_mm : profiles[i].top_mm, i};
    }
    climb_worst(verifier, zone, towards, places, ranked, n, zone->judgement.profile_pitch_mm);
}

/* What the profiles show of the step-over. */
static void sum_profiles(NcJudgement *judgement, const NcProfile *profiles, size_t n)
{
    judgement->n_profiles = n;
    g_autofree double *steps = g_new(double, n + 1);
    size_t n_steps = 0;
    for (size_t i = 0; i < n; i++) {
        judgement->profile_pitch_mm = fmax(judgement->profile_pitch_mm, profiles[i].pitch_mm);
        if (profiles[i].stepover_mm <= 0)
            continue;
        steps[n_steps++] = profiles[i].stepover_mm;
        judgement->pitch_share =
            fmax(judgement->pitch_share, profiles[i].pitch_mm / profiles[i].stepover_mm);
    }
    qsort(steps, n_steps, sizeof *steps, by_size);
    judgement->stepover_mm = n_steps > 0 ? steps[n_steps / 2] : NAN;
}

/* Profiles through these spots, and climbs from the worst. */
static void take_profiles(const NcVerifier *verifier, Zone *zone, const size_t *at, size_t n)
{
    g_autofree NcProfile *profiles = g_new(NcProfile, n + 1);
#pragma omp parallel for schedule(dynamic, 1)
    for (size_t i = 0; i < n; i++)
        profiles[i] = nc_profile(verifier, zone->region, &zone->places[at[i]]);
    size_t taken = 0;
    for (size_t i = 0; i < n; i++)
        if (profiles[i].pitch_mm > 0)
            profiles[taken++] = profiles[i];
    sum_profiles(&zone->judgement, profiles, taken);
    climb_profiles(verifier, zone, NC_CLIMB_GOUGE, profiles, taken);
    climb_profiles(verifier, zone, NC_CLIMB_EXCESS, profiles, taken);
}

static void look_closer(const NcVerifier *verifier, Zone *zone)
{
    size_t gouge[WORST_SPOTS], excess[WORST_SPOTS];
    size_t n_gouge = find_worst(zone, NC_CLIMB_GOUGE, gouge);
    climb_spots(verifier, zone, NC_CLIMB_GOUGE, gouge, n_gouge);
    if (zone->zone == 0 || zone->n == 0)
        return;
    size_t n_excess = find_worst(zone, NC_CLIMB_EXCESS, excess);
    climb_spots(verifier, zone, NC_CLIMB_EXCESS, excess, n_excess);
    g_autofree size_t *at = g_new(size_t, PROFILES + 2 * WORST_SPOTS);
    size_t even = MIN(zone->n, PROFILES), n = 0;
    for (size_t i = 0; i < even; i++)
        at[n++] = i * zone->n / even;
    for (size_t i = 0; i < n_gouge; i++)
        at[n++] = gouge[i];
    for (size_t i = 0; i < n_excess; i++)
        at[n++] = excess[i];
    take_profiles(verifier, zone, at, n);
}

/* -------------------------------------------------------------------------- sums */

static int by_deviation(const void *a, const void *b)
{
    const NcSpot *p = a, *q = b;
    return (p->deviation_mm > q->deviation_mm) - (p->deviation_mm < q->deviation_mm);
}

/* The excess that 99 % of the area that is reached does not go beyond. */
static double excess_p99(const NcSpot *spots, size_t n)
{
    g_autofree NcSpot *sorted = g_new(NcSpot, n + 1);
    size_t kept = 0;
    double area = 0;
    for (size_t i = 0; i < n; i++)
        if (spots[i].reached) {
            sorted[kept++] = spots[i];
            area += spots[i].area_mm2;
        }
    qsort(sorted, kept, sizeof *sorted, by_deviation);
    double above = 0;
    while (kept > 0 && above + sorted[kept - 1].area_mm2 <= 0.01 * area)
        above += sorted[--kept].area_mm2;
    return kept > 0 ? fmax(sorted[kept - 1].deviation_mm, 0) : 0;
}

static void sum_areas(NcJudgement *judgement, const NcSpot *spots, size_t n, double gouge_limit_mm,
                      double excess_limit_mm)
{
    double requested = 0, covered = 0, reached = 0, within = 0;
    for (size_t i = 0; i < n; i++) {
        const NcSpot *spot = &spots[i];
        if (spot->region == 0)
            continue;
        bool low = spot->deviation_mm <= excess_limit_mm;
        requested += spot->area_mm2;
        covered += low ? spot->area_mm2 : 0;
        reached += spot->reached ? spot->area_mm2 : 0;
        within +=
            spot->reached && low && spot->deviation_mm >= -gouge_limit_mm ? spot->area_mm2 : 0;
    }
    judgement->requested_area_mm2 = requested;
    judgement->unreachable_area_mm2 = fmax(requested - reached, 0);
    judgement->coverage_percent = requested > 0 ? 100 * (covered / requested) : NAN;
    judgement->within_tolerance_percent = reached > 0 ? 100 * (within / reached) : NAN;
}

static void sum_up(const NcVerifier *verifier, Zone *zone)
{
    NcJudgement *judgement = &zone->judgement;
    for (size_t i = 0; i < zone->n; i++) {
        const NcSpot *spot = &zone->spots[i];
        nc_worst_take(&judgement->gouge_max,
                      (NcWorst){-spot->deviation_mm, spot->point, zone->lines[i]});
        if (spot->reached)
            nc_worst_take(&judgement->excess_max,
                          (NcWorst){spot->deviation_mm, spot->point, zone->lines[i]});
    }
    judgement->region = zone->zone;
    judgement->n_spots = zone->n;
    judgement->survey_pitch_mm = zone->pitch_mm;
    judgement->excess_p99_mm = excess_p99(zone->spots, zone->n);
    sum_areas(judgement, zone->spots, zone->n, verifier->gouge_limit_mm, verifier->excess_limit_mm);
}

static void sum_whole(NcVerdict *verdict)
{
    NcJudgement *whole = &verdict->whole;
    whole->n_spots = verdict->n_spots;
    whole->stepover_mm = NAN;
    for (size_t r = 0; r < verdict->n_regions; r++) {
        const NcJudgement *region = &verdict->regions[r];
        nc_worst_take(&whole->gouge_max, region->gouge_max);
        nc_worst_take(&whole->excess_max, region->excess_max);
        whole->n_profiles += region->n_profiles;
        whole->survey_pitch_mm = fmax(whole->survey_pitch_mm, region->survey_pitch_mm);
        whole->profile_pitch_mm = fmax(whole->profile_pitch_mm, region->profile_pitch_mm);
        whole->pitch_share = fmax(whole->pitch_share, region->pitch_share);
    }
    whole->excess_p99_mm = excess_p99(verdict->spots, verdict->n_spots);
    sum_areas(whole, verdict->spots, verdict->n_spots, verdict->gouge_limit_mm,
              verdict->excess_limit_mm);
}

static double cutting_s(const NcVerifier *verifier, size_t n)
{
    g_autoptr(NcMotion) motion =
        nc_motion_new(verifier->input->machine, NC_NO_OVERRIDE, 0, verifier->moves, n);
    double s = 0;
    for (size_t i = 0; i < n; i++)
        if (verifier->moves[i].kind == NC_MOVE_FEED || verifier->moves[i].kind == NC_MOVE_ARC)
            s += nc_motion_duration_s(motion, i);
    return s;
}

/* -------------------------------------------------------------------- collisions */

/* Cuts the verifier's stock, which is of no use for uncut places then. */
static bool collide(NcVerifier *verifier, size_t n, NcVerdict *verdict, GError **error)
{
    verdict->collision_pitch_mm = verifier->pitch_mm;
    return nc_stock_cut(verifier->stock, verifier->moves, n, verifier->zero, verifier->input->tools,
                        verdict->collisions, error);
}
