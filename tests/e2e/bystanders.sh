#!/usr/bin/env bash
# SPDX-License-Identifier: Apache-2.0
# A hold gets through while other clients misuse the machine: tests/e2e/bystanders.py.
cd "$(dirname "$0")/../.." || exit 1
# shellcheck source=tests/e2e/tap.bash
. tests/e2e/tap.bash

ok "drip, deaf, flood, idle: a hold within 0.1 s" python3 tests/e2e/bystanders.py
cat "$dir/said" >&2
finish
