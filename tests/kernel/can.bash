# shellcheck shell=bash
# SPDX-License-Identifier: Apache-2.0
# A machine and its agents on a CAN bus, for the scripts that run in the kernel.
# shellcheck source=tests/kernel/setup.bash
. tests/kernel/setup.bash
export XDG_STATE_HOME=$dir/state XDG_CONFIG_HOME=$dir/config

program() { # program BLOCKS BLOCK
    printf '%s\n' 'G17 G21 G40 G49 G80 G90 G94'
    for ((i = 0; i < $1; i++)); do
        echo "G1 X$((i % 40)).$((100 + i % 900)) $2"
    done
    echo M2
}
configure() { # configure BUS NAME KEY_FILE GIVE_UP_S
    printf '%s\n' '[link]' 'heartbeat_s = 0.2' 'reconnect_s = 0.1' 'reply_timeout_s = 0.5' \
        "give_up_s = $4" '[machine.mill]' "address = can://$1" "can_key = $3" >"$dir/$2.ini"
}
agent() { # agent COMMAND…
    timeout 60 "$segmill" "$@" --to mill --config "$dir/agent.ini" </dev/null
}
switch_on() { # switch_on BUS SPEED
    mkfifo "$dir/hand.$((++machines))"
    "$vcnc" --machine "$dir/machine.ini" --can "$1" --speed "$2" <"$dir/hand.$machines" \
        >"$dir/vcnc.out" 2>"$dir/vcnc.err" &
    vcnc_pid=$!
    pids+=("$vcnc_pid")
    exec 7>"$dir/hand.$machines"
    within 5 grep -qsx "can $1" "$dir/vcnc.out" || cat "$dir/vcnc.err"
    echo ack >&7
}
record() { # record BUS LOG
    candump -r 100000000 -L "$1" >"$2" &
    recorder=$!
    pids+=("$recorder")
    within 5 can_heard "$1"
}
enough() { # the recorder has caught up with what is over
    local lines=-1 now
    sleep 0.2
    until now=$(wc -l <"$log"); [ $((now - lines)) -lt 20 ] && [ "$lines" -ge 0 ]; do
        lines=$now
        sleep 0.4
    done
    kill "$recorder"
    wait "$recorder" 2>/dev/null
}

# Two buses, vcan0 classic and vcan1 with FD; for each: use_bus NAME.
buses() {
    ip link add vcan0 type vcan && ip link set vcan0 mtu 16 up && can_up vcan1
}
use_bus() { # use_bus NAME: sets bus, options (of can-utils' ISO-TP) and form
    bus=$1 options='' form=''
    [ "$bus" = vcan0 ] || { options='-L 72:64:1' form=fd; }
    configure "$bus" agent "$dir/can.key" 10
}

cp config/etc/tools.ini config/etc/machine.ini "$dir"
sed -i '/^\[can\]/,/^\[/s|^#key =.*|key = can.key|' "$dir/machine.ini"
(umask 077 && head -c 32 /dev/urandom | od -An -v -tx1 | tr -d ' \n' >"$dir/can.key" &&
    echo 00112233445566778899aabbccddeeff >"$dir/wrong.key")
