SUMMARY = "Update of an image of fringed"
DESCRIPTION = "A signed RAUC bundle with the root and the boot partition of one slot."
LICENSE = "MIT"

# All content is made by other recipes.
SRC_URI = ""

inherit bundle

RAUC_BUNDLE_COMPATIBLE = "fringed-${MACHINE}"
RAUC_BUNDLE_DESCRIPTION = "fringed ${DISTRO_VERSION} for ${MACHINE}"
RAUC_BUNDLE_VERSION = "${DISTRO_VERSION}"
RAUC_BUNDLE_FORMAT = "verity"

RAUC_BUNDLE_SLOTS = "boot rootfs"
RAUC_SLOT_rootfs = "fringed-image"
RAUC_SLOT_rootfs[fstype] = "ext4"
RAUC_SLOT_boot = "fringed-boot"
RAUC_SLOT_boot[type] = "file"
RAUC_SLOT_boot[file] = "fringed-boot-${MACHINE}.vfat"
RAUC_SLOT_boot[rename] = "fringed-boot-${MACHINE}.vfat"
