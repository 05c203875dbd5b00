#!/usr/bin/env bash
# SPDX-License-Identifier: Apache-2.0
# Modbus/TCP Security end to end: certificates of segmill pki, roles, strangers by openssl's own
# client, and plain Modbus that stays on loopback.
cd "$(dirname "$0")/../.." || exit 1
# shellcheck source=tests/e2e/cell.bash
. tests/e2e/cell.bash
pki=$dir/pki

mode_is() { # mode_is MODE FILE…
    local mode=$1 f
    shift
    for f in "$@"; do
        [ "$(stat -c %a "$f")" = "$mode" ] || { stat "$f" && return 1; }
    done
}
# as ROLE COMMAND ARGUMENT…: segmill, to the machine that it knows by its role
cat >"$dir/as" <<SH
#!/bin/sh
role=\$1
shift
exec "$segmill" "\$@" --to "\$role" --config "$dir/tls.ini"
SH
chmod +x "$dir/as"
as=$dir/as
# A master of 12 bytes: reads the first two registers, which are version and state.
client() { # client ARGUMENT…: openssl's; the answer as hex, then what it says
    (printf '\0\1\0\0\0\6\1\3\0\0\0\2' && sleep 1) |
        timeout 5 openssl s_client -connect "$secure" -CAfile "$pki/ca.pem" -verify_return_error \
            -brief -no_ign_eof "$@" 2>"$dir/client.err" | od -An -tx1
    cat "$dir/client.err"
}
answered() {
    client "$@" | tee "$dir/client" | grep -q '00 01 00 00 00 07 01 03 04 01 01' ||
        { cat "$dir/client" && return 1; }
}
refused() { # refused WORD ARGUMENT…: no byte of Modbus, and WORD
    local word=$1
    shift
    client "$@" >"$dir/client"
    cat "$dir/client"
    not grep -q '00 01 00 00 00' "$dir/client" && grep -qi -e "$word" "$dir/client"
}

