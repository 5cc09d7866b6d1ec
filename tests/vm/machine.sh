#!/usr/bin/env bash
# Makes the virtual machine in DIR: qemu, busybox, and Debian's kernel with virtual displays, GPIO chips and cameras.
#
#     tests/vm/machine.sh DIR
#
# Nothing is installed and nothing of the machine changes, so no root is needed: apt resolves and downloads with lists of its own,
# from the machine's sources; what the machine already has is used from there. DIR/kernel keeps a kernel and its modules, DIR/root
# programs; a second call only looks whether it is complete. Ends with 69 (EX_UNAVAILABLE) and the reason where it cannot be had.
set -euo pipefail
shopt -s inherit_errexit nullglob
here=$(cd "$(dirname "${BASH_SOURCE[0]}")" && pwd)
mkdir -p "${1:?usage: machine.sh DIR}"
dir=$(cd "$1" && pwd)
source "$here/pins"
source "$here/../apt.sh"

unavailable() {
    echo "no virtual machine: $1" >&2
    exit 69
}

wanted=$({ cat "$here"/{machine.sh,vkms.patch,../apt.sh} && echo "$kernel $kernel_revision"; } | sha256sum)
[[ $(cat "$dir/complete" 2>/dev/null) == "$wanted" ]] && exit 0
[[ $(dpkg --print-architecture 2>/dev/null) == amd64 ]] || unavailable "this is no Debian on x86-64"
[[ $dir != *[[:space:]]* ]] || unavailable "a kernel is not built in a folder with a space: $dir"
rm -rf "$dir"/{complete,apt,build,kernel,root}
mkdir -p "$dir"/{build,kernel/modules,root}

apt_of_its_own "$dir/apt"
# A source that does not answer need not be the one with these packages.
apt-get -qq update || true
if ! apt-cache -qq show "linux-source-6.12=$kernel_revision" >/dev/null 2>&1; then
    echo "kernels that there are:" >&2
    apt-cache -qq madison linux-source-6.12 >&2
    unavailable "its kernel $kernel_revision is not in the archives: name another one in tests/vm/pins"
fi
# With the headers come the compiler and the tools that modules need.
apt-get -qq install --download-only --yes --no-install-recommends qemu-system-x86 busybox-static cpio kmod make patch xz-utils \
    "linux-headers-$kernel-amd64=$kernel_revision" || unavailable "apt cannot download the packages (the reason stands above)"
# Without their dependencies: they are not installed.
(cd "$dir/apt/archives" && apt-get -qq download "linux-image-$kernel-amd64-unsigned=$kernel_revision" \
    "linux-source-6.12=$kernel_revision") || unavailable "apt cannot download the kernel (the reason stands above)"
# A C library newer than the machine's would meet the machine's loader.
rm -f "$dir"/apt/archives/libc6_*
build=$dir/build root=$dir/root
source_package=$(echo "$dir"/apt/archives/linux-source-*.deb)
for package in "$dir"/apt/archives/*.deb; do
    case $package in
    "$source_package") ;;
    */linux-image-* | */linux-headers-* | */linux-kbuild-*) dpkg -x "$package" "$build" ;;
    *) dpkg -x "$package" "$root" ;;
    esac
done
source "$here/programs"

# The drivers of virtual devices that Debian does not build.
drivers=$build/drivers
mkdir -p "$drivers"
dpkg --fsys-tarfile "$source_package" | tar -xO ./usr/src/linux-source-6.12.tar.xz | xz -dc -T0 |
    tar -x --strip-components=1 -C "$drivers" --wildcards '*/drivers/gpu/drm/vkms/*' '*/drivers/media/test-drivers/vimc/*' \
        '*/drivers/gpio/gpio-sim.c' '*/kernel/irq/irq_sim.c'
rm -rf "$dir/apt"
cd "$drivers"
mv drivers/gpu/drm/vkms drivers/media/test-drivers/vimc .
mkdir gpio
mv drivers/gpio/gpio-sim.c gpio/sim.c
mv kernel/irq/irq_sim.c gpio/
patch -s -p1 <"$here/vkms.patch"
# Simulated interrupts are off in this kernel, so they go into the module that needs them, without a function that is not exported.
sed -i 's/handle_simple_irq(irq_to_desc(irqnum))/generic_handle_irq(irqnum)/' gpio/irq_sim.c
cat >Kbuild <<'END'
obj-m += vkms.o vimc.o gpio-sim.o
vkms-y := $(addprefix vkms/vkms_,drv.o plane.o output.o formats.o crtc.o composer.o writeback.o)
vimc-y := $(addprefix vimc/vimc-,core.o common.o streamer.o capture.o debayer.o scaler.o sensor.o lens.o)
gpio-sim-y := gpio/sim.o gpio/irq_sim.o
ccflags-y += -DCONFIG_IRQ_SIM=1
END
# The headers name their places as installed.
find "$build/usr/src" -type l -lname '/usr/*' | while read -r link; do
    ln -sfn "$build$(readlink "$link")" "$link"
done
{ grep -lE '/usr/(src/linux|lib/linux-kbuild)' "$build"/usr/src/*/{Makefile,.kernelvariables} 2>/dev/null || true; } |
    xargs -r sed -i -E "s#(^|[ =])/usr/(src/linux|lib/linux-kbuild)#\1$build/usr/\2#g"
# Type information for tracers would need one more program.
make -s -C "$build/usr/src/linux-headers-$kernel-amd64" M="$drivers" CONFIG_DEBUG_INFO_BTF_MODULES= modules ||
    unavailable "the drivers do not build against kernel $kernel (the reason stands above)"

# The kernel, and what those drivers and the shared folder need of its modules, in the order of loading.
cp "$build/boot/vmlinuz-$kernel-amd64" "$dir/kernel/vmlinuz"
[[ -d $build/lib/modules ]] || { mkdir -p "$build/lib" && ln -s ../usr/lib/modules "$build/lib/modules"; }
(exec -a depmod kmod -b "$build" -F "$build/boot/System.map-$kernel-amd64" "$kernel-amd64")
cd "$dir/kernel/modules"
for module in 9pnet_virtio 9p configfs drm_kms_helper drm_shmem_helper v4l2-tpg v4l2-async videobuf2-vmalloc videobuf2-v4l2 videobuf2-dma-contig; do
    (exec -a modprobe kmod -d "$build" -S "$kernel-amd64" --show-depends "$module") | sed -n 's/^insmod \([^ ]*\).*/\1/p'
done | awk '!seen[$0]++' | while read -r file; do
    name=$(basename "${file%.xz}")
    case $file in
    *.xz) xz -dc "$file" >"$name" ;;
    *) cp "$file" "$name" ;;
    esac
    echo "$name"
done >../order
for driver in vkms gpio-sim vimc; do
    strip -g -o "$driver.ko" "$drivers/$driver.ko"
    echo "$driver.ko" >>../order
done
rm -rf "$build"
echo "$wanted" >"$dir/complete"
