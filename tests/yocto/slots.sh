#!/usr/bin/env bash
# Simulates an update, a successful and a failed trial, and interruptions, with the script that tells the
# firmware which slot to start.
#
#     tests/yocto/slots.sh SCRIPT FOLDER
#
# The firmware is simulated: it takes the flag once, and starts the slot that autoboot.txt names for it.
set -euo pipefail
script=$(realpath "${1:?usage: slots.sh SCRIPT FOLDER}")
root=${2:?usage: slots.sh SCRIPT FOLDER}
rm -rf "$root"
mkdir -p "$root"/{boot/select,run/systemd,proc,bin}
root=$(realpath "$root")
cp "$(dirname "$script")/../../boot/files/autoboot.txt" "$root/boot/select"
# The partition is mounted read-only: nothing may be written before it is remounted.
cat >"$root/bin/mount" <<END
#!/bin/sh
case "\$2" in
remount,rw) $(command -v chmod) u+w '$root/boot/select/autoboot.txt' ;;
remount,ro) $(command -v chmod) u-w '$root/boot/select/autoboot.txt' ;;
*) exit 1 ;;
esac
echo "\$2" >>'$root/mounts'
END
# Like the image's busybox, which is built without FEATURE_DD_IBS_OBS and so without `conv=`.
cat >"$root/bin/dd" <<END
#!/bin/sh
case " \$*" in *" conv="*) echo "dd: invalid argument 'conv'" >&2; exit 1 ;; esac
exec $(command -v dd) "\$@"
END
printf '#!/bin/sh\necho sync >>%s\n' "'$root/mounts'" >"$root/bin/sync"
chmod +x "$root/bin"/*
# Only the programs of the image's busybox.
for applet in grep head rm sed sh; do ln -s "$(command -v "$applet")" "$root/bin"; done
before=$(stat -c %s "$root/boot/select/autoboot.txt")

rauc() { FRINGED_ROOT=$root PATH=$root/bin sh "$script" "$@"; }
partition() { sed -n "/^\[$1\]/,/^\[/s/^boot_partition=//p" "$root/boot/select/autoboot.txt"; }

# Starts the machine: with the flag after a restart, without it after a loss of power.
started=
start() {
    local section=all
    if [[ $1 == restart ]] && grep -qs tryboot "$root/run/systemd/reboot-param"; then section=tryboot; fi
    rm -f "$root/run/systemd/reboot-param"
    case $(partition "$section") in 2) started=A ;; 3) started=B ;; *) started=nothing ;; esac
    echo "root=PARTLABEL=root-x rauc.slot=$started ro" >"$root/proc/cmdline"
}

is() {
    if [[ $2 != "$3" ]]; then
        echo "slots: $1: $2 instead of $3" >&2
        exit 1
    fi
}

start plug
is "a new device starts" "$started" A
is "it knows that it is" "$(rauc get-current)" A
is "its primary" "$(rauc get-primary)" A
is "its other slot is" "$(rauc get-state B)" bad

# The calls of RAUC during an installation, in order.
rauc set-state B bad
rauc set-primary B
is "an installed slot is primary" "$(rauc get-primary)" B
is "nothing is written before it proved good" "$(partition all)" 2
start restart
is "a restart tries it" "$started" B
is "until it is good the primary is" "$(rauc get-primary)" A
start plug
is "a trial that hangs leads back to" "$started" A
start restart
is "and stays with" "$started" A

rauc set-primary B
start restart
rauc set-state B good
is "a slot that proved good starts" "$(partition all)" 3
is "and the other one is for trials" "$(partition tryboot)" 2
start plug
is "also without a flag" "$started" B
is "its primary" "$(rauc get-primary)" B
rauc set-state B good
is "the file has its length" "$(stat -c %s "$root/boot/select/autoboot.txt")" "$before"
is "the partition was opened, written through and closed once" "$(tr '\n' ' ' <"$root/mounts")" "remount,rw sync remount,ro "

rauc set-primary A
rauc set-primary B
start restart
is "a choice that was taken back starts" "$started" B
rauc set-state B bad
start restart
is "a good slot that turned bad gives way to" "$started" A

# Malformed content must be an error.
for wrong in "get-state C" "set-state A perfect" "set-primary" "get-secondary" ""; do
    # shellcheck disable=SC2086
    if rauc $wrong 2>/dev/null; then is "'$wrong' ends" well badly; fi
done
chmod u+w "$root/boot/select/autoboot.txt"
echo >"$root/boot/select/autoboot.txt"
if rauc get-primary 2>/dev/null; then is "an empty autoboot.txt ends" well badly; fi
echo root=/dev/sda >"$root/proc/cmdline"
if rauc get-current 2>/dev/null; then is "a slot that nobody named ends" well badly; fi
echo "slots: an update, a trial, a way back"