# --------------------------------------------------------------------- certificates
ok "pki makes certificates" says 0 'TEST CA' "$segmill" pki -o "$pki"
ok "all of them" all_there "$pki" {ca,machine,observer,operator,programmer}.{pem,key}
ok "keys are their owner's only" mode_is 600 "$pki"/*.key
ok "they are the CA's" openssl verify -CAfile "$pki/ca.pem" "$pki"/*.pem
ok "nothing is overwritten" fails 3 'is there already' "$segmill" pki -o "$pki"
ok "another CA" says 0 'for 7 days' "$segmill" pki -o "$dir/other" --host mill.example --days 7
ok "its machine names its host" sh -c \
    "openssl x509 -in '$dir/other/machine.pem' -noout -checkhost mill.example | grep -q 'does match'"
ok "no such time" fails 2 days "$segmill" pki -o "$dir/none" --days 0
ok "no such host" fails 3 'neither' "$segmill" pki -o "$dir/none" --host 'a,b'
ok "pki --json" json 0 "$segmill" pki -o "$dir/third" --json

# --------------------------------------------------------------------------- machine
cp "$dir/machine.ini" "$dir/plain.ini"
printf '[tls]\nca = pki/ca.pem\ncertificate = pki/machine.pem\nkey = pki/machine.key\n' \
    >"$dir/tls-group"
sed -i "/^\[tls\]/,/^\$/d" "$dir/machine.ini"
cat "$dir/tls-group" >>"$dir/machine.ini"
start_vcnc --machine "$dir/machine.ini" --speed 1 --tls 127.0.0.1:0
secure=$(sed -n '2s/^mbaps //p' "$dir/vcnc.out")
echo ack >&7
ok "says where it listens" test -n "$secure"
cat >"$dir/tls.ini" <<INI
[link]
give_up_s = 3
INI
for role in observer operator programmer; do
    printf '[machine.%s]\naddress = mbaps://%s\n' "$role" "$secure"
    printf 'tls_ca = pki/ca.pem\ntls_certificate = pki/%s.pem\ntls_key = pki/%s.key\n' $role $role
done >>"$dir/tls.ini"

# ------------------------------------------------------------------- openssl's client
ok "openssl is refused without a certificate" refused 'certificate required'
ok "openssl is refused with one of another CA" refused 'unknown ca' \
    -cert "$dir/other/programmer.pem" -key "$dir/other/programmer.key"
ok "openssl is refused with TLS 1.1" refused 'alert protocol version' \
    -tls1_1 -cipher 'ALL:@SECLEVEL=0' \
    -cert "$pki/programmer.pem" -key "$pki/programmer.key"
ok "openssl is answered with ours, TLS 1.3" answered -tls1_3 \
    -cert "$pki/observer.pem" -key "$pki/observer.key" -verify_hostname localhost
ok "openssl is answered with ours, TLS 1.2" answered -tls1_2 \
    -cert "$pki/observer.pem" -key "$pki/observer.key" -verify_ip 127.0.0.1
ok "not as another host" refused 'mismatch' \
    -cert "$pki/observer.pem" -key "$pki/observer.key" -verify_hostname mill.example

printf '[link]\ngive_up_s = 1\n[machine.foreign]\naddress = mbaps://%s\n' "$secure" >"$dir/foreign.ini"
printf 'tls_ca = pki/ca.pem\ntls_certificate = other/operator.pem\ntls_key = other/operator.key\n' \
    >>"$dir/foreign.ini"
ok "segmill says why it is refused" fails 4 'does not know the CA of our certificate' \
    "$segmill" status --to foreign --config "$dir/foreign.ini"

# ----------------------------------------------------------------------------- roles
ok "an observer sees the state" says 0 IDLE "$as" observer status
ok "an observer's hold is refused" fails 4 ROLE "$as" observer hold
printf 'G21 G90 G94 G54\nG4 P30\nM30\n' >"$dir/wait.ngc"
ok "an operator delivers nothing" fails 4 ROLE "$as" operator send "$dir/wait.ngc"
ok "a programmer delivers" says 0 'the machine is READY' "$as" programmer send "$dir/wait.ngc"
"$as" programmer send "$dir/wait.ngc" --start >"$dir/run.out" 2>&1 &
run_pid=$!
pids+=("$run_pid")
to=observer
state() {
    "$as" observer status --json 2>/dev/null | sed -n 's/^  "state": "\(.*\)",$/\1/p'
}
ok "it runs" state_is RUNNING
ok "an observer cannot abort it" fails 4 ROLE "$as" observer abort
ok "an operator holds it" says 0 HOLD "$as" operator hold
ok "it is held" state_is HELD
ok "an operator aborts it" says 0 ABORT "$as" operator abort
wait "$run_pid"
ok "the run says so" test $? = 6
stop_vcnc TERM
ok "what was refused is counted" grep -q '^requests refused:.* ROLE 3' "$dir/vcnc.out"
ok "so are handshakes" grep -Eqx 'TLS handshakes refused: ([3-9]|[1-9][0-9]+)' "$dir/vcnc.out"

start_vcnc --machine "$dir/machine.ini" --speed max --tls 127.0.0.1:0
sed -i "s|^address = .*|address = mbaps://$(sed -n '2s/^mbaps //p' "$dir/vcnc.out")|" "$dir/tls.ini"
echo ack >&7
ok "a run from the recipe to the end" says 0 '' \
    "$as" programmer run "$dir/recipe.ini" -o "$dir/run"
ok "run.json is valid" valid run "$dir/run/run.json"
ok "done" state_is COMPLETE
stop_vcnc TERM

# --------------------------------------------------------------------- files, plain Modbus
exits() { # exits STATUS WORD ARGUMENT…: vcnc ends so at once, with WORD on stderr
    local expected=$1 word=$2 got
    shift 2
    timeout 5 "$vcnc" "$@" </dev/null >"$dir/stdout" 2>"$dir/stderr"
    got=$?
    cat "$dir/stderr"
    [ "$got" = "$expected" ] && grep -q -e "$word" "$dir/stderr"
}
chmod 644 "$pki/machine.key" "$pki/observer.key"
ok "vcnc takes no key that others can read" exits 3 'chmod 600' \
    --machine "$dir/machine.ini" --tls 127.0.0.1:0
ok "segmill takes no key that others can read" fails 3 'chmod 600' "$as" observer status
ok "vcnc without certificates" exits 3 'not configured' \
    --machine "$dir/plain.ini" --tls 127.0.0.1:0
ok "mbaps without certificates" fails 3 'not configured' \
    "$segmill" status --to mbaps://127.0.0.1:1 --config "$dir/agent.ini"
ok "plain Modbus stays on loopback" exits 3 beyond_loopback \
    --machine "$dir/plain.ini" --modbus 0.0.0.0:0
ok "segmill too" fails 3 'plain = true' \
    "$segmill" status --to modbus://0.0.0.0:1 --config "$dir/agent.ini"
sed -i 's/^#beyond_loopback = .*/beyond_loopback = true/' "$dir/plain.ini"
start_vcnc --machine "$dir/plain.ini" --modbus 0.0.0.0:0
ok "unless its owner says so" grep -q 'everybody who reaches it' "$dir/vcnc.err"
printf '[machine.open]\naddress = modbus://%s\nplain = true\n' "$address" >"$dir/open.ini"
ok "and the agent's" says 0 OFF "$segmill" status --to open --config "$dir/open.ini"
stop_vcnc TERM

finish
