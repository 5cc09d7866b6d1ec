#!/usr/bin/env bash
# Signs a bundle with keys of yocto/keys.sh, and simulates two starts of a device with RAUC itself, this layer's system.conf
# and its script for the slots: an activated slot is tried, and kept after it was marked good.
#
#     tests/yocto/rauc.sh DIR
#
# RAUC and a D-Bus daemon come from Debian's packages, unpacked into DIR; no root is needed and nothing is installed.
# Exits with 69 (EX_UNAVAILABLE) and the reason if they are not available.
set -euo pipefail
mkdir -p "${1:?usage: rauc.sh DIR}"
dir=$(cd "$1" && pwd)
here=$(cd "$(dirname "${BASH_SOURCE[0]}")" && pwd)
yocto=$here/../../yocto
layer=$yocto/meta-fringed

unavailable() {
    echo "updates cannot be played: $1" >&2
    exit 69
}

if [[ ! -f $dir/complete ]]; then
    command -v apt-get >/dev/null || unavailable "this is no Debian"
    (cd "$dir" && apt-get download -qq -o APT::Sandbox::User=root rauc libjson-glib-1.0-0 libfdisk1 dbus-daemon liblzo2-2 squashfs-tools) ||
        unavailable "apt cannot download the packages (the reason stands above)"
    for package in "$dir"/*.deb; do dpkg -x "$package" "$dir/root"; done
    rm "$dir"/*.deb
    touch "$dir/complete"
fi
export PATH=$dir/root/usr/bin:$PATH LD_LIBRARY_PATH=$dir/root/usr/lib/x86_64-linux-gnu:$dir/root/lib/x86_64-linux-gnu DBUS_SYSTEM_BUS_ADDRESS=unix:path=$dir/bus
rauc --version >/dev/null || unavailable "RAUC does not run here"

stop() { for one in "${service:-}" "${bus:-}"; do [[ -z $one ]] || kill "$one" 2>/dev/null || true; done; }
trap stop EXIT

# A device: partitions as files, the firmware's choice, and a mount that does nothing.
device=$dir/device
keys=$dir/keys
rm -rf "$device" "$keys" "$dir/bus"
mkdir -p "$device"/{boot/select,run/systemd,proc,data,bin}
"$yocto/keys.sh" "$keys" >/dev/null 2>&1
cp "$layer/recipes-fringed/boot/files/autoboot.txt" "$device/boot/select"
for name in root-a root-b boot-a boot-b; do truncate -s 1M "$device/$name"; done
printf '#!/bin/sh\n' >"$device/bin/mount"
# shellcheck disable=SC2016
printf '#!/bin/sh\nFRINGED_ROOT=%s PATH=%s:$PATH exec sh %s "$@"\n' \
    "$device" "$device/bin" "$layer/recipes-fringed/slots/files/boot-slot" >"$device/boot-slot"
chmod +x "$device/bin/mount" "$device/boot-slot"
sed "s#@MACHINE@#raspberrypi5#; s#/dev/disk/by-partlabel/#$device/#; s#/data/rauc#$device/data#; s#/usr/lib/rauc/boot-slot#$device/boot-slot#
    s#/usr/lib/rauc/fringed-ca#$keys/fringed-ca#" "$layer/recipes-core/rauc/files/system.conf" >"$device/system.conf"

is() {
    if [[ $2 != "$3" ]]; then
        echo "rauc: $1: $2 instead of $3" >&2
        cat "$dir/log" >&2 || true
        exit 1
    fi
}

# A bundle like that of fringed-bundle.
mkdir "$device/bundle"
for name in boot rootfs; do head -c 100000 /dev/urandom >"$device/bundle/$name.img"; done
cat >"$device/bundle/manifest.raucm" <<END
[update]
compatible=fringed-raspberrypi5
version=1

[bundle]
format=verity

[image.boot]
filename=boot.img

[image.rootfs]
filename=rootfs.img
END
rauc bundle --cert "$keys/signing.cert.pem" --key "$keys/signing.key.pem" --keyring "$keys/fringed-ca.cert.pem" \
    "$device/bundle" "$device/update.raucb" >"$dir/log" 2>&1 || is "a bundle is signed" no yes
rauc info --keyring "$keys/fringed-ca.cert.pem" "$device/update.raucb" >"$dir/log" 2>&1 || is "a device trusts it" no yes
"$yocto/keys.sh" "$keys/others" >/dev/null 2>&1
if rauc info --keyring "$keys/others/fringed-ca.cert.pem" "$device/update.raucb" >"$dir/log" 2>&1; then
    is "a device with other keys trusts it" yes no
fi

cat >"$dir/bus.conf" <<END
<!DOCTYPE busconfig PUBLIC "-//freedesktop//DTD D-Bus Bus Configuration 1.0//EN"
 "http://www.freedesktop.org/standards/dbus/1.0/busconfig.dtd">
<busconfig>
  <type>session</type>
  <listen>unix:path=$dir/bus</listen>
  <auth>EXTERNAL</auth>
  <policy context="default">
    <allow send_destination="*" eavesdrop="true"/>
    <allow eavesdrop="true"/>
    <allow own="*"/>
  </policy>
</busconfig>
END
dbus-daemon --config-file="$dir/bus.conf" --nofork 2>/dev/null &
bus=$!

# boots SLOT: starts RAUC's service as in that slot.
boots() {
    rm -f "$device/run/systemd/reboot-param"
    echo "root=PARTLABEL=root rauc.slot=$1 ro" >"$device/proc/cmdline"
    if [[ -n ${service:-} ]]; then
        kill "$service"
        wait "$service" || true
    fi
    rauc --conf="$device/system.conf" --override-boot-slot="$1" service >"$dir/log" 2>&1 &
    service=$!
    local tries=0
    until timeout 5 rauc --conf="$device/system.conf" status >>"$dir/log" 2>&1; do
        tries=$((tries + 1))
        if [[ $tries -gt 10 ]]; then is "RAUC's service answers" no yes; fi
        sleep 0.5
    done
}
state() { timeout 20 rauc --conf="$device/system.conf" status --output-format=shell 2>/dev/null | sed -n "s/^$1='\(.*\)'$/\1/p"; }
starts() { sed -n '/^\[all\]/,/^\[/s/^boot_partition=//p' "$device/boot/select/autoboot.txt"; }

boots A
is "the slot that runs" "$(state RAUC_SYSTEM_BOOTED_BOOTNAME)" A
is "its primary" "$(state RAUC_BOOT_PRIMARY)" rootfs.0
timeout 20 rauc --conf="$device/system.conf" status mark-active other >>"$dir/log" 2>&1
is "the slot that starts next" "$(state RAUC_BOOT_PRIMARY)" rootfs.1
is "the restart's argument" "$(cat "$device/run/systemd/reboot-param")" "0 tryboot"
is "the usual slot during a trial" "$(starts)" 2
boots B
is "the usual slot before the trial ended well" "$(state RAUC_BOOT_PRIMARY)" rootfs.0
timeout 20 rauc --conf="$device/system.conf" status mark-good booted >>"$dir/log" 2>&1
is "the usual slot after it" "$(state RAUC_BOOT_PRIMARY)" rootfs.1
is "the firmware's" "$(starts)" 3
timeout 20 rauc --conf="$device/system.conf" status mark-bad booted >>"$dir/log" 2>&1
is "the usual slot after the good one turned bad" "$(state RAUC_BOOT_PRIMARY)" rootfs.0
echo "rauc: a bundle that only its own keys fit, a trial, a way back"
