#!/usr/bin/env bash
# SPDX-License-Identifier: Apache-2.0
# vcnc as a program: options, exit statuses, port line, signals, the person at the machine, the log.
cd "$(dirname "$0")/../.." || exit 1
# shellcheck source=tests/e2e/tap.bash
. tests/e2e/tap.bash
machine=config/etc/machine.ini

start() { # also sets port and start_ms
    local began=$EPOCHREALTIME now
    start_vcnc --machine "$machine" "$@"
    now=$EPOCHREALTIME
    start_ms=$(((${now/./} - ${began/./}) / 1000))
    port=${address##*:}
}
state() {
    mbpoll -m tcp -a 1 -0 -r 1 -c 1 -t 4 -p "$port" -1 127.0.0.1 | sed -n 's/^\[1\]:[[:space:]]*//p'
}
state_is() { # within 2 s
    local shown
    for ((i = 0; i < 20; i++)); do
        shown=$(state)
        [ "$shown" = "$1" ] && return
        sleep 0.1
    done
    echo "state $shown, expected $1"
    return 1
}
exits() { # exits STATUS WORD ARGUMENT…: says WORD on stderr, nothing on stdout
    local expected=$1 word=$2 got
    shift 2
    timeout 5 "$vcnc" "$@" </dev/null >"$dir/stdout" 2>"$dir/stderr"
    got=$?
    cat "$dir/stderr"
    [ "$got" = "$expected" ] && [ ! -s "$dir/stdout" ] && grep -q -e "$word" "$dir/stderr"
}

ok "unknown option" exits 2 --bus --machine "$machine" --bus vcan0
ok "CAN without a key" exits 3 "needs a key" --machine "$machine" --can vcan0
ok "no machine" exits 2 --machine
ok "stray argument" exits 2 stray --machine "$machine" stray
for speed in 0 -1 nan inf 1x ''; do
    ok "speed \"$speed\"" exits 2 --speed --machine "$machine" --speed "$speed"
done
ok "port out of range" exits 2 --modbus --machine "$machine" --modbus 127.0.0.1:70000
ok "no such machine file" exits 3 absent.ini --machine "$dir/absent.ini"
printf '[machine]\nnmae = x\n' >"$dir/bad.ini"
ok "bad machine file" exits 3 nmae --machine "$dir/bad.ini"
printf '[tools]\nfile = absent.ini\n' >"$dir/toolless.ini"
ok "no tool table" exits 3 absent.ini --machine "$dir/toolless.ini"
ok "log that cannot be written" exits 1 "$dir/no/log" --machine "$machine" --log "$dir/no/log"
documented() { # every option and every fault is in the man page, and no other option
    local word
    "$vcnc" --help | grep -o -e '--[a-z][a-z-]*' | sort -u >"$dir/options"
    grep -o -e '--[a-z][a-z-]*' docs/vcnc.1 | sort -u >"$dir/in-the-page"
    diff "$dir/options" "$dir/in-the-page" || return 1
    for word in $("$vcnc" --machine "$machine" --fault 'at line 1: x' 2>&1 |
        sed -n 's/.*one of \(.*\)/\1/p' | tr -d ,); do
        grep -q "^\.\(B\|BR\|BI\) \"*$word" docs/vcnc.1 || { echo "$word" && return 1; }
    done
    [ -n "$word" ]
}
ok "the man page has every option and every fault" documented
ok "help" sh -c "'$vcnc' --help | grep -q -e --speed"

start
ok "says its port" test -n "$port"
ok "starts in 0.2 s (took $start_ms ms; asserted ten times looser)" test "$start_ms" -lt 2000
ok "a port in use" exits 1 "$port" --machine "$machine" --modbus "127.0.0.1:$port"
if command -v mbpoll >/dev/null; then
    ok "OFF until acknowledged" state_is 0
    echo ack >&7
    ok "ack: IDLE" state_is 1
    echo estop >&7
    ok "estop: ESTOP" state_is 13
    echo ack >&7
    ok "ack: IDLE again" state_is 1
else
    skip "states over Modbus" "mbpoll is absent"
    echo ack >&7
fi
echo dance >&7
exec 7>&-
sleep 0.2
ok "an unknown word of the person is named" grep -q dance "$dir/vcnc.err"
ok "lives on when standard input ends" kill -0 "$vcnc_pid"
stop_vcnc TERM
ok "SIGTERM: status 0" test "$status" = 0
ok "SIGTERM: summary" grep -q '^programs: 0 started' "$dir/vcnc.out"
start
stop_vcnc INT
ok "SIGINT: status 0 and a summary" sh -c "[ $status = 0 ] && grep -q '^machine time: 0.000 s' '$dir/vcnc.out'"
start --log /dev/full
echo ack >&7
sleep 0.1
stop_vcnc TERM
ok "a log that is not complete: status 1" sh -c "[ $status = 1 ] && grep -q /dev/full '$dir/vcnc.err'"

cat >"$dir/part.ngc" <<'NGC'
G17 G21 G40 G49 G80 G90 G91.1 G94 G64 P0.01
T2 M6
S6000 M3
(REGION 1 convex tool=2 feed=3000)
G53 G0 X-30 Y-20 Z-5 (MSG,at the part)
G53 G1 X-40 F3000
G91 G2 X10 Y10 I10
G90 G4 P0.25
M5
G53 G0 Z0
M30
NGC
run() { # run SPEED LOG: delivers and executes; sets status
    start --speed "$1" --log "$2"
    echo ack >&7
    sleep 0.1
    ok "delivered and executed at --speed $1" sh -c \
        "python3 tests/e2e/deliver.py $port '$dir/part.ngc' | grep -x 'COMPLETE 9'"
    stop_vcnc TERM
    ok "--speed $1: summary counts it" grep -q '1 started, 1 completed' "$dir/vcnc.out"
}
run max "$dir/max.log"
run 40 "$dir/40.log"
ok "logs of both speeds are byte-identical" cmp "$dir/max.log" "$dir/40.log"
ok "the log has every block" sh -c "grep -c '\"kind\"' '$dir/max.log' | grep -x 9"
ok "and what the program says" grep -q '"message":"at the part","line":5,' "$dir/max.log"
printf 'G33 Z1 K1\nM30\n' >"$dir/wrong.ngc"
start --log "$dir/wrong.log"
echo ack >&7
sleep 0.1
ok "an unknown word is refused" sh -c \
    "python3 tests/e2e/deliver.py $port '$dir/wrong.ngc' | grep -x 'LOADING 0'"
ok "and named" grep -q 'alarm 101: line 1, column 1: G33' "$dir/vcnc.err"
stop_vcnc TERM

# A program larger than the memory, the same as whole, and a restart with an override.
printf '%s\n' '[machine]' 'program_memory_bytes = 7000' '[tools]' "file = $PWD/config/etc/tools.ini" \
    >"$dir/small.ini"
{
    printf '%s\n' 'G17 G21 G90 G94 G64 P0.01' 'T2 M6' 'S6000 M3' 'G53 G0 Z0'
    for ((i = 0; i < 100; i++)); do
        printf '%s\n' "G53 G0 X-$i Y-10" 'G53 G1 Z-10 F3000' 'G91 G1 X-1 Y-1' 'G2 X-2 I-1' 'G90 G53 G0 Z0'
    done
    printf '%s\n' M5 M30
} >"$dir/long.ngc"
send() { # send MACHINE LOG: delivers, executes; the machine stays
    machine=$1
    start --speed max --log "$2"
    echo ack >&7
    ok "executed by $(basename "$1")" operate send "$dir/long.ngc" --start --accept-cautions --machine "$1"
}
operate() { # operate COMMAND…
    XDG_STATE_HOME=$dir/state timeout 60 "$segmill" "$@" --to "modbus://$address"
}
executed() { # executed LOG: its blocks without their times; a pass ends at rest
    sed -n 's/^\({"line".*\)"start_s".*"position_mm"/\1"position_mm"/p' "$1"
}
send "$dir/small.ini" "$dir/drip.log"
stop_vcnc TERM
ok "it dripped" grep -q '"passes":' "$dir/drip.log"
send config/etc/machine.ini "$dir/whole.log"
ok "as a whole it did not" grep -q '"planned_s":' "$dir/whole.log"
executed "$dir/drip.log" >"$dir/drip.blocks"
executed "$dir/whole.log" >"$dir/whole.blocks"
ok "the same blocks" cmp "$dir/drip.blocks" "$dir/whole.blocks"
ok "all of them" sh -c "wc -l <'$dir/whole.blocks' | grep -x 505"
ok "delivered again" operate send "$dir/long.ngc" --machine config/etc/machine.ini
ok "an override" operate override --feed 150
ok "a restart" operate restart --at 50 --yes
stop_vcnc TERM
ok "the log shows the override" grep -q '"override":{"feed":150,' "$dir/whole.log"
ok "and the way" grep -q '"way":"spindle"' "$dir/whole.log"
ok "the logs match their schema" python3 tests/e2e/schema.py docs/schema/vcnc-log.json \
    "$dir"/{max,wrong,drip,whole}.log
finish
