/* SPDX-License-Identifier: Apache-2.0 */
/* Words into a block: modal groups, repeated and useless words, the motion of the block. */
#include "nc/gcode/interpreter.h"

/* LinuxCNC takes four M words in a block. */
enum { MAX_M_WORDS = 4 };

/* Letters whose words are looked at by what uses them; the others always mean something. */
#define USED_BY_CODES                                                                              \
    (NC_LETTER('D') | NC_LETTER('H') | NC_LETTER('I') | NC_LETTER('J') | NC_LETTER('K') |          \
     NC_LETTER('L') | NC_LETTER('P') | NC_LETTER('Q') | NC_LETTER('R'))

/* Letters whose numbers are not free. */
#define LIMITED                                                                                    \
    (NC_LETTER('F') | NC_LETTER('H') | NC_LETTER('L') | NC_LETTER('N') | NC_LETTER('P') |          \
     NC_LETTER('Q') | NC_LETTER('R') | NC_LETTER('S') | NC_LETTER('T'))

static bool sort_words(NcBlock *block, uint32_t line, GError **error);
static bool check_needs(const NcBlock *block, uint32_t line, GError **error);
static bool check_users(const NcBlock *block, uint32_t line, GError **error);
static bool check_values(const NcBlock *block, uint32_t line, GError **error);
static bool find_motion(NcBlock *block, const NcModal *modal, GError **error);
static bool check_motion(const NcBlock *block, const NcModal *modal, GError **error);

bool nc_check(NcBlock *block, const NcModal *modal, GError **error)
{
    uint32_t line = modal->line;
    return sort_words(block, line, error) && find_motion(block, modal, error) &&
           (!(block->by.letters & USED_BY_CODES) || check_users(block, line, error)) &&
           (!(block->by.some_g || block->by.some_m) || check_needs(block, line, error)) &&
           (!(block->by.letters & LIMITED) || check_values(block, line, error)) &&
           check_motion(block, modal, error);
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
    case 382:
    case 383:
    case 384:
    case 385:
    case 730:
    case 810:
    case 820:
    case 830:
    case 840:
    case 850:
    case 860:
    case 870:
    case 880:
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
    case 410:
    case 411:
    case 420:
    case 421:
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
    case 591:
    case 592:
    case 593:
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
    case 930:
    case 940:
    case 950:
        return NC_G_FEED_MODE;
    case 960:
    case 970:
        return NC_G_SPINDLE;
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
    case 60:
        return NC_M_STOP;
    case 3:
    case 4:
    case 5:
    case 19:
        return NC_M_SPINDLE;
    case 6:
    case 61:
        return NC_M_TOOL;
    case 7:
    case 8:
    case 9:
        return NC_M_COOLANT;
    case 48:
    case 49:
    case 50:
    case 51:
    case 52:
    case 53:
        return NC_M_OVERRIDE;
    default:
        return -1;
    }
}

/* Puts a G or M word, whose number times `scale` is whole, into its group. */
static bool sort_code(const NcBlock *block, int place, int scale, int (*group_of)(int),
                      int16_t *codes, uint8_t *by_group, uint32_t line, GError **error)
{
    const NcWord *word = &block->words[place];
    double scaled = word->value * scale;
    int whole = fabs(scaled) < 1e4 ? (int)(scaled + 0.5) : -1;
    int group = fabs(scaled - whole) < 1e-6 ? group_of(whole) : -1;
    if (group < 0)
        return nc_word_error(error, line, word, "is not supported");
    const NcWord *other = nc_word_of(block, by_group[group]);
    if (other) {
        return nc_word_error(error, line, word,
                             "cannot stand with %.*s in one block: they are of one modal group",
                             other->length, other->text);
    }
    codes[group] = (int16_t)whole;
    by_group[group] = (uint8_t)(place + 1);
    return true;
}

