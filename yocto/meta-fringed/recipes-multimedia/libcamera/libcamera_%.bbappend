# The pipelines of the Pi 4 and the Pi 5, whoever else asks for them.
PACKAGECONFIG:append:fringed-appliance = " raspberrypi"
