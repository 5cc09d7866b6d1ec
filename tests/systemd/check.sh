#!/usr/bin/env bash
# Checks the files in systemd/, and the collector's unit in docs/fleet, without starting anything: systemd's tools read them, and rate the
# exposure of the services.
#
#     tests/systemd/check.sh
#
# Exits with 69 (EX_UNAVAILABLE) and the reason if there is no systemd (Debian package systemd).
set -euo pipefail
shopt -s inherit_errexit
cd "$(dirname "${BASH_SOURCE[0]}")/../.."
# The largest exposure level, in tenths. 2.2 is the best that a program can have which uses devices, a privileged port and a real-time
# priority.
most=22
# That of the collector, which needs none of these.
most_collector=10

for program in systemd-analyze systemd-sysusers systemd-tmpfiles; do
    command -v "$program" >/dev/null || {
        echo "no check of the service: there is no $program (Debian package systemd)" >&2
        exit 69
    }
done

# A root folder with systemd's units, the service, and a program for it to start.
root=$(mktemp -d)
trap 'rm -rf "$root"' EXIT
mkdir -p "$root"/{etc,var/lib,usr/bin,usr/lib/{systemd/system,sysusers.d,tmpfiles.d}}
units=/usr/lib/systemd/system
[[ -e $units/sysinit.target ]] || units=/lib/systemd/system
cp -r "$units/." "$root/usr/lib/systemd/system"
cp systemd/fringed.service docs/fleet/fringed-fleet-collect.service "$root/usr/lib/systemd/system"
cp systemd/fringed.sysusers "$root/usr/lib/sysusers.d/fringed.conf"
cp systemd/fringed.tmpfiles "$root/usr/lib/tmpfiles.d/fringed.conf"
install -m 755 /dev/null "$root/usr/bin/fringed"
install -m 755 /dev/null "$root/usr/bin/fringed-fleet"

failed=0
complain() {
    echo "$1" >&2
    failed=1
}

# Its output counts, not only its exit code: an unknown key is only a warning.
said=$(systemd-analyze verify --man=no --root="$root" fringed.service fringed-fleet-collect.service 2>&1) || complain "systemd does not take the units"
[[ -z $said ]] || complain "systemd-analyze verify: $said"

rated=$(systemd-analyze security --no-pager --offline=true --threshold=$most systemd/fringed.service) ||
    complain "the service may do more than $((most / 10)).$((most % 10)) allows: systemd-analyze security --offline=true systemd/fringed.service"
tail -n 1 <<<"$rated"
rated=$(systemd-analyze security --no-pager --offline=true --threshold=$most_collector docs/fleet/fringed-fleet-collect.service) ||
    complain "the collector may do more than $((most_collector / 10)).$((most_collector % 10)) allows"
tail -n 1 <<<"$rated"

# The user, its groups and its folders, created in that root folder.
systemd-sysusers --root="$root" fringed.conf >"$root/said" 2>&1 || complain "systemd does not take the users"
grep -q '^fringed:[^:]*:[0-9]*:[0-9]*:[^:]*:/var/lib/fringed:[^:]*nologin$' "$root/etc/passwd" || complain "there is no user fringed"
for group in gpio i2c render video; do
    grep -q "^$group:.*:fringed$" "$root/etc/group" || complain "fringed is not in the group $group"
done
if [[ $(id -u) == 0 ]]; then
    systemd-tmpfiles --root="$root" --create fringed.conf || complain "systemd does not take the folders"
    [[ $(stat -c %a "$root/var/lib/fringed") == 750 ]] || complain "the state folder is open to others"
fi

# Each rule matches a kind of device and sets who may use it; one also names it.
while read -r line; do
    [[ $line =~ ^SUBSYSTEM==\"[a-z0-9_-]+\",\ (KERNEL==\"[a-zA-Z0-9*|,-]+\",\ )?GROUP=\"(gpio|i2c|render|video)\",\ MODE=\"0660\"(,\ SYMLINK\+=\"[a-z_/]+\",\ OPTIONS\+=\"link_priority=-[0-9]+\")?$ ]] ||
        complain "no rule of udev as expected: $line"
done < <(grep -v '^#' systemd/60-fringed.rules)
exit "$failed"
