#!/usr/bin/env bash
# SPDX-License-Identifier: Apache-2.0
# docs/vcnc-ci.md as its readers use it: its first block is saved, all others are run as they are.
cd "$(dirname "$0")/../.." || exit 1
# shellcheck source=tests/e2e/tap.bash
. tests/e2e/tap.bash
page=$PWD/docs/vcnc-ci.md

blocks() { # blocks LANGUAGE: each to $dir/LANGUAGE.N; sets n_blocks
    awk -v to="$dir/$1." -v open="\`\`\`$1" \
        '$0 == "```" { on = 0 } on { print > (to n) } $0 == open { on = 1; n++ }' "$page"
    n_blocks=$(find "$dir" -name "$1.*" | wc -l)
}
mkdir -p "$dir/work/ci" "$dir/bin"
cp config/etc/machine.ini config/etc/tools.ini "$dir/work"
cat >"$dir/work/program.ngc" <<'NGC'
G17 G21 G40 G49 G80 G90 G91.1 G94 G64 P0.01
T2 M6
S6000 M3
G53 G0 X-30 Y-20 Z-5
G53 G1 X-40 F3000
G53 G1 Y-60
M5
G53 G0 Z0
M30
NGC
ln -s "$segmill" "$vcnc" "$dir/bin"
export PATH=$dir/bin:$PATH XDG_STATE_HOME=$dir/state XDG_CONFIG_HOME=$dir/config
as_is() { # as_is FILE: in the reader's folder
    (cd "$dir/work" && timeout 120 sh -eu "$1")
}

blocks sh
ok "the page has its four blocks" test "$n_blocks" = 4
ok "the job: saved" cp "$dir/sh.1" "$dir/work/ci/vcnc-job.sh"
printf 'sh ci/vcnc-job.sh\n' >"$dir/plain"
ok "the job: completed" as_is "$dir/plain"
ok "it has kept the log" grep -q '"COMPLETE"' "$dir/work/vcnc-ci/run.log"
ok "and the summary" grep -q '^programs: 1 started, 1 completed' "$dir/work/vcnc-ci/vcnc.out"
printf 'PROGRAM=absent.ngc sh ci/vcnc-job.sh\n' >"$dir/absent"
ok "a job that fails, fails" not as_is "$dir/absent"
printf 'sh ci/vcnc-job.sh --fault nonsense\n' >"$dir/nonsense"
ok "a virtual CNC that does not start ends it" not as_is "$dir/nonsense"
for ((i = 2; i <= n_blocks; i++)); do
    ok "block $i" as_is "$dir/sh.$i"
done
blocks yaml
sed -n 's/^ *run: \(sh ci.*\)/\1/p' "$dir/yaml.1" >"$dir/steps"
ok "the workflow has two steps with the job" test "$(wc -l <"$dir/steps")" = 2
ok "they are done" as_is "$dir/steps"
if python3 -c 'import yaml' 2>/dev/null; then
    ok "the workflow is YAML" python3 -c 'import sys, yaml
steps = yaml.safe_load(open(sys.argv[1]))["jobs"]["vcnc"]["steps"]
sys.exit(not all("run" in step or "uses" in step for step in steps))' "$dir/yaml.1"
else
    skip "the workflow is YAML" "python3-yaml is absent"
fi
finish
