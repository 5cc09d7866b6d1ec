# The pipelines of the Pi 4 and the Pi 5.
PACKAGECONFIG:append:fringed-appliance = " raspberrypi"
