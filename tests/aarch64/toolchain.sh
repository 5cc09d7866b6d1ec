#!/usr/bin/env bash
# Unpacks into DIR what builds and runs programs for aarch64 on an x86-64 Debian: Rust and its library, a linker, qemu.
#
#     tests/aarch64/toolchain.sh DIR      then, for example: DIR/bin/cargo test -p algo
#
# Nothing is installed and nothing of the machine changes, so no root is needed: apt resolves and downloads with lists of
# its own, from the machine's sources; what the machine already has is used from there. DIR keeps everything: a second
# call only looks whether it is complete. Ends with 69 (EX_UNAVAILABLE) and the reason where it cannot be had.
set -euo pipefail
here=$(cd "$(dirname "${BASH_SOURCE[0]}")" && pwd)
source "$here/../apt.sh"
mkdir -p "${1:?usage: toolchain.sh DIR}"
dir=$(cd "$1" && pwd)

unavailable() {
    echo "no toolchain for aarch64: $1" >&2
    exit 69
}

# The folder may have been copied from elsewhere, and its files name their place; or an older script has made it.
made="$dir $(cat "$here"/{toolchain.sh,../apt.sh} | cksum)"
[[ $(cat "$dir/complete" 2>/dev/null) == "$made" ]] && exit 0
[[ $(dpkg --print-architecture 2>/dev/null) == amd64 ]] || unavailable "this is no Debian on x86-64"
[[ $dir != *[[:space:]]* ]] || unavailable "the linker's scripts cannot name a folder with a space: $dir"
if [[ ! -f $dir/.toolchain && -n $(ls -A "$dir") ]]; then
    echo "$dir holds files that are not from this script: name a folder of its own" >&2
    exit 64
fi
rm -rf "$dir"
mkdir -p "$dir"/{bin,root}
touch "$dir/.toolchain"

apt_of_its_own "$dir/apt" 'APT::Architectures { "amd64"; "arm64"; };'
# A source that does not answer need not be the one with these packages.
apt-get -qq update || true
# Debian's newest Rust; apt finds the names that carry its version. The dynamic qemu, because only it takes plugins.
apt-get -qq install --download-only --yes --no-install-recommends g++-aarch64-linux-gnu libc6-dev-arm64-cross qemu-user rustc-web ||
    unavailable "apt cannot download the packages (the reason stands above)"
# The target's library alone: its dependencies are the target's compiler.
(cd "$dir/apt/archives" && apt-get -qq download libstd-rust-web-dev:arm64) || unavailable "apt cannot download Rust's library"
# A C library newer than the machine's would meet the machine's loader.
rm -f "$dir"/apt/archives/libc6_*
for package in "$dir"/apt/archives/*.deb; do
    dpkg -x "$package" "$dir/root"
done
rm -rf "$dir/apt"
# The linker's script of the C library names its files by their installed place.
installed=/usr/aarch64-linux-gnu/lib
[[ ! -f $dir/root$installed/libc.so ]] || sed -i "s#$installed/#$dir/root$installed/#g" "$dir/root$installed/libc.so"

# wrapper NAME COMMAND…: runs COMMAND with the unpacked programs and libraries in front of the machine's.
wrapper() {
    local name=$1
    shift
    cat >"$dir/bin/$name" <<END
#!/bin/sh
export PATH='$dir/root/usr/bin':"\$PATH" LD_LIBRARY_PATH='$dir/root/usr/lib/x86_64-linux-gnu'
exec $* "\$@"
END
    chmod +x "$dir/bin/$name"
}
wrapper rustc "$dir/root/usr/bin/rustc"
wrapper rustdoc "$dir/root/usr/bin/rustdoc"
wrapper cc aarch64-linux-gnu-gcc
wrapper c++ aarch64-linux-gnu-g++
wrapper ar aarch64-linux-gnu-ar
libc=$(realpath "$("$dir/bin/cc" -print-file-name=libc.so.6)") || unavailable "the C compiler does not run"
wrapper qemu-aarch64 qemu-aarch64 -U LD_LIBRARY_PATH -L "${libc%/lib/*}"
wrapper qemu-x86_64 qemu-x86_64 -U LD_LIBRARY_PATH -cpu max

# The machine's cargo, with everything above.
cat >"$dir/bin/cargo" <<END
#!/bin/sh
export RUSTC='$dir/bin/rustc' RUSTDOC='$dir/bin/rustdoc'
export CARGO_BUILD_TARGET=aarch64-unknown-linux-gnu CARGO_TARGET_DIR='$dir/build'
export CARGO_TARGET_AARCH64_UNKNOWN_LINUX_GNU_LINKER='$dir/bin/cc'
export CARGO_TARGET_AARCH64_UNKNOWN_LINUX_GNU_RUNNER='$dir/bin/qemu-aarch64'
exec cargo "\$@"
END
chmod +x "$dir/bin/cargo"

# The proof that all of it works together.
echo 'fn main() { assert!(cfg!(target_arch = "aarch64")); }' >"$dir/proof.rs"
"$dir/bin/rustc" --target aarch64-unknown-linux-gnu -C linker="$dir/bin/cc" -o "$dir/proof" "$dir/proof.rs" &&
    "$dir/bin/qemu-aarch64" "$dir/proof" || unavailable "what was unpacked does not work on this machine"
rm "$dir/proof" "$dir/proof.rs"
echo "$made" >"$dir/complete"
