/* SPDX-License-Identifier: Apache-2.0 */
#include "nc/nc.h"

G_DEFINE_QUARK(nc_error, nc_error)
