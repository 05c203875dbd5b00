/* SPDX-License-Identifier: Apache-2.0 */
/*
 * config: the INI files as typed structs. Every key is described once, in a table (config/keys.*)
 * with its type, unit, default, range and help; reading, the commented examples and the messages
 * come from that table. Unknown or repeated groups and keys, and values out of range, are errors
 * that name file, line, group, key and, for an unknown one, the nearest known one.
 *
 * Units: mm, s, rev/min, mm/min, mm/s² as the names say. Strings and arrays belong to the struct.
 */
#ifndef CONFIG_CONFIG_H
#define CONFIG_CONFIG_H

#include <glib.h>
#include <stdbool.h>
#include <stdint.h>

typedef enum {
    CFG_ERROR_IO,    /* cannot read the file */
    CFG_ERROR_PARSE, /* not INI, or a key or group repeated */
    CFG_ERROR_KEY,   /* unknown group or key */
    CFG_ERROR_VALUE, /* wrong type or out of range, or values that do not go together */
    CFG_ERROR_SET,   /* any of these in an override from the command line */
} CfgError;

#define CFG_ERROR cfg_error_quark()
GQuark cfg_error_quark(void);

/* Appends the shortest decimal number that reads back as the same double, never "-0"; "null" where
 * `value` is not finite. The one number writer of every text we write. */
void cfg_number_append(GString *out, double value);

/* Modbus/TCP Security: PEM files. All three, or none. */
typedef struct {
    char *ca;          /* whom we trust: the peer's certificate is signed by it */
    char *certificate; /* ours, and behind it those between it and the peer's CA */
    char *key;         /* ours; only its owner may read it */
} CfgTls;

/* CAN: the lowest identifier, and how many agents have room behind it (docs/protocol.md, 9.1). */
enum { CFG_CAN_BASE_MOST = 0x7a0, CFG_CAN_AGENTS_MOST = 16 };

/* ------------------------------------------------------------------- tool table */

typedef enum {
    CFG_TOOL_FLAT,
    CFG_TOOL_BALL,
    CFG_TOOL_BULL,
    CFG_TOOL_DRILL,
    CFG_TOOL_CHAMFER,
    CFG_TOOL_TAPER,
    CFG_N_TOOL_KINDS
} CfgToolKind;

typedef struct {
    char *material;
    double cutting_speed_m_min;
    double feed_per_tooth_mm;
} CfgCutting;

typedef struct {
    int number;
    CfgToolKind kind;
    double diameter_mm;
    double corner_radius_mm; /* flat 0, ball diameter / 2 */
    double tip_angle_deg;    /* between opposite sides: drill, chamfer, taper; others 0 */
    double tip_diameter_mm;  /* of the flat at a chamfer's tip, of the ball at a taper's */
    double flute_length_mm;
    double stickout_mm; /* tip to the holder's nose */
    double length_mm;   /* gauge line to tip: the offset of G43 */
    double shank_diameter_mm;
    double holder_diameter_mm;
    bool counterclockwise; /* a left-hand tool: it cuts with M4 */
    double max_depth_of_cut_mm;
    int flutes;
    CfgCutting *cutting; /* one a material */
    size_t n_cutting;
} CfgTool;

/* Ascending by number. */
typedef struct {
    CfgTool *tools;
    size_t n_tools;
} CfgToolTable;

CfgToolTable *cfg_tools_load(const char *path, GError **error);
void cfg_tools_free(CfgToolTable *table);
G_DEFINE_AUTOPTR_CLEANUP_FUNC(CfgToolTable, cfg_tools_free)
/* NULL where the table does not have it. */
const CfgTool *cfg_tools_find(const CfgToolTable *table, int number);
const char *cfg_tool_kind_name(CfgToolKind kind); /* "flat", "ball", "bull", … */

/* ---------------------------------------------------------------------- machine */

typedef enum { CFG_AGENT_LOSS_NEXT_GATE, CFG_AGENT_LOSS_FINISH, CFG_AGENT_LOSS_HOLD } CfgAgentLoss;

typedef struct {
    double min_mm, max_mm; /* travel, machine coordinates */
    double max_mm_min;
    double max_mm_s2;
    double max_mm_s3; /* jerk; 0: not limited, speed goes in trapezoids */
} CfgAxis;

