#!/bin/sh
# SPDX-License-Identifier: Apache-2.0
# The Debian 12 packages that segmill builds and tests with, in one place, with what each saves us.
#   --missing   print those that are not installed
#   --install   install them (root, or sudo)
set -eu

packages() {
    sed -n 's/^#: *\([^ ]*\) .*/\1/p' "$0"
}
# build
#: gcc                        the compiler
#: g++                        for segmill-cad only
#: libc6-dev                  headers
#: pkg-config                 where libraries are
#: libglib2.0-dev             errors, containers, options, main loop, child processes, TAP, SHA-256
#: libjson-glib-dev           reading and building JSON
#: libgpiod-dev               the operator's panel: GPIO lines
#: libcairo2-dev              pictures
#: libmodbus-dev              names of Modbus; the peer in tests and benches
#: libssl-dev                 TLS, certificates
#: zlib1g-dev                 crc32
#: libocct-data-exchange-dev  IGES and STEP
#: libocct-modeling-algorithms-dev  tessellation, NURBS conversion
# test
#: clang                      the second compiler, and its sanitizers
#: clang-format               the style
#: libomp-dev                 OpenMP for clang
#: perl                       prove
#: python3-jsonschema         judge of the JSON files
#: python3-yaml               judge of the workflow in docs/vcnc-ci.md
#: mbpoll                     judge of the Modbus map
#: python3-pymodbus           judge of the Modbus map and of the exceptions
#: python3-serial-asyncio     pymodbus does not begin without it
#: tshark                     judge of the frames of a delivery
#: openssl                    judge of TLS
#: iproute2                   CAN buses
#: admesh                     judge of the in-process model
#: can-utils                  judge of CAN and ISO-TP
#: gpiod                      the hand on the operator's buttons
#: linux-source-6.1           a kernel with CAN and GPIO, for hosts that have none
#: flex                       reads its configuration
#: bison                      reads its configuration
#: bc                         works out its timers' constants

missing() {
    for p in $(packages); do
        case $(dpkg-query -W -f '${Status}' "$p" 2>/dev/null) in
        *"install ok installed") ;;
        *) echo "$p" ;;
        esac
    done
}

case ${1-} in
--missing) missing ;;
--install)
    need=$(missing)
    [ -n "$need" ] || exit 0
    if [ "$(id -u)" = 0 ]; then
        as_root=
    elif command -v sudo >/dev/null; then
        as_root=sudo
    else
        echo "segmill needs these Debian packages; ask an administrator to install them:" >&2
        echo "  apt-get install" $need >&2
        exit 1
    fi
    echo "installing:" $need
    $as_root env DEBIAN_FRONTEND=noninteractive apt-get update -qq
    $as_root env DEBIAN_FRONTEND=noninteractive apt-get install -y -qq --no-install-recommends $need >/dev/null
    ;;
*)
    echo "usage: $0 --missing | --install" >&2
    exit 2
    ;;
esac
