#!/usr/bin/env bash
# Counts exactly the instructions per pixel of the functions in `ceilings.txt`, and fails if a ceiling is exceeded. Part `row` is the
# number of instructions per row that do not depend on its length, including those of the C library, which has no symbols.
#
#     tests/aarch64/cost.sh DIR             DIR as toolchain.sh made it
#     tests/aarch64/cost.sh DIR record      writes what is counted now, plus 2 %, as the new ceilings
#
# The program decodes frames of two heights; in the difference everything cancels that does not grow with the height. The cost of a row
# follows from two widths, both multiples of the block of every back-end: it is the part that does not grow with the width.
set -euo pipefail
shopt -s inherit_errexit
dir=$(cd "${1:?usage: cost.sh DIR [record]}" && pwd)
mode=${2:-check}
cd "$(dirname "${BASH_SOURCE[0]}")/../.."
ceilings=tests/aarch64/ceilings.txt
few=16 many=48 # rows
narrow=64 wide=1408 # pixels
# Another compiler may need a few more instructions, so new ceilings are this share above the count.
headroom=0.02
# A ceiling that is farther above the count than this should be lowered.
slack=0.03

build=(build --quiet --profile dist -p algo --no-default-features --features std --example probe)
cargo "${build[@]}"
"$dir/bin/cargo" "${build[@]}"
declare -A probe=(
    [aarch64]=$dir/build/aarch64-unknown-linux-gnu/dist/examples/probe
    [x86_64]=${CARGO_TARGET_DIR:-target}/dist/examples/probe
)
cc -shared -fPIC -O2 -o "$dir/count.so" tests/aarch64/count.c

# counts MACHINE CASE ROWS FILE [WIDTH]: writes "count symbol" for every symbol, and prints the number of pixels.
counts() {
    "$dir/bin/qemu-$1" -d plugin -D "$4.raw" -plugin "$dir/count.so" "${probe[$1]}" decode "$2" "$3" ${5:+"$5"}
    c++filt <"$4.raw" >"$4"
}

# of_a_row MACHINE CASE WIDTH: instructions per row of that width.
of_a_row() {
    counts "$1" "$2" $few "$dir/few" "$3" >/dev/null
    counts "$1" "$2" $many "$dir/many" "$3" >/dev/null
    awk -v rows=$((many - few)) '{ sum += FILENAME ~ /few$/ ? -$1 : $1 } END { print sum / rows }' "$dir/few" "$dir/many"
}

failed=0 recorded=
while read -r machine case part ceiling; do
    if [[ -z $machine || $machine == '#'* ]]; then
        recorded+="$machine${case:+ $case}${part:+ $part}${ceiling:+ $ceiling}"$'\n'
        continue
    fi
    if [[ $part == row ]]; then
        counted=$(awk -v short="$(of_a_row "$machine" "$case" $narrow)" -v long="$(of_a_row "$machine" "$case" $wide)" \
            -v narrow=$narrow -v wide=$wide 'BEGIN { printf "%.0f", (short * wide - long * narrow) / (wide - narrow) }')
        echo "$machine $case $part: $counted instructions/row, ceiling $ceiling"
    else
        less=$(counts "$machine" "$case" $few "$dir/few")
        more=$(counts "$machine" "$case" $many "$dir/many")
        # Instructions per pixel of every symbol that grows, the largest first.
        awk -v pixels=$((more - less)) '
            { count = $1; sub(/^[0-9]+ /, ""); grown[$0] += FILENAME ~ /few$/ ? -count : count }
            END { for (symbol in grown) if (grown[symbol]) printf "%.3f %s\n", grown[symbol] / pixels, symbol }
        ' "$dir/few" "$dir/many" | sort -rn >"$dir/grown"
        counted=$(awk -v part="$part" '
            part == "all" && $2 != "-" || index($0, part) { sum += $1 }
            END { printf "%.2f", sum }' "$dir/grown")
        echo "$machine $case $part: $counted instructions/px, ceiling $ceiling"
        awk '$1 >= 0.5 { print "    " $0 }' "$dir/grown"
    fi
    recorded+="$machine $case $part $(awk -v n="$counted" -v h=$headroom 'BEGIN { printf n < 100 ? "%.1f" : "%.0f", n * (1 + h) + 0.05 }')"$'\n'
    [[ $mode == check ]] || continue
    case $(awk -v n="$counted" -v c="$ceiling" -v s=$slack 'BEGIN { print (n > c ? "above" : n <= 0 ? "none" : n < c * (1 - s) ? "below" : "at") }') in
    above)
        echo "    FAILED: above the ceiling" >&2
        failed=1
        ;;
    none)
        echo "    FAILED: nothing of that name was executed" >&2
        failed=1
        ;;
    below) echo "    more than 3 % below the ceiling: lower it ($0 $1 record)" ;;
    esac
done <"$ceilings"

if [[ $mode == record ]]; then
    printf '%s' "$recorded" >"$ceilings"
fi
exit $failed
