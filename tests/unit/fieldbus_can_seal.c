/* SPDX-License-Identifier: Apache-2.0 */
/* Keys, openings, seals and frames of CAN against docs/protocol-can.md: its tables and its example,
 * whose bytes come from another implementation. */
#include <glib/gstdio.h>
#include <sys/stat.h>

#include "fieldbus/can/seal.h"
#include "tests/unit/fieldbus_rig.h"

enum { EXAMPLE_ID = 0x121, EPOCH = 0x5e91a77 };

/* The bytes in the example's row that begins with `what`. */
static GByteArray *example(const char *what)
{
    g_autoptr(GPtrArray) rows = doc_table("### 9.7");
    GByteArray *bytes = g_byte_array_new();
    for (guint i = 1; i < rows->len; i++) {
        if (!g_str_has_prefix(doc_cell(rows, i, 0), what))
            continue;
        for (const char *hex = doc_cell(rows, i, 1); hex[0] && hex[1]; hex += 2) {
            const int high = g_ascii_xdigit_value(hex[0]), low = g_ascii_xdigit_value(hex[1]);
            const uint8_t byte = (uint8_t)(high << 4 | low);
            g_byte_array_append(bytes, &byte, 1);
        }
        break;
    }
    g_assert_cmpuint(bytes->len, >, 0);
    return bytes;
}

static void assert_bytes(const void *a, size_t n_a, const void *b, size_t n_b)
{
    g_assert_cmpuint(n_a, ==, n_b);
    g_assert_true(n_a == n_b && memcmp(a, b, n_a) == 0);
}

static void assert_example(const char *what, const uint8_t *bytes, size_t n)
{
    g_autoptr(GByteArray) expected = example(what);
    assert_bytes(bytes, n, expected->data, expected->len);
}

static FbCanKey example_key(void)
{
    g_autoptr(GByteArray) bytes = example("key");
    FbCanKey key = {.n = bytes->len};
    memcpy(key.bytes, bytes->data, MIN(bytes->len, sizeof key.bytes));
    return key;
}

static FbCanHello example_hello(void)
{
    FbCanHello h = {.version = 0x101, .flags = FB_CAN_FLAG_FD, .session = 0x01020304};
    for (int i = 0; i < FB_CAN_NONCE_BYTES; i++)
        h.nonce[i] = (uint8_t)(0xa0 + i);
    return h;
}

static FbCanWelcome example_welcome(void)
{
    FbCanWelcome w = {.version = 0x101, .flags = FB_CAN_FLAG_FD, .epoch = EPOCH, .beat_count = 7};
    for (int i = 0; i < FB_CAN_NONCE_BYTES; i++)
        w.nonce[i] = (uint8_t)(0xb0 + i);
    return w;
}

static FbCanKeys example_keys(void)
{
    FbCanKeys keys;
    const FbCanKey key = example_key();
    fb_can_derive(&keys, &key, EXAMPLE_ID, example_hello().nonce, example_welcome().nonce);
    return keys;
}

static void opening(void)
{
    uint8_t out[FB_CAN_MESSAGE_BYTES];
    const FbCanKey key = example_key();
    const FbCanHello h = example_hello();
    const FbCanWelcome w = example_welcome();
    const FbCanKeys keys = example_keys();
    assert_example("HELLO", out, fb_can_put_hello(out, &h, &key, EXAMPLE_ID));
    const Expected hello[] = {{"kind", 5},
                              {"protocol_version", 0x101},
                              {"flags", 1},
                              {"session", 0x01020304},
                              {"nonce_agent", 0xa0a1a2a3},
                              {"mac", number_at(out + 25, 4)},
                              {NULL, 0}};
    check_layout("Before anything else on a channel", out, 0, 1, hello);
    FbCanHello h2 = {0};
    g_assert_true(fb_can_get_hello(out, FB_CAN_HELLO_BYTES, &key, EXAMPLE_ID, &h2));
    assert_bytes(&h2, sizeof h2, &h, sizeof h);

    assert_example("WELCOME", out, fb_can_put_welcome(out, &w, &key, EXAMPLE_ID, h.nonce));
    const Expected welcome[] = {{"kind", 21},
                                {"protocol_version", 0x101},
                                {"flags", 1},
                                {"epoch", EPOCH},
                                {"beat_count", 7},
                                {"nonce_machine", 0xb0b1b2b3},
                                {"mac", number_at(out + 29, 4)},
                                {NULL, 0}};
    check_layout("The machine answers, in classic frames", out, 0, 1, welcome);
    FbCanWelcome w2 = {0};
    g_assert_true(fb_can_get_welcome(out, FB_CAN_WELCOME_BYTES, &key, EXAMPLE_ID, h.nonce, &w2));
    assert_bytes(&w2, sizeof w2, &w, sizeof w);
    g_assert_false(fb_can_get_welcome(out, FB_CAN_WELCOME_BYTES, &key, EXAMPLE_ID, w.nonce, &w2));
    assert_example("the channel's agent key", keys.agent.bytes, keys.agent.n);
    assert_example("the channel's machine key", keys.machine.bytes, keys.machine.n);
}

