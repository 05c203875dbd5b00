# shellcheck shell=bash
# SPDX-License-Identifier: Apache-2.0
# What the tests of segmill share: its calls, a recipe, a mesh and a configuration.
# shellcheck source=tests/e2e/tap.bash
. tests/e2e/tap.bash
part=$PWD/config/etc/p0-piece.igs
export XDG_STATE_HOME=$dir/state XDG_CONFIG_HOME=$dir/config
schemas=$PWD/docs/schema

run() { # run COMMAND…: sets status; output in $dir/stdout, $dir/stderr
    timeout 120 "$@" </dev/null >"$dir/stdout" 2>"$dir/stderr"
    status=$?
    echo "exit status $status"
    cat "$dir/stderr"
}
says() { # says STATUS WORD COMMAND…: ends so, with WORD on stdout
    local expected=$1 word=$2
    shift 2
    run "$@"
    [ "$status" = "$expected" ] && grep -q -e "$word" "$dir/stdout"
}
fails() { # fails STATUS WORD COMMAND…: ends so, with WORD in the one message on stderr
    local expected=$1 word=$2
    shift 2
    run "$@"
    [ "$status" = "$expected" ] && tail -n 1 "$dir/stderr" | grep -q -e "$word"
}
valid() { # valid SCHEMA FILE
    python3 tests/e2e/schema.py "$schemas/$1.json" "$2"
}
json() { # json STATUS COMMAND…: exactly one object on stdout, kept in $dir/json
    local expected=$1
    shift
    run "$@"
    cp "$dir/stdout" "$dir/json"
    [ "$status" = "$expected" ] && valid result "$dir/json"
}
all_there() { # all_there FOLDER FILE…: not empty
    local folder=$1 f
    shift
    for f in "$@"; do
        [ -s "$folder/$f" ] || { echo "$f is absent or empty" && return 1; }
    done
}
clean() { # clean FOLDER: no temporary files
    not grep -qv -e '^regions\.' -e '^local\.igs$' -e '^rest\.igs$' <(ls -A "$1")
}

cat >"$dir/agent.ini" <<'INI'
[link]
give_up_s = 1
reconnect_s = 0.1
heartbeat_s = 0.1
[machine.mill]
address = modbus://127.0.0.1:1
[machine.sim]
INI
# One tool and coarse passes: what is tested here is segmill, not the planning.
cat >"$dir/recipe.ini" <<'INI'
[part]
file = p0-piece.igs
[tools]
use = 15
[quality]
scallop_mm = 0.2
tolerance_mm = 0.1
INI
cp config/etc/machine.ini config/etc/tools.ini "$part" "$dir"
cat >"$dir/tetra.stl" <<'STL'
solid tetra
facet normal 0 0 -1
outer loop
vertex 0 0 0
vertex 0 1 0
vertex 1 0 0
endloop
endfacet
facet normal 0 -1 0
outer loop
vertex 0 0 0
vertex 1 0 0
vertex 0 0 1
endloop
endfacet
facet normal -1 0 0
outer loop
vertex 0 0 0
vertex 0 0 1
vertex 0 1 0
endloop
endfacet
facet normal 1 1 1
outer loop
vertex 1 0 0
vertex 0 1 0
vertex 0 0 1
endloop
endfacet
endsolid tetra
STL
