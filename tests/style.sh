#!/usr/bin/env bash
# SPDX-License-Identifier: Apache-2.0
# Fails on unformatted C, a file over 600 lines, a missing SPDX line, or an include that the rooms'
# table (tests/rooms.txt) does not allow.
set -euo pipefail
cd "$(dirname "$0")/.."

bad=0
complain() {
    echo "style: $*" >&2
    bad=1
}

mapfile -t sources < <(git ls-files -co --exclude-standard '*.c' '*.h' '*.cc')
mapfile -t texts < <(git ls-files -co --exclude-standard '*.c' '*.h' '*.cc' '*.sh' '*.mk' '*.py' \
    '*.ini' '*.md' '*.json' tests/rooms.txt Makefile .ci/run .clang-format .gitignore)

clang-format --dry-run --Werror "${sources[@]}" 2>/tmp/style.$$ ||
    { sed -n 's/^\([^:]*:[0-9]*\):.*/style: not formatted: \1/p' /tmp/style.$$ >&2; bad=1; }
rm -f /tmp/style.$$

for f in "${texts[@]}"; do
    lines=$(wc -l <"$f")
    [ "$lines" -le 600 ] || complain "$f has $lines lines; a file has one job and at most 600"
    head -n 3 "$f" | grep -q 'SPDX-License-Identifier: Apache-2.0' ||
        complain "$f: no SPDX line at the top"
done

# The row of tests/rooms.txt that a file falls under: the longest room that is a prefix of its path.
room_of() {
    case $1 in
    segcore/occ/*) echo segcore/occ ;;
    agent/panel/*) echo agent/panel ;;
    */*) echo "${1%%/*}" ;;
    esac
}

declare -A rooms libraries headers
while read -r kind name rest; do
    IFS=: read -r _ first second <<<"$rest"
    case $kind in
    room) rooms[$name]=" $first " libraries[$name]=" $second " ;;
    library) headers[$name]=$(tr -d ' ' <<<"$first") ;;
    esac
done <tests/rooms.txt

# FILE ROOM HEADER: an include with quotes.
check_room() {
    local other=${3%%/*}
    [ "$other" = "${2%%/*}" ] && return
    if [[ ${rooms[$2]} != *" $other "* ]]; then
        complain "$1: $2 may not include \"$3\""
    elif [ "$3" != "$other/$other.h" ] && [ "$2" != segcore/occ ]; then
        complain "$1: \"$3\" is private to $other; include \"$other/$other.h\""
    fi
}

# FILE ROOM HEADER: an include with angle brackets.
check_library() {
    local library
    for library in "${!headers[@]}"; do
        if [[ $3 =~ ^${headers[$library]}$ && ${libraries[$2]} != *" $library "* ]]; then
            complain "$1: <$3> belongs to $library, which $2 may not use"
        fi
    done
}

for f in "${sources[@]}"; do
    room=$(room_of "$f")
    [ -n "${rooms[$room]+x}" ] || continue # tests/ may include everything
    while read -r header; do
        check_room "$f" "$room" "$header"
    done < <(sed -n 's/^#include "\(.*\)"/\1/p' "$f")
    while read -r header; do
        check_library "$f" "$room" "$header"
    done < <(sed -n 's/^#include <\(.*\)>/\1/p' "$f")
done

exit $bad