/* A, B or C; `present` is false where the machine does not have it. */
typedef struct {
    bool present;
    double min_deg, max_deg; /* travel, machine coordinates */
    double max_deg_min;
    double max_deg_s2;
    double max_deg_s3; /* 0: not limited */
} CfgRotary;

/* G54 … G59, and G59.1 … G59.3 behind them. */
enum { CFG_N_WORK_OFFSETS = 9 };

typedef struct {
    char *name;
    char *dialect;       /* "linuxcnc" */
    CfgAxis axis[3];     /* X, Y, Z */
    CfgRotary rotary[3]; /* A, B, C */
    double spindle_min_rpm, spindle_max_rpm;
    double spindle_rpm_per_s;
    double orient_s;  /* M19 */
    double coolant_s; /* M7, M8, M9 */
    double tool_change_s;
    double tool_change_mm[3]; /* machine coordinates */
    double work_offset_mm[CFG_N_WORK_OFFSETS][3];
    double work_offset_deg[CFG_N_WORK_OFFSETS][3]; /* A, B, C */
    uint64_t program_memory_bytes;
    CfgAgentLoss on_agent_loss;
    double agent_timeout_s; /* heartbeat missing for this long is agent loss */
    char *tools_file;       /* resolved against the machine file's folder */
    bool beyond_loopback;   /* plain Modbus may listen there: whoever reaches it commands */
    CfgTls tls;             /* NULLs: no TLS */
    int can_base;           /* lowest CAN identifier */
    char *can_key;          /* file of the key that is shared with the agents; NULL: no CAN */
    int can_agents;         /* numbers of agents that are served, from 0 */
} CfgMachine;

CfgMachine *cfg_machine_load(const char *path, GError **error);
void cfg_machine_free(CfgMachine *machine);
G_DEFINE_AUTOPTR_CLEANUP_FUNC(CfgMachine, cfg_machine_free)

/* Commented files with every key and its default, as shipped in config/etc; caller frees. */
char *cfg_machine_example(void);
char *cfg_agent_example(void);

/* ----------------------------------------------------------------------- recipe */

typedef enum {
    CFG_UP_PLUS_X,
    CFG_UP_MINUS_X,
    CFG_UP_PLUS_Y,
    CFG_UP_MINUS_Y,
    CFG_UP_PLUS_Z,
    CFG_UP_MINUS_Z
} CfgUp;

/* Where the work zero lies on the part's bounding box, after `up` has been turned to +Z. */
typedef enum {
    CFG_ZERO_PART,       /* the part's own origin */
    CFG_ZERO_TOP_CENTRE, /* centre in X and Y, top in Z */
    CFG_ZERO_TOP_CORNER, /* smallest X and Y, top in Z */
    CFG_ZERO_BOTTOM_CENTRE,
    CFG_ZERO_BOTTOM_CORNER,
} CfgZero;

typedef enum {
    CFG_STOCK_NEAR_NET, /* the part and the allowance on every face */
    CFG_STOCK_BOX,
    CFG_STOCK_CYLINDER, /* upright */
    CFG_STOCK_FILE,
} CfgStockKind;
typedef enum {
    CFG_STRATEGY_AUTO,
    CFG_STRATEGY_ISO_PLANAR,
    CFG_STRATEGY_ISO_PARAMETRIC
} CfgStrategy;
typedef enum { CFG_METHOD_FEATURE_SIZE, CFG_METHOD_NONE } CfgMethod;
typedef enum { CFG_REPAIR_EXACT, CFG_REPAIR_RULE, CFG_REPAIR_POINTS } CfgRepair;

/* [region.NAME]: 0 (or AUTO, false) means: let the planner choose. */
typedef struct {
    char *name;
    int tool;
    double feed_mm_min;
    double spindle_rpm;
    CfgStrategy strategy;
    bool skip;
} CfgRegion;

