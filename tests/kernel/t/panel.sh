# SPDX-License-Identifier: Apache-2.0
# The operator's panel: segmill panel between vcnc and simulated lines, with a hand on the buttons and
# an eye on the lamp.
# shellcheck source=tests/kernel/setup.bash
. tests/kernel/setup.bash
export XDG_STATE_HOME=$dir/state XDG_CONFIG_HOME=$dir/config

cp config/etc/tools.ini config/etc/machine.ini "$dir"
printf '%s\n' 'G17 G21 G40 G49 G80 G90 G94' 'G1 X40 F240' 'X0' 'M2' >"$dir/program.ngc" # 20 s
start_vcnc --machine "$dir/machine.ini"
port=${address##*:}
read -r chip lines < <(gpio_sim panel 4 start hold lamp spare)
label=panel start=0 hold=1 lamp=2 spare=3

configure() { # configure LINE…: the [panel] of the agent's configuration
    printf '%s\n' '[link]' 'heartbeat_s = 0.1' 'reconnect_s = 0.1' 'give_up_s = 2' \
        '[machine.sim]' "address = modbus://$address" '[panel]' "chip = $label" "$@" >"$dir/agent.ini"
}
named=('start = start' 'hold = hold' 'lamp = 2' 'debounce_ms = 150')
configure "${named[@]}"

agent() { # agent COMMAND…
    timeout 20 "$segmill" "$@" --to sim --config "$dir/agent.ini" </dev/null
}
register() { # register FIRST COUNT: prints the last
    mbpoll -m tcp -a 1 -0 -r "$1" -c "$2" -t 4 -p "$port" -1 127.0.0.1 |
        sed -n 's/^\[[0-9]*\]:[[:space:]]*//p' | tail -n 1
}
IDLE=1 READY=4 RUNNING=5 HELD=7
is() { # is STATE: the machine's
    [ "$(register 1 1)" = "$1" ]
}
runs() { # runs COUNT: starts so far
    local n
    n=$(register 68 2)
    [ "$n" = "$1" ] || { echo "$n runs, expected $1" && return 1; }
}
said() { # said WORD: by the panel, within 5 s
    within 5 grep -q -e "$1" "$dir/panel.err" || { cat "$dir/panel.err" && return 1; }
}
panel_begins() {
    "$segmill" panel --json --to sim --config "$dir/agent.ini" >"$dir/panel.out" 2>"$dir/panel.err" &
    panel_pid=$!
    pids+=("$panel_pid")
    within 5 gpio_held "$chip" "segmill lamp" || { cat "$dir/panel.err" && return 1; }
}
panel_ends() { # panel_ends SIGNAL: and was well
    kill -s "$1" "$panel_pid" && wait "$panel_pid"
}
click() { # click OFFSET: long enough for any debounce
    press "$lines" "$1"
    sleep 0.4
    release "$lines" "$1"
    sleep 0.4
}
bounce() { # bounce OFFSET COUNT [SECONDS]: edges, that far apart; the last one presses
    local i
    for ((i = $2; i > 0; i--)); do
        if ((i % 2)); then press "$lines" "$1"; else release "$lines" "$1"; fi
        [ -z "${3-}" ] || sleep "$3"
    done
}
# Looks for 2.5 s, which is two periods of the slowest pattern but one: how often does it go on, and for
# what share is it lit?
lamp_is() { # lamp_is OFF|STEADY|SLOW|FAST|DOUBLE
    local began=${EPOCHREALTIME/./} now value last rises=0 lit=0 n=0 shown
    last=$(line "$lines" $lamp)
    while now=${EPOCHREALTIME/./} && ((now - began < 2500000)); do
        read -r value <"$lines/sim_gpio$lamp/value"
        ((rises += value > last, lit += value, n++))
        last=$value
        read -rt 0.01 <> <(:)
    done
    case $((100 * lit / n)):$rises in
    0:0) shown=OFF ;;
    100:0) shown=STEADY ;;
    [3-6]?:[23]) shown=SLOW ;;
    [3-6]?:9 | [3-6]?:1[01]) shown=FAST ;;
    1?:[345] | 2?:[345]) shown=DOUBLE ;;
    *) shown=neither ;;
    esac
    [ $shown = "$1" ] || { echo "$shown: lit $((100 * lit / n)) %, on $rises times" && return 1; }
}

refused() { # refused WORD LINE…: with this [panel], exit status 3
    configure "${@:2}"
    agent panel 2>"$dir/panel.err"
    [ $? = 3 ] && grep -q -e "$1" "$dir/panel.err" || { cat "$dir/panel.err" && return 1; }
}
ok "no such line" refused "hold = stop: chip panel has no such line" \
    'start = start' 'hold = stop' 'lamp = lamp'
