#!/usr/bin/env bash
# Builds libcamera with its virtual and vimc pipelines into DIR; what Debian 12 packages is too old for the crate.
#
#     tests/vm/libcamera.sh DIR
#     export PKG_CONFIG_PATH=DIR/root/usr/lib/x86_64-linux-gnu/pkgconfig     to build against it
#     export LD_LIBRARY_PATH=DIR/root/usr/lib/x86_64-linux-gnu               to run with it
#
# DIR/root is laid out as it lies in the virtual machine's root. What its build needs is installed as tests/apt.sh says (CI=true). DIR keeps it:
# a second call only looks whether it is there. Ends with 69 (EX_UNAVAILABLE) and the reason where it cannot be had.
set -euo pipefail

here=$(cd "$(dirname "${BASH_SOURCE[0]}")" && pwd)
source "$here/../libcamera.sh"
libraries=(libssl-dev libudev-dev libyaml-dev libyuv-dev)

mkdir -p "${1:?usage: libcamera.sh DIR}"
dir=$(cd "$1" && pwd)
wanted=$(cat "$here"/{libcamera.sh,../libcamera.sh,../apt.sh,pins} | sha256sum)

unavailable() {
    echo "no libcamera $libcamera_version: $1" >&2
    exit 69
}

[[ $(cat "$dir/complete" 2>/dev/null) == "$wanted" ]] && exit 0
if [[ ! -f $dir/.libcamera && -n $(ls -A "$dir") ]]; then
    echo "$dir holds files that are not from this script: name a folder of its own" >&2
    exit 64
fi
[[ $(dpkg --print-architecture 2>/dev/null) == amd64 ]] || unavailable "this is no Debian on x86-64"
rm -rf "$dir"
mkdir "$dir"
touch "$dir/.libcamera"

installed "${libraries[@]}" || unavailable "install ${libraries[*]}"
libcamera_source "$dir"
libcamera_build "$dir" lib/x86_64-linux-gnu -Dpkgconfig.relocatable=true -Dpipelines=virtual,vimc -Dipas=vimc
echo "$wanted" >"$dir/complete"
