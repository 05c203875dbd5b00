#!/usr/bin/env bash
# SPDX-License-Identifier: Apache-2.0
# run.sh as its callers see it: TAP, not run inside.
# shellcheck source=tests/e2e/tap.bash
. tests/e2e/tap.bash

run() { # run [NAME=VALUE…] -- SCRIPT_TEXT [ARGUMENT…]: sets status; output in $dir/out and $dir/err
    local settings=()
    while [ "$1" != -- ]; do
        settings+=("$1")
        shift
    done
    printf '%s\n' "$2" >"$dir/script.sh"
    env "${settings[@]}" tests/kernel/run.sh "$dir/script.sh" "${@:3}" >"$dir/out" 2>"$dir/err"
    status=$?
}

run -- 'exit 7'
ok "the script's status" test "$status" = 7
ok "where it ran is said" grep -q '^run.sh: .* \(in user-mode Linux\|on this host\)$' "$dir/err"

run "SPOKEN=a \"b\" \$c" -- 'printf "%s|" "$@" "$SPOKEN" "$PWD"' "one two" 'three*'
ok "arguments, environment and folder" test "$(cat "$dir/out")" = "one two|three*|a \"b\" \$c|$PWD|"

seq 200000 >"$dir/lines"
run LINES_FILE="$dir/lines" -- 'cat "$LINES_FILE"; printf "%b" "tab\tcr\r\0end\n" >&2'
ok "1.3 MB come out as they went in" cmp "$dir/lines" "$dir/out"
ok "stderr is apart" test "$(tail -n 1 "$dir/err" | od -An -c | tr -d ' \n')" = 'tab\tcr\r\0end\n'

mkdir "$dir/kept"
run KERNEL_WORK="$dir/kept" -- 'echo out >"$WORK/result"; echo "$TMPDIR" >&2'
ok "a file is handed out" grep -qx out "$dir/kept/result"

started=$SECONDS
run KERNEL_SECONDS=3 -- 'sleep 1000 & sleep 1000'
ok "killed in time" test "$status" = 124 -a $((SECONDS - started)) -lt 15

run -- '# KERNEL_TIME=travel
    sleep 3600; exit 5'
ok "an hour in no time" test "$status" = 5 -a $((SECONDS - started)) -lt 30
finish