/* Every bit counts, and the length, the key and the identifier. */
static void every_bit_counts(void)
{
    uint8_t hello[FB_CAN_HELLO_BYTES], message[64] = {FB_CAN_READ, 0, 128};
    const FbCanKey key = example_key();
    const FbCanKeys keys = example_keys();
    const FbCanHello h = example_hello();
    FbCanHello h2;
    uint32_t counter = 0;
    fb_can_put_hello(hello, &h, &key, EXAMPLE_ID);
    for (unsigned bit = 0; bit < 8 * sizeof hello; bit++) {
        hello[bit / 8] ^= (uint8_t)(1 << bit % 8);
        g_assert_false(fb_can_get_hello(hello, sizeof hello, &key, EXAMPLE_ID, &h2));
        hello[bit / 8] ^= (uint8_t)(1 << bit % 8);
    }
    g_assert_false(fb_can_get_hello(hello, sizeof hello, &key, EXAMPLE_ID + 1, &h2));
    g_assert_false(fb_can_get_hello(hello, sizeof hello - 1, &key, EXAMPLE_ID, &h2));
    g_assert_false(fb_can_get_hello(hello, sizeof hello, &keys.agent, EXAMPLE_ID, &h2));

    const size_t n = fb_can_seal(message, 3, 1, &keys.agent);
    assert_example("READ", message, n);
    const Expected seal[] = {{"counter", 1}, {"mac", number_at(message + 7, 4)}, {NULL, 0}};
    check_layout("All but HELLO and WELCOME", message + 3, 0, 1, seal);
    g_assert_true(fb_can_unseal(message, n, &keys.agent, &counter));
    g_assert_cmpuint(counter, ==, 1);
    g_assert_false(fb_can_unseal(message, n, &keys.machine, &counter));
    for (unsigned bit = 0; bit < 8 * n; bit++) {
        message[bit / 8] ^= (uint8_t)(1 << bit % 8);
        g_assert_false(fb_can_unseal(message, n, &keys.agent, &counter));
        message[bit / 8] ^= (uint8_t)(1 << bit % 8);
    }
    for (size_t shorter = 0; shorter < n; shorter++)
        g_assert_false(fb_can_unseal(message, shorter, &keys.agent, &counter));
}

static void stop(void)
{
    uint8_t frame[FB_CAN_FRAME_BYTES];
    const FbCanKeys keys = example_keys();
    FbCommand command;
    uint32_t seq;
    fb_can_put_stop(frame, FB_COMMAND_HOLD, 9, &keys.agent);
    assert_example("STOP", frame, sizeof frame);
    fb_can_put_stop(frame, FB_COMMAND_ABORT, 0x010203, &keys.agent);
    const Expected fields[] = {{"command", FB_COMMAND_ABORT},
                               {"seq", 0x010203},
                               {"mac", number_at(frame + 4, 4)},
                               {NULL, 0}};
    check_layout("### 9.4", frame, 0, 1, fields);
    g_assert_true(fb_can_get_stop(frame, &keys.agent, &command, &seq));
    g_assert_cmpint(command, ==, FB_COMMAND_ABORT);
    g_assert_cmphex(seq, ==, 0x010203);
    g_assert_cmphex(fb_can_stop_counter(seq), ==, 0x80010203);
    g_assert_false(fb_can_get_stop(frame, &keys.machine, &command, &seq));
    for (unsigned bit = 0; bit < 8 * sizeof frame; bit++) {
        frame[bit / 8] ^= (uint8_t)(1 << bit % 8);
        g_assert_false(fb_can_get_stop(frame, &keys.agent, &command, &seq));
        frame[bit / 8] ^= (uint8_t)(1 << bit % 8);
    }
}

