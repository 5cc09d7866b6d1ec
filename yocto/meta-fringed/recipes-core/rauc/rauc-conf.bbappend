FILESEXTRAPATHS:prepend:fringed-appliance := "${THISDIR}/files:${FRINGED_KEYS}:"

# The certificate that a device checks updates with, of yocto/keys.sh. It has a name of its own: meta-rauc's example
# must not get into a product, so without this file the build ends.
RAUC_KEYRING_FILE:fringed-appliance = "fringed-ca.cert.pem"

PACKAGE_ARCH:fringed-appliance = "${MACHINE_ARCH}"

do_install:append:fringed-appliance() {
    sed -i 's/@MACHINE@/${MACHINE}/' ${D}${nonarch_libdir}/rauc/system.conf
}
