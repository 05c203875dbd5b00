# shellcheck shell=bash
# SPDX-License-Identifier: Apache-2.0
# What every script in tests/kernel/t shares: TAP and virtual machines (tests/e2e/tap.bash), CAN buses,
# and GPIO lines with a hand on them.
# shellcheck source=tests/e2e/tap.bash
. tests/e2e/tap.bash

within() { # within SECONDS COMMAND…: until it succeeds
    local end=$((SECONDS + $1))
    until "${@:2}"; do
        [ $SECONDS -le $end ] || return
        sleep 0.05
    done
}

can_up() { # can_up NAME: a bus for classic frames and FD
    ip link add "$1" type vcan && ip link set "$1" mtu 72 up
}
can_heard() { # can_heard NAME [raw|isotp]: somebody listens there
    grep -Eqs "^ +$1 .* ${2-raw} *$" /proc/net/can/rcvlist_*
}

# Prints the chip's name and the folder of its lines: read -r chip lines < <(gpio_sim panel 3 start)
gpio_sim() { # gpio_sim NAME COUNT [LINE_NAME…]
    local sim=/sys/kernel/config/gpio-sim/${GPIO_SIM_PREFIX-segmill}-$1 i=0 name
    mkdir "$sim" "$sim/bank0" && echo "$2" >"$sim/bank0/num_lines" &&
        echo "$1" >"$sim/bank0/label" || return
    for name in "${@:3}"; do
        mkdir "$sim/bank0/line$i" && echo "$name" >"$sim/bank0/line$i/name" || return
        i=$((i + 1))
    done
    echo 1 >"$sim/live" &&
        echo "$(<"$sim/bank0/chip_name") /sys/devices/platform/$(<"$sim/dev_name")/$(<"$sim/bank0/chip_name")"
}
gpio_held() { # gpio_held CHIP PROGRAM: it holds a line
    gpioinfo "$1" | grep -q "\"$2\""
}
press() { # press LINES OFFSET: the input reads 1
    echo pull-up >"$1/sim_gpio$2/pull"
}
release() { # release LINES OFFSET: it reads 0
    echo pull-down >"$1/sim_gpio$2/pull"
}
line() { # line LINES OFFSET: prints 1 or 0, of an input or an output
    cat "$1/sim_gpio$2/value"
}
