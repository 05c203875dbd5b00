#!/usr/bin/env bash
# SPDX-License-Identifier: Apache-2.0
# Peers that we did not write: mbpoll and pymodbus read vcnc by docs/protocol.md, and tshark takes a
# whole delivery apart.
cd "$(dirname "$0")/../.." || exit 1
# shellcheck source=tests/e2e/segmill.bash
. tests/e2e/segmill.bash
python=/usr/bin/python3 # Debian's, which Debian's pymodbus belongs to
export PYTHONPATH=tests/e2e PYTHONDONTWRITEBYTECODE=1

peer() { # peer WHAT ARGUMENT…
    "$python" tests/e2e/peers.py "$port" "$@"
}
start() {
    start_vcnc --machine "$dir/machine.ini" --speed max
    port=${address##*:}
    to=modbus://$address
    echo ack >&7
    sleep 0.1
}
read_map() { # read_map: pymodbus and segmill, of a machine that stands still
    "$segmill" status --to "$to" --json >"$dir/status.json" &&
        peer map "$dir/machine.ini" "$dir/status.json"
}
read_mbpoll() {
    mbpoll -m tcp -a 1 -0 -r 0 -c 124 -t 4 -p "$port" -1 127.0.0.1 >"$dir/mbpoll" &&
        peer mbpoll "$dir/mbpoll"
}
count_exceptions() {
    peer exceptions >"$dir/exceptions"
}
show() { # show FILTER FIELD: of the frames of the capture
    tshark -r "$dir/delivery.pcap" -Y "$1" -T fields -e "$2" 2>"$dir/tshark.err"
}

cat >"$dir/cut.ngc" <<'NGC'
G17 G21 G40 G49 G80 G90 G94 G54
T2 M6
S6000 M3
G53 G0 Z0
G53 G0 X-100 Y-100
G53 G1 Z-20 F3000
G53 G1 X-120
G53 G0 Z0
M30
NGC
printf 'G33 Z1 K1\nM30\n' >"$dir/wrong.ngc"
sed -i 's/^#g55 = .*/g55 = -100.5, -50.25, -400.0001/' "$dir/machine.ini"

start
if "$python" -c 'import pymodbus' 2>/dev/null; then
    ok "pymodbus reads the map of an idle machine" read_map
    "$segmill" send "$dir/wrong.ngc" --to "$to" >"$dir/said" 2>&1
    ok "of one that refused a program" read_map
    ok "with the reason as text" grep -q '"code": 101' "$dir/status.json"
    "$segmill" send "$dir/cut.ngc" --to "$to" --start >"$dir/said" 2>&1
    ok "and of one that has run one" read_map
    ok "whose hash is the program's" grep -q "$(sha256sum "$dir/cut.ngc" | cut -c1-64)" \
        "$dir/status.json"
    ok "what is not of the protocol gets its exception and changes nothing" count_exceptions
    ok "more connections than it serves" peer crowd
else
    skip "pymodbus" "python3-pymodbus is absent"
fi
if command -v mbpoll >/dev/null; then
    ok "mbpoll reads STATUS, as the document has it" read_mbpoll
else
    skip "mbpoll" "mbpoll is absent"
fi
if command -v tshark >/dev/null; then
    ok "a delivery on the wire" python3 tests/e2e/wire.py "$port" "$dir/delivery.pcap"
    grep . "$dir/said" >"$dir/wire"
    ok "tshark finds no malformed packet" test -z \
        "$(show '_ws.malformed or tcp.analysis.flags or _ws.expert.severity == error' frame.number)"
    ok "every request and answer that passed is Modbus to it" test \
        "$(show mbtcp mbtcp.trans_id | wc -l)" = "$(sed -n 's/^frames //p' "$dir/wire")"
    ok "and the writes are FC23" test \
        "$(show 'modbus.func_code == 23 and tcp.dstport == 502' frame.number | wc -l)" = \
        "$(sed -n 's/^writes //p' "$dir/wire")"
    ok "of whole chunks" test "$(show 'modbus.write_word_cnt == 121' frame.number | wc -l)" -gt 10
else
    skip "tshark" "tshark is absent"
fi
stop_vcnc TERM
if [ -s "$dir/exceptions" ]; then
    ok "vcnc has counted the exceptions" \
        grep -qx "Modbus exceptions: $(cat "$dir/exceptions")" "$dir/vcnc.out"
fi
finish
