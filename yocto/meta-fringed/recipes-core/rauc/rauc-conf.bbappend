FILESEXTRAPATHS:prepend:fringed-appliance := "${THISDIR}/files:${FRINGED_KEYS}:"

# The certificate with which a device verifies updates, made by yocto/keys.sh. It has a name of its own, so that the build
# fails without this file instead of using meta-rauc's example.
RAUC_KEYRING_FILE:fringed-appliance = "fringed-ca.cert.pem"

PACKAGE_ARCH:fringed-appliance = "${MACHINE_ARCH}"

do_install:append:fringed-appliance() {
    sed -i 's/@MACHINE@/${MACHINE}/' ${D}${nonarch_libdir}/rauc/system.conf
}
