#!/usr/bin/env bash
# Checks what is in a package: the size of the binary, where the files lie, what belongs to the user, what it needs.
#
#     tests/package/check.sh PACKAGE.deb
set -euo pipefail
shopt -s inherit_errexit
package=$(realpath -- "${1:?usage: check.sh PACKAGE.deb}")
cd "$(dirname "${BASH_SOURCE[0]}")/../.."
largest=$((12 << 20)) # bytes of the stripped binary, without libcamera's own

work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT
failed=0
broken() {
    echo "FAILED: $*" >&2
    failed=1
}

dpkg-deb --raw-extract "$package" "$work"
for file in usr/bin/fringed usr/lib/systemd/system/fringed.service usr/lib/sysusers.d/fringed.conf usr/lib/tmpfiles.d/fringed.conf \
    usr/lib/udev/rules.d/60-fringed.rules usr/share/{bash-completion/completions/fringed,zsh/vendor-completions/_fringed,fish/vendor_completions.d/fringed.fish} \
    usr/share/man/man1/fringed.1.gz usr/share/doc/fringed/{README.md,licences.txt,copyright,examples/fringed.toml}; do
    [[ -s $work/$file ]] || broken "there is no $file"
done
for file in fringed.service 60-fringed.rules; do
    cmp -s "systemd/$file" "$(find "$work/usr" -name "$file")" || broken "$file is not the one of this source"
done
# What is neither the program's nor its documentation's would be there after its removal as well.
stray=$(cd "$work" && find . -type f -not -path './DEBIAN/*' -not -path './usr/bin/fringed' -not -path './usr/share/doc/fringed/*' \
    -not -path ./usr/share/man/man1/fringed.1.gz -not -path './usr/lib/s*' -not -path './usr/lib/tmpfiles.d/*' -not -path './usr/lib/udev/*' -not -path './usr/share/*completions*/*fringed*' -not -path ./etc/fringed/fringed.toml)
[[ -z $stray ]] || broken "nobody asked for $stray"

# Each shell knows the commands and the options of one of them.
for completion in bash-completion/completions/fringed zsh/vendor-completions/_fringed fish/vendor_completions.d/fringed.fish; do
    for word in serve doctor scenario; do
        grep -q -- "$word" "$work/usr/share/$completion" || broken "$completion does not know $word"
    done
done
bash -n "$work/usr/share/bash-completion/completions/fringed" || broken "the completion for bash is no script"
completed=$(bash -c 'source "$1"; COMP_WORDS=(fringed doctor --sc); COMP_CWORD=2; COMP_LINE="fringed doctor --sc"; COMP_POINT=19
    _fringed fringed --sc doctor; echo "${COMPREPLY[*]}"' - "$work/usr/share/bash-completion/completions/fringed")
[[ $completed == --scenario ]] || broken "bash completes doctor --sc to $completed"

[[ $(cat "$work/DEBIAN/conffiles") == /etc/fringed/fringed.toml ]] || broken "the configuration is not a file of the user's"
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

binary=$work/usr/bin/fringed
size=$(stat --format %s "$binary")
((size <= largest)) || broken "the binary has $size bytes, more than $largest"
sections=$(readelf --section-headers --wide "$binary")
[[ $sections != *.symtab* && $sections != *.debug_info* ]] || broken "the binary is not stripped"
depends=$(dpkg-deb --field "$package" Depends)
[[ $depends == *'libc6 (>= 2.'* ]] || broken "it depends on $depends, on no C library"
loads=$(readelf --dynamic --wide "$binary" | sed -n 's/.*(NEEDED).*\[libcamera\.so\.\(.*\)\]/libcamera\1/p')
[[ ", $depends, " == *", $loads, "* || -z $loads ]] || broken "it loads $loads and depends on $depends"

echo "$(basename "$package"): $(stat --format %s "$package") bytes; its binary $size bytes of at most $largest; depends on $depends"
exit $failed
