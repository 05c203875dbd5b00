/* SPDX-License-Identifier: Apache-2.0 */
/* The agent's token for a machine's lease (docs/protocol.md, 6.1). */
#ifndef AGENT_TOKEN_H
#define AGENT_TOKEN_H

#include <stdint.h>

/* The user's token, the same for all processes and after a restart: so that `segmill resume` may go
 * on with what `segmill run` holds. Made at the first call, in the user's state folder
 * (XDG_STATE_HOME/segmill/token), readable by the user only: where it is anybody else's, too, or
 * damaged, another one takes its place. Where it cannot be kept it is made anew. Its high half is
 * never 0. */
uint64_t agent_token(void);

#endif
