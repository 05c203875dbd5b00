#!/usr/bin/env bash
# SPDX-License-Identifier: Apache-2.0
# Builds the kernel for the tests, once: user-mode Linux from Debian's kernel source with the
# configuration of `fragment`, kept in the user's cache folder. Prints the kernel's path.
#   build.sh            builds it where it is not built yet: some minutes
#   build.sh --built    builds nothing: status 1 where it is not built
set -euo pipefail
here=$(realpath "$(dirname "$0")")
package=linux-source-6.1
source=/usr/src/$package.tar.xz
fragment=$here/fragment

# Corrections to 6.1, FILE:OLD:NEW, where OLD is a basic regular expression.
corrections=(
    # 2696 bytes for the registers of a process are too few where the processor has AMX (11008):
    # nothing would run there. They lie on the kernel's stacks, which fragment makes larger.
    'arch/x86/um/user-offsets.c:(HOST_FP_SIZE, 2696):(HOST_FP_SIZE, 12288)'
    # Every interrupt number is taken by user-mode Linux itself: none is left for the edges of lines.
    'arch/um/include/asm/irq.h:NR_IRQS.*UM_LAST_SIGNAL_IRQ$:NR_IRQS (UM_LAST_SIGNAL_IRQ + 64)'
)

version=$(dpkg-query -W -f '${Version}' "$package" 2>/dev/null) || version=none
key=$({ echo "$version ${corrections[*]}"; cat "$fragment"; } | sha256sum | cut -c 1-16)
home=${HOME:-$(getent passwd "$(id -u)" | cut -d : -f 6)}
cache=${XDG_CACHE_HOME:-$home/.cache}/segmill
kernel=$cache/kernel-$key/linux
out=$cache/kernel-$key.build

main() {
    if [ "${1-}" = --built ]; then
        [ -x "$kernel" ] && echo "$kernel"
        return
    fi
    [ -f "$source" ] || fail "no $source: install the Debian package $package (make deps)"
    mkdir -p "$cache"
    exec 9>"$cache/kernel.lock"
    flock 9
    [ -x "$kernel" ] || build >&2
    echo "$kernel"
}

build() {
    echo "building the kernel for the tests, once: some minutes"
    rm -rf "$out"
    trap 'rm -rf "$out"' EXIT
    mkdir -p "$out/source" "$out/object"
    tar -xf "$source" -C "$out/source" --strip-components=1 || fail "cannot unpack $source"
    for correction in "${corrections[@]}"; do
        correct "$correction"
    done

    kbuild KCONFIG_ALLCONFIG="$fragment" allnoconfig
    grep -E '^(CONFIG_|# CONFIG_.* is not set)' "$fragment" | while read -r line; do
        grep -qxF "$line" "$out/object/.config" || fail "\"$line\" did not stick"
    done
    kbuild -j"$(nproc)" linux
    strip -o "$out/linux" "$out/object/linux"
    mkdir -p "$(dirname "$kernel")"
    mv "$out/linux" "$kernel"
}

correct() { # correct FILE:OLD:NEW
    local file old new
    IFS=: read -r file old new <<<"$1"
    grep -q "$old" "$out/source/$file" || fail "$file has no \"$old\""
    sed -i "s/$old/$new/" "$out/source/$file"
}

# What an outer make was told (its compiler, its flags) is not for the kernel.
kbuild() {
    env -u MAKEFLAGS -u MAKEOVERRIDES -u MFLAGS make -C "$out/source" ARCH=um O="$out/object" \
        CC=gcc HOSTCC=gcc "$@" >"$out/log" 2>&1 || {
        tail -n 40 "$out/log"
        fail "the kernel's make failed: $*"
    }
}

fail() {
    echo "build.sh: $*" >&2
    exit 1
}

main "$@"
