/* SPDX-License-Identifier: Apache-2.0 */
#include "fieldbus/modbus/slave.h"

#include <modbus.h>
#include <string.h>

#include "fieldbus/bytes.h"

enum {
    WRITE_BYTES = 242, /* what a FC23 can write: 121 registers */
    READ_MOST = MODBUS_MAX_READ_REGISTERS,
    UNIT_NOT_HERE = MODBUS_EXCEPTION_GATEWAY_TARGET,
};

struct FbModbusSlave {
    FbReceiver *receiver;
    int unit_id;
    void (*act)(FbDo what, void *data);
    void *data;
    GArray *actions;     /* of FbDo */
    uint64_t exceptions; /* answered */
    bool published;      /* ALARM, OFFSETS and TOOLS are in `map`, by these serials */
    uint16_t alarm_serial, setup_serial;
    uint8_t map[2 * FB_N_REGISTERS]; /* as it is read; the blocks that are written stay 0 */
};

/* What an ADU asks for; counts are 0 where it does not read or write. */
typedef struct {
    unsigned read_at, n_read, write_at, n_write;
    const uint8_t *written;
} Wish;

static int parse(const uint8_t *pdu, size_t n, Wish *wish);
static int check(const Wish *wish);
static FbBlock write_block(FbModbusSlave *s, FbRole role, const Wish *wish, int64_t now_us);
static size_t answer_wish(FbModbusSlave *s, const uint8_t *pdu, const Wish *wish, int64_t now_us,
                          uint8_t *out);

void fb_modbus_slave_adu(FbModbusSlave *s, FbRole role, const uint8_t *adu, size_t n,
                         int64_t now_us, FbModbusAnswer *answer)
{
    const int unit = adu[6];
    const uint8_t *pdu = adu + FB_MBAP_HEADER_BYTES;
    uint8_t *out = answer->bytes;
    Wish wish = {0};
    const uint8_t header[FB_MBAP_HEADER_BYTES] = {adu[0], adu[1], 0, 0, 0, 0, adu[6]};
    memcpy(out, header, sizeof header);
    answer->n = sizeof header;
    answer->times_moved = false;
    int exception = unit == s->unit_id || unit == 0 || unit == 255 ? 0 : UNIT_NOT_HERE;
    if (!exception)
        exception = parse(pdu, n - FB_MBAP_HEADER_BYTES, &wish);
    if (!exception)
        exception = check(&wish);
    if (exception) {
        s->exceptions++;
        out[answer->n++] = pdu[0] | 0x80;
        out[answer->n++] = (uint8_t)exception;
    } else {
        if (wish.n_write > 0)
            answer->times_moved = write_block(s, role, &wish, now_us) != FB_BLOCK_CHUNK;
        answer->n += answer_wish(s, pdu, &wish, now_us, out + answer->n);
    }
    out[5] = (uint8_t)(answer->n - 6);
}

/* The exception, or 0. */
static int parse(const uint8_t *pdu, size_t n, Wish *w)
{
    const uint8_t *write = NULL; /* at the address of the writing half */
    switch (pdu[0]) {
    case MODBUS_FC_READ_HOLDING_REGISTERS:
    case MODBUS_FC_READ_INPUT_REGISTERS:
        if (n != 5)
            return MODBUS_EXCEPTION_ILLEGAL_DATA_VALUE;
        break;
    case MODBUS_FC_WRITE_MULTIPLE_REGISTERS:
        write = pdu + 1;
        break;
    case MODBUS_FC_WRITE_AND_READ_REGISTERS:
        write = pdu + 5;
        break;
    default:
        return MODBUS_EXCEPTION_ILLEGAL_FUNCTION;
    }
    const unsigned most =
        write == pdu + 1 ? MODBUS_MAX_WRITE_REGISTERS : MODBUS_MAX_WR_WRITE_REGISTERS;
    if (write) {
        const size_t head = (size_t)(write - pdu) + 5;
        if (n < head || fb_get16(write + 2) < 1 || fb_get16(write + 2) > most ||
            write[4] != 2 * fb_get16(write + 2) || n != head + write[4])
            return MODBUS_EXCEPTION_ILLEGAL_DATA_VALUE;
        *w = (Wish){
            .write_at = fb_get16(write), .n_write = fb_get16(write + 2), .written = write + 5};
    }
    if (write != pdu + 1) {
        w->read_at = fb_get16(pdu + 1);
        w->n_read = fb_get16(pdu + 3);
        if (w->n_read < 1 || w->n_read > READ_MOST)
            return MODBUS_EXCEPTION_ILLEGAL_DATA_VALUE;
    }
    return 0;
}

