#!/usr/bin/env bash
# Compares the results of every back-end, on this machine and on aarch64 (under qemu), with the frozen bits.
#
#     tests/aarch64/bits.sh DIR [PROFILE]      DIR as made by toolchain.sh; built with dist or another profile
set -euo pipefail
shopt -s inherit_errexit
dir=${1:?usage: bits.sh DIR [PROFILE]}
profile=${2:-dist}
cd "$(dirname "${BASH_SOURCE[0]}")/../.."
probe=(run --quiet --profile "$profile" -p algo --no-default-features --features std --example probe)
frozen=algo/examples/probe/frozen.txt

here=$(cargo "${probe[@]}")
there=$("$dir/bin/cargo" "${probe[@]}")
for machine in here there; do
    for back_end in $(cut -d ' ' -f 1 <<<"${!machine}" | sort -u); do
        if ! diff "$frozen" <(sed -n "s/^$back_end //p" <<<"${!machine}"); then
            echo "$back_end $machine (>) does not give the frozen bits (<)" >&2
            exit 1
        fi
        echo "$back_end $machine: $(wc -l <"$frozen") cases as frozen, profile $profile"
    done
done
