#!/usr/bin/env bash
# Makes a minimal Debian with systemd's programs in DIR/root.tar, from the machine's package sources.
#
#     tests/package/root.sh DIR
#
# Exits with 69 (EX_UNAVAILABLE) and the reason if that is not possible: it needs root, mmdebstrap and a Debian.
set -euo pipefail
mkdir -p "${1:?usage: root.sh DIR}"
dir=$(cd "$1" && pwd)

unavailable() {
    echo "no clean Debian: $1" >&2
    exit 69
}

[[ -f $dir/root.tar ]] && exit 0
[[ $(id -u) -eq 0 ]] || unavailable "a root of its own needs root"
command -v mmdebstrap >/dev/null || unavailable "mmdebstrap is not installed"
# shellcheck source=/dev/null
. /etc/os-release
[[ $ID == debian ]] || unavailable "this is no Debian"
mmdebstrap --quiet --mode=root --format=tar --variant=minbase --include=systemd "$VERSION_CODENAME" "$dir/root.tar.part" ||
    unavailable "mmdebstrap cannot make it (the reason stands above)"
mv "$dir/root.tar.part" "$dir/root.tar"
