# Removes services that a sensor does not need: backlight, containers, suspend, keyboard, host name.
PACKAGECONFIG:remove:fringed-appliance = "backlight binfmt hibernate hostnamed localed machined nss-mymachines quotacheck vconsole"
