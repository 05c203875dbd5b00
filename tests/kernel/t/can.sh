# SPDX-License-Identifier: Apache-2.0
# vcnc and segmill on CAN buses, one classic, one with FD: what goes over them is what
# docs/protocol-can.md says; strangers change nothing; a bus that breaks is named, and used again.
# shellcheck source=tests/kernel/can.bash
. tests/kernel/can.bash
judge=$PWD/tests/kernel/can_judge.py noise=$PWD/tests/kernel/can_noise.py

state_is() { # state_is STATE: within 10 s
    within 10 shows state "\"$1\"" || { cat "$dir/status.json" && return 1; }
}
shows() { # shows KEY VALUE: the status does
    agent status --json >"$dir/status.json" 2>&1
    grep -q "^  \"$1\": $2,\$" "$dir/status.json"
}
begins() { # a program that takes some minutes is started by a program in the background
    "$segmill" send "$dir/slow.ngc" --start --to mill --config "$dir/agent.ini" \
        </dev/null >"$dir/run.out" 2>"$dir/run.err" &
    run_pid=$!
    pids+=("$run_pid")
    state_is RUNNING || { cat "$dir/run.err" && return 1; }
}
exits() { # exits STATUS: the program in the background
    local status
    wait "$run_pid"
    status=$?
    [ "$status" = "$1" ] || { echo "status $status" && cat "$dir/run.err" && return 1; }
}
counted() { # counted NAME LEAST: vcnc's summary
    local n
    n=$(sed -n "s/^CAN:.*\b$1 \([0-9]*\).*/\1/p" "$dir/vcnc.out")
    echo "# $bus: $1 $n"
    [ "${n:-0}" -ge "$2" ]
}
refuses_strangers() { # nothing that one without the key can do is done
    local before
    agent status --json >"$dir/before.json"
    for ((i = 0; i < 4200; i += 150)); do # in bursts, or most would be lost on their way
        for id in 100 110 120 130 140 150; do
            cangen "$bus" -g 0 -i -n 150 -I $id -L r -D r
        done
        sleep 0.02
    done
    for id in 120 140; do
        head -c 300 /dev/urandom | od -An -v -tx1 -w300 | timeout 3 isotpsend -s $id -d $((id + 10)) "$bus"
        echo 05 01 01 00 00 00 00 00 09 | timeout 3 isotpsend -s $id -d $((id + 10)) "$bus"
    done
    timeout 5 "$segmill" hold --to mill --config "$dir/wrong.ini" </dev/null
    [ $? = 4 ] || return 1
    canplayer -t -I "$dir/heard.log" # of earlier openings, and of this one:
    timeout 1 candump -L "$bus" >"$dir/now.log"
    canplayer -t -I "$dir/now.log"
    sleep 1
    state_is RUNNING
    for key in run epoch transfer received command_session feed_override_percent; do
        before=$(grep "^  \"$key\":" "$dir/before.json")
        [ "$before" = "$(grep "^  \"$key\":" "$dir/status.json")" ] ||
            { echo "$before" && cat "$dir/status.json" && return 1; }
    done
}
goes_off() { # as a controller tells it
    cansend "$bus" '20000040#0000000000000000'
    state_is RUNNING
}
followed() { # by the program that started it, to its end
    agent abort && exits 6
}
goes_down() {
    ip link set "$bus" down
    timeout 20 "$segmill" status --to mill --config "$dir/impatient.ini" </dev/null
    [ $? = 4 ] || return 1
    ip link set "$bus" up
    state_is RUNNING
}

