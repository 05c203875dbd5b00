/* SPDX-License-Identifier: Apache-2.0 */
/* Words into a block: modal groups, repeated and useless words, the motion of the block. */
#include "nc/gcode/interpreter.h"

/* LinuxCNC takes four M words in a block. */
enum { MAX_M_WORDS = 4 };

static bool sort_words(NcBlock *block, uint32_t line, GError **error);
static bool check_users(const NcBlock *block, uint32_t line, GError **error);
static bool check_values(const NcBlock *block, uint32_t line, GError **error);
static bool find_motion(NcBlock *block, const NcModal *modal, uint32_t line, GError **error);
static bool check_motion(const NcBlock *block, const NcModal *modal, uint32_t line, GError **error);

bool nc_check(NcBlock *block, const NcModal *modal, GError **error)
{
    uint32_t line = modal->line;
    return sort_words(block, line, error) && find_motion(block, modal, line, error) &&
           check_users(block, line, error) && check_values(block, line, error) &&
           check_motion(block, modal, line, error);
}

/* ----------------------------------------------------------------- sorting words */

/* The group of ten times a G number; -1: not supported. */
static int g_group(int code)
{
    switch (code) {
    case 0:
    case 10:
    case 20:
    case 30:
    case 730:
    case 810:
    case 820:
    case 830:
    case 840:
    case 850:
    case 860:
    case 890:
        return NC_G_MOTION;
    case 980:
    case 990:
        return NC_G_RETRACT;
    case 800:
        return NC_G_CANCEL;
    case 40:
    case 100:
    case 280:
    case 281:
    case 300:
    case 301:
    case 520:
    case 530:
    case 920:
    case 921:
    case 922:
    case 923:
        return NC_G_NON_MODAL;
    case 170:
    case 180:
    case 190:
        return NC_G_PLANE;
    case 200:
    case 210:
        return NC_G_UNITS;
    case 400:
        return NC_G_CUTTER;
    case 430:
    case 431:
    case 490:
        return NC_G_TOOL;
    case 540:
    case 550:
    case 560:
    case 570:
    case 580:
    case 590:
        return NC_G_WORK;
    case 610:
    case 611:
    case 640:
        return NC_G_CONTROL;
    case 900:
    case 910:
        return NC_G_DISTANCE;
    case 901:
    case 911:
        return NC_G_ARC;
    case 940:
        return NC_G_FEED_MODE;
    default:
        return -1;
    }
}

static int m_group(int code)
{
    switch (code) {
    case 0:
    case 1:
    case 2:
    case 30:
        return NC_M_STOP;
    case 3:
    case 4:
    case 5:
        return NC_M_SPINDLE;
    case 6:
        return NC_M_TOOL;
    case 7:
    case 8:
    case 9:
        return NC_M_COOLANT;
    default:
        return -1;
    }
}

/* Puts a G or M word, whose number times `scale` is whole, into its group. */
static bool sort_code(const NcWord *word, int scale, int (*group_of)(int), int *code,
                      const NcWord **by_group, uint32_t line, GError **error)
{
    double scaled = word->value * scale, whole = round(scaled);
    int group = fabs(scaled - whole) < 1e-6 && fabs(whole) < 1e4 ? group_of((int)whole) : -1;
    if (group < 0)
        return nc_word_error(error, line, word, "is not supported");
    const NcWord *other = by_group[group];
    if (other) {
        return nc_word_error(error, line, word,
                             "cannot stand with %.*s in one block: they are of one modal group",
                             other->length, other->text);
    }
    code[group] = (int)whole;
    by_group[group] = word;
    return true;
}

