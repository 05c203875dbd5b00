#!/usr/bin/env bash
# SPDX-License-Identifier: Apache-2.0
# segmill as a program, without a machine: usage, configuration, segmentation, planning, the files
# and their schemas, the same bytes twice. The runs are in segmill_run.sh.
cd "$(dirname "$0")/../.." || exit 1
# shellcheck source=tests/e2e/segmill.bash
. tests/e2e/segmill.bash

# ------------------------------------------------------------------------------ usage
ok "help names every command" says 0 "segmill restart\|segmill segment" "$segmill" --help
for command in init segment plan estimate verify send run hold resume abort override optional-stop \
    restart panel status; do
    ok "help $command" says 0 "segmill $command " "$segmill" help "$command"
    ok "$command --help" says 0 "Options:" "$segmill" "$command" --help
    ok "$command without arguments" fails 2 "is missing" "$segmill" "$command"
done
ok "no command" says 2 "Commands:" "$segmill"
ok "unknown command" fails 2 "no command 'serve'" "$segmill" serve
ok "help of an unknown command" fails 2 "no command 'x'" "$segmill" help x
ok "unknown option" fails 2 "Unknown option --speed" "$segmill" segment a --speed -o "$dir/x"
ok "two parts" fails 2 "'b' is one argument too many" "$segmill" segment a b -o "$dir/x"
ok "no folder" fails 2 "-o is missing" "$segmill" segment "$part"
ok "unknown method" fails 2 "'magic' is not one of feature-size, none" \
    "$segmill" segment "$part" --method magic -o "$dir/x"
ok "unknown key" fails 2 "clearence_mm: unknown key; did you mean clearance_mm?" \
    "$segmill" segment "$part" --set clearence_mm=1 -o "$dir/x"
ok "no override" fails 2 "are missing" "$segmill" override --to mill
ok "too much of an override" fails 2 "--rapid 101 is not within 0 to 100" \
    "$segmill" override --rapid 101 --to mill
ok "too little of one" fails 2 "--spindle 49 is not within 50 to 200" \
    "$segmill" override --feed 200 --spindle 49 --to mill
ok "no results of a wrong call" test ! -e "$dir/x"

# ---------------------------------------------------------------------- configuration
recipe() { # recipe LINE…: the test's recipe with more lines
    { cat "$dir/recipe.ini" && printf '%s\n' "$@"; } >"$dir/other.ini"
}
recipe '[setup]' 'up = +z' 'clearence_mm = 3'
ok "bad recipe names file, line and key" fails 3 \
    "other.ini:[0-9]*: \[setup\] clearence_mm: unknown key; did you mean clearance_mm" \
    "$segmill" plan "$dir/other.ini" -o "$dir/x"
recipe '[machine]' 'file = nowhere.ini'
ok "missing machine file" fails 3 nowhere.ini "$segmill" plan "$dir/other.ini" -o "$dir/x"
ok "missing recipe" fails 3 nowhere.ini "$segmill" plan "$dir/nowhere.ini" -o "$dir/x"
ok "missing part" fails 3 nowhere.igs "$segmill" segment "$dir/nowhere.igs" -o "$dir/x"
head -c 3000 /dev/zero >"$dir/zeros.igs"
ok "a part that is none" fails 3 zeros.igs "$segmill" segment "$dir/zeros.igs" -o "$dir/x"
: >"$dir/empty.stl"
ok "an empty part" fails 3 empty.stl "$segmill" segment "$dir/empty.stl" -o "$dir/x"
ok "no results of bad input" test ! -e "$dir/x"
ok "a folder that cannot be made" fails 1 "$dir/recipe.ini" \
    "$segmill" segment "$dir/tetra.stl" --method none -o "$dir/recipe.ini/x"

