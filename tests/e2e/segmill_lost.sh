#!/usr/bin/env bash
# SPDX-License-Identifier: Apache-2.0
# The agent is killed in the middle of a run: the machine holds at the next gate, whoever asks is
# told so, and only an acknowledgement at the machine and then a person's resume move it again.
cd "$(dirname "$0")/../.." || exit 1
# shellcheck source=tests/e2e/cell.bash
. tests/e2e/cell.bash
sed -i 's/^#agent_timeout_s = .*/agent_timeout_s = 1/' "$dir/machine.ini"
sed -i '/^\[region.local-1\]/,$d' "$dir/recipe.ini" # two regions, so that a gate is between them

field() { # field KEY: of the status
    "$segmill" status --to "$to" --config "$dir/agent.ini" --json |
        sed -n "s/^  \"$1\": \(.*\),\$/\1/p"
}
shows() { # shows KEY VALUE
    local value
    value=$(field "$1")
    echo "$1 is $value"
    [ "$value" = "$2" ]
}
# The block before the one that comes next took the tool up and out of the part.
at_gate() {
    head -n $(($(field line) - 1)) "$dir/run/program.ngc" | grep -v '^(' | tail -n 1 |
        tee "$dir/last" && grep -qE '^(G53 )?G0 Z' "$dir/last"
}
moved() { # within 10 s
    for ((i = 0; i < 50; i++)); do
        shows program_time_s "$stood_s" || return 0
        sleep 0.2
    done
    return 1
}

start 20
ok "a slow run" begin
disown "$run_pid"
kill -9 "$run_pid"
ok "the agent is killed: the machine holds" state_is HELD
ok "at a gate" at_gate
stood_s=$(field program_time_s)
ok "status tells of the agent" shows agent_lost true
ok "and of the acknowledgement" says 0 'wants an acknowledgement at the machine' \
    "$segmill" status --to "$to"
ok "a new agent is refused" fails 4 'is HELD and takes no program' \
    "$segmill" send "$dir/run/program.ngc" --to "$to"
ok "a stranger's resume is refused" fails 4 'refused' \
    env XDG_STATE_HOME="$dir/stranger" "$segmill" resume --to "$to"
ok "the person's own, too" fails 4 'NEEDS_ACKNOWLEDGE' "$segmill" resume --to "$to"
echo ack >&7
ok "acknowledged at the machine" shows needs_acknowledge false
ok "which moves nothing" shows program_time_s "$stood_s"
ok "now a resume" control resume --no-follow
ok "goes on" moved
stop
finish
