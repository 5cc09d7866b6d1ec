SUMMARY = "System configuration of an image of fringed"
DESCRIPTION = "The data partition and the state on it, the journal's bound, the watchdog, the network, the camera's \
trigger, and when a slot counts as good."
SECTION = "industrial"
LICENSE = "MIT"
LIC_FILES_CHKSUM = "file://${COMMON_LICENSE_DIR}/MIT;md5=0835ade698e0bcf8506ecda2f7b4f302"

SRC_URI = "\
    file://boot-complete.conf \
    file://camera.yaml \
    file://data.mount \
    file://fringed-data.conf \
    file://fringed-service.conf \
    file://fringed.network \
    file://imx296.conf \
    file://journald.conf \
    file://networkd.conf \
    file://var-lib-fringed.mount \
    file://wait-online.conf \
    file://watchdog.conf \
"
S = "${UNPACKDIR}"

inherit features_check systemd

REQUIRED_DISTRO_FEATURES = "systemd"

# libcamera's names of the two generations of the Pi's camera pipeline.
CAMERA_PIPELINE = "pisp"
CAMERA_PIPELINE:raspberrypi4-64 = "bcm2835"

do_configure[noexec] = "1"
do_compile[noexec] = "1"

do_install() {
    units=${D}${systemd_system_unitdir}
    manager=${D}${nonarch_libdir}/systemd
    install -d ${D}/data ${D}${sysconfdir}/systemd/network
    install -D -m 0644 ${S}/data.mount $units/data.mount
    install -D -m 0644 ${S}/var-lib-fringed.mount $units/var-lib-fringed.mount
    install -D -m 0644 ${S}/fringed-service.conf $units/fringed.service.d/20-image.conf
    install -D -m 0644 ${S}/networkd.conf $units/systemd-networkd.service.d/20-data.conf
    install -D -m 0644 ${S}/wait-online.conf $units/systemd-networkd-wait-online.service.d/20-timeout.conf
    install -D -m 0644 ${S}/boot-complete.conf $units/boot-complete.target.d/20-fringed.conf
    install -D -m 0644 ${S}/journald.conf $manager/journald.conf.d/20-fringed.conf
    install -D -m 0644 ${S}/watchdog.conf $manager/system.conf.d/20-fringed.conf
    install -D -m 0644 ${S}/fringed.network $manager/network/20-fringed.network
    install -D -m 0644 ${S}/fringed-data.conf ${D}${nonarch_libdir}/tmpfiles.d/fringed-data.conf
    install -D -m 0644 ${S}/imx296.conf ${D}${nonarch_libdir}/modprobe.d/imx296.conf
    install -D -m 0644 ${S}/camera.yaml ${D}${sysconfdir}/fringed/camera.yaml
    sed -i 's/@TARGET@/${CAMERA_PIPELINE}/' ${D}${sysconfdir}/fringed/camera.yaml
}

PACKAGE_ARCH = "${MACHINE_ARCH}"

FILES:${PN} += "\
    /data \
    ${nonarch_libdir}/modprobe.d \
    ${nonarch_libdir}/systemd \
    ${nonarch_libdir}/tmpfiles.d \
    ${sysconfdir}/fringed \
    ${sysconfdir}/systemd/network \
    ${systemd_system_unitdir} \
"

SYSTEMD_SERVICE:${PN} = "data.mount var-lib-fringed.mount"

RDEPENDS:${PN} = "e2fsprogs-e2fsck fringed"
