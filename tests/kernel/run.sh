#!/usr/bin/env bash
# SPDX-License-Identifier: Apache-2.0
# Runs a bash script where there are CAN and simulated GPIO, and ends with its status: on this host
# if it has both, else in the kernel of build.sh, which is an ordinary process without privileges.
#   run.sh SCRIPT [ARGUMENT…]    the script finds the caller's environment and current folder;
#                                $WORK is an empty folder, removed afterwards
#   run.sh --on-host             runs nothing: status 0 if it would be on this host
#   BUILD            where the programs are (default build)
#   KERNEL_WORK      a folder to use as $WORK and to keep
#   KERNEL_SECONDS   after which the run is killed and has failed, with status 124 (default 300)
#   KERNEL_USE=uml   the kernel of build.sh, whatever this host has
#   KERNEL_TIME=travel   there, with a clock that stands while programs compute and jumps when all
#                    of them wait (it implies uml)
# A line "# KERNEL_…=value" in the script is its own default.
set -euo pipefail
here=$(realpath "$(dirname "$0")")

main() {
    if [ "${1-}" = --on-host ]; then
        on_host_itself
        return
    fi
    [ $# -gt 0 ] || { echo "usage: $0 SCRIPT [ARGUMENT…] | --on-host" >&2; exit 2; }
    take_defaults "$1"
    dir=$(mktemp -d)
    trap end EXIT
    trap 'exit 129' HUP
    trap 'exit 130' INT
    trap 'exit 143' TERM
    export BUILD
    BUILD=$(realpath -m "${BUILD:-build}")
    WORK=$(realpath -m "${KERNEL_WORK:-$dir/work}")
    mkdir -p "$WORK"
    export WORK

    if on_host_itself; then
        echo "run.sh: $1 on this host" >&2
        run_on_host "$@"
    else
        echo "run.sh: $1 in user-mode Linux" >&2
        run_in_kernel "$@"
    fi
}

take_defaults() { # take_defaults SCRIPT
    local name value
    while IFS='=' read -r name value; do
        [ -n "${!name-}" ] || declare -gx "$name=$value"
    done < <(sed -n 's/^# \(KERNEL_[A-Z]*=[a-z0-9]*\)$/\1/p' "$1")
}

# By trying, in a network of our own, which leaves nothing behind.
on_host_itself() {
    local probe=/sys/kernel/config/gpio-sim/segmill-probe-$$
    [ "${KERNEL_USE-}" != uml ] && [ -z "${KERNEL_TIME-}" ] &&
        unshare --net ip link add vcan0 type vcan 2>/dev/null &&
        perl -e 'socket(my $s, 29, 2, 6) or exit 1' && # AF_CAN, SOCK_DGRAM, CAN_ISOTP
        mkdir "$probe" 2>/dev/null && rmdir "$probe"
}

run_on_host() {
    export GPIO_SIM_PREFIX=segmill-$$
    watched unshare --net bash -c 'ip link set lo up && exec bash "$@"' bash "$@"
}

# The host's root is read-only inside, except for $WORK; TMPDIR is in memory.
run_in_kernel() {
    local kernel cpu status=0 time=()
    if [ ! -x "$BUILD/kernel/poweroff" ]; then
        echo "run.sh: no $BUILD/kernel/poweroff: make BUILD=$BUILD $BUILD/kernel/poweroff" >&2
        exit 2
    fi
    kernel=$("$here/build.sh")
    case ${KERNEL_TIME-} in
    '') ;;
    travel) time=(time-travel=inf-cpu) ;;
    *) echo "run.sh: KERNEL_TIME is \"$KERNEL_TIME\"; it may be \"travel\"" >&2; exit 2 ;;
    esac
    {
        export -p
        echo 'export TMPDIR=/run/tmp'
        echo 'mount -t hostfs none -o "$WORK" "$WORK" || exit'
        printf 'cd %q || exit\nexec bash' "$PWD"
        printf ' %q' "$@"
    } >"$dir/script"
    ln -s "$here/init.sh" "$dir/init"
    ln -s "$BUILD/kernel/poweroff" "$dir/poweroff"

    # The kernel makes the descriptors that it writes to non-blocking, so it gets pipes of its own.
    # Where its memory lies makes no difference; how it always ends is no news.
    mkfifo "$dir/out" "$dir/err"
    cat "$dir/out" &
    sed -u '/^Warning: tempdir .* is not on tmpfs$/d; /^reboot: System halted\r*$/d' "$dir/err" >&2 &
    cpu=$(taskset -cp $$ | sed 's/.*[^0-9]//') # the last that we may use: pinned is faster
    TMPDIR=$dir watched taskset -c "$cpu" "$kernel" root=/dev/root rootfstype=hostfs rootflags=/ ro \
        uml_dir="$dir" umid=kernel mem=1G "${time[@]}" \
        con=null con0=null,fd:1 con1=null,fd:2 console=tty1 quiet \
        init="$dir/init" RUN="$dir" >"$dir/out" 2>"$dir/err" || status=$?
    end_remains
    wait # for the last of the output
    return "$status"
}

# A kernel that was killed leaves its processes, in a session of their own, and its pid.
end_remains() {
    [ ! -f "$dir/kernel/pid" ] || kill -KILL -- "-$(<"$dir/kernel/pid")" 2>/dev/null || true
}

# Runs a command for KERNEL_SECONDS at most; returns its status.
watched() {
    local status=0
    timeout -k 5 "${KERNEL_SECONDS:-300}" "$@" </dev/null &
    running=$!
    wait "$running" || status=$?
    running=
    [ "$status" != 124 ] || echo "run.sh: not done after ${KERNEL_SECONDS:-300} s: killed" >&2
    return "$status"
}

end() {
    if [ -n "${running-}" ]; then
        kill "$running" 2>/dev/null || true
        wait "$running" || true
    fi
    end_remains
    [ -z "${GPIO_SIM_PREFIX-}" ] || remove_lines
    rm -rf "$dir"
}

remove_lines() {
    local sim
    for sim in "/sys/kernel/config/gpio-sim/$GPIO_SIM_PREFIX"-*; do
        [ -d "$sim" ] || continue
        echo 0 >"$sim/live"
        rmdir "$sim"/bank0/line* "$sim/bank0" "$sim"
    done 2>/dev/null
}

main "$@"
