#!/usr/bin/env bash
# SPDX-License-Identifier: Apache-2.0
# vcnc with material clamped: programs over Modbus at --speed max, what is left of the material judged
# by ADMesh and by closed forms, collisions in the log, on stderr, in the exit status.
cd "$(dirname "$0")/../.." || exit 1
# shellcheck source=tests/e2e/tap.bash
. tests/e2e/tap.bash
cp config/etc/machine.ini config/etc/tools.ini "$dir"
machine=$dir/machine.ini
sed -i 's/^#g54 = .*/g54 = -300, -200, -300/' "$machine"

head='G17 G21 G40 G49 G80 G90 G91.1 G94 G64 P0.01'
# A slot of Ø10 through the block along X, 4 deep, and a pocket: G43 on, work zero at the top.
printf '%s\n' "$head" 'T7 M6' 'G43 H7' 'S6000 M3' 'G0 X-10 Y15' 'G0 Z5' 'G1 Z-4 F600' 'G1 X70 F1200' \
    'G0 Z5' 'G53 G0 Z0' M5 M30 >"$dir/slot.ngc"
# The same but a rapid back through the block in line 9, down to Z-5: deeper by (70 - x + √(25 - y²))/80,
# in all 329.5 mm³.
printf '%s\n' "$head" 'T7 M6' 'G43 H7' 'S6000 M3' 'G0 X-10 Y15' 'G0 Z5' 'G1 Z-4 F600' 'G1 X70 F1200' \
    'G0 X-10 Z-5' 'G53 G0 Z0' M5 M30 >"$dir/rapid.ngc"
# One that stops for a person behind the slot's first half.
printf '%s\n' "$head" 'T7 M6' 'G43 H7' 'S6000 M3' 'G0 X-10 Y15' 'G0 Z5' 'G1 Z-4 F600' 'G1 X30 F1200' \
    M0 'G1 X70' 'G53 G0 Z0' M5 M30 >"$dir/half.ngc"
# One that cuts the slot, then feels for its floor, for the block's top, and past it.
printf '%s\n' "$head" 'T7 M6' 'G43 H7' 'S6000 M3' 'G0 X-10 Y15' 'G0 Z5' 'G1 Z-4 F600' 'G1 X70 F1200' \
    'G0 Z5' M5 'G0 X30' 'G38.2 Z-10 F100' 'G0 Z[#5063 + 7]' 'G0 Y3' 'G38.2 Z-10' 'G38.4 Z20' 'G0 Y-10' \
    'G38.3 Z-10' 'G53 G0 Z0' M30 >"$dir/probe.ngc"

cut() { # cut PROGRAM ARGUMENT…: until vcnc ends by itself; sets status
    local program=$1
    shift
    rm -f "$dir/left".*
    start_vcnc --machine "$machine" --stock box:0,0,-20,60,30,0 --ipm "$dir/left.stl" --pitch 0.25 \
        --log "$dir/log" --acknowledge --exit-after-job "$@"
    timeout 60 python3 tests/e2e/deliver.py "${address##*:}" "$program" >"$dir/delivered" 2>&1
    wait "$vcnc_pid"
    status=$?
    exec 7>&-
}
of() { # of LABEL: a number that ADMesh gives
    sed -n "s/.*$1 *: *\([-0-9.e+]*\).*/\1/p" "$dir/judged" | head -n 1
}
whole() { # whole PARTS VOLUME: closed, manifold, outward, in so many parts, of this volume within 0.02 %
    admesh "$dir/left.stl" >"$dir/judged"
    cat "$dir/judged"
    for flaw in 'Total disconnected facets' 'Degenerate facets' 'Edges fixed' 'Facets removed' \
        'Facets added' 'Facets reversed' 'Backwards edges' 'Normals fixed'; do
        [ "$(of "$flaw")" = 0 ] || return 1
    done
    [ "$(of 'Number of parts')" = "$1" ] &&
        awk -v v="$(of Volume)" -v w="$2" 'BEGIN { exit !(v > w * 0.9998 && v < w * 1.0002) }'
}
said() {
    cat "$dir/vcnc.err"
    grep -q "$@" "$dir/vcnc.err"
}
logged() {
    tail -n 20 "$dir/log"
    grep -q "$@" "$dir/log"
}

if ! command -v admesh >/dev/null; then
    skip "material" "admesh is absent"
    finish
    exit
