SUMMARY = "Bootloader backend of RAUC for the slots of the Pi's firmware"
DESCRIPTION = "Starts an installed slot once, on trial, and makes it the default after it was marked good."
SECTION = "base"
LICENSE = "MIT"
LIC_FILES_CHKSUM = "file://${COMMON_LICENSE_DIR}/MIT;md5=0835ade698e0bcf8506ecda2f7b4f302"

SRC_URI = "\
    file://boot-select.mount \
    file://boot-slot \
"
S = "${UNPACKDIR}"

inherit allarch features_check systemd

REQUIRED_DISTRO_FEATURES = "systemd"

do_configure[noexec] = "1"
do_compile[noexec] = "1"

do_install() {
    install -d ${D}/boot/select
    install -D -m 0644 ${S}/boot-select.mount ${D}${systemd_system_unitdir}/boot-select.mount
    install -D -m 0755 ${S}/boot-slot ${D}${nonarch_libdir}/rauc/boot-slot
}

FILES:${PN} += "\
    /boot/select \
    ${nonarch_libdir}/rauc/boot-slot \
    ${systemd_system_unitdir} \
"

SYSTEMD_SERVICE:${PN} = "boot-select.mount"