static bool sort_words(NcBlock *block, uint32_t line, GError **error)
{
    int n_m = 0;
    for (const NcWord *word = block->words; word < block->words + block->n_words; word++) {
        bool good = true;
        if (word->letter == 'G') {
            good = sort_code(word, 10, g_group, block->g, block->g_word, line, error);
        } else if (word->letter == 'M') {
            good = sort_code(word, 1, m_group, block->m, block->m_word, line, error);
            if (good && ++n_m > MAX_M_WORDS) {
                return nc_word_error(error, line, word, "is one M word too many: %d are read",
                                     MAX_M_WORDS);
            }
        } else if (block->letter[word->letter - 'A']) {
            good = nc_word_error(error, line, word, "is the second %c word of the block",
                                 word->letter);
        } else if (word->letter == 'N' && word != block->words) {
            good = nc_word_error(error, line, word, "must be the first word of the block");
        } else {
            block->letter[word->letter - 'A'] = word;
        }
        if (!good)
            return false;
    }
    return true;
}

/* ------------------------------------------------------------ the block's motion */

static const NcWord *axis_word(const NcBlock *block)
{
    const NcWord *x = nc_word(block, 'X'), *y = nc_word(block, 'Y'), *z = nc_word(block, 'Z');
    return x ? x : y ? y : z;
}

static bool is_arc(int code)
{
    return code == 20 || code == 30;
}

bool nc_block_keeps_axes(const NcBlock *block)
{
    int code = block->g[NC_G_NON_MODAL];
    return code == 100 || code == 280 || code == 300 || code == 520 || code == 920 ||
           block->g[NC_G_TOOL] == 431;
}

/* False for those that neither take axis words nor leave them to a motion. */
static bool uses_axes(int non_modal)
{
    return non_modal != 281 && non_modal != 301 && (non_modal < 921 || non_modal > 923);
}

/* Axis words without a motion word continue the modal motion; so do I, J, K after an arc. */
static bool find_motion(NcBlock *block, const NcModal *modal, uint32_t line, GError **error)
{
    const NcWord *axis = axis_word(block);
    const NcWord *word = block->g_word[NC_G_MOTION];
    int non_modal = block->g[NC_G_NON_MODAL];
    bool cancel = block->g_word[NC_G_CANCEL] != NULL;
    block->motion = block->g[NC_G_MOTION];
    if (nc_block_keeps_axes(block) || !uses_axes(non_modal)) {
        const NcWord *user = block->g_word[block->g[NC_G_TOOL] == 431 ? NC_G_TOOL : NC_G_NON_MODAL];
        if (word) {
            return nc_word_error(error, line, word, "cannot stand with %.*s in one block",
                                 user->length, user->text);
        }
        return nc_block_keeps_axes(block) || !axis ||
               nc_word_error(error, line, axis, "has no use with %.*s", user->length, user->text);
    }
    if (axis && !word && (cancel || modal->motion == 800)) {
        return nc_word_error(error, line, axis,
                             cancel ? "has no use with G80"
                                    : "has no use: no G0, G1, G2 or G3 is in force");
    }
    bool offsets = nc_word(block, 'I') || nc_word(block, 'J') || nc_word(block, 'K');
    if (!word && !cancel && (axis || (offsets && is_arc(modal->motion))))
        block->motion = modal->motion;
    return true;
}

/* ------------------------------------------------------------------- other words */

/* Codes that say nothing without axis words. */
static bool check_axes(const NcBlock *block, uint32_t line, GError **error)
{
    int code = block->g[NC_G_NON_MODAL];
    const NcWord *x = nc_word(block, 'X'), *y = nc_word(block, 'Y');
    if ((code == 520 || code == 920) && !axis_word(block))
        return nc_word_error(error, line, block->g_word[NC_G_NON_MODAL], "needs an axis word");
    if (block->g[NC_G_TOOL] != 431)
        return true;
    if (uses_axes(code) && code >= 0 && code != 40)
        return nc_word_error(error, line, block->g_word[NC_G_TOOL],
                             "cannot stand with another code that takes axis words");
    if (x || y) {
        return nc_word_error(error, line, x ? x : y,
                             "is not supported with G43.1: a tool has a length along Z only");
    }
    return nc_word(block, 'Z') ||
           nc_word_error(error, line, block->g_word[NC_G_TOOL], "needs a Z word: the length");
}

/* Words that only some codes use are refused without one. P serves one code at a time: LinuxCNC
 * would hand it to each of G4, G64 and G2, G3, which nobody can mean. */