static void beat(void)
{
    uint8_t frame[FB_CAN_FRAME_BYTES];
    const FbCanKey shared = example_key();
    FbCanKey key;
    FbCanMachineBeat b;
    fb_can_beat_key(&key, &shared, EPOCH);
    assert_example("key of the beats", key.bytes, key.n);
    fb_can_put_beat(frame, &(FbCanMachineBeat){FB_STATE_RUNNING, 1, 0x10007}, &key);
    assert_example("beat", frame, sizeof frame);
    const Expected fields[] = {{"state", FB_STATE_RUNNING},
                               {"flags", 1},
                               {"count", 7},
                               {"mac", number_at(frame + 4, 4)},
                               {NULL, 0}};
    check_layout("### 9.5", frame, 0, 1, fields);
    /* Found from what is expected, over a turn of its low half; not behind, not a turn ahead. */
    static const uint32_t before[] = {0x10007, 0x10006, 0x10000, 0xffff, 0x9000};
    for (size_t i = 0; i < G_N_ELEMENTS(before); i++) {
        g_assert_true(fb_can_get_beat(frame, &key, before[i], &b));
        g_assert_cmphex(b.count, ==, 0x10007);
    }
    g_assert_false(fb_can_get_beat(frame, &key, 0x10008, &b));
    g_assert_false(fb_can_get_beat(frame, &key, 7, &b));
    for (unsigned bit = 0; bit < 8 * sizeof frame; bit++) {
        frame[bit / 8] ^= (uint8_t)(1 << bit % 8);
        g_assert_false(fb_can_get_beat(frame, &key, 0x10007, &b));
        frame[bit / 8] ^= (uint8_t)(1 << bit % 8);
    }
}

static void numbers_as_documented(void)
{
    static const struct {
        const char *name;
        FbCanKind kind;
    } kinds[] = {
        {"COMMAND", FB_CAN_COMMAND}, {"CHUNK", FB_CAN_CHUNK},    {"BEAT", FB_CAN_BEAT},
        {"READ", FB_CAN_READ},       {"HELLO", FB_CAN_HELLO},    {"STATUS", FB_CAN_STATUS},
        {"ALARM", FB_CAN_ALARM},     {"ACK", FB_CAN_ACK},        {"OFFSETS", FB_CAN_OFFSETS},
        {"TOOLS", FB_CAN_TOOLS},     {"WELCOME", FB_CAN_WELCOME}};
    static const unsigned offsets[] = {FB_CAN_ID_STOP,    FB_CAN_ID_BEAT,
                                       FB_CAN_ID_CONTROL, FB_CAN_ID_CONTROL + FB_CAN_ID_ANSWER,
                                       FB_CAN_ID_WORK,    FB_CAN_ID_WORK + FB_CAN_ID_ANSWER};
    g_autoptr(GPtrArray) rows = doc_table("### 9.2");
    g_assert_cmpuint(rows->len, ==, G_N_ELEMENTS(kinds) + 1);
    for (guint i = 1; i < rows->len && i <= G_N_ELEMENTS(kinds); i++) {
        g_assert_cmpint(atoi(doc_cell(rows, i, 0)), ==, kinds[i - 1].kind);
        g_assert_cmpstr(doc_cell(rows, i, 2), ==, kinds[i - 1].name);
    }
    g_autoptr(GPtrArray) ids = doc_table("### 9.1");
    g_assert_cmpuint(ids->len, ==, G_N_ELEMENTS(offsets) + 1);
    for (guint i = 1; i < ids->len && i <= G_N_ELEMENTS(offsets); i++)
        g_assert_cmpint(strtol(doc_cell(ids, i, 0), NULL, 16), ==, offsets[i - 1]);
    g_assert_cmpuint(fb_can_request_id(0x100, 3, FB_CAN_CONTROL_CHANNEL), ==, 0x123);
    g_assert_cmpuint(fb_can_request_id(0x100, 3, FB_CAN_WORK_CHANNEL), ==, 0x143);
    g_assert_cmpuint(1 + FB_CHUNK_HEADER_BYTES + FB_CHUNK_BYTES + FB_CAN_SEAL_BYTES, ==, 4095);
}