/* The blocks that may be written. */
static const struct {
    FbBlock block;
    unsigned at, fewest, most;
} blocks[] = {
    {FB_BLOCK_COMMAND, FB_AT_COMMAND, FB_COMMAND_BYTES / 2, WRITE_BYTES / 2},
    {FB_BLOCK_CHUNK, FB_AT_CHUNK, FB_CHUNK_HEADER_BYTES / 2 + 1, WRITE_BYTES / 2},
    {FB_BLOCK_BEAT, FB_AT_BEAT, FB_BEAT_BYTES / 2, FB_BEAT_BYTES / 2},
};

/* The block that the wish writes; G_N_ELEMENTS(blocks) where there is none. */
static size_t find_block(const Wish *w)
{
    size_t i = 0;
    while (i < G_N_ELEMENTS(blocks) &&
           !(w->write_at == blocks[i].at && w->n_write >= blocks[i].fewest &&
             w->n_write <= blocks[i].most))
        i++;
    return i;
}

static int check(const Wish *w)
{
    if (w->n_read > 0 && w->read_at + w->n_read > FB_N_REGISTERS)
        return MODBUS_EXCEPTION_ILLEGAL_DATA_ADDRESS;
    if (w->n_write > 0 && find_block(w) == G_N_ELEMENTS(blocks))
        return MODBUS_EXCEPTION_ILLEGAL_DATA_ADDRESS;
    return 0;
}

static FbBlock write_block(FbModbusSlave *s, FbRole role, const Wish *w, int64_t now_us)
{
    const FbBlock block = blocks[find_block(w)].block;
    fb_receiver_write(s->receiver, role, block, w->written, 2 * (size_t)w->n_write, now_us,
                      s->actions);
    fb_do_actions(s->actions, s->act, s->data);
    return block;
}

/* The map as it is now. What changes seldom has a serial number. */
static void publish(FbModbusSlave *s, int64_t now_us)
{
    FbStatus status;
    const FbSetup *setup = fb_receiver_setup(s->receiver);
    fb_receiver_publish(s->receiver, (FbCarrier){FB_MODBUS_CHUNK_BYTES, FB_WINDOW_MOST}, now_us,
                        &status);
    fb_wire_put_status(s->map + 2 * FB_AT_STATUS, &status);
    if (!s->published || status.alarm_serial != s->alarm_serial)
        fb_wire_put_alarm(s->map + 2 * FB_AT_ALARM, &status);
    if (!s->published || setup->serial != s->setup_serial) {
        fb_wire_put_offsets(s->map + 2 * FB_AT_OFFSETS, setup);
        for (unsigned page = 0; page < FB_TOOLS_PAGES; page++)
            fb_wire_put_tools(s->map + 2 * (FB_AT_TOOLS + page * FB_TOOLS_PAGE_REGISTERS), setup,
                              page);
    }
    s->published = true;
    s->alarm_serial = status.alarm_serial;
    s->setup_serial = setup->serial;
}

/* The PDU of the answer; its length. */
static size_t answer_wish(FbModbusSlave *s, const uint8_t *pdu, const Wish *w, int64_t now_us,
                          uint8_t *out)
{
    out[0] = pdu[0];
    if (w->n_read == 0) {
        memcpy(out + 1, pdu + 1, 4); /* where, and how many */
        return 5;
    }
    publish(s, now_us);
    out[1] = (uint8_t)(2 * w->n_read);
    memcpy(out + 2, s->map + 2 * w->read_at, out[1]);
    return 2 + (size_t)out[1];
}

uint64_t fb_modbus_slave_exceptions(const FbModbusSlave *s)
{
    return s->exceptions;
}

FbModbusSlave *fb_modbus_slave_new(int unit_id, FbReceiver *receiver,
                                   void (*act)(FbDo what, void *data), void *data)
{
    FbModbusSlave *s = g_new0(FbModbusSlave, 1);
    s->receiver = receiver;
    s->unit_id = unit_id;
    s->act = act;
    s->data = data;
    s->actions = g_array_new(FALSE, FALSE, sizeof(FbDo));
    return s;
}

void fb_modbus_slave_free(FbModbusSlave *s)
{
    if (!s)
        return;
    g_array_unref(s->actions);
    g_free(s);
}
