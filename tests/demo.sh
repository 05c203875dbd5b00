#!/usr/bin/env bash
# SPDX-License-Identifier: Apache-2.0
# The main job, start to end: a virtual CNC, a shipped IGES part, regions, one program, delivery
# over Modbus TCP, the run, the proof of what it cut. Everything it makes stays in $BUILD/demo.
set -euo pipefail
cd "$(dirname "$0")/.."
build=${BUILD:-build}
out=$build/demo

rm -rf "$out"
mkdir -p "$out"
export XDG_STATE_HOME=$out/state # the lease's token: the demo leaves nothing in the home folder

coproc vcnc { exec "$build/vcnc" --machine config/etc/machine.ini --modbus 127.0.0.1:0 \
    --speed max --log "$out/vcnc.log"; }
trap 'kill "$vcnc_PID" 2>/dev/null || true' EXIT
read -r _ address <&"${vcnc[0]}"
echo ack >&"${vcnc[1]}" # the person at the machine switches it on

echo "vcnc, the virtual CNC, listens at modbus://$address"
"$build/segmill" run config/etc/recipe.ini --to "modbus://$address" -o "$out"

echo
echo "what the program leaves of the stock, against the CAD faces:"
"$build/segmill" verify "$out/program.ngc" --recipe config/etc/recipe.ini -o "$out"

echo
echo "pictures: $out/regions.png, $out/deviation.png"
echo "program:  $out/program.ngc"
echo "report:   $out/run.json, $out/plan.json, $out/verify.json, $out/regions.json"
