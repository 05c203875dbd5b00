#!/usr/bin/env bash
# SPDX-License-Identifier: Apache-2.0
# The kernel itself: what the other scripts here stand on is really there.
# shellcheck source=tests/kernel/setup.bash
. tests/kernel/setup.bash

seen() { # seen FILTER FRAME: cansend sends it, candump sees it
    timeout 5 candump -L -n 1 "$1" >"$dir/seen" &
    within 5 can_heard vcan0 || return
    cansend vcan0 "$2" && wait $! && [ "$(sed 's/^([^)]*) //' "$dir/seen")" = "vcan0 $2" ]
}
isotp() { # isotp BYTES [OPTION…]: a PDU of so many bytes arrives as it is
    head -c "$1" /dev/urandom | od -An -v -tx1 -w"$1" | tr a-f A-F | sed 's/^ //' >"$dir/sent"
    timeout 10 isotprecv -s 321 -d 123 "${@:2}" vcan0 >"$dir/received" &
    within 5 can_heard vcan0 isotp || return
    timeout 10 isotpsend -s 123 -d 321 "${@:2}" vcan0 <"$dir/sent" && wait $! &&
        diff -q <(sed 's/ *$//' "$dir/received") <(sed 's/ *$//' "$dir/sent")
}
edge() { # edge EVENT_LINE_REGEX press|release: gpiomon sees the hand
    timeout 10 gpiomon --num-events=1 "$chip" 0 >"$dir/edge" &
    within 5 gpio_held "$chip" gpiomon || return
    "$2" "$lines" 0 && wait $! && grep -E "$1" "$dir/edge"
}
output() { # output VALUE: a program sets the line, and we read it while it is held
    gpioset --mode=time --sec=2 "$chip" "2=$1" &
    within 5 gpio_held "$chip" gpioset || return
    [ "$(line "$lines" 2)" = "$1" ] && wait $!
}
tcp() {
    perl -MIO::Socket::INET -e '
        my $s = IO::Socket::INET->new(Listen => 1, LocalAddr => "127.0.0.1") or die;
        if (!fork) {
            my $c = IO::Socket::INET->new("127.0.0.1:" . $s->sockport) or die;
            print $c "through lo";
            exit;
        }
        my $c = $s->accept or die;
        exit(<$c> ne "through lo");'
}

ok "a bus" can_up vcan0
ok "a classic frame" seen vcan0 "123#DEADBEEF"
ok "a frame of CAN FD" seen vcan0 "123##5$(printf '%0128d' 7)" # 5: fast bits, and FD
ok "an error frame: bus off, asked for" seen "vcan0,0:0,#40" "20000040#0000000000000000"
ok "an error frame, not asked for" not seen vcan0 "20000040#0000000000000000"
ok "2000 bytes by ISO-TP" isotp 2000
ok "2000 bytes by ISO-TP on CAN FD" isotp 2000 -L 72:64:0

read -r chip lines < <(gpio_sim panel 3 start hold lamp)
ok "a chip with three lines" test -n "$chip"
ok "its lines have names" test "$(gpiofind start) $(gpiofind lamp)" = "$chip 0 $chip 2"
ok "an input is released" test "$(gpioget "$chip" 0)" = 0
press "$lines" 0
ok "an input is pressed" test "$(gpioget "$chip" 0)" = 1
ok "falling edge" edge FALLING release
ok "rising edge" edge RISING press
ok "an output is 1" output 1
ok "an output is 0" output 0

ok "TCP on the loopback" tcp
ok "a file for the outside" cp "$0" "$WORK/kernel.sh"
if [ -e /proc/exitcode ]; then
    ok "no other file can be written" not touch "$0"
else
    skip "no other file can be written" "on the host itself"
fi
finish
