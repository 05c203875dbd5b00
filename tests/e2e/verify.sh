#!/usr/bin/env bash
# SPDX-License-Identifier: Apache-2.0
# segmill verify: the shipped part as it is planned is in tolerance; programs spoilt by hand are
# found, with the line and the depth.
cd "$(dirname "$0")/../.." || exit 1
# shellcheck source=tests/e2e/segmill.bash
. tests/e2e/segmill.bash

recipe=config/etc/recipe.ini
verify() { # verify PROGRAM FOLDER OPTION…
    local program=$1 folder=$2
    shift 2
    timeout 400 "$segmill" verify "$program" --recipe "$recipe" -o "$folder" "$@" </dev/null
}
judged() { # judged STATUS PROGRAM FOLDER OPTION…: verify ends so; stdout, stderr in FOLDER.out, .err
    local expected=$1 folder=$3
    shift
    verify "$@" >"$folder.out" 2>"$folder.err"
    status=$?
    cat "$folder.err"
    [ "$status" = "$expected" ]
}
holds() { # holds FOLDER EXPRESSION: true of verify.json, as v
    python3 - "$1/verify.json" "$2" <<'PY'
import json, sys
v = json.load(open(sys.argv[1]))
print({k: x for k, x in v.items() if k != "regions"})
sys.exit(not eval(sys.argv[2]))
PY
}

ok "the shipped recipe is planned" "$segmill" plan "$recipe" -o "$dir/plan"
program=$dir/plan/program.ngc

# ------------------------------------------------------------------------ as planned
ok "as planned: exit 0" judged 0 "$program" "$dir/good" --json
ok "its object is valid" valid result "$dir/good.out"
ok "its files" all_there "$dir/good" verify.json deviation.png
ok "verify.json is valid" valid verify "$dir/good/verify.json"
ok "deviation.png is a PNG" test "$(head -c 4 "$dir/good/deviation.png" | tail -c 3)" = PNG
ok "no gouge beyond the tolerance" holds "$dir/good" "0 <= v['gouge_max_mm'] <= 0.02"
ok "no excess beyond scallop and tolerance" holds "$dir/good" "0 < v['excess_max_mm'] <= 0.03"
ok "all that can be reached is within" holds "$dir/good" "v['within_tolerance_percent'] == 100"
ok "nearly all is covered" holds "$dir/good" "99 < v['coverage_percent'] <= 100"
ok "nothing collides" holds "$dir/good" "v['collisions'] == [] and v['in_tolerance']"
ok "scallops are looked at closely enough" holds "$dir/good" \
    "all(0 < r['sampling']['profile_pitch_share'] <= 0.0500001 for r in v['regions'])"
ok "areas are the plan's" python3 - "$dir/good/verify.json" "$dir/plan/plan.json" <<'PY'
import json, sys
v, p = (json.load(open(f))["regions"] for f in sys.argv[1:])
asked = {r["id"]: 0 for r in p}
for r in p:
    asked[r["id"]] += r["requested_area_mm2"]
print(asked, [(r["id"], r["requested_area_mm2"]) for r in v])
sys.exit(not all(abs(asked[r["id"]] - r["requested_area_mm2"]) < 1e-6 * asked[r["id"]] for r in v))
PY

# ------------------------------------------------------------------- spoilt by hand
# One point of a cutting move in the middle of region 1 lies 0.02 mm too low.
python3 - "$program" "$dir/low.ngc" >"$dir/low.line" <<'PY'
import re, sys
lines = open(sys.argv[1]).read().split("\n")
begin = max(i for i, l in enumerate(lines) if l.startswith("(REGION 1 "))
cuts = [i for i in range(begin, len(lines)) if re.fullmatch(r"X\S+ Y\S+ Z\S+", lines[i])]
i = cuts[len(cuts) // 2]
lines[i] = re.sub(r"Z(\S+)", lambda m: f"Z{float(m[1]) - 0.02:.4f}", lines[i])
open(sys.argv[2], "w").write("\n".join(lines))
print(i + 1)
PY
ok "0.02 mm too low at one point: exit 1" judged 1 "$dir/low.ngc" "$dir/low"
ok "it is named" grep -q 'out of tolerance: 0\.0[23].* mm of gouge (limit 0.02)' "$dir/low.err"
ok "where it is" holds "$dir/low" \
    "0.02 < v['gouge_max_mm'] < 0.03 and abs(v['gouge_at']['line'] - $(cat "$dir/low.line")) <= 1"
ok "in region 1 alone" holds "$dir/low" \
    "[r['gouge_max_mm'] > 0.02 for r in v['regions']] == [True, False]"
ok "its verify.json is valid" valid verify "$dir/low/verify.json"

# Region 2 is left as it is, and a rapid goes through it.
python3 - "$program" "$dir/rapid.ngc" >"$dir/rapid.line" <<'PY'
import re, sys
lines = open(sys.argv[1]).read().split("\n")
begin = next(i for i, l in enumerate(lines) if l.startswith("(REGION 2 "))
end = next(i for i, l in enumerate(lines) if i > begin and l.startswith("(REGION "))
cut = next(i for i in range(begin, end) if re.fullmatch(r"X\S+ Y\S+ Z\S+", lines[i]))
lines[cut:end] = ["G0 Z-1", "G0 X0 Y25", "G0 Z10"]
open(sys.argv[2], "w").write("\n".join(lines))
print(cut + 2)
PY
ok "a rapid through stock: exit 1" judged 1 "$dir/rapid.ngc" "$dir/rapid" --json
ok "its object is an error" valid result "$dir/rapid.out"
ok "the collision has its line" holds "$dir/rapid" \
    "any(c['kind'] == 'rapid' and abs(c['line'] - $(cat "$dir/rapid.line")) <= 1 for c in v['collisions'])"
ok "what was not cut is found" holds "$dir/rapid" \
    "v['excess_max_mm'] == 0.5 and v['excess_at']['line'] is None and v['coverage_percent'] < 85"

# ------------------------------------------------------------------------- bad input
ok "no recipe" fails 2 "--recipe is missing" "$segmill" verify "$program" -o "$dir/x"
ok "no program" fails 3 "nowhere.ngc" \
    "$segmill" verify "$dir/nowhere.ngc" --recipe "$recipe" -o "$dir/x"
printf 'G21 G90\nG0 X1\nG7 X3\n' >"$dir/bad.ngc"
ok "a program that is wrong" fails 3 'bad.ngc.*3.*G7' \
    "$segmill" verify "$dir/bad.ngc" --recipe "$recipe" -o "$dir/x"
ok "stock that is not there" fails 3 "gone.stl" "$segmill" verify "$program" --recipe "$recipe" \
    --set stock.kind=file --set "stock.file=$dir/gone.stl" -o "$dir/x"
cp config/etc/tools.ini "$dir"
sed '/^\[axis.a\]/,/^\[axis.b\]/s/^#present = false/present = true/' config/etc/machine.ini >"$dir/machine.ini"
printf 'G21 G90 G94\nT15 M6\nS6000 M3\nG1 X1 A5 F100\nM30\n' >"$dir/turned.ngc"
ok "a rotary axis away from zero" fails 3 'turned.ngc: line 4: .* rotary axis A at 5 degrees' \
    "$segmill" verify "$dir/turned.ngc" --recipe "$recipe" --set "machine.file=$dir/machine.ini" -o "$dir/x"
ok "no results of bad input" test ! -e "$dir/x"

finish
