#!/usr/bin/env bash
# Builds libcamera for aarch64, with the pipelines of the Raspberry Pis and the virtual one, and a cargo that builds against it.
#
#     tests/aarch64/libcamera.sh DIR      DIR as toolchain.sh made it; then, for example:
#     DIR/bin/cargo-rpi build -p appliance --features rpi
#
# DIR/libcamera/root is what libcamera needs of a Debian 13 for arm64, the system below Raspberry Pi OS, and libcamera itself, laid out as
# installed: DIR/bin/qemu-rpi runs programs in it. What its build needs is installed as tests/apt.sh says (CI=true). DIR keeps it: a second call
# only looks whether it is there. Ends with 69 (EX_UNAVAILABLE) and the reason where it cannot be had.
set -euo pipefail
shopt -s inherit_errexit
here=$(cd "$(dirname "${BASH_SOURCE[0]}")" && pwd)
source "$here/../libcamera.sh"
suite=trixie
libraries=(libpisp-dev libssl-dev libudev-dev libyaml-dev libyuv-dev)

toolchain=$(cd "${1:?usage: libcamera.sh DIR}" && pwd)
dir=$toolchain/libcamera
unavailable() {
    echo "no libcamera $libcamera_version for aarch64: $1" >&2
    exit 69
}
[[ -f $toolchain/complete ]] || { echo "$toolchain holds no toolchain: tests/aarch64/toolchain.sh $toolchain" >&2; exit 64; }
wanted="$toolchain $(cat "$here"/{libcamera.sh,../libcamera.sh,../apt.sh,../vm/pins} | sha256sum)"
[[ $(cat "$dir/complete" 2>/dev/null) == "$wanted" ]] && exit 0
rm -rf "$dir"
mkdir -p "$dir/root/usr/lib"

libcamera_source "$dir"
# A machine of its own for apt: it has another processor, and nothing is installed on it.
apt_of_its_own "$dir/apt" 'APT::Architecture "arm64";' 'APT::Architectures { "arm64"; };' 'Dir::State::status "/dev/null";'
sources_of_its_own "$dir/apt" "deb $suite" || unavailable "its libraries are Debian's"
apt-get update -qq || unavailable "apt cannot read Debian $suite (the reason stands above)"
apt-get install -qq --download-only --yes --no-install-recommends "${libraries[@]}" ||
    unavailable "apt cannot download ${libraries[*]} of Debian $suite (the reason stands above)"
unset APT_CONFIG
root=$dir/root
ln -s usr/lib "$root/lib"
for package in "$dir"/apt/archives/*.deb; do
    dpkg -x "$package" "$root"
done
rm -rf "$dir/apt"

# The compiler's own C library is older than the root's, so what is built here runs on older systems too. Only the loader knows all that
# the root's libraries need.
library=$root/usr/lib/aarch64-linux-gnu
linking="-L$library -Wl,-rpath-link,$library -Wl,--allow-shlib-undefined"
cat >"$dir/cross" <<END
[binaries]
c = '$toolchain/bin/cc'
cpp = '$toolchain/bin/c++'
ar = '$toolchain/bin/ar'
pkgconfig = 'pkg-config'
[properties]
sys_root = '$root'
pkg_config_libdir = '$library/pkgconfig:$root/usr/share/pkgconfig'
[built-in options]
c_args = ['-isystem', '$root/usr/include', '-isystem', '$root/usr/include/aarch64-linux-gnu']
cpp_args = ['-isystem', '$root/usr/include', '-isystem', '$root/usr/include/aarch64-linux-gnu']
c_link_args = ['${linking// /\', \'}']
cpp_link_args = ['${linking// /\', \'}']
[host_machine]
system = 'linux'
cpu_family = 'aarch64'
cpu = 'aarch64'
endian = 'little'
END

libcamera_build "$dir" lib/aarch64-linux-gnu --cross-file "$dir/cross" -Dpipelines=rpi/vc4,rpi/pisp,virtual -Dipas=rpi/vc4,rpi/pisp

# program NAME COMMAND…: writes a program of the toolchain; its lines so far come from the standard input.
program() {
    local name=$1
    shift
    { echo '#!/bin/sh' && cat && echo "exec $* \"\$@\""; } >"$toolchain/bin/$name"
    chmod +x "$toolchain/bin/$name"
}
program cc-rpi "$toolchain/bin/cc" "$linking" </dev/null
program qemu-rpi "$toolchain/bin/qemu-aarch64" -L "$root" </dev/null
# What reads header files in place of the compiler is to see the compiler's.
headers=$toolchain/root/usr/aarch64-linux-gnu/include
reads="-nostdlibinc -nostdinc++$(printf ' -isystem %s' "$headers"/c++/* "$headers"/c++/*/aarch64-linux-gnu "$headers")"
target=aarch64-unknown-linux-gnu
program cargo-rpi "$toolchain/bin/cargo" --config "target.$target.linker=\\\"$toolchain/bin/cc-rpi\\\"" \
    --config "target.$target.runner=\\\"$toolchain/bin/qemu-rpi\\\"" <<END
export CC_${target//-/_}='$toolchain/bin/cc' CXX_${target//-/_}='$toolchain/bin/c++' AR_${target//-/_}='$toolchain/bin/ar'
export PKG_CONFIG_SYSROOT_DIR_${target//-/_}='$root' PKG_CONFIG_LIBDIR_${target//-/_}='$library/pkgconfig'
export BINDGEN_EXTRA_CLANG_ARGS_${target//-/_}='$reads'
END
echo "$wanted" >"$dir/complete"
