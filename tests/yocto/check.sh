#!/usr/bin/env bash
# Checks the Yocto layer without building it: the list of crates, a linter, kas, BitBake's own parser, the units, and the
# script that chooses a slot; then breaks copies of the layer, and verifies that the checks find each defect.
#
#     tests/yocto/tools.sh DIR && tests/yocto/check.sh DIR
#
# Needs no network and no root.
# Single quotes are for sed.
# shellcheck disable=SC2016
set -euo pipefail
dir=$(cd "${1:?usage: check.sh DIR}" && pwd)
here=$(cd "$(dirname "${BASH_SOURCE[0]}")" && pwd)
workspace=$(cd "$here/../.." && pwd)
bin=$dir/python/bin

crates() { "$bin/python" "$1/yocto/crates.py" --check; }

# Hints are not errors. The two ignored rules: the project has no home page, and small recipes have no sources with a licence text.
lint() {
    local files
    mapfile -t files < <(cd "$1" && find yocto/meta-fringed \( -name '*.bb' -o -name '*.bbappend' -o -name '*.inc' -o -path '*/conf/*.conf' \) | sort)
    (cd "$1" && "$bin/oelint-adv" --release wrynose --extra-layer rauc --hide info --quiet --relpaths --jobs 1 \
        "--constantmods=+$here/names.json" --suppress oelint.var.mandatoryvar.HOMEPAGE \
        --suppress oelint.var.licenseremotefile -- "${files[@]}")
}

# configuration WORKSPACE FILES: writes the configuration that kas makes of the files to $dir/configuration.json.
configuration() {
    mkdir -p "$dir/kas"
    (cd "$1" && KAS_WORK_DIR=$dir/kas "$bin/kas" --log-level warning dump --skip finish_setup_repos --skip repos_checkout \
        --format json "$2") >"$dir/configuration.json"
}

parse() { "$bin/python" "$here/parse.py" "$1" "$dir/bitbake" "$dir/configuration.json"; }

machine() { configuration "$1" "$2" && parse "$1"; }

slots() { "$here/slots.sh" "$1/yocto/meta-fringed/recipes-fringed/slots/files/boot-slot" "$dir/slots"; }

