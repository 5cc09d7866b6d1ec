#!/usr/bin/env bash
# Installs a package in a clean Debian, upgrades it to a newer one, removes and purges it, and checks the files after each.
#
#     tests/package/install.sh DIR PACKAGE.deb      DIR as made by root.sh
#
# No service manager runs there, as when a system image is built; the links to units show what it would start.
set -euo pipefail
shopt -s inherit_errexit
usage='usage: install.sh DIR PACKAGE.deb'
dir=$(cd "${1:?$usage}" && pwd)
root=$dir/root
link=$root/etc/systemd/system/multi-user.target.wants/fringed.service

broken() {
    echo "FAILED: $*" >&2
    exit 1
}
# Runs a command in the clean Debian; its output is shown only if it fails.
inside() {
    chroot "$root" /usr/bin/env -i PATH=/usr/sbin:/usr/bin:/sbin:/bin DEBIAN_FRONTEND=noninteractive "$@" >"$dir/said" 2>&1 || {
        cat "$dir/said" >&2
        broken "$*"
    }
}
# shellcheck disable=SC2317 # called by the trap
finish() {
    umount "$root/proc" 2>/dev/null || true
    rm -rf --one-file-system "$root"
}
trap finish EXIT

rm -rf --one-file-system "$root"
mkdir "$root"
tar --extract --file "$dir/root.tar" --directory "$root"
mount -t proc proc "$root/proc"
cp "${2:?$usage}" "$root/old.deb"
# A newer package with a different default configuration.
newer=$(dpkg-deb --field "$root/old.deb" Version)+1
dpkg-deb --raw-extract "$root/old.deb" "$root/new"
sed -i "s/^Version: .*/Version: $newer/" "$root/new/DEBIAN/control"
echo '# a newer default' >>"$root/new/etc/fringed/fringed.toml"
dpkg-deb --build --root-owner-group "$root/new" "$root/new.deb" >/dev/null
rm -r "$root/new"

echo "installed:"
inside dpkg --install /old.deb
inside systemd-analyze verify fringed.service
[[ -L $link ]] || broken "the service is not enabled"
inside id fringed
groups=$(cat "$dir/said")
for group in gpio render video; do
    [[ $groups == *"($group)"* ]] || broken "the user fringed is not in $group: $groups"
done
[[ $(stat --format '%U %a' "$root/etc/fringed/fringed.toml") == 'root 644' ]] || broken "the configuration is not root's"
inside runuser -u fringed -- test -w /var/lib/fringed
inside fringed --version
[[ $(cat "$dir/said") =~ ^fringed\ [0-9.]+ ]] || broken "it calls itself $(cat "$dir/said")"
sed 's/^/  /' "$dir/said"
inside fringed config check /etc/fringed/fringed.toml
# As the service would: teach the first recipe, measure parts, and make a secret that no other user can read.
inside runuser -u fringed -- fringed demo --exit --config /etc/fringed/fringed.toml --modbus 127.0.0.1:0 --http 127.0.0.1:0
[[ -s $root/var/lib/fringed/recipes/0001.recipe ]] || broken "the demonstration taught no recipe"

echo "upgraded, with a configuration of the user's:"
before=$(cd "$root/var/lib/fringed" && find . -type f -exec sha256sum {} + | sort)
sed -i 's/^listen = "0.0.0.0:80"/listen = "0.0.0.0:8080"/' "$root/etc/fringed/fringed.toml"
edited=$(sha256sum <"$root/etc/fringed/fringed.toml")
# dpkg asks which configuration to use; the default answer keeps the user's.
inside dpkg --install /new.deb <<<''
inside dpkg --status fringed
grep -q "^Version: $newer$" "$dir/said" || broken "the newer one is not there: $(cat "$dir/said")"
[[ $(cd "$root/var/lib/fringed" && find . -type f -exec sha256sum {} + | sort) == "$before" ]] || broken "the upgrade touched the state"
[[ $(sha256sum <"$root/etc/fringed/fringed.toml") == "$edited" ]] || broken "the upgrade touched the configuration"
[[ -f $root/etc/fringed/fringed.toml.dpkg-dist ]] || broken "the newer default is not beside the user's configuration"
[[ -L $link ]] || broken "the service is no longer enabled"
# A service that was disabled stays disabled after an upgrade.
inside systemctl disable fringed
inside dpkg --install --force-confold /new.deb
[[ ! -e $link && ! -L $link ]] || broken "an upgrade enables the service again"
inside systemctl enable fringed

echo "removed:"
inside dpkg --remove fringed
[[ ! -e $root/usr/bin/fringed ]] || broken "the program is still there"
[[ $(cd "$root/var/lib/fringed" && find . -type f -exec sha256sum {} + | sort) == "$before" ]] || broken "the removal touched the state"
[[ $(sha256sum <"$root/etc/fringed/fringed.toml") == "$edited" ]] || broken "the removal touched the configuration"
left=$(find "$root/usr" "$root/etc" -path '*fringed*' -not -path "$root/etc/fringed*" -not -path '*/multi-user.target.wants/*')
[[ -z $left ]] || broken "the removal leaves $left"

echo "purged:"
inside dpkg --purge fringed
left=$(find "$root/usr" "$root/etc" "$root/var/lib" -path '*fringed*' -not -path "*/dpkg/*")
[[ -z $left ]] || broken "the purge leaves $left"
echo "  nothing of it is left but its user"
