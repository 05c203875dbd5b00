/* SPDX-License-Identifier: Apache-2.0 */
/*
 * Any ADUs, from anybody, to the machine's Modbus side. The input is a list of steps: who and how,
 * how many bytes, the ADU from its unit id on. A step may have its block's CRC mended, or else
 * nothing would come past it. Every answer must be one, and who may do nothing changes nothing.
 */
#include <string.h>

#include "fieldbus/modbus/slave.h"

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size);

enum { ROLE = 3, MENDED = 4, LATER = 8, EPOCH = 77, SECOND_US = 1000000 };

typedef struct {
    FbReceiver *receiver;
    FbModbusSlave *slave;
    int64_t now_us;
} Machine;

static void machine_event(Machine *m, FbMachineEvent event)
{
    fb_receiver_machine(m->receiver, event, NULL, m->now_us, NULL);
}

static void act(FbDo what, void *data)
{
    switch (what) {
    case FB_DO_VERIFY:
        machine_event(data, FB_MACHINE_VERIFIED);
        break;
    case FB_DO_HOLD:
        machine_event(data, FB_MACHINE_HELD);
        break;
    case FB_DO_RESUME:
        machine_event(data, FB_MACHINE_RUNNING);
        break;
    case FB_DO_ABORT:
        machine_event(data, FB_MACHINE_ABORTED);
        break;
    default:
        break;
    }
}

static unsigned u16(const uint8_t *p)
{
    return (unsigned)p[0] << 8 | p[1];
}

/* Where the blocks have their CRC. */
static const struct {
    unsigned at;
    size_t crc_at;
} blocks[] = {{FB_AT_COMMAND, 28}, {FB_AT_CHUNK, 20}, {FB_AT_BEAT, 16}};

static void mend(uint8_t *adu, size_t n)
{
    const size_t write = adu[7] == 16 ? 8 : adu[7] == 23 ? 12 : n;
    if (write + 5 > n)
        return;
    uint8_t *block = adu + write + 5, joined[FB_ADU_BYTES];
    const size_t n_block = n - write - 5;
    for (size_t i = 0; i < G_N_ELEMENTS(blocks); i++) {
        const size_t at = blocks[i].crc_at;
        if (u16(adu + write) != blocks[i].at || n_block < at + 4)
            continue;
        memcpy(joined, block, at);
        memcpy(joined + at, block + at + 4, n_block - at - 4);
        const uint32_t crc = fb_wire_crc(joined, n_block - 4);
        for (int k = 0; k < 4; k++)
            block[at + (size_t)k] = (uint8_t)(crc >> (24 - 8 * k));
    }
}

/* What a role that may do nothing must leave alone. */
static bool same(const FbStatus *a, const FbStatus *b)
{
    return a->state == b->state && a->transfer == b->transfer && a->received == b->received &&
           a->run == b->run && a->lease_owner == b->lease_owner &&
           a->optional_stop == b->optional_stop &&
           a->feed_override_percent == b->feed_override_percent && a->agent_lost == b->agent_lost &&
           memcmp(a->id, b->id, sizeof a->id) == 0;
}

static void check_answer(const uint8_t *adu, const FbModbusAnswer *answer)
{
    const uint8_t *a = answer->bytes;
    g_assert(answer->n >= 9 && answer->n <= FB_ADU_BYTES);
    g_assert(memcmp(a, adu, 4) == 0 && u16(a + 4) == answer->n - 6 && a[6] == adu[6]);
    g_assert(a[7] == adu[7] || (a[7] == (adu[7] | 0x80) && answer->n == 9));
    if (a[7] != 3 && a[7] != 4 && a[7] != 23)
        return;
    const unsigned at = u16(adu + 8), n = u16(adu + 10);
    g_assert(answer->n == 9 + 2 * n && a[8] == 2 * n && at + n <= FB_N_REGISTERS);
    FbStatus status;
    if (at == FB_AT_STATUS && n == FB_STATUS_BYTES / 2)
        g_assert(fb_wire_get_status(a + 9, FB_STATUS_BYTES, &status));
    for (unsigned i = 0; i < n; i++) /* nobody reads a token back */
        g_assert(at + i < FB_AT_COMMAND || u16(a + 9 + 2 * i) == 0);
}

static void step(Machine *m, uint8_t how, const uint8_t *bytes, size_t n)
{
    uint8_t adu[FB_ADU_BYTES] = {0x12, 0x34, 0, 0, 0, (uint8_t)n};
    FbModbusAnswer answer;
    FbStatus before, after;
    const FbRole role = (FbRole)(how & ROLE);
    memcpy(adu + 6, bytes, n);
    n += 6;
    if (how & MENDED)
        mend(adu, n);
    if (how & LATER)
        m->now_us += SECOND_US;
    fb_receiver_tick(m->receiver, m->now_us, NULL);
    fb_receiver_status(m->receiver, m->now_us, &before);
    fb_modbus_slave_adu(m->slave, role, adu, n, m->now_us, &answer);
    fb_receiver_status(m->receiver, m->now_us, &after);
    check_answer(adu, &answer);
    g_assert(role >= FB_ROLE_OPERATOR || same(&before, &after));
    /* An operator may end a run, and with it a program that drips. */
    g_assert(role >= FB_ROLE_PROGRAMMER ||
             (after.received <= before.received &&
              (after.transfer == before.transfer || after.transfer == 0)));
}

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size)
{
    const FbReceiverOptions options = {.epoch = EPOCH,
                                       .memory_bytes = 4096,
                                       .agent_timeout_us = 5 * SECOND_US,
                                       .lease_timeout_us = 30 * SECOND_US};
    Machine m = {.receiver = fb_receiver_new(&options), .now_us = 1};
    m.slave = fb_modbus_slave_new(1, m.receiver, act, &m);
    machine_event(&m, FB_MACHINE_ACKNOWLEDGED);
    while (size >= 2) {
        const size_t n = data[1];
        if (n < 2 || n > FB_ADU_BYTES - 6 || n > size - 2)
            break;
        step(&m, data[0], data + 2, n);
        data += 2 + n;
        size -= 2 + n;
    }
    fb_modbus_slave_free(m.slave);
    fb_receiver_free(m.receiver);
    return 0;
}
