#!/usr/bin/env bash
# SPDX-License-Identifier: Apache-2.0
# Every frame of a delivery and run over Modbus TCP × every fault (tests/e2e/faults.py), with one
# request in flight and with sixteen, at full speed; of a program that is fed while it runs every
# third. The rest, and programs that take their time: tests/ci.
cd "$(dirname "$0")/../.." || exit 1
# shellcheck source=tests/e2e/tap.bash
. tests/e2e/tap.bash

for window in 1 16; do
    ok "window $window: every frame × every fault" \
        python3 tests/e2e/faults.py --window "$window" --speed max
    head -n 1 "$dir/said" >&2
done
ok "dripping: a third of them" \
    python3 tests/e2e/faults.py --drip auto --speed max --every 3
head -n 1 "$dir/said" >&2
finish