# ----------------------------------------------------------------------- segmentation
ok "segment the P0 piece" says 0 'local' "$segmill" segment "$part" -o "$dir/p0"
ok "its files" all_there "$dir/p0" regions.json regions.png regions.obj local.igs rest.igs
ok "regions.json is valid" valid regions "$dir/p0/regions.json"
ok "nothing is left beside" clean "$dir/p0"
# Open CASCADE reads both files back: the same number of faces, and their area to 1e-6.
same_faces_and_area() { # same_faces_and_area PART FOLDER
    local judge=${BUILD:-build}/judges/occ_judge
    { "$judge" --total "$1" && "$judge" --total "$2/local.igs" && "$judge" --total "$2/rest.igs"; } |
        awk '{ n[NR] = $1; a[NR] = $2; print }
             END { d = a[2] + a[3] - a[1]; d = d < 0 ? -d : d
                   exit !(NR == 3 && n[2] + n[3] == n[1] && n[2] > 0 && d <= 1e-6 * a[1]) }'
}
ok "the two IGES files hold the part" same_faces_and_area "$part" "$dir/p0"
ok "all faces are there once" python3 tests/e2e/regions.py "$dir/p0"
ok "segment --json" json 0 "$segmill" segment "$part" -o "$dir/again" --json
ok "twice the same bytes" diff -r "$dir/p0" "$dir/again"
OMP_NUM_THREADS=1 "$segmill" segment "$part" -o "$dir/one" >/dev/null 2>&1
ok "one thread, the same bytes" diff -r "$dir/p0" "$dir/one"
ok "segment by none" says 0 'part' "$segmill" segment "$part" --method none -o "$dir/whole"
ok "no IGES by none" test ! -e "$dir/whole/local.igs" -a ! -e "$dir/whole/rest.igs"
impeller=${BUILD:-build}/parts/impeller.igs
ok "segment an impeller" says 0 'local' "$segmill" segment "$impeller" -o "$dir/impeller"
ok "its two IGES files hold it" same_faces_and_area "$impeller" "$dir/impeller"
ok "a face made local by hand" says 0 'local' \
    "$segmill" segment "$part" --set local_ratio=0 --set local_faces=0 -o "$dir/by-hand"
ok "a mesh by feature size is refused" fails 3 'method none' \
    "$segmill" segment "$dir/tetra.stl" -o "$dir/mesh"
ok "a mesh" says 0 'part' "$segmill" segment "$dir/tetra.stl" --method none -o "$dir/mesh"
ok "its regions.json is valid" valid regions "$dir/mesh/regions.json"
ok "its area in closed form" python3 tests/e2e/regions.py "$dir/mesh" 2.36602540378443865
data=${SEGMILL_TEST_DATA:-../shared/data}/asitus_features/chamfer_1.stp
if [ -e "$data" ]; then
    ok "segment a STEP file" says 0 'rest' "$segmill" segment "$data" -o "$dir/step"
    ok "its regions.json is valid" valid regions "$dir/step/regions.json"
elif [ "${SEGMILL_TEST_DATA_REQUIRED-}" = 1 ]; then
    ok "outside data is there" test -e "$data"
else
    skip "segment a STEP file" "outside test data is absent (SEGMILL_TEST_DATA)"
fi

# ------------------------------------------------------------------------------- init
ok "init" says 0 'regions' "$segmill" init "$part" -o "$dir/new/recipe.ini"
ok "init --json" json 0 "$segmill" init "$part" -o "$dir/new/two.ini" --json
ok "init keeps what is there" fails 1 'is there already' \
    "$segmill" init "$part" -o "$dir/new/recipe.ini"
ok "the recipe lists the regions" grep -q '^#\[region\.local-1\]$' "$dir/new/recipe.ini"
sed 's/^#\(\[region\.local-1\]\)$/\1\nskip = true/; s/^\[machine\]/&\nfile = nowhere.ini/' \
    "$dir/new/recipe.ini" >"$dir/new/edited.ini"
ok "and can be edited" fails 3 'nowhere.ini' "$segmill" plan "$dir/new/edited.ini" -o "$dir/x"

