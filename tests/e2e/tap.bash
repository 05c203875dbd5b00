# shellcheck shell=bash
# SPDX-License-Identifier: Apache-2.0
# What every end-to-end test shares: TAP, a folder of its own, and virtual machines.
segmill=$(realpath -m "${BUILD:-build}/segmill")
vcnc=$(realpath -m "${BUILD:-build}/vcnc")
dir=$(mktemp -d)
pids=()
trap 'for p in "${pids[@]}"; do kill "$p" 2>/dev/null; done; rm -rf "$dir"' EXIT

count=0
ok() { # ok DESCRIPTION COMMAND…
    local what=$1
    shift
    count=$((count + 1))
    if "$@" >"$dir/said" 2>&1; then
        echo "ok $count - $what"
    else
        echo "not ok $count - $what"
        excerpt "$dir/said" | sed 's/^/# /' | tee "$dir/last_failed"
        { echo "# not ok $count - $what" && cat "$dir/last_failed"; } >>"$dir/failed"
    fi
}
excerpt() { # excerpt FILE: its beginning and its end
    if [ "$(wc -c <"$1")" -le 4000 ]; then
        cat "$1"
    else
        head -c 2000 "$1" && printf '\n[…]\n' && tail -c 2000 "$1"
    fi
}
skip() { # skip DESCRIPTION REASON
    count=$((count + 1))
    echo "ok $count - $1 # SKIP $2"
}
# What failed is said once more, last, and where prove shows it: logs are cut.
finish() {
    echo "1..$count"
    [ ! -e "$dir/failed" ] || cat "$dir/failed" >&2
}
not() {
    ! "$@"
}

machines=0
# Starts vcnc and waits for its address; the person at it is descriptor 7. Sets vcnc_pid and
# address; what it says is in $dir/vcnc.out and $dir/vcnc.err.
start_vcnc() { # start_vcnc ARGUMENT…
    mkfifo "$dir/person.$((++machines))"
    rm -f "$dir/vcnc.out"
    "$vcnc" --modbus 127.0.0.1:0 "$@" <"$dir/person.$machines" >"$dir/vcnc.out" 2>"$dir/vcnc.err" &
    vcnc_pid=$!
    pids+=("$vcnc_pid")
    exec 7>"$dir/person.$machines"
    for ((i = 0; i < 500; i++)); do
        grep -qs '^modbus ' "$dir/vcnc.out" && break
        sleep 0.01
    done
    address=$(sed -n '1s/^modbus //p' "$dir/vcnc.out")
}
stop_vcnc() { # stop_vcnc SIGNAL: waits for its end; sets status
    kill -s "$1" "$vcnc_pid" 2>/dev/null
    wait "$vcnc_pid" 2>/dev/null
    status=$?
    exec 7>&-
}
