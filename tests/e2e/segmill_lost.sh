#!/usr/bin/env bash
# SPDX-License-Identifier: Apache-2.0
# The agent is killed in the middle of a run: the machine holds at the next gate, whoever asks is
# told so, and only an acknowledgement at the machine and then a person's resume move it again.
cd "$(dirname "$0")/../.." || exit 1
# shellcheck source=tests/e2e/cell.bash
. tests/e2e/cell.bash
sed -i 's/^#agent_timeout_s = .*/agent_timeout_s = 1.5/' "$dir/machine.ini"
# Two regions, so that a gate is between them; the second one takes its time.
sed -i '/^\[region.local-1\]/,$d' "$dir/recipe.ini"
printf '%s\n' '[region.local-2]' 'feed = 500' '[region.local-1]' 'feed = 50' >>"$dir/recipe.ini"

# The block before the one that comes next took the tool up and out of the part.
at_gate() {
    head -n $(($(field line) - 1)) "$dir/run/program.ngc" | grep -v '^(' | tail -n 1 |
        tee "$dir/last" && grep -qE '^(G53 )?G0 Z' "$dir/last"
}
moved() { # within 20 s
    for ((i = 0; i < 100; i++)); do
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
background resume
ok "now a resume goes on, once the dead agent's lease has lapsed" moved
ok "and stays: the machine is not alone" says 0 'RUNNING$' sh -c "sleep 2; '$segmill' status --to $to"
kill -INT "$run_pid"
ok "its Ctrl-C holds" state_is HELD
sleep 2
ok "it still stays" shows agent_lost false
ok "another terminal resumes" control resume --no-follow
ok "which moves" state_is RUNNING
kill -INT "$run_pid"
ok "a second Ctrl-C aborts" exits 6
ok "the program is there" state_is READY
background restart --at last --yes
ok "begun again at its last gate: the lease was given back" state_is RUNNING
disown "$run_pid"
kill -9 "$run_pid"
lost() { # within 10 s
    for ((i = 0; i < 50; i++)); do
        shows agent_lost true && return
        sleep 0.2
    done
    return 1
}
ok "killed again" lost
ok "anyone may abort" control abort
ok "aborted" state_is READY
ok "a restart wants an acknowledgement, too" fails 4 'NEEDS_ACKNOWLEDGE' \
    "$segmill" restart --at last --yes --to "$to"
stop
finish