# ------------------------------------------------------------------------------- plan
ok "plan --json" json 0 "$segmill" plan "$dir/recipe.ini" -o "$dir/plan" --json
ok "its files" all_there "$dir/plan" program.ngc plan.json regions.json regions.png
ok "plan.json is valid" valid plan "$dir/plan/plan.json"
ok "plan.json agrees with itself and the program" python3 tests/e2e/plan.py "$dir/plan"
ok "the program's header names the part" \
    grep -q "^(part sha256 $(sha256sum "$part" | cut -c1-64))" "$dir/plan/program.ngc"
ok "and the recipe" grep -q '^(quality.scallop_mm=0.2)' "$dir/plan/program.ngc"
ok "no paths in what is compared" \
    not grep -rl -e "$dir" -e "$PWD" -e '\.igs' --include=*.ngc --include=*.json "$dir/plan"
mkdir "$dir/moved" && cp "$dir"/{recipe,machine,tools}.ini "$part" "$dir/moved"
OMP_NUM_THREADS=1 "$segmill" plan "$dir/moved/recipe.ini" -o "$dir/plan2" >/dev/null 2>&1
ok "one thread, another folder, the same bytes" diff -r "$dir/plan" "$dir/plan2"

# --------------------------------------------------------------------------- estimate
ok "estimate --json" json 0 \
    "$segmill" estimate "$dir/plan/program.ngc" --machine config/etc/machine.ini --json
ok "it agrees with the plan" python3 - "$dir/json" "$dir/plan/plan.json" <<'PY'
import json, sys
a, b = (json.load(open(f))["estimated_s"] for f in sys.argv[1:])
print(a, b)
sys.exit(abs(a - b) > 0.03 * b)
PY
printf 'G21 G90\nG0 X1\nG7 X3\n' >"$dir/bad.ngc"
ok "estimate names file, line and word" fails 3 'bad.ngc.*3.*G7' \
    "$segmill" estimate "$dir/bad.ngc" --machine config/etc/machine.ini

# ---------------------------------------------------------------------------- machine
ok "unknown machine" fails 2 "no machine of that name; .* has: mill, sim" \
    "$segmill" status --to nobody --config "$dir/agent.ini"
for command in status hold abort resume "override --feed 50" "restart --at 1" "send $dir/plan/program.ngc" "run $dir/recipe.ini -o $dir/x"; do
    # shellcheck disable=SC2086
    ok "unreachable: ${command%% *}" fails 4 '' \
        "$segmill" $command --to mill --config "$dir/agent.ini"
done
sed 's/^give_up_s.*/give_up_s = 2/' "$dir/agent.ini" >"$dir/patient.ini"
ok "whoever waits is told so" fails 4 'is not reachable' \
    "$segmill" hold --to mill --config "$dir/patient.ini"
ok "after a second" grep -q 'no answer from modbus://127.0.0.1:1 yet' "$dir/stderr"
ok "no panel configured" fails 3 'chip, start, hold and lamp' \
    "$segmill" panel --to mill --config "$dir/agent.ini"
printf '%s\n' '[panel]' 'chip = gpiochip99' 'start = 0' 'hold = 1' 'lamp = 2' |
    cat - "$dir/agent.ini" >"$dir/panel.ini"
ok "no such chip" fails 3 'chip = gpiochip99: No such file' \
    "$segmill" panel --to mill --config "$dir/panel.ini"
ok "optional stop is on or off" fails 2 "'maybe' is neither on nor off" \
    "$segmill" optional-stop maybe --to mill --config "$dir/agent.ini"
ok "unreachable is found before planning" test ! -e "$dir/x"
ok "unreachable --json" json 4 "$segmill" status --to mill --config "$dir/agent.ini" --json
ok "a broken configuration" fails 3 'recipe.ini:' \
    "$segmill" status --to mill --config "$dir/recipe.ini"

finish