ok "an offset beyond the chip" refused "lamp = 4: chip panel has no such line among its 4" \
    'start = start' 'hold = 1' 'lamp = 4'
ok "a line twice" refused "lamp = 1: .* taken by 'segmill hold'" \
    'start = start' 'hold = hold' 'lamp = 1'
label=gpiochip99 ok "no such chip" refused "\[panel\] chip = gpiochip99: " "${named[@]}"
ok "half a panel" refused "lamp: missing" 'start = start' 'hold = hold'
gpioset --mode=signal "$chip" $spare=1 &
spare_pid=$!
within 5 gpio_held "$chip" gpioset
ok "a line of somebody else's" refused "start = spare: .* taken by 'gpioset'" \
    'start = spare' 'hold = hold' 'lamp = lamp'
kill $spare_pid
configure "${named[@]}"

# pressed at power-up
echo ack >&7
within 5 is $IDLE
ok "a program is delivered" agent send "$dir/program.ngc"
press "$lines" $start
ok "the panel begins" panel_begins
ok "gpioinfo shows who has the lines, and how" sh -c "gpioinfo $chip | tr -s ' ' |
    grep -c -e 'segmill start\" input active-high' -e 'segmill hold\" input' \
        -e 'segmill lamp\" output' | grep -qx 3"
ok "pressed at power-up: the lamp shows a fault" lamp_is DOUBLE
ok "and the panel says it" said "pressed when it was first seen"
release "$lines" $start
sleep 2.2
click $start
ok "released, and pressed again: nothing is started" runs 0
sleep 2.2
ok "still a fault" lamp_is DOUBLE
click $hold
ok "hold clears it: armed" lamp_is SLOW
ok "nothing was started" runs 0

# a press
bounce $start 3 0.003
release "$lines" $start
sleep 0.4
ok "a touch starts nothing" runs 0
press "$lines" $start
ok "a press starts it" within 5 is $RUNNING
ok "the lamp is lit" lamp_is STEADY
release "$lines" $start
click $start
ok "one run" runs 1
bounce $hold 1
ok "hold holds" within 5 is $HELD
release "$lines" $hold
ok "the lamp blinks fast" lamp_is FAST
click $start
ok "start does not resume" is $HELD
ok "and says so" said "start does nothing: the machine is not READY"
ok "resumed by somebody else" agent resume --no-follow
ok "runs on" within 5 is $RUNNING
ok "the same run" runs 1
ok "aborted" agent abort
ok "READY again" within 5 is $READY

# bounce
for edges in 1 49; do
    sleep 0.5
    before=$(register 68 2)
    bounce $start $edges
    ok "$edges edges at once: a run" within 5 is $RUNNING
    bounce $start 10 0.003
    release "$lines" $start
    sleep 0.3
    ok "one, and none by letting go" runs $((before + 1))
    agent abort >/dev/null
    ok "READY again" within 5 is $READY
done

# the link
before=$(register 68 2)
sleep 0.5
kill -STOP "$vcnc_pid"
press "$lines" $start
ok "the link is lost under the finger" said "link was lost at the start"
ok "the lamp says that nothing is known" lamp_is DOUBLE
kill -CONT "$vcnc_pid"
ok "the link is back" within 5 is $READY
sleep 1
ok "nothing is made up for" runs "$before"
release "$lines" $start
sleep 0.4
press "$lines" $start
ok "a fresh press starts" within 5 is $RUNNING
release "$lines" $start

# the chip goes away, in the middle of a run, and comes back with a finger on the button
sim=/sys/kernel/config/gpio-sim/${GPIO_SIM_PREFIX-segmill}-panel
echo 0 >"$sim/live"
ok "the chip is gone: said" said "is it still plugged in"
ok "the run goes on" is $RUNNING
echo 1 >"$sim/live"
ok "the lines are back" said "lines are back"
read -r chip lines <<<"$(<"$sim/bank0/chip_name") /sys/devices/platform/$(<"$sim/dev_name")/$(<"$sim/bank0/chip_name")"
click $hold
ok "hold holds again" within 5 is $HELD

# the end
ok "the run goes on" agent resume --no-follow
within 5 is $RUNNING
ok "the panel ends" panel_ends TERM
ok "and touches no run" is $RUNNING
ok "which it says" said "the run goes on without its heartbeats"
ok "and what it did" python3 tests/e2e/schema.py docs/schema/result.json "$dir/panel.out"
ok "exactly" test "$(tr -d ' \n' <"$dir/panel.out")" = '{"command":"panel","starts":5,"holds":3}'
ok "the lines are free" not gpio_held "$chip" "segmill lamp"
ok "the lamp is dark" test "$(line "$lines" $lamp)" = 0
agent abort >/dev/null
finish
