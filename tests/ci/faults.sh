#!/usr/bin/env bash
# SPDX-License-Identifier: Apache-2.0
# Every frame × every fault over Modbus TCP where the run takes its time, so that frames and faults
# also fall into it, and random pairs of faults of the link; SEGMILL_SEED sets the seed.
cd "$(dirname "$0")/../.." || exit 1
# shellcheck source=tests/e2e/tap.bash
. tests/e2e/tap.bash
seed=${SEGMILL_SEED:-1}

for window in 1 16; do
    ok "window $window: every frame × every fault, and pairs with seed $seed" \
        python3 tests/e2e/faults.py --window "$window" --speed 10 --pairs 100 --seed "$seed"
    cat "$dir/said" >&2
done
for how in "max --every 1" "10 --every 5"; do
    # shellcheck disable=SC2086
    ok "dripping, speed $how" \
        python3 tests/e2e/faults.py --drip auto --speed $how --pairs 50 --seed "$seed"
    cat "$dir/said" >&2
done
finish
