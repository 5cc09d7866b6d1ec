#!/usr/bin/env bash
# Triggers by token with mbpoll, like a PLC that opens a new connection for every request, and reads each result in one read of
# 120 registers.
#
#     tests/clients/tokens.sh target/release/fringed [CYCLES]
#
# Exits with a code other than 0 at the first broken promise.
set -euo pipefail

fringed=$1
cycles=${2:-5}
state=$(mktemp -d)
log="$state.log"
daemon=

finish() {
    if [[ -n $daemon ]]; then kill -KILL "$daemon" 2>/dev/null || true; fi
    rm -rf "$state" "$log"
}
trap finish EXIT

broken() {
    echo "broken promise: $*" >&2
    cat "$log" >&2
    exit 1
}

"$fringed" serve --state "$state/state" --modbus 127.0.0.1:0 --http 127.0.0.1:0 2>"$log" &
daemon=$!
port=
for _ in $(seq 600); do
    port=$(sed -n 's/.*Modbus TCP on 127\.0\.0\.1:\([0-9]*\),.*/\1/p' "$log")
    [[ -z $port ]] || break
    kill -0 "$daemon" 2>/dev/null || broken "the daemon ended before it served"
    sleep 0.1
done
[[ -n $port ]] || broken "the daemon did not serve within a minute"

# COUNT holding registers from ADDRESS, unsigned, in one request, on one line.
read_registers() {
    mbpoll -m tcp -p "$port" -a 1 -0 -t 4 -r "$1" -c "$2" -1 127.0.0.1 |
        sed -n 's/^\[[0-9]*\]:[[:space:]]*\([0-9]*\).*/\1/p' | tr '\n' ' '
}

# Writes registers from ADDRESS in one request.
write_registers() {
    local address=$1
    shift
    mbpoll -m tcp -p "$port" -a 1 -0 -t 4 -r "$address" 127.0.0.1 -- "$@" >/dev/null
}

# Polls the result block until its token is TOKEN; leaves the 120 registers in `result`.
result=()
await_token() {
    for _ in $(seq 200); do
        read -ra result <<<"$(read_registers 200 120)"
        [[ ${#result[@]} -eq 120 ]] || broken "one read gave ${#result[@]} registers, not 120"
        [[ ${result[2]} -ne $1 ]] || return 0
        sleep 0.05
    done
    broken "no result with token $1 within ten seconds"
}

read -ra before <<<"$(read_registers 100 32)"
[[ ${#before[@]} -eq 32 ]] || broken "one read of the status gave ${#before[@]} registers, not 32"
seq_before=$((before[12] << 16 | before[13]))
for cycle in $(seq "$cycles"); do
    token=$((cycle + 100))
    # TRIGGER_TOKEN, RECIPE_SELECT, PLC_HEARTBEAT, PART_ID, PRESS_STROKE.
    trigger=("$token" 1 "$cycle" 1 "$cycle" 2 "$token")
    write_registers 1 "${trigger[@]}"
    # The same write again, as after a lost answer, must not measure again.
    write_registers 1 "${trigger[@]}"
    await_token "$token"
    seq=$((result[0] << 16 | result[1]))
    [[ $seq -eq $((result[118] << 16 | result[119])) ]] || broken "SEQ $seq differs at the end of the block"
    [[ $seq -eq $((seq_before + cycle)) ]] || broken "SEQ is $seq in cycle $cycle after $seq_before"
    [[ ${result[8]} -eq 1 ]] || broken "verdict ${result[8]} for a good part, not 1 (PASS)"
    [[ ${result[3]} -eq 1 ]] || broken "recipe ${result[3]}, not 1"
    [[ $((result[6] << 16 | result[7])) -eq $((65536 + cycle)) ]] || broken "PART_ID is not the one of the trigger"
    [[ $((result[28] << 16 | result[29])) -eq $((131072 + token)) ]] || broken "PRESS_STROKE is not the one of the trigger"
    gauges=${result[27]}
    [[ $((result[10] << 16 | result[11])) -eq $(((1 << gauges) - 1)) ]] || broken "not all $gauges gauges pass"
    echo "cycle $cycle: token $token, SEQ $seq, PASS, $gauges gauges"
done
read -ra after <<<"$(read_registers 100 32)"
triggers=$(((after[10] << 16 | after[11]) - (before[10] << 16 | before[11])))
[[ $triggers -eq $cycles ]] || broken "$triggers triggers accepted in $cycles cycles"
[[ $((after[14] << 16 | after[15])) -eq $((before[14] << 16 | before[15])) ]] || broken "triggers were missed"
[[ ${after[16]} -eq $token ]] || broken "LAST_TOKEN is ${after[16]}, not $token"

# The README's examples, unchanged except for the port.
examples=0
while IFS= read -r example; do
    words=${example%%#*}
    eval "${words/-p 1502/-m tcp -p $port}" >"$log.example" || broken "the README's example fails: $example"
    examples=$((examples + 1))
done < <(grep '^mbpoll -p 1502' "$(dirname "${BASH_SOURCE[0]}")/../../README.md")
[[ $examples -eq 2 ]] || broken "the README has $examples examples for mbpoll, not 2"
await_token 7
[[ $((result[6] << 16 | result[7])) -eq 4711 && $((result[28] << 16 | result[29])) -eq 12 && ${result[8]} -eq 1 ]] ||
    broken "the README's part 4711 of stroke 12 did not pass"
rm -f "$log.example"

kill -TERM "$daemon"
code=0
wait "$daemon" || code=$?
daemon=
[[ $code -eq 0 ]] || broken "SIGTERM ended the daemon with exit code $code"
echo "mbpoll: $cycles cycles by token, each sent twice and measured once; the README's examples hold"
