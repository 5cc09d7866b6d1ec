#!/usr/bin/env bash
# Compares the results of every back-end with the frozen bits: on this machine, and under qemu on aarch64 and on an x86-64 processor
# without AVX2. An older one without SSSE3 must be refused by name.
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
# This processor has SSSE3, but not SSE4.1; newer instructions are as illegal in qemu as on the processor.
older=$(CARGO_TARGET_X86_64_UNKNOWN_LINUX_GNU_RUNNER="$dir/bin/qemu-x86_64 -cpu Conroe" cargo "${probe[@]}")
there=$("$dir/bin/cargo" "${probe[@]}")
if ! grep -q "^ssse3 " <<<"$older"; then
    echo "a processor with SSSE3 does not decode with it" >&2
    exit 1
fi
said=$(CARGO_TARGET_X86_64_UNKNOWN_LINUX_GNU_RUNNER="$dir/bin/qemu-x86_64 -cpu Conroe,-ssse3" cargo "${probe[@]}" 2>&1) && said="nothing, and ended with 0"
if [[ $said != *"this processor has no SSSE3"* ]]; then
    echo "a processor without SSSE3 is not refused by name, but said: $said" >&2
    exit 1
fi
for machine in here older there; do
    for back_end in $(cut -d ' ' -f 1 <<<"${!machine}" | sort -u); do
        if ! diff "$frozen" <(sed -n "s/^$back_end //p" <<<"${!machine}"); then
            echo "$back_end $machine (>) does not give the frozen bits (<)" >&2
            exit 1
        fi
        echo "$back_end $machine: $(wc -l <"$frozen") cases as frozen, profile $profile"
    done
done
