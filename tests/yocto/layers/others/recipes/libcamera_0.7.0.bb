PACKAGECONFIG ?= ""
PACKAGECONFIG[raspberrypi] = ",,libpisp"
