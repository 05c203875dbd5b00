#!/usr/bin/env bash
# SPDX-License-Identifier: Apache-2.0
# segmill against vcnc with each fault on purpose: how both end, in which state the machine is then,
# and what was executed.
cd "$(dirname "$0")/../.." || exit 1
# shellcheck source=tests/e2e/segmill.bash
. tests/e2e/segmill.bash
sed -i 's/^#change_s = .*/change_s = 0.5/; s/^#rpm_per_s = .*/rpm_per_s = 100000/' "$dir/machine.ini"
printf '%s\n' '[link]' 'reply_timeout_s = 0.3' 'reconnect_s = 0.05' 'heartbeat_s = 0.1' \
    'give_up_s = 10' >"$dir/agent.ini"
{
    printf '%s\n' 'G17 G21 G40 G49 G80 G90 G91.1 G94 G64 P0.01' 'T2 M6' 'S6000 M3' 'G53 G0 Z0'
    for ((i = 1; i <= 10; i++)); do
        printf '%s\n' "G53 G0 X-$((100 + i)) Y-100" 'G53 G1 Z-50 F6000' 'G53 G1 Y-140' 'G53 G0 Z0'
    done
    printf '%s\n' M5 M30
} >"$dir/part.ngc"
blocks=45 # of the 46 lines all but the first

