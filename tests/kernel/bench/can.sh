# SPDX-License-Identifier: Apache-2.0
# Program bytes a bit on the wire of a CAN bus, a delivery beside plain ISO-TP.
# shellcheck source=tests/kernel/can.bash
. tests/kernel/can.bash
bits=$PWD/tests/kernel/can_bits.py

# Program bytes a bit on the wire, beside the same bytes in ISO-TP messages of 4095: goal 0.95.
economical() {
    local ours plain parts=0
    log=$dir/ours.log
    record "$bus" "$log"
    agent send "$dir/long.ngc" 2>"$dir/send.err" >&2 || return 1
    enough
    ours=$("$bits" "$log")
    log=$dir/plain.log
    record "$bus" "$log"
    timeout 60 isotprecv -l -s 7e8 -d 7e0 $options "$bus" >"$dir/received" &
    pids+=($!)
    within 5 can_heard "$bus" isotp
    for part in "$dir"/part.*; do # each is gone when isotpsend ends
        od -An -v -tx1 -w4095 "$part" | timeout 5 isotpsend -s 7e0 -d 7e8 $options "$bus"
        parts=$((parts + 1))
    done
    enough
    [ "$(grep -Ec "$bus 7E0##?[0-9]?1[0-9A-F]{3}" "$log")" -ge $((parts - 1)) ] || return 1
    plain=$("$bits" "$log")
    echo "$ours $plain" | awk -v bytes="$(stat -c %s "$dir/long.ngc")" -v bus="$bus" '{
        printf "can %s, %d bytes: %.5f program bytes a frame bit, plain ISO-TP %.5f: ratio %.3f (goal 0.95)\n",
            bus, bytes, bytes / $3, bytes / $6, $6 / $3 }'
}

program 22000 F24000 >"$dir/long.ngc"
split -b 4095 "$dir/long.ngc" "$dir/part."
buses
for each in vcan0 vcan1; do
    use_bus $each
    sed -i "s/^heartbeat_s.*/heartbeat_s = 0.5/" "$dir/agent.ini" # as it is where nothing is said
    switch_on $bus max
    economical || exit
    stop_vcnc TERM
done
