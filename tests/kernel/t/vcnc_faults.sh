#!/usr/bin/env bash
# SPDX-License-Identifier: Apache-2.0
# vcnc's own faults on purpose on CAN: segmill ends well after those of the link, and says what
# happened after those of the machine. On Modbus: tests/e2e/vcnc_faults.sh.
# shellcheck source=tests/kernel/can.bash
. tests/kernel/can.bash
sed -i 's/^#change_s = .*/change_s = 0.5/; s/^#rpm_per_s = .*/rpm_per_s = 100000/' "$dir/machine.ini"
printf '%s\n' 'G17 G21 G40 G49 G80 G90 G94 G64 P0.01' 'T2 M6' 'S6000 M3' 'G53 G0 X-20 Y-20' \
    'G53 G1 Z-30 F6000' 'G53 G1 Y-60' 'G53 G0 Z0' M5 M30 >"$dir/part.ngc"

ends() { # ends FAULT STATUS STATUS BLOCKS [WORD]: so segmill, so vcnc; executed; what segmill says
    rm -f "$dir/log"
    "$vcnc" --machine "$dir/machine.ini" --can "$bus" --speed 10 --log "$dir/log" --acknowledge \
        --exit-after-job --fault "$1" </dev/null >"$dir/vcnc.out" 2>"$dir/vcnc.err" &
    vcnc_pid=$!
    pids+=("$vcnc_pid")
    within 5 grep -qsx "can $bus" "$dir/vcnc.out"
    agent send "$dir/part.ngc" --start --machine "$dir/machine.ini" 2>"$dir/stderr"
    local sent=$? blocks
    wait "$vcnc_pid"
    local status=$?
    blocks=$(grep -c '^{"line"' "$dir/log")
    echo "segmill: $sent, vcnc: $status, $blocks blocks"
    cat "$dir/stderr" "$dir/vcnc.err" "$dir/vcnc.out"
    [ "$sent" = "$2" ] && [ "$status" = "$3" ] && [ "$blocks" = "$4" ] &&
        grep -qx 'faults begun: 1 of 1' "$dir/vcnc.out" && grep -q -e "${5:-}" "$dir/stderr"
}

buses
for bus in vcan0 vcan1; do
    use_bus $bus
    [ $bus = vcan0 ] && moment='at frame 5' || moment='at line 5'
    for fault in drop duplicate 'delay 0.8' corrupt close 'slow 0.05'; do
        ok "$bus: $moment: $fault" ends "$moment: $fault" 0 0 8
    done
    ok "$bus: alarm" ends 'at line 5: alarm 4001 mist' 5 1 3 'alarm 4001 .*mist'
    ok "$bus: reboot" ends 'at line 5: reboot' 7 1 3 restarted
done
finish
