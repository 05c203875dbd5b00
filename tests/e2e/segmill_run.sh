#!/usr/bin/env bash
# SPDX-License-Identifier: Apache-2.0
# segmill against vcnc over Modbus TCP: delivery, run, hold, resume, Ctrl-C, alarm, lost link.
cd "$(dirname "$0")/../.." || exit 1
# shellcheck source=tests/e2e/cell.bash
. tests/e2e/cell.bash

ends() { # ends STATUS OUTCOME: the run ended so, and run.json says it
    exits "$1" && valid run "$dir/run/run.json" && grep -q "^  \"outcome\": \"$2\"" "$dir/run/run.json"
}
holds_are() {
    grep -A 60 '"states"' "$dir/run/run.json"
    [ "$(grep -c '"duration_s"' "$dir/run/run.json")" = "$1" ]
}

# -------------------------------------------------------------------------- full run
start max
ok "status --json" json 0 "$segmill" status --to "$to" --json
ok "hold has nothing to hold" fails 4 WRONG_STATE "$segmill" hold --to "$to"
ok "run --json" json 0 "$segmill" run "$dir/recipe.ini" --to "$to" -o "$dir/run" --json
ok "run.json is valid" valid run "$dir/run/run.json"
ok "run.json agrees with plan.json" python3 tests/e2e/run.py "$dir/run"
ok "the machine is done" state_is COMPLETE
ok "send moves nothing" says 0 'the machine is READY' \
    "$segmill" send "$dir/run/program.ngc" --to "$to"
ok "so it is" state_is READY
ok "send --json finds the gates" json 0 \
    "$segmill" send "$dir/run/program.ngc" --to "$to" --machine "$dir/machine.ini" --json
ok "more than the end" not grep -q '"gates": 1,' "$dir/json"
ok "send --start" says 0 'the machine is COMPLETE' \
    "$segmill" send "$dir/run/program.ngc" --to "$to" --start
printf 'G21 G90 G94 G54\nG53 G0 X-9999\nM30\n' >"$dir/far.ngc"
ok "a program beyond the travel is refused" fails 4 'PROGRAM' \
    "$segmill" send "$dir/far.ngc" --to "$to"
ok "the agent's token is the user's own" \
    test "$(stat -c %a "$dir/state/segmill/token")" = 600
stop

# ------------------------------------------------------------------ hold, resume, abort
start 1
ok "a run that takes its time" begin
ok "another terminal holds it" control hold
ok "it is held" state_is HELD
sleep 1 # the run samples the machine's state
ok "and resumes it" control resume --no-follow
ok "it runs" state_is RUNNING
sleep 1
ok "a second agent is refused" fails 4 'is RUNNING and takes no program' \
    "$segmill" send "$dir/far.ngc" --to "$to"
kill -INT "$run_pid"
ok "Ctrl-C holds" state_is HELD
sleep 1
kill -INT "$run_pid"
ok "a second Ctrl-C aborts" ends 6 aborted
ok "two holds are on record" holds_are 2
ok "the machine keeps the program" state_is READY
ok "a run to abort" begin
ok "another terminal aborts it" control abort
ok "aborted" ends 6 aborted

# ------------------------------------------------------------------ alarm, lost link
ok "a run with trouble" begin
echo estop >&7
ok "the emergency stop ends it" ends 5 alarm
ok "the machine shows it" state_is ESTOP
ok "it takes no program" fails 4 'is ESTOP and takes no program' \
    "$segmill" run "$dir/recipe.ini" --to "$to" -o "$dir/x"
ok "status tells why" says 0 '^alarm' "$segmill" status --to "$to"
stop
start 1
ok "a run to lose" begin
disown "$vcnc_pid"
kill -9 "$vcnc_pid"
ok "the link is lost: unknown" ends 7 link-lost
stop

finish
