#!/usr/bin/env bash
# SPDX-License-Identifier: Apache-2.0
# LinuxCNC's own stand-alone interpreter, from Debian's package unpacked beside the build, reads the
# programs of tests/gcode, those that the writer's test writes, and the outside data; what it says must
# agree with our interpreter to 1e-6, or be listed in tests/gcode/corpus.txt. Skips where the package
# cannot be had. Its output for tests/gcode is what is kept in the tree: tests/ci/rs274.sh --update
# writes it anew. tests/ci/rs274.sh --time PROGRAM says how many seconds of the processor it needs.
set -u
build=$(realpath -m "${BUILD:-build}")
judge=$build/judges/linuxcnc
here=$PWD

# Only what the interpreter needs: the package is a whole control system.
unpack() {
    local package=$1
    shift
    timeout 60 apt-get download "$package" >/dev/null 2>&1 || return
    dpkg --fsys-tarfile "$package"_*.deb | tar -x --wildcards "$@"
    rm -f "$package"_*.deb
}

fetch() {
    [ -x "$judge/usr/bin/rs274" ] && return
    mkdir -p "$judge" && cd "$judge" || return
    unpack libedit2 './usr/lib/*.so*' &&
        unpack libpython3.11 './usr/lib/*.so*' &&
        unpack libboost-python1.74.0 './usr/lib/*.so*' &&
        unpack linuxcnc-uspace './usr/lib/lib*.so*' './usr/bin/rs274'
    cd "$here" || return
    [ -x "$judge/usr/bin/rs274" ]
}

export LD_LIBRARY_PATH=$judge/usr/lib:$judge/usr/lib/$(uname -m)-linux-gnu

# PROGRAM: seconds of the processor, its output thrown away.
measure() {
    local variables TIMEFORMAT='%U %S'
    variables=$(mktemp) || return
    cp tests/gcode/machine.var "$variables"
    { time timeout 600 "$judge/usr/bin/rs274" -t tests/gcode/tools.tbl -v "$variables" -g "$1" \
        >/dev/null 2>&1 || echo failed; } 2>&1 | awk '/failed/ { exit 1 } { print $1 + $2 }'
    local status=${PIPESTATUS[1]}
    rm -f "$variables" "$variables.bak"
    return "$status"
}

# PROGRAM OUTPUT: the canonical calls; fails where LinuxCNC refuses the program. The tool table is
# the one beside it, or ours.
ask() {
    local variables tools
    tools=$(dirname "$1")/test.tbl
    [ -e "$tools" ] || tools=tests/gcode/tools.tbl
    variables=$(mktemp) || return
    cp tests/gcode/machine.var "$variables"
    LD_PRELOAD=${EXACT+$judge/doubles.so} timeout 20 "$judge/usr/bin/rs274" -t "$tools" -v "$variables" -g "$1" 2>"$2.log" |
        sed 's/^ *[0-9]* *//' >"$2"
    local status=${PIPESTATUS[0]}
    rm -f "$variables" "$variables.bak"
    return "$status"
}

skip() {
    echo "1..0 # SKIP $1"
    exit 0
}

command -v apt-get >/dev/null || skip "no apt-get to fetch LinuxCNC's interpreter with"
fetch || skip "Debian's linuxcnc-uspace cannot be downloaded"
ldd "$judge/usr/bin/rs274" | grep -q 'not found' && skip "rs274 lacks a library of this system"

if [ "${1-}" = --time ]; then
    measure "$2"
    exit
fi

if [ "${1-}" = --update ]; then
    for program in tests/gcode/*.ngc; do
        ask "$program" "${program%.ngc}.expected" || exit 1
        rm -f "${program%.ngc}.expected.log"
    done
    exit 0
fi

"${CC:-gcc}" -shared -fPIC -O1 -o "$judge/doubles.so" tests/ci/rs274_doubles.c ||
    skip "no compiler for tests/ci/rs274_doubles.c"
export EXACT=
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
cp tests/gcode/*.ngc "$folder"
SEGMILL_GCODE_OUT=$folder "$build/tests/nc_gcode_write" >"$folder/log" 2>&1
SEGMILL_GCODE_OUT=$folder "$build/tests/nc_compensation" >"$folder/log" 2>&1
command -v python3 >/dev/null &&
    python3 tests/ci/random_gcode.py "$folder" "${SEGMILL_GCODE_RANDOM:-40}" "${SEGMILL_SEED:-1}"

programs=("$folder"/*.ngc)
echo "1..$((${#programs[@]} + 5))"
n=0
result() { # GOOD DESCRIPTION
    n=$((n + 1))
    [ "$1" = 0 ] && echo "ok $n - $2" || echo "not ok $n - $2"
}
for program in "${programs[@]}"; do
    name=$(basename "$program")
    ask "$program" "${program%.ngc}.expected"
    result $? "LinuxCNC reads $name"
    sed 's/^/# /' "${program%.ngc}.expected.log" | grep -v '# executing' || true
done
[ -e "$folder/regions.ngc" ] && [ -e "$folder/random.ngc" ] && [ -e "$folder/contours.ngc" ]
result $? "the writer's programs and the random contours are among them"
SEGMILL_GCODE=$folder "$build/tests/nc_gcode_conformance" -p /nc/gcode/conformance/own \
    >"$folder/log" 2>&1
result $? "and understands them as we do"
grep '^#' "$folder/log" | head -n 60

# Time of the processor, of both: others may be at work here.
awk 'BEGIN { print "G21 G90 G94 F1000"; for (i = 0; i < 200000; i++)
    printf "G1 X%.3f Y%.3f\n", i % 1000 / 10, i / 1000; print "M2" }' >"$folder/long.ngc"
SEGMILL_GCODE_LONG=$folder/long.ngc SEGMILL_GCODE_SECONDS=$(measure "$folder/long.ngc") \
    "$build/tests/nc_gcode_conformance" -p /nc/gcode/conformance/speed >"$folder/log" 2>&1
result $? "and in at most a quarter of the time"
grep '^#' "$folder/log" | head -n 60

# The corpus: what LinuxCNC refuses has no answer.
data=${SEGMILL_TEST_DATA:-../shared/data}
if [ ! -d "$data/gcode_programs" ]; then
    echo "ok $((n + 1)) # SKIP no outside data"
    echo "ok $((n + 2)) # SKIP no outside data"
    exit 0
fi
mkdir "$folder/corpus"
accepted=
while read -r path verdict _; do
    [ "$verdict" = equal ] || [ "$verdict" = both ] || continue
    answer=$folder/corpus/${path//\//__}
    if ask "$data/$path" "$answer"; then
        [ "$verdict" = equal ] || accepted="$accepted $path"
    else
        rm -f "$answer"
    fi
done < <(grep -v '^#' tests/gcode/corpus.txt)
SEGMILL_GCODE_CORPUS=$folder/corpus "$build/tests/nc_gcode_conformance" \
    -p /nc/gcode/conformance/corpus >"$folder/log" 2>&1
result $? "and every program of the corpus as tests/gcode/corpus.txt says"
[ -z "$accepted" ]
result $? "and LinuxCNC refuses those that both are to refuse$accepted"
grep '^#' "$folder/log" | head -n 60
