#!/usr/bin/env bash
# Builds `fringed` for aarch64 with the devices that need no library, and runs it under qemu.
#
#     tests/aarch64/daemon.sh DIR            DIR as toolchain.sh made it
#     tests/aarch64/daemon.sh DIR tests      also runs the tests that need no device: twice the time
set -euo pipefail
shopt -s inherit_errexit
dir=$(cd "${1:?usage: daemon.sh DIR [tests]}" && pwd)
tests=${2:-}
cd "$(dirname "${BASH_SOURCE[0]}")/../.."
features=kms,gpio
# SQLite is written in C.
export CC_aarch64_unknown_linux_gnu=$dir/bin/cc AR_aarch64_unknown_linux_gnu=$dir/bin/ar

# If tests follow, with their profile, so that nothing is built twice.
profile=dev
if [[ -n $tests ]]; then profile=test; fi
"$dir/bin/cargo" build --profile "$profile" -p appliance --features "$features"
fringed=("$dir/bin/qemu-aarch64" "$dir/build/aarch64-unknown-linux-gnu/debug/fringed")
"${fringed[@]}" --version

# This build has no camera, and must say so with the remedy.
had=0
said=$("${fringed[@]}" config check docs/fringed.toml 2>&1) || had=$?
if [[ $had != 78 || $said != *"built without libcamera:"*"--features rpi"* ]]; then
    echo "the configuration of a head with a camera ended with $had and said: $said" >&2
    exit 1
fi
# It has lines and a simulated head; there is no chip here.
config=$(mktemp)
trap 'rm -f "$config"' EXIT
printf '[lines]\nchip = "no-such-chip"\nstart = "START"\n' >"$config"
had=0
said=$("${fringed[@]}" --config "$config" --state "$dir/state" --modbus 127.0.0.1:0 --http 127.0.0.1:0 2>&1) || had=$?
if [[ $had != 69 || $said != *'no GPIO chip is labelled "no-such-chip"'* ]]; then
    echo "a station whose lines are not there ended with $had and said: $said" >&2
    exit 1
fi

if [[ -n $tests ]]; then
    "$dir/bin/cargo" test -p hal --features "$features"
    "$dir/bin/cargo" test -p sim
    "$dir/bin/cargo" test -p appliance --features "$features"
fi