# What docs/protocol-can.md says, checked by a program that knows nothing else; and what a foreign
# tool makes of a chunk.
delivers() {
    log=$dir/$bus.log
    record "$bus" "$log"
    timeout 20 isotpsniffer -s 140 -d 150 $options "$bus" <&8 >"$dir/sniffed" &
    pids+=($!)
    within 5 can_heard "$bus" isotp
    agent send "$dir/program.ngc" --start || return 1
    enough
    "$judge" "$log" "$dir/can.key" "$dir/program.ngc" $form
}
sees() {
    grep -Eq '140 +\[2[0-9]+\] +02 ' "$dir/sniffed" || { head -c 1500 "$dir/sniffed" && return 1; }
}
welcomes() { # a foreign tool has its HELLO answered
    timeout 10 isotprecv -s 123 -d 133 "$bus" >"$dir/welcome" &
    within 5 can_heard "$bus" isotp
    "$noise" hello "$dir/can.key" 123 | timeout 5 isotpsend -s 123 -d 133 "$bus"
    wait $!
    grep -Eqx '15 01 01 00 0[01]( [0-9A-F]{2}){40} *' "$dir/welcome" || { cat "$dir/welcome" && return 1; }
}
takes_noise() { # whole messages of random bytes
    said=$("$noise" "$bus" "$dir/can.key" 30000 $form) && sleep 0.5
}
clean() {
    cat "$dir/vcnc.out"
    grep -q 'CAN: forged 0, replayed 0, malformed 0, torn 0, unsent 0' "$dir/vcnc.out"
}
stops() { # two more programs hold, resume and abort the run of the first
    record "$bus" "$dir/heard.log"
    log=$dir/heard.log
    begins && agent hold && state_is HELD && agent resume --no-follow && state_is RUNNING &&
        agent abort && exits 6 && state_is READY || return 1
    enough
    "$judge" "$log" "$dir/can.key" "$dir/slow.ngc" $form
}

mkfifo "$dir/silent" && exec 8<>"$dir/silent" # a keyboard that nobody touches
program 115 F24000 >"$dir/program.ngc" # about 2 kB
program 200 F100 >"$dir/slow.ngc" # some minutes
buses

for bus in ${CAN_BUSES-vcan0 vcan1}; do
    use_bus $bus
    configure $bus impatient "$dir/can.key" 1
    configure $bus wrong "$dir/wrong.key" 1
    configure $bus same "$dir/can.key" 10
    echo 'can_last = 0' >>"$dir/same.ini"
    switch_on $bus max
    ok "$bus: 2 kB are delivered and run, as documented" delivers
    ok "$bus: a foreign tool sees the chunk" sees
    stop_vcnc TERM
    ok "$bus: nothing was refused, torn or unsent" clean

    switch_on $bus max
    ok "$bus: a foreign tool is welcomed" welcomes
    ok "$bus: 30000 random messages" takes_noise
    stop_vcnc TERM
    echo "# sent: $said" && sed -n 's/^CAN: forged/# counted: forged/p' "$dir/vcnc.out"
    ok "$bus: each of them is counted, as documented" grep -qx "CAN: $said" "$dir/vcnc.out"

    switch_on $bus 1
    ok "$bus: hold, resume and abort by other programs" stops
    ok "$bus: by the second agent, on the lowest identifier" grep -q "$bus 101#06" "$dir/heard.log"
    ok "$bus: a run to be left alone" begins
    ok "$bus: strangers change nothing" refuses_strangers
    ok "$bus: off, and on again" goes_off
    ok "$bus: down, and up again" goes_down
    ok "$bus: the run is still followed" followed
    ok "$bus: another run" begins
    ok "$bus: its number is nobody else's" not timeout 20 "$segmill" hold --to mill --config "$dir/same.ini"
    kill -KILL "$run_pid" && wait "$run_pid" 2>/dev/null
    ok "$bus: but free when it is killed" timeout 20 "$segmill" hold --to mill --config "$dir/same.ini"
    ok "$bus: the machine is held" state_is HELD
    ok "$bus: the run is over" agent abort
    stop_vcnc TERM
    sed 's/^/# /' "$dir/vcnc.out"
    ok "$bus: three programs were started" grep -q 'programs: 3 started, 0 completed, 3 aborted' "$dir/vcnc.out"
    ok "$bus: forged messages and frames are counted" counted forged 100
    ok "$bus: malformed ones are" counted malformed 10
    ok "$bus: replayed ones are" counted replayed 1
    ok "$bus: the bus-off is" grep -q 'CAN: error frames: bus-off 1$' "$dir/vcnc.out"
    ok "$bus: it was lost twice" counted breaks 2
done
finish