static bool check_users(const NcBlock *block, uint32_t line, GError **error)
{
    bool arc = is_arc(block->motion), dwell = block->g[NC_G_NON_MODAL] == 40;
    bool data = block->g[NC_G_NON_MODAL] == 100;
    bool cycle = nc_is_cycle(block->motion);
    bool waits = block->motion == 820 || block->motion == 840 || block->motion == 860 ||
                 block->motion == 890;
    bool pecks = block->motion == 730 || block->motion == 830;
    bool blend = block->g[NC_G_CONTROL] == 640, offset = block->g[NC_G_TOOL] == 430;
    const struct {
        char letter;
        bool used;
        const char *users;
    } words[] = {
        {'H', offset, "G43"},
        {'I', arc, "G2 or G3"},
        {'J', arc, "G2 or G3"},
        {'K', arc, "G2 or G3"},
        {'L', data || cycle, "G10 or a canned cycle"},
        {'R', arc || data || cycle, "G2, G3, G10 or a canned cycle"},
        {'P', arc || dwell || blend || data || waits, "G2, G3, G4, G10, G64, G82, G84, G86 or G89"},
        {'Q', blend || pecks, "G64, G73 or G83"}};
    for (size_t i = 0; i < G_N_ELEMENTS(words); i++) {
        const NcWord *word = nc_word(block, words[i].letter);
        if (word && !words[i].used)
            return nc_word_error(error, line, word, "needs %s in the same block", words[i].users);
    }
    const NcWord *p = nc_word(block, 'P');
    if (p && arc + dwell + blend + data + waits > 1) {
        return nc_word_error(error, line, p,
                             "could belong to two of the block's G words: give them a block each");
    }
    if (data && !(p && nc_word(block, 'L'))) {
        return nc_word_error(error, line, block->g_word[NC_G_NON_MODAL],
                             "needs L2 or L20, and P: the coordinate system");
    }
    if (!check_axes(block, line, error))
        return false;
    if (dwell && !p) {
        return nc_word_error(error, line, block->g_word[NC_G_NON_MODAL],
                             "needs a P word: the seconds to wait");
    }
    return true;
}

static bool check_values(const NcBlock *block, uint32_t line, GError **error)
{
    for (const char *letter = "FHLNSTPQ"; *letter; letter++) {
        const NcWord *word = nc_word(block, *letter);
        if (!word)
            continue;
        if (word->value < 0.0)
            return nc_word_error(error, line, word, "must not be negative");
        bool whole = *letter == 'H' || *letter == 'T' || *letter == 'L' ||
                     (*letter == 'P' && is_arc(block->motion));
        if (whole && (word->value != floor(word->value) || word->value > 99999.0))
            return nc_word_error(error, line, word, "must be a whole number up to 99999");
        if (*letter == 'L' && word->value < 1.0)
            return nc_word_error(error, line, word, "must be at least 1");
        if (*letter == 'P' && is_arc(block->motion) && word->value < 1.0)
            return nc_word_error(error, line, word, "must be at least one turn");
    }
    return true;
}

static bool check_motion(const NcBlock *block, const NcModal *modal, uint32_t line, GError **error)
{
    const NcWord *word = block->g_word[NC_G_MOTION];
    if (block->g[NC_G_NON_MODAL] == 530) {
        const NcWord *g53 = block->g_word[NC_G_NON_MODAL];
        int distance = block->g[NC_G_DISTANCE];
        if (block->motion != 0 && block->motion != 10)
            return nc_word_error(error, line, g53, "needs G0 or G1");
        if (distance == 910 || (distance < 0 && modal->incremental))
            return nc_word_error(error, line, g53, "cannot be used with G91: add G90");
    }
    if (nc_is_cycle(block->motion) && !axis_word(block))
        return nc_word_error(error, line, nc_motion_word(block), "needs an axis word");
    double feed = nc_word(block, 'F') ? nc_word(block, 'F')->value : modal->feed_mm_min;
    if (block->motion > 0 && !(feed > 0.0)) {
        return nc_word_error(error, line, word ? word : &block->words[0],
                             "needs a feed: add an F word above 0");
    }
    return true;
}
