#!/usr/bin/env bash
# SPDX-License-Identifier: Apache-2.0
# Pre-flight against a machine that is not as planned; overrides and optional stop; a run that is
# aborted and begun again at a gate, by the copy that was kept.
cd "$(dirname "$0")/../.." || exit 1
# shellcheck source=tests/e2e/cell.bash
. tests/e2e/cell.bash

# Three passes of two tools, each 20 mm at 60 mm/min. Between them the tool is clear of the part, but
# not at the top of the travel: a restart has to come down to its gate.
pass() { # pass TOOL SPEED REGION
    cat <<NGC
T$1 M6
(REGION $3 flat tool=$1 feed=60)
S$2 M3
G43 H$1 G0 X10 Y$3 Z30
Z5
G1 X30 F60
G0 Z30
M5
NGC
}
{
    printf '%s\n' 'G17 G21 G40 G49 G80 G90 G91.1 G94 G64 P0.01' G54 'G53 G0 Z0'
    pass 2 6000 1
    echo M1
    pass 5 9000 2
    pass 2 7000 3
    echo M30
} >"$dir/three.ngc"
send() { # send ARGUMENT…: as the machine file says
    echo "$segmill" send "$dir/three.ngc" --to "$to" --config "$dir/agent.ini" \
        --machine "$dir/machine.ini" "$@"
}
finds() { # finds LEVEL CODE: in $dir/json
    python3 - "$dir/json" "$@" <<'PY'
import json, sys
path, level, code = sys.argv[1:]
found = [(f["level"], f["code"]) for f in json.load(open(path))["preflight"]]
print(found)
sys.exit((level, code) not in found)
PY
}

# ---------------------------------------------------------------------------- pre-flight
# other SED EXPRESSION FILE: a machine of its own, which is another one than planned with
other() {
    mkdir -p "$dir/other"
    cp "$dir/machine.ini" "$dir/tools.ini" "$dir/other"
    sed -i "$1" "$dir/other/$2"
    start_vcnc --machine "$dir/other/machine.ini" --speed max
    echo ack >&7
    to=modbus://$address
}
# shellcheck disable=SC2046
{
    other '/^\[tool.5\]/,/^length_mm/s/^length_mm = .*/length_mm = 92.02/' tools.ini
    ok "another length blocks the start" fails 8 'T5: length is 92.0200 mm on the machine, 92.0000' \
        $(send --start)
    ok "nothing was sent" shows length 0
    ok "the error as an object" json 8 $(send --start --json)
    ok "send without --start is blocked, too: a button could start it" json 8 $(send --json)
    ok "accepted, it is delivered" json 0 $(send --json --accept-cautions)
    ok "as a caution" finds caution tool-length
    ok "accepted, it starts" says 0 'the machine is COMPLETE' $(send --start --accept-cautions)
    ok "an override" control override --rapid 25
    ok "and another" json 0 "$segmill" override --spindle 110 --to "$to" --json
    ok "leaves the others" grep -q '"rapid_percent": 25,' "$dir/json"
    ok "send --json" json 0 $(send --json --accept-cautions)
    ok "a warning of it" finds warning override
    stop

    other '/^\[tool.5\]/,/^$/d' tools.ini
    ok "a missing tool blocks the start" fails 8 "T5 (flat Ø6 mm) is not in the machine's" \
        $(send --start)
    stop

    other 's/^#g54 = .*/g54 = -381, -203, -419.98/' machine.ini
    ok "another work offset blocks the start" fails 8 'G54 is X-381.0000 .* Z-419.9800 on the' \
        $(send --start)
    ok "a planned run, too" fails 8 'G54' \
        "$segmill" run "$dir/recipe.ini" --to "$to" -o "$dir/run"
    ok "its run.json is valid" valid run "$dir/run/run.json"
    ok "and says so" grep -q '"outcome": "blocked"' "$dir/run/run.json"
    ok "without a description" json 0 "$segmill" send "$dir/three.ngc" --to "$to" --json
    ok "nothing is compared" finds note not-compared
    stop

    other 's/^#program_memory_bytes = .*/program_memory_bytes = 1024/' machine.ini
    cp "$dir/three.ngc" "$dir/small.ngc"
    sed -i "s/^G1 X30/($(printf '%0200d' 0))\n($(printf '%0200d' 0))\n($(printf '%0200d' 0))\n&/" "$dir/three.ngc"
    ok "larger than the memory: fed while it runs" json 0 $(send --start --json)
    ok "which is noted" finds note drip
    ok "the machine says so, too" shows drip true
    sed 's/^\[link\]/&\ndrip = never/' "$dir/agent.ini" >"$dir/never.ini"
    ok "unless that is forbidden" fails 8 'takes .* bytes with its gates and the machine has 1024' \
        $(send --start) --config "$dir/never.ini"
    mv "$dir/small.ngc" "$dir/three.ngc"
    stop
}

