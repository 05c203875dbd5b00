/* SPDX-License-Identifier: Apache-2.0 */
/* A TCP relay that is a slow network: what comes in on one side goes out on the other later. */
#ifndef TESTS_LIB_RELAY_H
#define TESTS_LIB_RELAY_H

#include <stdint.h>
#include <sys/types.h>

/* In a child process, between a port of loopback that it takes and shows in *port, and `to`. Every
 * byte is held up by delay_us in each direction. Ends with SIGTERM. -1: could not begin. */
pid_t relay_spawn(uint16_t to, int64_t delay_us, uint16_t *port);

#endif
