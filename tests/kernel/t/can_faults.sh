#!/usr/bin/env bash
# SPDX-License-Identifier: Apache-2.0
# KERNEL_TIME=travel
# KERNEL_SECONDS=1200
# The frames of a delivery and its run over CAN, FD and classic, × every fault (can_faults.c). Of the
# consecutive frames inside a classic message every CAN_INSIDE-th, of what is left every CAN_ALL-th, of
# the frames of segmill and vcnc themselves every CAN_PROGRAMS-th. `make check` takes a part, `make
# check-ci` all but the inside of classic messages, `make soak` each; docs/testing.md.
# shellcheck source=tests/kernel/setup.bash
. tests/kernel/setup.bash
inside=${CAN_INSIDE-200} all=${CAN_ALL-8} programs=${CAN_PROGRAMS-100}

pair() { # pair MTU: two buses with a bridge of the test's between them
    local bus
    for bus in agent machine; do
        ip link add "$bus$1" type vcan && ip link set "$bus$1" mtu "$1" up || return
    done
}
sweep() { # sweep CELL NAME MTU INSIDE ALL [hold]
    local status
    "$BUILD/kernel/$1" "$2" "agent$3" "machine$3" "$dir" "${@:4}" 2>&1 | sed -u 's/^/# /' |
        tee "$dir/report"
    status=${PIPESTATUS[0]}
    tail -n 1 "$dir/report" >&2
    ok "$2: every fault" test "$status" = 0
}

# 16 cuts with a gate behind each: 18 s of machine time.
program() {
    echo 'G17 G21 G40 G49 G80 G90 G91.1 G94 G64 P0.01
T2 M6
S6000 M3
G53 G0 Z0'
    for ((cut = 1; cut <= 16; cut++)); do
        x=$((-100 - 10 * cut))
        echo "(REGION $cut convex tool=2 feed=6000)
G53 G0 X$x Y-100
G53 G0 Z-100
G53 G1 Z-110 F6000
G53 G1 X$((x - 5))
G53 G1 Y-105
G53 G0 Z0"
    done
    echo 'M5
M30'
}
configure() { # configure MTU
    cat >"$dir/agent.ini" <<INI
[link]
reply_timeout_s = 0.3
reconnect_s = 0.1
give_up_s = 20
heartbeat_s = 1.2
[machine.mill]
address = can://agent$1
can_key = $dir/can.key
INI
}

export XDG_STATE_HOME=$dir/state
cp config/etc/tools.ini "$dir"
(umask 077 && echo 000102030405060708090a0b0c0d0e0f >"$dir/can.key")
program >"$dir/program.ngc"
cat >"$dir/machine.ini" <<'INI'
[machine]
agent_timeout_s = 4
on_agent_loss = next_gate
[tools]
file = tools.ini
change_s = 0
[spindle]
rpm_per_s = 10000000
[can]
key = can.key
INI
for mtu in ${CAN_MTUS-72 16}; do
    ok "buses of $mtu bytes a frame" pair "$mtu"
    configure "$mtu"
    for cell in ${CAN_CELLS-can_cell}; do
        case $cell-$mtu in
        can_cell-72)
            sweep "$cell" FD 72 1 "$all"
            sweep "$cell" "FD, a hold" 72 "$inside" "$((all * 4))" hold
            ;;
        can_cell-16)
            sweep "$cell" classic 16 "$inside" "$all"
            sweep "$cell" "classic, a hold" 16 "$inside" "$((all * 4))" hold
            ;;
        can_programs-72) sweep "$cell" "FD, segmill and vcnc" 72 1 "$programs" ;;
        can_programs-16) sweep "$cell" "classic, segmill and vcnc" 16 1 "$((programs * 4))" ;;
        esac
    done
done
finish