fi
cut "$dir/slot.ngc" --speed max
ok "a slot: status 0" test "$status" = 0
ok "a slot: the model is closed, and as large as it should be" whole 1 $((60 * 30 * 20 - 60 * 10 * 4))
ok "a slot: no collision" sh -c "! grep -q collision '$dir/log'"
ok "a slot: in the summary" grep -q '^material: 2400 mm3 removed of 36000' "$dir/vcnc.out"
ok "a slot: which lines made it" grep -q ',7,8,8\]' "$dir/left.stl.json"
cp "$dir/left.stl" "$dir/slot.stl"
cp "$dir/log" "$dir/slot.log"
sed -i 's/^#change_s = .*/change_s = 0.5/; s/^#rpm_per_s = .*/rpm_per_s = 100000/' "$machine"
cut "$dir/slot.ngc" --speed 100
ok "a slot: the same model at another speed and time" cmp "$dir/slot.stl" "$dir/left.stl"

cut "$dir/rapid.ngc" --speed max
ok "a rapid through the block: status 1" test "$status" = 1
ok "a rapid through the block: named with its line" said 'line 9: rapid through material'
ok "a rapid through the block: in the log" logged '^{"collision":"rapid","line":9,'
ok "a rapid through the block: nothing else" [ "$(grep -c collision "$dir/log")" = 1 ]
ok "a rapid through the block: removed all the same" whole 1 33270.5
ok "a rapid through the block: no alarm" sh -c "! grep -q ALARM '$dir/log'"
cp "$dir/log" "$dir/rapid.log"
cut "$dir/rapid.ngc" --speed 50
ok "a rapid through the block: the same log at another speed" cmp "$dir/rapid.log" "$dir/log"
cut "$dir/rapid.ngc" --speed max --collision-alarm
ok "with --collision-alarm: ALARM behind it" logged '^{"state":"ALARM"'

cut "$dir/probe.ngc" --speed max
at() { # at LINE Z: where the tip was behind a block
    awk -F '[][,]' -v line="$1" -v z="$2" 'index($0, "{\"line\":" line ",") {
        tip = $8 + 300 - 108; print tip; good = tip > z - 3e-5 && tip < z + 3e-5 } END { exit !good }' \
        "$dir/log"
}
ok "G38.2: the floor of the slot, as cut before" at 12 -4
ok "G38.2: #5063 has it" at 13 3
ok "G38.2: the block's top" at 15 0
ok "G38.4: off it again" at 16 0
ok "G38.3: nothing there, to the end" at 18 -10
ok "G38: nothing is removed" whole 1 $((60 * 30 * 20 - 60 * 10 * 4))
sed 's/G38.3/G38.2/' "$dir/probe.ngc" >"$dir/nothing.ngc"
cut "$dir/nothing.ngc" --speed max
ok "G38.2 with nothing there: refused, with its line" said 'line 18.*touched nothing'

start_vcnc --machine "$machine" --stock "$dir/slot.stl" --ipm "$dir/left.stl" --pitch 0.25 \
    --acknowledge --speed max
stop_vcnc TERM
ok "a block from a file, not cut: the same" whole 1 $((60 * 30 * 20 - 60 * 10 * 4))

rm -f "$dir/left".*
start_vcnc --machine "$machine" --stock box:0,0,-20,60,30,0 --ipm "$dir/left.off" --pitch 0.25 \
    --acknowledge --speed max
timeout 60 python3 tests/e2e/deliver.py "${address##*:}" "$dir/half.ngc" >"$dir/delivered" 2>&1 &
pids+=($!)
for ((i = 0; i < 100; i++)); do
    grep -q 'PROGRAM_STOP' "$dir/delivered" && break
    sleep 0.05
done
stop_vcnc TERM
# Half a slot: 30 long and half of the cutter's end.
ok "ended in a program stop: what was executed is removed, as OFF" awk -v most=$((36000 - 1200)) \
    'NR == 3 { good = $1 > 1000 && $2 > 2000 } END { exit !good }' "$dir/left.off"
ok "ended in a program stop: summary" sh -c "cat '$dir/vcnc.out'; grep -q '^material: 135[5-9] mm3 removed' '$dir/vcnc.out'"

refused() { # refused STATUS WORD ARGUMENT…
    local expected=$1 word=$2 got
    shift 2
    timeout 10 "$vcnc" --machine "$machine" --modbus 127.0.0.1:0 "$@" </dev/null >"$dir/stdout" \
        2>"$dir/stderr"
    got=$?
    cat "$dir/stderr"
    [ "$got" = "$expected" ] && grep -q -e "$word" "$dir/stderr"
}
ok "a box that is none" refused 3 box:1,2 --stock box:1,2
ok "a box without volume" refused 3 'no volume' --stock box:0,0,0,1,1,0
ok "no such file" refused 3 absent.stl --stock "$dir/absent.stl"
ok "a model of nothing" refused 2 --stock --ipm "$dir/left.stl"
finish
