SUMMARY = "Boot partitions of an image of fringed"
DESCRIPTION = "Two FAT file systems: one for each slot, with firmware, kernel, device tree and config.txt, and a small \
one that says which slot starts. Image and bundle take the same files."
SECTION = "bootloaders"
LICENSE = "MIT"
LIC_FILES_CHKSUM = "file://${COMMON_LICENSE_DIR}/MIT;md5=0835ade698e0bcf8506ecda2f7b4f302"

SRC_URI = "\
    file://autoboot.txt \
    file://config.txt \
"
S = "${UNPACKDIR}"
B = "${WORKDIR}/build"

COMPATIBLE_MACHINE = "^rpi$"
INHIBIT_DEFAULT_DEPS = "1"

inherit deploy nopackages

PACKAGE_ARCH = "${MACHINE_ARCH}"

# KiB; the firmware wants at least 32 MiB for FAT32.
SLOT_SIZE = "131072"
SELECT_SIZE = "16384"

# The projector's mode, and nothing that draws on it; memory limits per service, which the Pi's kernel disables by default;
# a restart after a kernel panic, which ends a trial.
FRINGED_CMDLINE ?= "video=HDMI-A-1:1280x720@60D consoleblank=0 vt.global_cursor_default=0 console=serial0,115200 cgroup_enable=memory isolcpus=3 panic=10 quiet"
ROOT_CMDLINE = "ro rootfstype=ext4 rootwait"

do_configure[noexec] = "1"
do_install[noexec] = "1"
do_compile[cleandirs] = "${B}"

do_compile() {
    sed 's/@KERNEL@/${SDIMG_KERNELIMAGE}/' ${S}/config.txt > ${B}/config.txt
    echo "root=PARTLABEL=root-a rauc.slot=A ${ROOT_CMDLINE} ${FRINGED_CMDLINE}" > ${B}/cmdline-a.txt
    echo "root=PARTLABEL=root-b rauc.slot=B ${ROOT_CMDLINE} ${FRINGED_CMDLINE}" > ${B}/cmdline-b.txt
}

# The folder for the machine's list of boot files.
python do_collect() {
    import shutil
    from oe.bootfiles import get_boot_files

    deployed = d.getVar("DEPLOY_DIR_IMAGE")
    slot = os.path.join(d.getVar("B"), "slot")
    for source, target in get_boot_files(deployed, d.getVar("IMAGE_BOOT_FILES")):
        path = os.path.join(slot, target)
        bb.utils.mkdirhier(os.path.dirname(path))
        shutil.copy(os.path.join(deployed, source), path)
    bb.utils.remove(os.path.join(slot, "cmdline.txt"))
    for name in ("config.txt", "cmdline-a.txt", "cmdline-b.txt"):
        shutil.copy(os.path.join(d.getVar("B"), name), slot)
}
do_collect[doc] = "Collects the boot files of a slot in a folder"
do_collect[cleandirs] = "${B}/slot"
do_collect[depends] = "virtual/kernel:do_deploy rpi-bootfiles:do_deploy rpi-cmdline:do_deploy rpi-config:do_deploy"

addtask collect after do_compile before do_deploy

do_deploy() {
    mkfs.vfat -F 32 -n SLOT -C ${DEPLOYDIR}/fringed-boot-${MACHINE}.vfat ${SLOT_SIZE}
    mcopy -s -i ${DEPLOYDIR}/fringed-boot-${MACHINE}.vfat ${B}/slot/* ::/
    mkfs.vfat -F 16 -n SELECT -C ${DEPLOYDIR}/fringed-select-${MACHINE}.vfat ${SELECT_SIZE}
    mcopy -i ${DEPLOYDIR}/fringed-select-${MACHINE}.vfat ${S}/autoboot.txt ::/
}
do_deploy[depends] = "dosfstools-native:do_populate_sysroot mtools-native:do_populate_sysroot"

addtask deploy after do_collect before do_build
