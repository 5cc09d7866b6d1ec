#!/usr/bin/env bash
# Makes a small Debian with systemd in DIR/root, for the virtual machine of tests/vm.
#
#     tests/systemd/machine.sh DIR
#
# Debian's packages are unpacked, nothing is installed and no root is needed: apt resolves and downloads with lists of its own, for an
# empty system, from the machine's sources. A second call only looks whether it is complete. Ends with 69 (EX_UNAVAILABLE) and the reason
# where it cannot be had.
set -euo pipefail
shopt -s inherit_errexit nullglob
here=$(cd "$(dirname "${BASH_SOURCE[0]}")" && pwd)
mkdir -p "${1:?usage: machine.sh DIR}"
dir=$(cd "$1" && pwd)
source "$here/../apt.sh"

unavailable() {
    echo "no machine with systemd: $1" >&2
    exit 69
}

wanted=$(cat "$here"/{machine.sh,../apt.sh} | sha256sum)
[[ $(cat "$dir/complete" 2>/dev/null) == "$wanted" ]] && exit 0
[[ $(dpkg --print-architecture 2>/dev/null) == amd64 ]] || unavailable "this is no Debian on x86-64"
rm -rf "$dir"/{complete,apt,root}
apt_of_its_own "$dir/apt" 'Dir::State::status "/dev/null";'
# A source that does not answer need not be the one with these packages.
apt-get -qq update || true
apt-get -qq install --download-only --yes --no-install-recommends systemd udev mbpoll busybox-static ||
    unavailable "apt cannot download the packages (the reason stands above)"

# Its folders are merged, as those of a system are that was installed lately.
root=$dir/root
mkdir -p "$root"/{dev,etc,out,proc,root,run,sys,tmp,usr/{bin,sbin,lib,lib64},var}
for folder in bin sbin lib lib64; do ln -s "usr/$folder" "$root/$folder"; done
for package in "$dir"/apt/archives/*.deb; do
    dpkg --fsys-tarfile "$package" | tar -x -C "$root" --keep-directory-symlink --no-same-owner \
        --exclude='./usr/share/*/*' --exclude='./usr/lib/udev/hwdb*' --exclude='./usr/lib/x86_64-linux-gnu/gconv' --exclude='./dev/*'
done
rm -rf "$dir/apt"
# Where Debian's packages have no program of that name, busybox has.
busybox=$root/usr/bin/busybox
for applet in $("$busybox" --list); do
    [[ -e $root/usr/bin/$applet || -e $root/usr/sbin/$applet || $applet == init ]] || ln -s busybox "$root/usr/bin/$applet"
done
echo "$wanted" >"$dir/complete"