# Each case has a folder and a machine of its own; they mostly wait, so many go side by side.
AT_ONCE=12
root=$dir names=()
later() { # later DESCRIPTION COMMAND…
    local n=${#names[@]} here
    names+=("$1")
    shift
    here=$root/case.$n
    mkdir "$here" && cp "$root"/{machine,tools,agent}.ini "$root/part.ngc" "$here"
    while [ "$(jobs -rp | wc -l)" -ge $AT_ONCE ]; do wait -n; done
    (
        dir=$here XDG_STATE_HOME=$here/state pids=()
        "$@" >"$dir/said" 2>&1
        echo $? >"$dir/result"
        kill "${pids[@]}" 2>/dev/null
    ) &
}
together() { # waits, and says how they went
    local n
    wait
    for n in "${!names[@]}"; do
        ok "${names[$n]}" went "$root/case.$n"
    done
}
went() {
    cat "$1/said"
    return "$(cat "$1/result")"
}

begin() { # begin FAULT… : a virtual CNC that ends behind its first job; nobody is there
    local specs=() fault
    for fault in "$@"; do specs+=(--fault "$fault"); done
    start_vcnc --machine "$dir/machine.ini" --speed "${speed:-10}" --log "$dir/log" --acknowledge \
        --exit-after-job "${specs[@]}"
}
send() { # send: sets sent, the exit status of segmill
    timeout 60 "$segmill" send "$dir/part.ngc" --start --to "modbus://$address" \
        --config "$dir/agent.ini" --machine "$dir/machine.ini" >"$dir/stdout" 2>"$dir/stderr"
    sent=$?
}
end() { # waits for vcnc, which ends by itself, within a minute; sets status
    for ((i = 0; i < 1200; i++)); do
        kill -0 "$vcnc_pid" 2>/dev/null || break
        sleep 0.05
    done
    stop_vcnc TERM
}
show() {
    echo "segmill: $sent, vcnc: $status"
    cat "$dir/stderr" "$dir/vcnc.err" "$dir/vcnc.out"
    grep -v '"line"' "$dir/log"
}
executed() {
    grep -c '^{"line"' "$dir/log"
}
# ends FAULT STATUS STATUS BLOCKS [WORD]: so segmill, so vcnc; blocks executed, or a range; what
# segmill says.
ends() {
    local fault=$1 n low=${4%-*} high=${4#*-}
    begin "$fault"
    send
    end
    show
    n=$(executed)
    echo "$n blocks"
    [ "$sent" = "$2" ] && [ "$status" = "$3" ] && [ "$n" -ge "$low" ] && [ "$n" -le "$high" ] &&
        grep -q "^faults begun: 1 of 1$" "$dir/vcnc.out" &&
        grep -qF "{\"fault\":\"$fault\"" "$dir/log" && grep -q -e "${5:-}" "$dir/stderr"
}

# The machine's. Before line 11 there are ten blocks but that of line 1, which only sets modes.
later "alarm" ends 'at line 11: alarm 777 coolant is low' 5 1 9 'alarm 777 .*coolant is low'
later "alarm at a time of the program" ends 'at time 1: alarm 777' 5 1 2-44 'an alarm on purpose'
later "tool missing" ends 'at line 2: tool-missing' 5 1 0 'alarm 202'
later "limit hit" ends 'at line 11: limit-hit' 5 1 9 'alarm 203'
later "e-stop pressed" ends 'at line 11: estop' 5 1 9 'alarm 201'
rebooted() { # it comes back OFF, at the same address, and is acknowledged
    ends 'at line 11: reboot' 7 1 9 'was restarted' &&
        [ "$(grep -c "^modbus $address$" "$dir/vcnc.out")" = 2 ] &&
        sed -n '/reboot/,$p' "$dir/log" | grep -o '"[A-Z]*"' | tr '\n' ' ' | grep -x '"OFF" "IDLE" '
}
later "reboot: nobody knows what was done last" rebooted

# The link's: segmill ends well, by itself, and every block is executed once.
for moment in 'at line 11' 'at time 1'; do
    for fault in drop duplicate 'delay 0.5' corrupt 'corrupt 3' close 'slow 0.05'; do
        later "$moment: $fault" ends "$moment: $fault" 0 0 $blocks
    done
done
# The first frames of a delivery: status, LEASE, OPEN, chunks, VERIFY, START.
for frame in 1 2 3 4 5 6 7 8 9 10; do
    for fault in drop duplicate corrupt close; do
        later "at frame $frame: $fault" ends "at frame $frame: $fault" 0 0 $blocks
    done
done
several() { # a row of faults in one run
    begin 'at frame 3: drop' 'at frame 4: close' 'at line 5: corrupt' 'at line 20: slow 0.02' \
        'at line 30: delay 0.4' 'at line 3000: hold'
    send
    end
    show
    [ "$sent" = 0 ] && [ "$status" = 0 ] && [ "$(executed)" = $blocks ] &&
        grep -x "faults begun: 5 of 6" "$dir/vcnc.out" &&
        grep -x "fault not reached: at line 3000: hold" "$dir/vcnc.out"
}
later "several faults in one run, and one that does not come" several
random() { # random SEED
    begin "random:$1:0.05"
    send
    end
    show
    [ "$sent" = 0 ] && [ "$status" = 0 ] && [ "$(executed)" = $blocks ] &&
        grep -x "vcnc: --fault random:$1:0.05" "$dir/vcnc.err" &&
        grep "^random faults, seed $1, of [0-9]* replies: drop" "$dir/vcnc.out"
}
for seed in 1 2 3; do
    later "random faults, seed $seed" random $seed
done
drawn() {
    local seed
    begin random
    seed=$(sed -n 's/^vcnc: --fault random:\([0-9]*\):0.01$/\1/p' "$dir/vcnc.err")
    echo "seed $seed"
    stop_vcnc TERM
    [ "$status" = 0 ] && [ -n "$seed" ] && grep "^random faults, seed $seed, of" "$dir/vcnc.out"
}
later "a seed is drawn, and said" drawn

# Feed hold: the machine stands HELD before the line until somebody lets it go on.
held() { # held SPEED: keeps the log
    local sender i
    speed=$1 begin 'at line 11: hold'
    send &
    sender=$!
    for ((i = 0; i < 400; i++)); do
        grep -q '"HELD"' "$dir/log" && break
        sleep 0.05
    done
    cp "$dir/log" "$dir/held"
    echo resume >&7
    wait "$sender"
    end
    cp "$dir/log" "$root/hold.$1.log"
    cat "$dir/stderr" "$dir/log"
    [ "$status" = 0 ] && [ "$(executed)" = $blocks ] && tail -n 1 "$dir/held" | grep HELD &&
        [ "$(grep -c '^{"line"' "$dir/held")" = 9 ]
}
alarmed() { # alarmed SPEED: keeps the log
    speed=$1 begin 'at time 1.25: alarm 9'
    send
    end
    cp "$dir/log" "$root/alarm.$1.log"
    [ "$sent" = 5 ]
}
for speed in 1 max; do
    later "feed hold, resumed at the machine, --speed $speed" held $speed
    later "an alarm at a time, --speed $speed" alarmed $speed
done
unset speed

printf '%s\n' '# what goes wrong' '' 'at line 11: alarm 4711' >"$dir/faults"
from_file() {
    start_vcnc --machine "$dir/machine.ini" --speed max --acknowledge --exit-after-job \
        --fault-file "$root/faults"
    send
    end
    echo "segmill: $sent, vcnc: $status"
    [ "$sent" = 5 ] && [ "$status" = 1 ] && grep -q 'alarm 4711' "$dir/stderr"
}
later "faults from a file" from_file
two_jobs() {
    start_vcnc --machine "$dir/machine.ini" --speed max --acknowledge --exit-after-job=2
    send
    local first=$sent
    send
    end
    echo "segmill: $first $sent, vcnc: $status"
    [ "$first$sent$status" = 000 ] && grep '2 started, 2 completed' "$dir/vcnc.out"
}
later "ends behind the second job" two_jobs
refused_job() {
    start_vcnc --machine "$dir/machine.ini" --speed max --acknowledge --exit-after-job
    printf '%s\n' 'G21 G90' 'G33 Z1 K1' M30 >"$dir/wrong.ngc"
    python3 tests/e2e/deliver.py "${address##*:}" "$dir/wrong.ngc"
    end
    echo "vcnc: $status"
    [ "$status" = 1 ] && grep '1 refused at VERIFY' "$dir/vcnc.out"
}
later "a program that is refused has ended, badly" refused_job

together
ok "feed hold: the same log at both speeds, to the byte" cmp "$dir/hold.1.log" "$dir/hold.max.log"
ok "alarm: the same log at both speeds" cmp "$dir/alarm.1.log" "$dir/alarm.max.log"
ok "the logs match their schema" python3 tests/e2e/schema.py docs/schema/vcnc-log.json \
    "$dir"/*.log "$dir"/case.*/log

refuses() { # refuses WORD ARGUMENT…: with status 2
    local word=$1
    shift
    timeout 5 "$vcnc" --machine "$dir/machine.ini" "$@" </dev/null >"$dir/stdout" 2>"$dir/stderr"
    [ $? = 2 ] && cat "$dir/stderr" && grep -q -e "$word" "$dir/stderr"
}
ok "a wrong fault is named with its place" refuses 'column 13: "explode": expected one of alarm' \
    --fault 'at line 12: explode'
echo 'at noon: hold' >>"$dir/faults"
ok "and in a file with its line" refuses "$dir/faults:4: column 4" --fault-file "$dir/faults"
ok "no such file" refuses "$dir/absent" --fault-file "$dir/absent"
ok "no whole number of jobs" refuses 'exit-after-job' --exit-after-job=0
finish
