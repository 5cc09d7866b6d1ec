#!/usr/bin/env bash
# Builds the package for a Raspberry Pi, unpacks it, and runs its binary under qemu to show its version and to measure a recording.
#
#     tests/package/arm64.sh DIR OUT      DIR as made by tests/aarch64/toolchain.sh and libcamera.sh
set -euo pipefail
shopt -s inherit_errexit
usage='usage: arm64.sh DIR OUT'
dir=$(cd "${1:?$usage}" && pwd)
mkdir -p "${2:?$usage}"
out=$(cd "$2" && pwd)
cd "$(dirname "${BASH_SOURCE[0]}")/../.."

"$dir/bin/cargo-rpi" build --profile dist -p appliance -p fringed-lab -p fringed-fleet --features appliance/rpi
package=$(PATH=$PATH:$dir/root/usr/bin LD_LIBRARY_PATH=$dir/root/usr/lib/x86_64-linux-gnu \
    debian/make "$dir/build/aarch64-unknown-linux-gnu/dist/fringed" "$out" "$dir/bin/qemu-rpi")
tests/package/check.sh "$package"
depends=$(dpkg-deb --field "$package" Depends)
if [[ $depends != *libcamera0.* ]]; then
    echo "the package for a Raspberry Pi does not ask for libcamera: $depends" >&2
    exit 1
fi

work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT
dpkg-deb --extract "$package" "$work/root"
fringed=("$dir/bin/qemu-rpi" "$work/root/usr/bin/fringed")
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
