#!/usr/bin/env bash
# Counts the read misses in the first-level cache per pixel of decoding twelve aligned frames with AVX2 and with SSSE3, and fails
# if a ceiling is exceeded.
#
#     tests/cache.sh
#
# Cachegrind simulates the caches of a Raspberry Pi's processors, so the count is the same in every run and on any machine. The frames
# begin at pages of 16 KiB, as a camera's buffers do, so that equal pixels of all frames compete for the same sets of these caches.
# Of the counts, 0.19 is each byte of the frames read once, and 0.16 the 5 bytes per pixel that a level hands to the next one and that are
# read twice. The rest is competition: a Cortex-A72 keeps two lines of a set, a level has four frames.
# The results lie on the heap: an allocator that maps large ones by itself lets them begin at pages, too, of one height and not of the
# other, depending on what was freed before, and they then compete with the frames by chance.
# As in aarch64/cost.sh, the program decodes frames of two heights, and in the difference everything cancels that does not grow with the
# height. Ends with 69 (EX_UNAVAILABLE) and the reason if Valgrind is not available, or the processor is another.
set -euo pipefail
shopt -s inherit_errexit
cd "$(dirname "${BASH_SOURCE[0]}")/.."
case=geometric-3x4-8/aligned
few=16 many=48 # rows
# Back-end; size, ways and line of the cache; read misses per pixel; processor. SSSE3 reads 16 pixels of a frame at a time, as NEON does.
ceilings='
avx2 65536,4,64 0.39 Cortex-A76
avx2 32768,2,64 0.57 Cortex-A72
ssse3 65536,4,64 0.43 Cortex-A76
ssse3 32768,2,64 0.95 Cortex-A72
'

grep -qw avx2 /proc/cpuinfo || { echo "misses cannot be counted: the ceilings are those of x86-64 with AVX2" >&2; exit 69; }
command -v valgrind >/dev/null || { echo "misses cannot be counted: Valgrind is not installed (Debian package valgrind)" >&2; exit 69; }
cargo build --quiet --profile dist -p algo --no-default-features --features std --example probe
# Environment and command line lie on the stack, which competes with some pixels of the frames, so both are the same everywhere.
cd "${CARGO_TARGET_DIR:-target}/dist/examples"
valgrind=$(command -v valgrind)
log=$(mktemp)
trap 'rm -f "$log"' EXIT

# misses BACK-END CACHE ROWS: prints the read misses and the number of pixels.
misses() {
    local pixels
    pixels=$(env -i MALLOC_MMAP_THRESHOLD_=16777216 "$valgrind" --tool=cachegrind --cache-sim=yes --D1="$2" --cachegrind-out-file=/dev/null --log-file="$log" \
        ./probe decode "$case@$1" "$3" </dev/null)
    # "==1== D1  misses: ALL ( READ rd + WRITE wr)"
    sed -nE "s/.*D1 +misses:.*\( *([0-9,]+) rd.*/\1 $pixels/p" "$log" | tr -d ,
}

failed=0
while read -r back_end cache ceiling processor; do
    [[ -n $cache ]] || continue
    per_pixel=$({ misses "$back_end" "$cache" $few && misses "$back_end" "$cache" $many; } |
        awk '{ misses = $1 - misses; pixels = $2 - pixels } END { printf "%.3f", misses / pixels }')
    echo "$back_end, $processor ($cache): $per_pixel read misses/px, ceiling $ceiling"
    if ! awk -v n="$per_pixel" -v c="$ceiling" 'BEGIN { exit !(n > 0 && n <= c) }'; then
        echo "    FAILED: above the ceiling, or nothing was counted" >&2
        failed=1
    fi
done <<<"$ceilings"
exit $failed
