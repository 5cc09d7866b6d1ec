#!/usr/bin/env bash
# Builds `fringed` for aarch64 with all devices of a Raspberry Pi, and runs it and the tests of its camera back-end under qemu.
#
#     tests/aarch64/rpi.sh DIR      DIR as toolchain.sh made it
#
# The cameras are libcamera's virtual ones on a Debian 13 for arm64; their frames go through all code of hal that handles frames.
# Exits with 69 (EX_UNAVAILABLE) and the reason if libcamera is not available.
set -euo pipefail
shopt -s inherit_errexit
dir=$(cd "${1:?usage: rpi.sh DIR}" && pwd)
cd "$(dirname "${BASH_SOURCE[0]}")/../.."
# Symbol versions of the C and C++ libraries of Debian 12. Debian 13, on which Raspberry Pi OS is based, has newer ones.
newest=(GLIBC_2.36 GLIBCXX_3.4.30 CXXABI_1.3.13)
tests/aarch64/libcamera.sh "$dir"
root=$dir/libcamera/root

failed() {
    echo "$*" >&2
    exit 1
}

# The crate rustix, which the buffers' crates make their calls with, goes through the C library, where udmabuf.so replaces them. The crate
# dma-heap takes its other way for granted, so a copy of the tree is built with the right type.
tree=$dir/rpi
rm -rf "$tree" && mkdir "$tree"
git ls-files -z | tar --create --null --files-from - | tar --extract --directory "$tree"
cargo fetch --locked --quiet
heap=$(cargo metadata --all-features --format-version 1 | grep -o '[^"]*/dma-heap-[^"/]*/Cargo.toml')
cp -r "${heap%/Cargo.toml}" "$tree/dma-heap"
sed -i 's/\(ALLOC_OPCODE: \)u32/\1rustix::ioctl::Opcode/' "$tree/dma-heap/src/ioctl.rs"
through_libc=(--config 'target.aarch64-unknown-linux-gnu.rustflags=["--cfg=rustix_use_libc"]'
    --config 'patch.crates-io.dma-heap.path="dma-heap"')
cd "$tree"
# With the profile of the tests, so that nothing is built twice.
"$dir/bin/cargo-rpi" "${through_libc[@]}" build --profile test -p appliance --features rpi
fringed=$dir/build/aarch64-unknown-linux-gnu/debug/fringed

needed=$(readelf --wide --dynamic "$fringed" | sed -n 's/.*(NEEDED).*\[\(.*\)\]/\1/p')
echo "$fringed needs ${needed//$'\n'/ }"
[[ $needed == *libcamera.so.* ]] || failed "fringed is not linked with libcamera"
for known in "${newest[@]}"; do
    latest=$({ readelf --wide --version-info "$fringed" | grep -o "${known%_*}_[0-9.]*" && echo "$known"; } | sort -uV | tail -n 1)
    [[ $latest == "$known" ]] || failed "fringed needs $latest, above $known of Debian 12"
done

# All symbols are resolved at the start, also those of the modules that the pipelines load for their cameras.
"$dir/bin/cc" -shared -fPIC -O2 -o "$dir/udmabuf.so" tests/aarch64/udmabuf.c
modules=/usr/lib/aarch64-linux-gnu/libcamera/ipa
said=$("$dir/bin/qemu-rpi" -E LD_BIND_NOW=1 -E "LD_PRELOAD=$modules/ipa_rpi_vc4.so $modules/ipa_rpi_pisp.so" "$fringed" --version 2>&1)
[[ $said == "fringed "* && $said != *$'\n'* ]] || failed "fringed with the modules for the Raspberry Pis said: $said"
echo "$said"
# It must have the features for the configuration of the reference head.
"$dir/bin/qemu-rpi" "$fringed" config check docs/fringed.toml

# The tests of the camera back-end, which draw the images of one of the cameras.
export VM_HAL=1 VM_ROOT=$root
rm -rf "$root/replay" "$root/usr/share/libcamera/pipeline/virtual/virtual.yaml"
export QEMU_SET_ENV=LD_PRELOAD=$dir/udmabuf.so LIBCAMERA_LOG_LEVELS='*:ERROR'
log=$dir/rpi.log
# Skipped: tests that need the kernel's camera or start themselves again, and those that measure waiting times.
"$dir/bin/cargo-rpi" "${through_libc[@]}" test -p hal --features kms,gpio,libcamera --test libcamera -- \
    --test-threads 1 --nocapture --skip cameras_are_listed --skip a_real_driver --skip stopping_takes_back --skip without_any_camera \
    --skip a_wait_ends --skip copied:: --skip isolated:: | tee "$log"
grep -q '^test result: ok. [1-9]' "$log" || failed "the tests of the camera proved nothing"

# doctor CAMERA: runs `fringed doctor` with this camera.
doctor() {
    printf '[head]\nbackend = "rpi"\n[head.camera]\nid = "%s"\nluma = true\n' "$1" >"$dir/rpi.toml"
    "$dir/bin/qemu-rpi" "$fringed" --config "$dir/rpi.toml" --state "$dir/state" doctor 2>&1
}
# A camera that does not exist, and one that has no exposure control.
for camera in none Replay; do
    case $camera in
    none) wanted="set head.camera.id to one that is there: \`Bars\`, \`Replay\`" ;;
    *) wanted="setting the exposure, gain of the camera \`$camera\`" ;;
    esac
    had=0
    said=$(doctor "$camera") || had=$?
    [[ $had == 69 && $said == *"$wanted"* ]] || failed "a head with the camera $camera ended with $had and said: $said"
    echo "$said"
done
