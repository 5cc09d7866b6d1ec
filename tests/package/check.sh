#!/usr/bin/env bash
# Checks the content of the packages fringed, fringed-lab and fringed-fleet: the size of the binary, the places of the files, the user's configuration,
# and the dependencies.
#
#     tests/package/check.sh PACKAGE.deb            built with the profile dist
#     tests/package/check.sh PACKAGE.deb quick      built otherwise: the size of its binary is not checked
set -euo pipefail
shopt -s inherit_errexit
package=$(realpath -- "${1:?usage: check.sh PACKAGE.deb [quick]}")
cd "$(dirname "${BASH_SOURCE[0]}")/../.."
largest=$((12 << 20)) # bytes of the stripped binary, without libcamera's own

work=$(mktemp -d)
trap 'rm -rf "$work" "$work-lab" "$work-fleet"' EXIT
failed=0
broken() {
    echo "FAILED: $*" >&2
    failed=1
}

lab=${package/fringed_/fringed-lab_}
dpkg-deb --raw-extract "$package" "$work"
dpkg-deb --raw-extract "$lab" "$work-lab"
fleet=${package/fringed_/fringed-fleet_}
dpkg-deb --raw-extract "$fleet" "$work-fleet"
for file in usr/bin/fringed usr/lib/systemd/system/fringed.service usr/lib/sysusers.d/fringed.conf usr/lib/tmpfiles.d/fringed.conf \
    usr/lib/udev/rules.d/60-fringed.rules etc/security/limits.d/fringed.conf usr/share/{bash-completion/completions/fringed,zsh/vendor-completions/_fringed,fish/vendor_completions.d/fringed.fish} \
    usr/share/man/man1/fringed{,-serve,-recipe-list}.1.gz usr/share/doc/fringed/{README.md,licences.txt,copyright,examples/{fringed.toml,fringed.st,verdict.st,plc.py,handshakes.py}}; do
    [[ -s $work/$file ]] || broken "there is no $file"
done
for file in fringed.service 60-fringed.rules; do
    cmp -s "systemd/$file" "$(find "$work/usr" -name "$file")" || broken "$file is not the one of this source"
done
# Other files than those of the program and its documentation must not be in the package.
stray=$(cd "$work" && find . -type f -not -path './DEBIAN/*' -not -path './usr/bin/fringed' -not -path './usr/share/doc/fringed/*' \
    -not -path './usr/share/man/man1/fringed*.1.gz' -not -path './usr/lib/s*' -not -path './usr/lib/tmpfiles.d/*' -not -path './usr/lib/udev/*' -not -path './usr/share/*completions*/*fringed*' -not -path ./etc/fringed/fringed.toml -not -path ./etc/security/limits.d/fringed.conf)
[[ -z $stray ]] || broken "nobody asked for $stray"

# The completion of each shell has the commands, and the options of one command.
for completion in bash-completion/completions/fringed zsh/vendor-completions/_fringed fish/vendor_completions.d/fringed.fish; do
    for word in serve doctor scenario; do
        grep -q -- "$word" "$work/usr/share/$completion" || broken "$completion does not know $word"
    done
done
bash -n "$work/usr/share/bash-completion/completions/fringed" || broken "the completion for bash is no script"
completed=$(bash -c 'source "$1"; COMP_WORDS=(fringed doctor --sc); COMP_CWORD=2; COMP_LINE="fringed doctor --sc"; COMP_POINT=19
    _fringed fringed --sc doctor; echo "${COMPREPLY[*]}"' - "$work/usr/share/bash-completion/completions/fringed")
[[ $completed == --scenario ]] || broken "bash completes doctor --sc to $completed"

[[ $(sort "$work/DEBIAN/conffiles" | xargs) == "/etc/fringed/fringed.toml /etc/security/limits.d/fringed.conf" ]] || broken "the configuration is not a file of the user's"
case $(dpkg-deb --field "$package" Architecture) in
amd64) configuration=debian/fringed.toml ;;
arm64) configuration=docs/fringed.toml ;;
esac
cmp -s "$configuration" "$work/etc/fringed/fringed.toml" || broken "the configuration is not $configuration"
grep -q '^writers = \["127.0.0.0/8"[^.]*\]' "$work/etc/fringed/fringed.toml" || broken "others than this machine may trigger"
for step in 'postinst deb-systemd-helper enable' 'postinst systemd-sysusers' 'postinst systemd-tmpfiles' 'prerm deb-systemd-invoke stop' \
    'postrm rm -rf /var/lib/fringed'; do
    grep -q -- "${step#* }" "$work/DEBIAN/${step%% *}" || broken "${step%% *} has no ${step#* }"
