#!/usr/bin/env bash
# SPDX-License-Identifier: Apache-2.0
# Programs in a row over a link with 1 % random faults: tests/e2e/soak.py. SEGMILL_SOAK is how many,
# 200 by default; SEGMILL_SEED the seed.
cd "$(dirname "$0")/../.." || exit 1
# shellcheck source=tests/e2e/tap.bash
. tests/e2e/tap.bash
programs=${SEGMILL_SOAK:-200} seed=${SEGMILL_SEED:-1}

for window in 1 8; do
    ok "$programs programs, window $window, seed $seed: none lost, none twice, no growth" \
        python3 tests/e2e/soak.py --programs "$programs" --seed "$seed" --window "$window"
    head -n 1 "$dir/said" >&2
done
finish
