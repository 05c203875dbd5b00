#!/usr/bin/env bash
# SPDX-License-Identifier: Apache-2.0
# A host that has CAN and GPIO runs the scripts itself; here the kernel plays that host.
# shellcheck source=tests/kernel/setup.bash
. tests/kernel/setup.bash
unset KERNEL_USE KERNEL_TIME

run() { # run SCRIPT_TEXT: sets status; output in $dir/out and $dir/err
    printf '. tests/kernel/setup.bash\n%s\n' "$1" >"$dir/script.sh"
    tests/kernel/run.sh "$dir/script.sh" >"$dir/out" 2>"$dir/err"
    status=$?
}
no_lines() {
    not ls -d /sys/kernel/config/gpio-sim/segmill-* 2>/dev/null
}

ok "found by trying" tests/kernel/run.sh --on-host
ok "not if the kernel is asked for" not env KERNEL_USE=uml tests/kernel/run.sh --on-host
ok "trying leaves nothing" no_lines

run 'can_up vcan0 && gpio_sim panel 3 start hold lamp >"$dir/chip" && exit 7'
ok "the script's status" test "$status" = 7
ok "it is said where" grep -q '^run.sh: .* on this host$' "$dir/err"
ok "its bus was its own" not ip link show vcan0
ok "its lines are gone" no_lines
finish