# ------------------------------------------------------------------------------- restart
slow() { # slow SPEED LOG
    start_vcnc --machine "$dir/machine.ini" --speed "$1" --log "$dir/$2"
    echo ack >&7
    to=modbus://$address
}
line_is() { # within 20 s
    for ((i = 0; i < 200; i++)); do
        shows line "$1" && return
        sleep 0.1
    done
    return 1
}
on_terminal() { # on_terminal DESCRIPTION COMMAND…: where the system can make one
    if script -qec true /dev/null >/dev/null 2>&1; then
        ok "$@"
    else
        skip "$1" "no pseudo-terminals here"
    fi
}
# A person restarts at gate 1, is asked, does something else first, and then says yes.
yes_after() { # yes_after STATUS COMMAND…
    local expected=$1
    shift
    : >"$dir/asked"
    {
        for ((i = 0; i < 300; i++)); do
            grep -q 'Start here' "$dir/asked" && break
            sleep 0.1
        done
        "$@" >/dev/null
        echo y
    } | timeout 60 script -qec "'$segmill' restart --at 1 --to $to --config '$dir/agent.ini' --json \
        >'$dir/json' 2>'$dir/asked'" /dev/null
    status=$?
    cat "$dir/asked"
    [ "$status" = "$expected" ]
}
# shellcheck disable=SC2046
{
    slow max full.log
    ok "a run without a break" says 0 COMPLETE $(send --start)
    stop
    ok "restart needs a machine" fails 4 '' "$segmill" restart --at 1 --to "$to" \
        --config "$dir/agent.ini"

    slow max think.log
    sed 's/^M30/(another one)\n&/' "$dir/three.ngc" >"$dir/next.ngc"
    ok "not started yet" json 0 $(send --json)
    on_terminal "another program comes before the yes" \
        yes_after 4 "$segmill" send "$dir/next.ngc" --to "$to" --machine "$dir/machine.ini"
    on_terminal "with --json a person sees what would be done" grep -q 'goes on   in line 4:' "$dir/asked"
    on_terminal "the other program is not the one that was shown" grep -q 'not hold the program that is meant' "$dir/json"
    ok "and not started" state_is READY
    kept="$XDG_STATE_HOME/segmill/programs/$(sha256sum "$dir/next.ngc" | cut -d ' ' -f 1).ini"
    sed -i 's/^gates=[0-9]*/gates=1/' "$kept"
    on_terminal "other gates than this user sent" fails 3 'has the program with 5 gates, the copy has 5' \
        "$segmill" restart --at 1 --to "$to" --yes
    stop

    slow 10 log
    ok "restart needs a program" fails 4 'is IDLE and takes no restart' \
        "$segmill" restart --at 1 --to "$to"
    ok "optional stop" json 0 "$segmill" optional-stop on --to "$to" --json
    background send "$dir/three.ngc" --machine "$dir/machine.ini" --start
    ok "M1 stops" state_is PROGRAM_STOP
    ok "restart is no resume" fails 4 'segmill resume' "$segmill" restart --at 1 --to "$to"
    ok "override" control override --feed 150
    ok "status shows both" says 0 'feed 150 %.*optional stop on' "$segmill" status --to "$to"
    ok "resume" control resume --no-follow
    ok "in the second pass" line_is 18
    ok "abort" control abort
    ok "the run has ended" exits 6
    ok "ready for a restart" state_is READY
    ok "it stopped there" shows stop_line 18
    ok "behind the second gate" shows gate 2
    rm "$dir/three.ngc" # the copy is what counts
    ok "a wrong gate lists those near" fails 2 'gates 1 to 4.*near the stop: 1 (line 4), 2 (line 11)' \
        "$segmill" restart --at 9 --to "$to"
    ok "no gate" fails 2 'gates 1 to 4' "$segmill" restart --at '2x' --to "$to"
    ok "without a terminal it shows" says 2 'goes on   in line 11: M5' \
        "$segmill" restart --at last --to "$to"
    ok "and wants --yes" grep -q 'add --yes' "$dir/stderr"
    ok "another user has no copy" fails 3 'no copy' \
        env XDG_STATE_HOME="$dir/stranger" "$segmill" restart --at last --to "$to" --yes
    on_terminal "a person may say no" sh -c "echo n | script -qec \
        '$segmill restart --at last --to $to' /dev/null | grep -q 'not started'"
    ok "nothing has moved" state_is READY
    ok "no optional stop" control optional-stop off
    ok "restart" json 0 "$segmill" restart --at last --to "$to" --yes -o "$dir/again" --json
    ok "its run.json is valid" valid run "$dir/again/run.json"
    ok "and names the gate" grep -q '"gate": 2,' "$dir/again/run.json"
    ok "up, tool, across, spindle, down; then the rest, once" \
        python3 tests/e2e/restart.py "$dir/log" "$dir/full.log" 11
    ok "complete" state_is COMPLETE
    ok "which takes no restart" fails 4 'is COMPLETE' "$segmill" restart --at 1 --to "$to"
    stop
}
finish