done

# fringed-lab has a program and its documentation, and nothing that would affect a station.
stray=$(cd "$work-lab" && find . -type f -not -path './usr/share/doc/fringed-lab/*' -not -path './usr/share/man/man1/fringed-lab*.1.gz' | sort | tr '\n' ' ')
[[ $stray == './DEBIAN/control ./DEBIAN/md5sums ./usr/bin/fringed-lab ./usr/share/bash-completion/completions/fringed-lab '\
'./usr/share/fish/vendor_completions.d/fringed-lab.fish ./usr/share/zsh/vendor-completions/_fringed-lab ' ]] ||
    broken "fringed-lab has $stray"
for file in doc/fringed-lab/{licences.txt,copyright} man/man1/fringed-lab{,-bench}.1.gz; do
    [[ -s $work-lab/usr/share/$file ]] || broken "fringed-lab has no $file"
done
grep -q -- --frames "$work-lab/usr/share/bash-completion/completions/fringed-lab" || broken "the completion of fringed-lab does not know --frames"

# fringed-fleet has a program, its unit and its documentation; the unit is there and waits for a configuration.
stray=$(cd "$work-fleet" && find . -type f -not -path './DEBIAN/*' -not -path './usr/share/doc/fringed-fleet/*' -not -path './usr/share/man/man1/fringed-fleet*.1.gz' | sort | tr '\n' ' ')
[[ $stray == './usr/bin/fringed-fleet ./usr/lib/systemd/system/fringed-fleet-collect.service ' ]] ||
    broken "fringed-fleet has $stray"
for file in doc/fringed-fleet/{fleet.md,licences.txt,copyright,examples/{fleet.toml,prometheus.yml,alerts.yml,results.json,health.json}} man/man1/fringed-fleet{,-collect}.1.gz; do
    [[ -s $work-fleet/usr/share/$file ]] || broken "fringed-fleet has no $file"
done
[[ -d $work-fleet/etc/fringed-fleet ]] || broken "fringed-fleet has no folder for a configuration"
grep -q 'deb-systemd-helper enable' "$work-fleet/DEBIAN/postinst" || broken "the collector is not enabled"
grep -q '^ConditionPathExists=/etc/fringed-fleet/fleet.toml$' "$work-fleet/usr/lib/systemd/system/fringed-fleet-collect.service" ||
    broken "the collector starts without a configuration"

binary=$work/usr/bin/fringed
size=$(stat --format %s "$binary")
[[ ${2:-} == quick ]] || ((size <= largest)) || broken "the binary has $size bytes, more than $largest"
for one in "$binary" "$work-lab/usr/bin/fringed-lab" "$work-fleet/usr/bin/fringed-fleet"; do
    sections=$(readelf --section-headers --wide "$one")
    [[ $sections != *.symtab* && $sections != *.debug_info* ]] || broken "$one is not stripped"
done
for one in "$lab" "$fleet" "$package"; do
    depends=$(dpkg-deb --field "$one" Depends)
    [[ $depends == *'libc6 (>= 2.'* ]] || broken "$one depends on $depends, on no C library"
done
loads=$(readelf --dynamic --wide "$binary" | sed -n 's/.*(NEEDED).*\[libcamera\.so\.\(.*\)\]/libcamera\1/p')
[[ ", $depends, " == *", $loads, "* || -z $loads ]] || broken "it loads $loads and depends on $depends"

echo "$(basename "$package"): $(stat --format %s "$package") bytes; its binary $size bytes of at most $largest; depends on $depends"
exit $failed