static bool sort_letter(NcBlock *block, int place, uint32_t line, GError **error)
{
    const NcWord *word = &block->words[place];
    const uint32_t bit = NC_LETTER(word->letter);
    if (block->by.letters & bit)
        return nc_word_error(error, line, word, "is the second %c word of the block", word->letter);
    if (word->letter == 'N' && place > 0)
        return nc_word_error(error, line, word, "must be the first word of the block");
    block->by.letters |= bit;
    block->by.letter[word->letter - 'A'] = (uint8_t)(place + 1);
    return true;
}

static bool sort_words(NcBlock *block, uint32_t line, GError **error)
{
    NcSorted *by = &block->by;
    int n_m = 0;
    for (int i = 0; i < block->n_words; i++) {
        bool good = true;
        if (block->words[i].letter == 'G') {
            good = sort_code(block, i, 10, g_group, by->g, by->g_word, line, error);
            by->some_g = by->some_g || by->g_word[NC_G_MOTION] != i + 1;
        } else if (block->words[i].letter == 'M') {
            by->some_m = true;
            good = sort_code(block, i, 1, m_group, by->m, by->m_word, line, error);
            if (good && ++n_m > MAX_M_WORDS) {
                return nc_word_error(error, line, &block->words[i],
                                     "is one M word too many: %d are read", MAX_M_WORDS);
            }
        } else {
            good = sort_letter(block, i, line, error);
        }
        if (!good)
            return false;
    }
    return true;
}

/* ------------------------------------------------------------ the block's motion */

static const NcWord *first_word_of(const NcBlock *block, const char *letters)
{
    for (; *letters; letters++)
        if (nc_word(block, *letters))
            return nc_word(block, *letters);
    return NULL;
}

static const NcWord *axis_word(const NcBlock *block)
{
    return block->by.letters & NC_AXES ? first_word_of(block, "XYZABC") : NULL;
}

static bool is_arc(int code)
{
    return code == 20 || code == 30;
}

/* Whether axis words say something else than where to move. */
static bool keeps_axes(const NcBlock *block)
{
    int code = block->by.g[NC_G_NON_MODAL];
    return code == 100 || code == 280 || code == 300 || code == 520 || code == 920 ||
           block->by.g[NC_G_TOOL] == 431;
}

/* False for those that neither take axis words nor leave them to a motion. */
static bool uses_axes(int non_modal)
{
    return non_modal != 281 && non_modal != 301 && (non_modal < 921 || non_modal > 923);
}

/* G codes that take the axis words, or forbid them. */
static bool check_axis_codes(const NcBlock *block, uint32_t line, GError **error)
{
    const NcWord *axis = axis_word(block), *word = nc_g_word(block, NC_G_MOTION);
    const NcWord *user =
        nc_g_word(block, block->by.g[NC_G_TOOL] == 431 ? NC_G_TOOL : NC_G_NON_MODAL);
    if (word) {
        return nc_word_error(error, line, word, "cannot stand with %.*s in one block", user->length,
                             user->text);
    }
    return keeps_axes(block) || !axis ||
           nc_word_error(error, line, axis, "has no use with %.*s", user->length, user->text);
}

/* Axis words without a motion word continue the modal motion; so do I, J, K after an arc. */
static bool find_motion(NcBlock *block, const NcModal *modal, GError **error)
{
    bool word = block->by.g_word[NC_G_MOTION] > 0, cancel = block->by.g_word[NC_G_CANCEL] > 0;
    block->motion = block->by.g[NC_G_MOTION];
    if (block->by.some_g && (keeps_axes(block) || !uses_axes(block->by.g[NC_G_NON_MODAL])))
        return check_axis_codes(block, modal->line, error);
    if (word)
        return true;
    bool axis = block->by.letters & NC_AXES;
    if (axis && (cancel || modal->motion == 800)) {
        return nc_word_error(error, modal->line, axis_word(block),
                             cancel ? "has no use with G80"
                                    : "has no use: no G0, G1, G2 or G3 is in force");
    }
    bool offsets = block->by.letters & (NC_LETTER('I') | NC_LETTER('J') | NC_LETTER('K'));
    if (!cancel && (axis || (offsets && is_arc(modal->motion))))
        block->motion = modal->motion;
    return true;
}

/* ------------------------------------------------------------------- other words */