# The units and drop-ins, with a substitute for the real service, whose program is not on this machine.
units() {
    local from=$1/yocto/meta-fringed/recipes-fringed to=$dir/units
    rm -rf "$to"
    mkdir -p "$to"/{fringed.service.d,boot-complete.target.d,systemd-networkd.service.d}
    cp "$from"/system/files/*.mount "$from"/slots/files/*.mount "$to"
    printf '[Service]\nType=notify\nStateDirectory=fringed\nExecStart=/bin/true\n' >"$to/fringed.service"
    cp "$from/system/files/fringed-service.conf" "$to/fringed.service.d/20-image.conf"
    cp "$from/system/files/networkd.conf" "$to/systemd-networkd.service.d/20-data.conf"
    mkdir "$to/systemd-networkd-wait-online.service.d"
    cp "$from/system/files/wait-online.conf" "$to/systemd-networkd-wait-online.service.d/20-timeout.conf"
    cp "$from/system/files/boot-complete.conf" "$to/boot-complete.target.d/20-fringed.conf"
    SYSTEMD_UNIT_PATH=$to: systemd-analyze verify "$to"/*.mount "$to/fringed.service" boot-complete.target \
        systemd-networkd-wait-online.service systemd-networkd.service
}

echo "crates, recipes, machines, slots"
crates "$workspace"
lint "$workspace"
for files in yocto/kas-raspberrypi4.yml yocto/kas.yml:yocto/kas-bundle.yml yocto/kas.yml:yocto/kas-development.yml yocto/kas.yml; do
    machine "$workspace" "$files"
done
slots "$workspace"
if command -v systemd-analyze >/dev/null; then
    units "$workspace"
else
    echo "units: SKIPPED, there is no systemd-analyze (Debian package systemd)"
fi

# broken CHECK FILE CHANGE: makes a copy with one file changed by sed, or moved with "mv TO"; CHECK must find that.
found=0
broken() {
    local check=$1 file=$2 change=$3 copy=$dir/copy
    rm -rf "$copy"
    mkdir -p "$copy"/{appliance,docs}
    cp -r "$workspace"/{yocto,systemd,Cargo.lock,Cargo.toml,LICENSE-MIT,LICENSE-APACHE,README.md} "$copy"
    cp "$workspace/appliance/Cargo.toml" "$copy/appliance"
    cp "$workspace"/docs/{hardware.md,fringed.toml,licences.txt} "$copy/docs"
    git -C "$copy" init --quiet
    git -C "$copy" -c user.name=check -c user.email=check@localhost commit --quiet --allow-empty --message copy
    if [[ -n $file ]]; then
        if [[ $change == "mv "* ]]; then
            mkdir -p "$(dirname "$copy/${change#mv }")"
            mv "$copy/$file" "$copy/${change#mv }"
        else
            sed -i "$change" "$copy/$file"
        fi
        if cmp --quiet "$workspace/$file" "$copy/$file"; then
            echo "$file: nothing to break with $change" >&2
            exit 1
        fi
    fi
    case $check in
    kas) ! configuration "$copy" yocto/kas.yml ;;
    machine) ! machine "$copy" yocto/kas.yml ;;
    *) ! "$check" "$copy" ;;
    esac >"$dir/broken.log" 2>&1 || {
        if [[ -z $file ]]; then return; fi
        echo "$check does not find $change in $file:" >&2
        cat "$dir/broken.log" >&2
        exit 1
    }
    if [[ -z $file ]]; then
        echo "$check finds something in a copy that is whole:" >&2
        cat "$dir/broken.log" >&2
        exit 1
    fi
    found=$((found + 1))
}

recipes=yocto/meta-fringed/recipes-fringed
for check in crates lint parse slots machine; do broken "$check" "" ""; done

# A crate's checksum, a crate, the lock file.
list=$recipes/fringed/fringed-crates.inc
broken crates $list 's/^\(SRC_URI\[libc-.*"\)./\1g/'
broken parse $list 's/^\(SRC_URI\[libc-.*"\)./\1g/'
broken parse $list '/crates.io\/rayon\//d'
broken parse $list 's/rayon-core-\(.*\)sha256sum/rayon-core-\1md5sum/'
broken crates Cargo.lock '0,/^checksum = "./s//&0/'
broken parse Cargo.lock '/^name = "zip"/,/^$/d'

# A line of a recipe.
recipe=$recipes/fringed/fringed_0.1.0.bb
broken parse $recipe 's/^inherit cargo/inherti cargo/'
broken parse $recipe 's/^inherit cargo/inherit carg/'
broken parse $recipe 's/clang-native libcamera/clang-native/'
broken parse $recipe 's/--features rpi/--features pi/'
broken parse $recipe 's/--profile dist/--release/'
broken parse $recipe 's/--bin fringed/--bin fringe/'
broken parse $recipe 's/systemd\/fringed.service /systemd\/fringed.servce /'
broken parse $recipe 's/^SYSTEMD_SERVICE.*/SYSTEMD_SERVICE:${PN} = "fringe.service"/'
broken parse $recipe 's/md5=146/md5=147/'
broken parse $recipe 's/--groups video,render/--groups video/'
broken parse $recipe 's/ --system render;//'
broken parse $recipe 's/^def fringed_commit/def fringed_comit/'
broken parse $recipe 's/"rev-parse", "--verify", "HEAD"/"hash-object", "README.md"/'
broken lint $recipe 's/^SYSTEMD_SERVICE:/SYSTEMD_SERVICE_/'
broken lint $recipe '/^SUMMARY/d'
broken lint $recipe 's/^LICENSE = /LICENCE = /'
broken parse $recipe '/^export FRINGED_COMMIT/d'
broken parse 'yocto/meta-fringed/recipes-core/systemd/systemd_%.bbappend' 's/ vconsole//'
image=$recipes/image/fringed-image.bb
broken parse $image 's/"read-only-rootfs /&ssh-server-dropbear /'
broken parse $image '/^    rauc-mark-good /d'
broken parse $image 's/debug-shell.service //'
broken lint $image 's/^IMAGE_INSTALL = /IMAGE_INSTAL = /'

# Consistency of releases, partitions, updates, the head, the kernel, state.
broken parse yocto/meta-fringed/conf/layer.conf 's/"wrynose"/"scarthgap"/'
broken parse yocto/meta-fringed/files/wic/fringed.wks.in 's/root-b/root-c/'
broken parse yocto/meta-fringed/files/wic/fringed.wks.in "mv yocto/meta-fringed/wic/fringed.wks.in"
broken parse yocto/meta-fringed/recipes-core/rauc/rauc-conf.bbappend 's/{nonarch_libdir}/{sysconfdir}/'
broken parse yocto/meta-fringed/recipes-core/rauc/files/system.conf 's/^path=.usr.lib/path=\/etc/'
broken parse yocto/meta-fringed/recipes-core/rauc/files/system.conf 's/boot-b/boot-c/'
broken parse $recipes/bundle/fringed-bundle_1.0.bb 's/"boot rootfs"/"rootfs"/'
broken parse $recipes/boot/files/config.txt '/strict_gpiod/d'
broken parse $recipes/boot/files/config.txt '/i2c_arm/d'
broken parse $recipes/boot/files/config.txt '/imx296,cam0/d'
broken parse $recipes/boot/files/config.txt 's/,always-on//'
broken parse $recipes/boot/files/config.txt 's/boot_partition=3/boot_partition=4/'
broken parse $recipes/boot/files/config.txt '/^\[pi4\]/,/^\[all\]/{/^\[all\]/d}'
broken parse $recipes/boot/files/config.txt '/^\[pi5\]/d'
broken parse $recipes/boot/fringed-boot_1.0.bb 's/ cgroup_enable=memory//'
broken parse $recipes/boot/fringed-boot_1.0.bb 's/ isolcpus=3//'
broken parse $recipes/system/files/boot-complete.conf '/^After/d'
broken parse $recipes/system/files/var-lib-fringed.mount 's/^What=.*/What=\/data\/fring/'
broken parse $recipes/system/files/journald.conf '/^RuntimeMaxUse/d'
broken parse systemd/fringed.service 's/^Type=notify/Type=simple/'
broken parse yocto/meta-fringed/recipes-kernel/linux/files/fringed.cfg 's/^CONFIG_GPIO_CDEV_V1=y/# &/'
broken parse yocto/meta-fringed/conf/distro/fringed-appliance.conf '/^INIT_MANAGER/d'
broken parse yocto/meta-fringed/conf/distro/fringed-appliance.conf 's/create-spdx/create-sbom/'

# A unit, and a drop-in.
if command -v systemd-analyze >/dev/null; then
    broken units "" ""
    broken units $recipes/system/files/data.mount 's/^Where=.*/Where=\/dat/'
    broken units $recipes/system/files/wait-online.conf 's/^ExecStart=.usr.*/ExecStart=bin\/wait/'
    broken units $recipes/system/files/boot-complete.conf 's/^Requires=fringed/Requires=fring_/'
fi

# The choice of the slot.
broken slots $recipes/slots/files/boot-slot 's/set-primary)/set-primry)/'
broken slots $recipes/slots/files/boot-slot 's/then other "$slot"; else/then echo "$slot"; else/'
broken slots $recipes/slots/files/boot-slot '/bad) if/s/rm -f "$next"/make_good "$2"/'
broken slots $recipes/slots/files/boot-slot 's/^    mount -o remount,ro.*/    :/'
broken slots $recipes/slots/files/boot-slot 's/ 1<>"$file"/ | dd of="$file" conv=notrunc,fsync/'
broken slots $recipes/slots/files/boot-slot 's/ 1<>"$file"/ | install -m 0644 \/dev\/stdin "$file"/'
broken slots $recipes/slots/files/boot-slot '/^    sync$/d'

# A key of kas.
broken kas yocto/kas.yml 's/^machine:/machin:/'
broken kas yocto/kas.yml 's/^repos:/repo:/'
broken kas yocto/kas.yml 's/^  version: 18/  version: 999/'
broken kas yocto/kas.yml 's/^    branch: wrynose/    brnch: wrynose/'
broken machine yocto/kas.yml '0,/branch: wrynose/s//branch: scarthgap/'
broken machine yocto/kas.yml 's/^distro: .*/distro: poky/'
broken machine yocto/kas.yml '/meta-multimedia:/d'
broken machine yocto/kas.yml '/commit: f62c/d'
broken machine yocto/kas.yml 's/commit: \(ef022bf82d\).*/commit: \1/'

# Requirements of yocto-check-layer.
broken parse yocto/meta-fringed/README.md "mv yocto/meta-fringed/notes.md"
broken parse yocto/meta-fringed/README.md 's/<maintainers@.*>//'

rm -rf "$dir/copy"
echo "broken on purpose: $found, all found"