/* ------------------------------------------------------------------------------ file */

static bool load(const char *folder, const char *text, mode_t mode, FbCanKey *key)
{
    g_autofree char *path = g_build_filename(folder, "can.key", NULL);
    g_autoptr(GError) error = NULL;
    g_unlink(path);
    g_file_set_contents(path, text, -1, NULL);
    chmod(path, mode);
    const bool loaded = fb_can_key_load(key, path, &error);
    if (!loaded) {
        g_assert_error(error, FB_ERROR, FB_ERROR_CREDENTIALS);
        g_assert_true(strstr(error->message, path));
    }
    return loaded;
}

static void key_file(void)
{
    static const char good[] = "000102030405060708090a0b0c0d0e0f";
    char *folder = test_folder();
    g_autofree char *most = g_strnfill(128, 'f'), *over = g_strnfill(130, 'f');
    FbCanKey key;
    g_assert_true(load(folder, good, 0600, &key));
    const FbCanKey expected = example_key();
    assert_bytes(key.bytes, key.n, expected.bytes, expected.n);
    g_assert_true(load(folder, "  000102030405060708090A0B0C0D0E0F \n", 0400, &key));
    assert_bytes(key.bytes, key.n, expected.bytes, expected.n);
    g_assert_true(load(folder, most, 0600, &key));
    g_assert_cmpuint(key.n, ==, FB_CAN_KEY_MOST_BYTES);
    static const mode_t modes[] = {0640, 0604, 0660, 0610};
    for (size_t i = 0; i < G_N_ELEMENTS(modes); i++)
        g_assert_false(load(folder, good, modes[i], &key));
    g_assert_false(load(folder, over, 0600, &key));
    g_assert_false(load(folder, "", 0600, &key));
    g_assert_false(load(folder, "000102030405060708090a0b0c0d0e", 0600, &key));
    g_assert_false(load(folder, "000102030405060708090a0b0c0d0e0", 0600, &key));
    g_assert_false(load(folder, "000102030405060708090a0b0c0d0e0f0", 0600, &key));
    g_assert_false(load(folder, "0x0102030405060708090a0b0c0d0e0f", 0600, &key));
    g_assert_false(load(folder, "00010203 0405060708090a0b0c0d0e0f", 0600, &key));
    g_autofree char *pipe_path = g_build_filename(folder, "pipe", NULL);
    g_assert_cmpint(mkfifo(pipe_path, 0600), ==, 0);
    g_assert_false(fb_can_key_load(&key, pipe_path, NULL)); /* at once, although nobody writes */
    g_assert_false(fb_can_key_load(&key, folder, NULL));
    g_assert_false(fb_can_key_load(&key, "/no/such/file", NULL));
    test_folder_remove(folder);
}

static void add(void)
{
    g_test_add_func("/fieldbus/can-seal/opening", opening);
    g_test_add_func("/fieldbus/can-seal/every-bit", every_bit_counts);
    g_test_add_func("/fieldbus/can-seal/stop", stop);
    g_test_add_func("/fieldbus/can-seal/beat", beat);
    g_test_add_func("/fieldbus/can-seal/numbers", numbers_as_documented);
    g_test_add_func("/fieldbus/can-seal/key-file", key_file);
}

int main(int argc, char **argv)
{
    return test_main(argc, argv, add);
}
