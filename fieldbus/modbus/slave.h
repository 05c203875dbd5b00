/* SPDX-License-Identifier: Apache-2.0 */
/*
 * The machine's side of docs/protocol.md, section 2.9, between its ADUs and the receiver: an ADU is
 * checked, its block is written, and the registers that it reads are copied out. Pure: it knows
 * neither sockets nor clocks.
 */
#ifndef FIELDBUS_MODBUS_SLAVE_H
#define FIELDBUS_MODBUS_SLAVE_H

#include "fieldbus/modbus/mbap.h"
#include "fieldbus/receiver.h"

typedef struct FbModbusSlave FbModbusSlave;

/* The receiver must outlive it. `act` is called for every FbDo before the answer is made: a FC23
 * reads what its writing has led to, so a VERIFY needs no second request. On CAN it is the other
 * way round (fieldbus/can/slave.h). */
FbModbusSlave *fb_modbus_slave_new(int unit_id, FbReceiver *receiver,
                                   void (*act)(FbDo what, void *data), void *data);
void fb_modbus_slave_free(FbModbusSlave *slave);
G_DEFINE_AUTOPTR_CLEANUP_FUNC(FbModbusSlave, fb_modbus_slave_free)

typedef struct {
    size_t n; /* there is always one */
    uint8_t bytes[FB_ADU_BYTES];
    bool times_moved; /* fb_receiver_tick has something else to say than before */
} FbModbusAnswer;

/* Steps by a whole ADU, 8 to FB_ADU_BYTES of any bytes, from somebody of this role. */
void fb_modbus_slave_adu(FbModbusSlave *slave, FbRole role, const uint8_t *adu, size_t n,
                         int64_t now_us, FbModbusAnswer *answer);

uint64_t fb_modbus_slave_exceptions(const FbModbusSlave *slave); /* answered so far */

#endif
