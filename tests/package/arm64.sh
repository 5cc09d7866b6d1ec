#!/usr/bin/env bash
# Makes the package for arm64, unpacks it, and runs its binary under qemu: its version, and a recording measured.
#
#     tests/package/arm64.sh DIR OUT [BINARY [LIBRARIES]]
#
# DIR as tests/aarch64/toolchain.sh made it. Without BINARY it is built here, with the devices that need no library; one that
# needs some is run with those in LIBRARIES.
set -euo pipefail
shopt -s inherit_errexit
usage='usage: arm64.sh DIR OUT [BINARY [LIBRARIES]]'
dir=$(cd "${1:?$usage}" && pwd)
mkdir -p "${2:?$usage}"
out=$(cd "$2" && pwd)
binary=${3:-$dir/build/aarch64-unknown-linux-gnu/release/fringed}
libraries=${4:-}
cd "$(dirname "${BASH_SOURCE[0]}")/../.."

if [[ -z ${3:-} ]]; then
    CC_aarch64_unknown_linux_gnu=$dir/bin/cc AR_aarch64_unknown_linux_gnu=$dir/bin/ar \
        "$dir/bin/cargo" build --release -p appliance --features kms,gpio
fi
package=$(PATH=$PATH:$dir/root/usr/bin LD_LIBRARY_PATH=$dir/root/usr/lib/x86_64-linux-gnu debian/make "$binary" "$out")
tests/package/check.sh "$package"
[[ $(dpkg-deb --field "$package" Architecture) == arm64 ]]

work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT
dpkg-deb --extract "$package" "$work/root"
fringed=("$dir/bin/qemu-aarch64" ${libraries:+-E "LD_LIBRARY_PATH=$libraries"} "$work/root/usr/bin/fringed")
"${fringed[@]}" --version
"${fringed[@]}" config check "$work/root/etc/fringed/fringed.toml"
printf '[rig.camera]\nwidth = 128\nheight = 128\n' >"$work/scenario.toml"
printf '[head]\nscenario = "scenario.toml"\n' >"$work/small.toml"
"${fringed[@]}" record "$work/recording" --config "$work/small.toml" --quiet
"${fringed[@]}" measure "$work/recording" --out "$work/result" --quiet
resolved=$(sed -n 's/.*"resolved": *\([0-9]*\).*/\1/p' "$work/result/report.json")
if ((resolved < 1000)); then
    echo "only $resolved pixels of $((128 * 128)) were measured" >&2
    exit 1
fi
echo "measured under qemu: $resolved pixels"
