# shellcheck shell=bash
# SPDX-License-Identifier: Apache-2.0
# What the tests of segmill against vcnc share: a machine and a long run on it.
# shellcheck source=tests/e2e/segmill.bash
. tests/e2e/segmill.bash

# Quick to plan, slow to run, and nobody waits for the tool changer.
sed -i 's/^#change_s = .*/change_s = 0.5/' "$dir/machine.ini"
printf '%s\n' '[region.rest]' 'skip = true' '[region.local-1]' 'skip = true' \
    '[region.local-2]' 'feed = 200' >>"$dir/recipe.ini"

start() { # start SPEED: a virtual CNC, switched on; sets to
    start_vcnc --machine "$dir/machine.ini" --speed "$1"
    echo ack >&7
    to=modbus://$address
}
stop() {
    stop_vcnc TERM
}
state() {
    "$segmill" status --to "$to" --config "$dir/agent.ini" --json 2>/dev/null |
        sed -n 's/^  "state": "\(.*\)",$/\1/p'
}
state_is() { # within 10 s
    local shown
    for ((i = 0; i < 50; i++)); do
        shown=$(state)
        [ "$shown" = "$1" ] && return
        sleep 0.2
    done
    echo "state $shown, expected $1"
    return 1
}
# A command of segmill in the background; sets run_pid. Bash gives a child in the background SIGINT
# ignored, so Ctrl-C is given back to it.
background() { # background COMMAND [ARGUMENT…]
    python3 -c 'import os, signal, sys
signal.signal(signal.SIGINT, signal.default_int_handler)
os.execv(sys.argv[1], sys.argv[1:])' \
        "$segmill" "$@" --to "$to" --config "$dir/agent.ini" >"$dir/run.out" 2>"$dir/run.err" &
    run_pid=$!
    pids+=("$run_pid")
}
# Delivers and starts the long program.
begin() {
    background run "$dir/recipe.ini" -o "$dir/run"
    state_is RUNNING
}
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
exits() { # exits STATUS: the command in the background
    local status
    wait "$run_pid"
    status=$?
    echo "exit status $status"
    cat "$dir/run.err"
    [ "$status" = "$1" ]
}
control() { # control COMMAND [ARGUMENT…]: as anyone at another terminal
    run "$segmill" "$@" --to "$to" --config "$dir/agent.ini"
    [ "$status" = 0 ]
}
