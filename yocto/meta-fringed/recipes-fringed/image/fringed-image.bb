SUMMARY = "Image of the reference head"
DESCRIPTION = "Two slots with a read-only root, a data partition, fringed and its dependencies; nobody can log in."
LICENSE = "MIT"

inherit core-image

IMAGE_FEATURES = "read-only-rootfs ${EXTRA_IMAGE_FEATURES}"

# No packagegroup-base, which is for desktops and servers. No getty, no secure shell.
IMAGE_INSTALL = "\
    fringed \
    fringed-slots \
    fringed-system \
    kernel-modules \
    packagegroup-core-boot \
    rauc \
    rauc-mark-good \
    rauc-service \
"
BAD_RECOMMENDATIONS += "busybox-syslog busybox-udhcpc systemd-vconsole-setup udev-hwdb"

# The slots are separate files, which the bundle uses as well.
IMAGE_FSTYPES = "ext4 wic.bmap wic.xz"
WKS_FILE = "fringed.wks.in"
do_image_wic[depends] += "fringed-boot:do_deploy"

# MiB. Two roots of this size and the data partition have to fit on the card.
FRINGED_ROOT_SIZE ?= "1024"
FRINGED_DATA_SIZE ?= "4096"
IMAGE_ROOTFS_MAXSIZE = "${@int(d.getVar('FRINGED_ROOT_SIZE')) * 1024}"

# Nobody can log in: no password is valid, and there is no login prompt.
ROOTFS_POSTPROCESS_COMMAND += "fringed_no_logins"
fringed_no_logins() {
    if ${@bb.utils.contains('IMAGE_FEATURES', 'allow-root-login', 'false', 'true', d)}; then
        for unit in getty.target serial-getty@.service getty@.service autovt@.service debug-shell.service emergency.service rescue.service; do
            ln -sf /dev/null ${IMAGE_ROOTFS}${sysconfdir}/systemd/system/$unit
        done
    fi
}