/* A word that at most one code of the block may use. LinuxCNC would hand P to each of G4, G64 and
 * G2, G3, which nobody can mean. */
static bool check_user(const NcBlock *block, char letter, int n_users, const char *users,
                       uint32_t line, GError **error)
{
    const NcWord *word = nc_word(block, letter);
    if (!word || n_users == 1)
        return true;
    if (n_users == 0)
        return nc_word_error(error, line, word, "needs %s in the same block", users);
    return nc_word_error(error, line, word,
                         "could belong to two of the block's words: give them a block each");
}

/* Words that only some codes use are refused without one. */
static bool check_users(const NcBlock *block, uint32_t line, GError **error)
{
    const int motion = block->motion, m = block->by.m[NC_M_OVERRIDE];
    const bool arc = is_arc(motion), cycle = nc_is_cycle(motion), back = motion == 870;
    const bool dwell = block->by.g[NC_G_NON_MODAL] == 40;
    const bool data = block->by.g[NC_G_NON_MODAL] == 100;
    const bool waits =
        motion == 820 || motion == 840 || motion == 860 || motion == 880 || motion == 890;
    const bool pecks = motion == 730 || motion == 830;
    const bool blend = block->by.g[NC_G_CONTROL] == 640;
    const bool orient = block->by.m[NC_M_SPINDLE] == 19;
    const bool cutter = block->by.g[NC_G_CUTTER] > 400;
    const bool number = block->by.m[NC_M_TOOL] == 61, enables = m >= 50;
    return check_user(block, 'D', cutter + (block->by.g[NC_G_SPINDLE] == 960),
                      "G41, G42, G41.1, G42.1 or G96", line, error) &&
           check_user(block, 'H', block->by.g[NC_G_TOOL] == 430, "G43", line, error) &&
           check_user(block, 'I', arc + back, "G2, G3 or G87", line, error) &&
           check_user(block, 'J', arc + back, "G2, G3 or G87", line, error) &&
           check_user(block, 'K', arc + back, "G2, G3 or G87", line, error) &&
           check_user(block, 'L', data + cycle, "G10 or a canned cycle", line, error) &&
           check_user(block, 'R', arc + data + cycle + orient, "G2, G3, G10, M19 or a canned cycle",
                      line, error) &&
           check_user(block, 'P', arc + dwell + blend + data + waits + orient + enables,
                      "G2, G3, G4, G10, G64, G82, G84, G86, G88, G89, M19 or M50 to M53", line,
                      error) &&
           check_user(block, 'Q', blend + pecks + orient + number, "G64, G73, G83, M19 or M61",
                      line, error);
}

static bool need(const NcBlock *block, const NcWord *word, char letter, const char *what,
                 uint32_t line, GError **error)
{
    return !word || nc_word(block, letter) || nc_word_error(error, line, word, "needs %s", what);
}

/* Codes that say nothing without axis words. */
static bool check_axes(const NcBlock *block, uint32_t line, GError **error)
{
    int code = block->by.g[NC_G_NON_MODAL];
    const NcWord *tool = nc_g_word(block, NC_G_TOOL);
    if ((code == 520 || code == 920) && !axis_word(block))
        return nc_word_error(error, line, nc_g_word(block, NC_G_NON_MODAL), "needs an axis word");
    if (block->by.g[NC_G_TOOL] != 431)
        return true;
    if (uses_axes(code) && code >= 0 && code != 40)
        return nc_word_error(error, line, tool,
                             "cannot stand with another code that takes axis words");
    const NcWord *other = first_word_of(block, "XYABC");
    if (other) {
        return nc_word_error(error, line, other,
                             "is not supported with G43.1: a tool has a length along Z only");
    }
    return need(block, tool, 'Z', "a Z word: the length", line, error);
}

