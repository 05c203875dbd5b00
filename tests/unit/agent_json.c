/* SPDX-License-Identifier: Apache-2.0 */
/* The JSON writer, with json-glib as the judge. */
#include <json-glib/json-glib.h>
#include <math.h>
#include <string.h>

#include "agent/out/json.h"
#include "tests/lib/test.h"

/* The root object of what was written; NULL, and a failure, where it is not JSON. */
static JsonParser *parsed(AgentJson *json)
{
    g_autofree char *text = agent_json_finish(json);
    JsonParser *parser = json_parser_new();
    g_autoptr(GError) error = NULL;
    json_parser_load_from_data(parser, text, -1, &error);
    g_assert_no_error(error);
    return parser;
}

/* Every finite double reads back as itself. */
static void round_trip(void)
{
    g_autoptr(GRand) random = g_rand_new_with_seed(1);
    double values[5000] = {
        0, -0.0, 0.1, 1.0 / 3, 1e300, -1e-300, 5e-324, 123456789012345678.0, 0x1p53, 0x1p-1022};
    for (size_t i = 10; i < G_N_ELEMENTS(values); i++)
        values[i] = i % 2 ? test_any_double(random) : g_rand_double_range(random, -1e4, 1e4);
    g_autoptr(AgentJson) json = agent_json_new();
    agent_json_row(json, "values");
    for (size_t i = 0; i < G_N_ELEMENTS(values); i++)
        agent_json_number(json, NULL, values[i]);
    agent_json_end(json);
    g_autoptr(JsonParser) parser = parsed(json);
    JsonNode *root = json_parser_get_root(parser);
    if (!root)
        return;
    JsonArray *read = json_object_get_array_member(json_node_get_object(root), "values");
    g_assert_cmpuint(json_array_get_length(read), ==, G_N_ELEMENTS(values));
    for (guint i = 0; i < json_array_get_length(read); i++)
        g_assert_cmpfloat(json_array_get_double_element(read, i), ==, values[i]);
}

static void not_finite(void)
{
    g_autoptr(AgentJson) json = agent_json_new();
    agent_json_number(json, "a", INFINITY);
    agent_json_number(json, "b", -INFINITY);
    agent_json_number(json, "c", NAN);
    g_autofree char *text = agent_json_finish(json);
    g_assert_cmpstr(text, ==, "{\n  \"a\": null,\n  \"b\": null,\n  \"c\": null\n}\n");
}

static void strings(void)
{
    static const char *const texts[] = {"",
                                        "plain",
                                        "quote \" and \\ back",
                                        "line\nline\ttab\r",
                                        "\001\037\177",
                                        "Ø 3 mm²",
                                        "</script>",
                                        "𝄞"};
    g_autoptr(AgentJson) json = agent_json_new();
    agent_json_array(json, "texts");
    for (size_t i = 0; i < G_N_ELEMENTS(texts); i++)
        agent_json_string(json, NULL, texts[i]);
    agent_json_string(json, NULL, "not \xff UTF-8");
    agent_json_string(json, NULL, NULL);
    agent_json_end(json);
    g_autoptr(JsonParser) parser = parsed(json);
    JsonNode *root = json_parser_get_root(parser);
    if (!root)
        return;
    JsonArray *read = json_object_get_array_member(json_node_get_object(root), "texts");
    for (guint i = 0; i < G_N_ELEMENTS(texts); i++)
        g_assert_cmpstr(json_array_get_string_element(read, i), ==, texts[i]);
    g_assert_cmpstr(json_array_get_string_element(read, G_N_ELEMENTS(texts)), ==,
                    "not \xef\xbf\xbd UTF-8");
    g_assert_true(json_array_get_null_element(read, G_N_ELEMENTS(texts) + 1));
}

static void layout(void)
{
    g_autoptr(AgentJson) json = agent_json_new();
    agent_json_string(json, "name", "a");
    agent_json_array(json, "empty");
    agent_json_end(json);
    agent_json_array(json, "items");
    agent_json_object(json, NULL);
    agent_json_integer(json, "id", G_MININT64);
    agent_json_bool(json, "on", true);
    agent_json_row(json, "uv");
    for (int i = 0; i < 2; i++) {
        agent_json_row(json, NULL);
        agent_json_number(json, NULL, 0.5);
        agent_json_number(json, NULL, i);
        agent_json_end(json);
    }
    agent_json_end(json);
    agent_json_end(json);
    agent_json_end(json);
    g_autofree char *text = agent_json_finish(json);
    g_assert_cmpstr(text, ==,
                    "{\n"
                    "  \"name\": \"a\",\n"
                    "  \"empty\": [],\n"
                    "  \"items\": [\n"
                    "    {\n"
                    "      \"id\": -9223372036854775808,\n"
                    "      \"on\": true,\n"
                    "      \"uv\": [[0.5, 0], [0.5, 1]]\n"
                    "    }\n"
                    "  ]\n"
                    "}\n");
}

static void add(void)
{
    g_test_add_func("/agent/json/round-trip", round_trip);
    g_test_add_func("/agent/json/not-finite", not_finite);
    g_test_add_func("/agent/json/strings", strings);
    g_test_add_func("/agent/json/layout", layout);
}

int main(int argc, char **argv)
{
    return test_main(argc, argv, add);
}