typedef struct {
    char *path; /* of the recipe itself */
    char *part_file;
    double chord_mm; /* 0: taken from tolerance_mm */
    CfgUp up;
    CfgZero zero;
    int wcs;             /* 54 … 59 */
    double clearance_mm; /* safe height above the stock */
    int32_t *keep_out;   /* faces that are not machined */
    size_t n_keep_out;
    CfgStockKind stock_kind;
    double allowance_mm;
    double stock_min_mm[3], stock_max_mm[3]; /* box and cylinder, workpiece coordinates; equal: the
                                                part's own box and the allowance around it */
    char *stock_file;                        /* workpiece coordinates; NULL: none */
    char *material;
    char *machine_file;
    char *tools_file;
    int *use_tools; /* tool numbers; none: all of the table */
    size_t n_use_tools;
    double scallop_mm, tolerance_mm, stock_to_leave_mm;
    double overlap_mm; /* neighbouring regions, against witness lines */
    bool one_way;      /* else zigzag */
    CfgMethod method;
    struct {
        CfgRepair repair;
        int points;
        double datum_mm, tolerance, subset_tolerance, min_size_mm, local_ratio;
        int32_t *local_tags, *local_faces;
        size_t n_local_tags, n_local_faces;
        int32_t (*reassign)[2]; /* written "face:tag, face:tag" */
        size_t n_reassign;
        bool split_rest;
    } feature_size;
    CfgRegion *regions;
    size_t n_regions;
    char **settings; /* every key in force as "group.key=value", sorted; NULL-terminated */
} CfgRecipe;

/* `set` holds "group.key=value" (or "key=value" where the key is unique) overrides; may be NULL.
 * File names are resolved against the recipe's folder. */
CfgRecipe *cfg_recipe_load(const char *path, char *const *set, GError **error);

/* The defaults with overrides, for `segment PART` that has no recipe file. */
CfgRecipe *cfg_recipe_default(const char *part_file, char *const *set, GError **error);
void cfg_recipe_free(CfgRecipe *recipe);
G_DEFINE_AUTOPTR_CLEANUP_FUNC(CfgRecipe, cfg_recipe_free)

/* A commented recipe with every key and its default; caller frees. */
char *cfg_recipe_example(const char *part_file);

/* The overrides for one region, NULL where the recipe has none. */
const CfgRegion *cfg_recipe_region(const CfgRecipe *recipe, const char *name);

/* ------------------------------------------------------------------------ agent */

typedef struct {
    char *name;
    char *address; /* modbus://host:port, mbaps://host:port with `tls`, can://interface */
    bool plain;    /* modbus:// may go beyond loopback */
    CfgTls tls;
    int unit_id;
    int can_base;            /* lowest CAN identifier */
    char *can_key;           /* file of the key that is shared with the machine */
    int can_first, can_last; /* agents' numbers that programs of this host may have */
    char *machine_file;      /* its description; NULL: not known to the agent */
} CfgTarget;

/* Feeding a program while it runs, because the machine's memory cannot hold it. */
typedef enum { CFG_DRIP_AUTO, CFG_DRIP_NEVER, CFG_DRIP_ALWAYS } CfgDrip;

typedef enum { CFG_BIAS_AS_IS, CFG_BIAS_DISABLED, CFG_BIAS_PULL_UP, CFG_BIAS_PULL_DOWN } CfgBias;

/* The operator's panel; each line by its name, or by its offset in digits. */
typedef struct {
    char *chip; /* name, label or path; NULL: no panel */
    char *start, *hold, *lamp;
    bool active_low, lamp_active_low;
    CfgBias bias; /* of the buttons */
    int debounce_ms;
} CfgPanel;

typedef struct {
    CfgTarget *machines;
    size_t n_machines;
    double reply_timeout_s; /* no answer for this long: close, reconnect, read */
    double reconnect_s;     /* pause before a reconnect */
    double give_up_s; /* unreachable for this long: exit 4 before the start, 7 while running */
    double heartbeat_s;
    int window; /* requests in flight, 1 … 16 */
    CfgDrip drip;
    CfgPanel panel;
} CfgAgent;

CfgAgent *cfg_agent_load(const char *path, GError **error);
CfgAgent *cfg_agent_default(GError **error);
void cfg_agent_free(CfgAgent *agent);
G_DEFINE_AUTOPTR_CLEANUP_FUNC(CfgAgent, cfg_agent_free)

#endif