static bool check_needs(const NcBlock *block, uint32_t line, GError **error)
{
    int code = block->by.g[NC_G_NON_MODAL];
    const NcWord *non_modal = nc_g_word(block, NC_G_NON_MODAL), *m = NULL;
    if (code == 100 && !(nc_word(block, 'P') && nc_word(block, 'L'))) {
        return nc_word_error(error, line, non_modal,
                             "needs L2 or L20 and P, the coordinate system, or L1, L10 or L11 and "
                             "P, the tool");
    }
    if (!check_axes(block, line, error))
        return false;
    if (code == 40 && !need(block, non_modal, 'P', "a P word: the seconds to wait", line, error))
        return false;
    if (block->by.g[NC_G_SPINDLE] == 960)
        return need(block, nc_g_word(block, NC_G_SPINDLE), 'S',
                    "an S word: metres in a minute, or feet with G20", line, error);
    if (block->by.m[NC_M_TOOL] == 61)
        m = nc_m_word(block, NC_M_TOOL);
    if (!need(block, m, 'Q', "a Q word: the number of the tool in the spindle", line, error))
        return false;
    const NcWord *p = nc_word(block, 'P');
    return block->by.m[NC_M_OVERRIDE] != 53 || !p || p->value != 0.0 ||
           nc_word_error(error, line, p,
                         "is not supported with M53: a person can always hold the feed");
}

static bool must_be_whole(const NcBlock *block, char letter)
{
    return letter == 'H' || letter == 'T' || letter == 'L' ||
           (letter == 'Q' && block->by.m[NC_M_TOOL] == 61) ||
           (letter == 'P' && (is_arc(block->motion) || block->by.m[NC_M_SPINDLE] == 19));
}

static bool check_value(const NcBlock *block, const NcWord *word, uint32_t line, GError **error)
{
    const double value = word->value;
    const bool of_arc = word->letter == 'P' && is_arc(block->motion);
    const bool orients = block->by.m[NC_M_SPINDLE] == 19;
    if (value < 0.0)
        return nc_word_error(error, line, word, "must not be negative");
    if (must_be_whole(block, word->letter) && (value != floor(value) || value > 99999.0))
        return nc_word_error(error, line, word, "must be a whole number up to 99999");
    if (word->letter == 'L' && value < 1.0)
        return nc_word_error(error, line, word, "must be at least 1");
    if (of_arc && value < 1.0)
        return nc_word_error(error, line, word, "must be at least one turn");
    if (orients && word->letter == 'P' && value > 2.0)
        return nc_word_error(error, line, word, "must be 0, 1 or 2: the way the spindle turns");
    if (orients && word->letter == 'Q' && value == 0.0)
        return nc_word_error(error, line, word, "must be above 0: the seconds to wait");
    return true;
}

static bool check_values(const NcBlock *block, uint32_t line, GError **error)
{
    const NcWord *r = nc_word(block, 'R');
    for (const char *letter = "FHLNSTPQ"; *letter; letter++) {
        const NcWord *word = nc_word(block, *letter);
        if (word && !check_value(block, word, line, error))
            return false;
    }
    if (r && block->by.m[NC_M_SPINDLE] == 19 && (r->value < 0.0 || r->value > 360.0))
        return nc_word_error(error, line, r, "must be between 0 and 360 degrees");
    return true;
}

static bool check_motion(const NcBlock *block, const NcModal *modal, GError **error)
{
    if (block->by.g[NC_G_NON_MODAL] == 530) {
        const NcWord *g53 = nc_g_word(block, NC_G_NON_MODAL);
        int distance = block->by.g[NC_G_DISTANCE];
        if (block->motion != 0 && block->motion != 10)
            return nc_word_error(error, modal->line, g53, "needs G0 or G1");
        if (distance == 910 || (distance < 0 && modal->incremental))
            return nc_word_error(error, modal->line, g53, "cannot be used with G91: add G90");
    }
    const bool cycle = nc_is_cycle(block->motion);
    if (!cycle && !nc_is_probe(block->motion))
        return true;
    const NcWord *rotary = first_word_of(block, "ABC");
    if (cycle && rotary)
        return nc_word_error(error, modal->line, rotary, "cannot stand in a canned cycle");
    return axis_word(block) ||
           nc_word_error(error, modal->line, nc_motion_word(block), "needs an axis word");
}
