/* SPDX-License-Identifier: Apache-2.0 */
/* pki: a test CA and certificates for Modbus/TCP Security. */
#include <stdio.h>

#include "agent/agent.h"
#include "fieldbus/fieldbus.h"

enum { DAYS = 825 };

static bool run(const AgentOptions *options, AgentJson *result, GError **error);

const AgentCommand agent_pki = {
    .name = "pki",
    .synopsis = "-o DIR [--host NAME ...] [--days N]",
    .summary = "make a TEST CA and certificates for Modbus in TLS",
    .help =
        "Writes NAME.pem and NAME.key (EC P-256, readable by their owner only) of:\n"
        "  ca          the TEST CA that signs the others, for trying and testing: its key lies\n"
        "              beside theirs, and it cannot take a certificate back\n"
        "  machine     names each --host; [tls] ca, certificate and key of the machine's file\n"
        "  observer, operator, programmer\n"
        "              agents with these roles; tls_ca, tls_certificate and tls_key of the\n"
        "              machine's group in the agent's configuration\n"
        "Nothing that is there is overwritten. A real plant has a CA of its own: docs/security.md\n"
        "says what its certificates need.",
    .out_help = "The folder of the results",
    .takes = AGENT_TAKES_OUT | AGENT_TAKES_HOST | AGENT_TAKES_DAYS,
    .needs = AGENT_TAKES_OUT,
    .run = run,
};

static bool run(const AgentOptions *options, AgentJson *result, GError **error)
{
    static const char *const local[] = {"localhost", "127.0.0.1", "::1", NULL};
    const FbPkiOptions pki = {
        .folder = options->out,
        .hosts = options->host ? (const char *const *)options->host : local,
        .days = options->days > 0 ? options->days : DAYS,
    };
    if (!fb_pki_write(&pki, error))
        return false;
    agent_json_string(result, "folder", pki.folder);
    agent_json_integer(result, "days", pki.days);
    if (!options->json)
        printf("%s: a TEST CA, and certificates of machine, observer, operator and programmer for "
               "%d days\n",
               pki.folder, pki.days);
    return true;
}
