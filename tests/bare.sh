#!/usr/bin/env bash
# SPDX-License-Identifier: Apache-2.0
# The README's two commands on a fresh Debian 12: debootstrap, git, make, a clone, nothing else.
#   sudo tests/bare.sh FOLDER
set -euo pipefail
cd "$(dirname "$0")/.."
root=${1:?usage: tests/bare.sh FOLDER (an empty folder, or one that this script filled before)}
data=${SEGMILL_TEST_DATA:-../shared/data}

[ -x "$root/bin/sh" ] ||
    debootstrap --variant=minbase --include=git,make,ca-certificates bookworm "$root"
rm -rf "$root/srv"
mkdir -p "$root/srv/shared"
git clone -q . "$root/srv/segmill"
[ -d "$data" ] && cp -r "$data" "$root/srv/shared/data"

mountpoint -q "$root/proc" || mount -t proc proc "$root/proc"
mountpoint -q "$root/dev/pts" || mount -t devpts devpts "$root/dev/pts"
trap 'umount "$root/dev/pts" "$root/proc"' EXIT
for command in demo check; do
    chroot "$root" /bin/sh -c "cd /srv/segmill && make $command"
done
