FILESEXTRAPATHS:prepend:fringed-appliance := "${THISDIR}/files:"

SRC_URI:append:fringed-appliance = " file://fringed.cfg"
