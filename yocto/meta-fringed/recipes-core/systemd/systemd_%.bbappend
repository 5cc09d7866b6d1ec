# Services that a sensor has no use for: no backlight, no containers, no suspend, no keyboard, nobody to rename it.
PACKAGECONFIG:remove:fringed-appliance = "backlight binfmt hibernate hostnamed localed machined nss-mymachines quotacheck vconsole"
