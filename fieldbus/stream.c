/* SPDX-License-Identifier: Apache-2.0 */
/* The stream of a transfer: the table of gates, then the program. */
#include "fieldbus/wire.h"

uint64_t fb_stored_bytes(uint64_t program_bytes, size_t n_gates)
{
    return program_bytes + FB_GATE_BYTES * (uint64_t)n_gates;
}

uint64_t fb_dripped_bytes(const uint64_t *gates, size_t n_gates)
{
    uint64_t longest = 0, from = 0;
    for (size_t i = 0; i < n_gates; i++) {
        longest = MAX(longest, gates[i] - from);
        from = gates[i];
    }
    return longest + FB_DRIP_GATE_BYTES * (uint64_t)n_gates;
}

uint32_t fb_stored_gates_crc(const uint64_t *gates, size_t n_gates)
{
    g_autofree uint8_t *table = g_malloc_n(n_gates, FB_GATE_BYTES);
    for (size_t i = 0; i < n_gates; i++)
        fb_wire_put_gate(table + i * FB_GATE_BYTES, gates[i], NULL);
    return fb_wire_crc(table, n_gates * FB_GATE_BYTES);
}
