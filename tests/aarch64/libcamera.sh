#!/usr/bin/env bash
# Builds libcamera for aarch64, with the pipelines of the Raspberry Pis and the virtual one, and a cargo that builds against it.
#
#     tests/aarch64/libcamera.sh DIR      DIR as toolchain.sh made it; then, for example:
#     DIR/bin/cargo-rpi build -p appliance --features rpi
#
# DIR/libcamera/root is what libcamera needs of a Debian 13 for arm64, the system below Raspberry Pi OS, and libcamera itself, laid out as
# installed: DIR/bin/qemu-rpi runs programs in it. The source is Debian's package, of the version and the checksum in tests/vm/pins.
# What its build needs is installed where this runs as root. DIR keeps it: a second call only looks whether it is there. Ends with
# 69 (EX_UNAVAILABLE) and the reason where it cannot be had.
set -euo pipefail
shopt -s inherit_errexit
here=$(cd "$(dirname "${BASH_SOURCE[0]}")" && pwd)
source "$here/../vm/pins"
version=${libcamera%-*}
suite=trixie
tools=(meson ninja-build pkg-config libclang-dev openssl python3-jinja2 python3-ply python3-yaml)
libraries=(libpisp-dev libssl-dev libudev-dev libyaml-dev libyuv-dev)

toolchain=$(cd "${1:?usage: libcamera.sh DIR}" && pwd)
dir=$toolchain/libcamera
unavailable() {
    echo "no libcamera $version for aarch64: $1" >&2
    exit 69
}
[[ -f $toolchain/complete ]] || { echo "$toolchain holds no toolchain: tests/aarch64/toolchain.sh $toolchain" >&2; exit 64; }
wanted="$toolchain $({ cat "${BASH_SOURCE[0]}" && echo "$libcamera $libcamera_checksum"; } | sha256sum)"
[[ $(cat "$dir/complete" 2>/dev/null) == "$wanted" ]] && exit 0
rm -rf "$dir"
mkdir -p "$dir"/{apt/lists/partial,apt/archives/partial,source,root/usr/lib}

if ! dpkg-query --show "${tools[@]}" >/dev/null 2>&1; then
    [[ $(id -u) -eq 0 ]] || unavailable "install ${tools[*]}"
    { apt-get install -y -qq --no-install-recommends "${tools[@]}" ||
        { apt-get update -qq && apt-get install -y -qq --no-install-recommends "${tools[@]}"; }; } >&2 ||
        unavailable "apt cannot install ${tools[*]} (the reason stands above)"
fi

# Where this machine's own packages come from, Debian's other suites are as well.
archive=$(apt-get indextargets --format '$(SITE) $(RELEASE) $(CREATED_BY)' |
    awk '$3 == "Packages" && $2 !~ /security/ { print $1; exit }')
[[ -n $archive ]] || unavailable "apt knows of no Debian archive"
# A machine of its own for apt: it has another processor, and nothing is installed on it.
: >"$dir/apt/status"
cat >"$dir/apt/apt.conf" <<END
APT::Architecture "arm64";
APT::Architectures { "arm64"; };
APT::Sandbox::User "$(id -un)";
APT::Update::Post-Invoke { "true"; };
Dir::Etc::SourceList "$dir/apt/sources.list";
Dir::Etc::SourceParts "/dev/null";
Dir::State::Lists "$dir/apt/lists";
Dir::State::status "$dir/apt/status";
Dir::Cache::Archives "$dir/apt/archives";
Dir::Cache::pkgcache "";
Dir::Cache::srcpkgcache "";
Debug::NoLocking "true";
END
signed='[signed-by=/usr/share/keyrings/debian-archive-keyring.gpg]'
echo "deb $signed $archive $suite main
deb-src $signed $archive $libcamera_suite main" >"$dir/apt/sources.list"
export APT_CONFIG=$dir/apt/apt.conf
apt-get update -qq || unavailable "apt cannot read Debian $suite and the sources of $libcamera_suite (the reason stands above)"
apt-get install -qq --download-only --yes --no-install-recommends "${libraries[@]}" ||
    unavailable "apt cannot download ${libraries[*]} of Debian $suite (the reason stands above)"
(cd "$dir/apt" && apt-get source -qq --download-only "libcamera=$libcamera") ||
    unavailable "Debian $libcamera_suite has left $libcamera behind: name another one, and its checksum, in tests/vm/pins"
unset APT_CONFIG
source=$dir/apt/libcamera_$version.orig.tar.gz
echo "$libcamera_checksum  $source" | sha256sum --check --quiet || unavailable "the source is not the one that was pinned"
tar -xzf "$source" -C "$dir/source" --strip-components=1
root=$dir/root
ln -s usr/lib "$root/lib"
for package in "$dir"/apt/archives/*.deb; do
    dpkg -x "$package" "$root"
done

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

# Debian's own Python has the modules; another one may stand before it in the path.
export PATH=/usr/bin:$PATH
features=()
for feature in apps-output-dng cam documentation gstreamer lc-compliance libdw libunwind pycamera qcam rpi-awb-nn softisp-gpu tracing v4l2; do
    features+=("-D$feature=disabled")
done
{
    meson setup "$dir/build" "$dir/source" --cross-file "$dir/cross" --prefix=/usr --sysconfdir=/etc --libdir=lib/aarch64-linux-gnu \
        --buildtype=release --wrap-mode=nodownload \
        -Dpipelines=rpi/vc4,rpi/pisp,virtual -Dipas=rpi/vc4,rpi/pisp -Dudev=enabled -Dtest=false "${features[@]}" &&
        ninja -C "$dir/build" &&
        DESTDIR=$root meson install -C "$dir/build" --no-rebuild
} >"$dir/build.log" 2>&1 || {
    tail -n 40 "$dir/build.log" >&2
    unavailable "its build failed (the end of $dir/build.log stands above)"
}
rm -rf "$dir"/{apt,source,build}

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
