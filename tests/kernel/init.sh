#!/bin/bash
# SPDX-License-Identifier: Apache-2.0
# Process 1 of the kernel for the tests. RUN is a folder on the host, filled by run.sh: `script` is
# run, and `poweroff` hands its status out.
mount -t proc none /proc
mount -t sysfs none /sys
mount -t configfs none /sys/kernel/config
mount -t devtmpfs none /dev
mkdir /dev/pts /dev/shm
mount -t devpts none /dev/pts
mount -t tmpfs none /dev/shm
mount -t tmpfs none /run
mkdir /run/tmp
ln -s /proc/self/fd /dev/fd
ln -s fd/0 /dev/stdin
ln -s fd/1 /dev/stdout
ln -s fd/2 /dev/stderr
ip link set lo up

# The script's output leaves byte for byte.
stty -F /dev/tty0 raw
stty -F /dev/tty1 raw
bash "$RUN/script" </dev/null >/dev/tty0 2>/dev/tty1
"$RUN/poweroff" $? /dev/tty0 /dev/tty1
