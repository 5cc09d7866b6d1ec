#!/usr/bin/env bash
# Measures the time from the start of `fringed` until a measurement can be triggered, with the reference head's camera
# (1456 × 1088 pixels), and fails if it is longer than promised.
#
#     tests/package/start.sh BINARY [RUNS]
#
# Three starts: with a replay head and a stored recipe, with a simulated head and a stored recipe, and with the simulated head of a new
# device, which teaches its first recipe and for which no time is promised. A start ends with the line of the log that says ready with
# recipe 1. The program's processor time until then is printed as well, because wall time means little on a machine with other work.
set -euo pipefail
shopt -s inherit_errexit
usage='usage: start.sh BINARY [RUNS]'
fringed=$(realpath -- "${1:?$usage}")
runs=${2:-5}
# The largest allowed median of the times, in ms, by the head's name.
declare -A promised=([replay]=2000 [simulated]=5000)

work=$(mktemp -d)
daemon=
# shellcheck disable=SC2317 # called by the trap
finish() {
    if [[ -n $daemon ]]; then kill -KILL "$daemon" 2>/dev/null || true; fi
    rm -rf "$work"
}
trap finish EXIT

# A camera with the reference head's number of pixels, which are square.
printf '[rig.camera]\nwidth = 1456\nheight = 1088\nfov_deg = [20.0, 15.0]\n' >"$work/scenario.toml"
printf '[head]\nscenario = "scenario.toml"\n' >"$work/simulated.toml"
printf '[head]\nbackend = "replay"\nrecordings = ["recording"]\n' >"$work/replay.toml"
cp "$work/simulated.toml" "$work/new.toml"
"$fringed" record "$work/recording" --config "$work/simulated.toml" --quiet
"$fringed" teach --number 1 --golden "$work/recording" --config "$work/replay.toml" --out "$work/1.recipe" --quiet
"$fringed" recipe import "$work/1.recipe" --config "$work/replay.toml" --state "$work/replay" --quiet
"$fringed" teach --number 1 --config "$work/simulated.toml" --state "$work/simulated" --quiet

# start NAME: one start and stop; prints milliseconds of the wall and of the processors.
start() {
    local began ended line ticks log
    began=${EPOCHREALTIME/./}
    "$fringed" serve --config "$work/$1.toml" --state "$work/$1" --modbus 127.0.0.1:0 --http 127.0.0.1:0 2>"$work/log" &
    daemon=$!
    exec {log}< <(tail --follow --lines=+1 --sleep-interval 0.005 --pid "$daemon" "$work/log" 2>/dev/null)
    ended=
    while IFS= read -r -u "$log" line; do
        case $line in
        *': ready, recipe 1 '*) ended=${EPOCHREALTIME/./} ;;&
        # Logged after the line about being ready, and also by a station that is not ready: the first start of these two lines ends the wait.
        *': ready'* | *': Modbus TCP on '*) break ;;
        esac
    done
    if [[ -z $ended ]]; then
        echo "the station with the $1 head did not become ready:" >&2
        cat "$work/log" >&2
        return 1
    fi
    read -ra ticks <"/proc/$daemon/stat"
    kill -TERM "$daemon"
    wait "$daemon"
    daemon=
    exec {log}<&-
    echo $(((ended - began) / 1000)) $(((ticks[13] + ticks[14]) * 1000 / $(getconf CLK_TCK)))
}

failed=0
sed -n 's/^model name[[:space:]]*: /machine: /p' /proc/cpuinfo | sort | uniq -c | sed 's/^ *\([0-9]*\) \(.*\)/\2, \1 cores/'
"$fringed" --version
for name in replay simulated new; do
    for _ in $(seq "$runs"); do
        [[ $name != new ]] || rm -rf "$work/new"
        start "$name"
    done >"$work/times"
    median=$(cut -d ' ' -f 1 "$work/times" | sort -n | sed -n "$(((runs + 1) / 2))p")
    processor=$(cut -d ' ' -f 2 "$work/times" | sort -n | sed -n "$(((runs + 1) / 2))p")
    most=$(cut -d ' ' -f 1 "$work/times" | sort -n | tail -n 1)
    echo "start to ready, $name: median $median ms, most $most ms of $runs; processors $processor ms; promised ${promised[$name]:-nothing}"
    if [[ -n ${promised[$name]:-} && $median -gt ${promised[$name]} ]]; then
        echo "FAILED: more than promised" >&2
        failed=1
    fi
done
exit $failed
