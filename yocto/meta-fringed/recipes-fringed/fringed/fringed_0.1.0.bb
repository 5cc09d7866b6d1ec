SUMMARY = "Station of an open 3-D smart sensor by fringe projection"
DESCRIPTION = "Measures the height of a part with a projector and a camera, compares it with the part as taught, \
and gives a verdict to a PLC over Modbus TCP."
SECTION = "industrial"
LICENSE = "MIT | Apache-2.0"
LIC_FILES_CHKSUM = "\
    file://LICENSE-MIT;md5=146e39d6ba652918c52bdc1117389467 \
    file://LICENSE-APACHE;md5=3b83ef96387f14655fc854ddc3c6bd57 \
"

# The workspace that contains this layer, and the commit that is checked out there.
FRINGED_REPOSITORY ?= "${@os.path.abspath(os.path.join(d.getVar('FILE_DIRNAME'), '../../../..'))}"
SRC_URI = "git://${FRINGED_REPOSITORY};protocol=file;nobranch=1"
SRCREV = "${@fringed_commit(d)}"

require fringed-crates.inc

inherit cargo pkgconfig systemd useradd

# The checked-out commit may change while this file does not.
BB_DONT_CACHE = "1"

PACKAGECONFIG ?= "rpi"
PACKAGECONFIG[rpi] = "--features rpi,,clang-native libcamera,libcamera"

CARGO_BUILD_FLAGS += "--package appliance --bin fringed"
# The release profile of the project and its folder, in place of the class's `--release`.
BUILD_MODE = "--profile dist"
BUILD_DIR = "dist"

# The commit shown by --version.
export FRINGED_COMMIT = "${@d.getVar('SRCREV')[:12]}"

# bindgen, which makes the bindings of libcamera, reads the headers with clang, for the target.
export LIBCLANG_PATH = "${STAGING_LIBDIR_NATIVE}"
export BINDGEN_EXTRA_CLANG_ARGS = "--sysroot=${STAGING_DIR_HOST} --target=${TARGET_SYS}"

do_install() {
    install -D -m 0755 ${B}/target/${CARGO_TARGET_SUBDIR}/fringed ${D}${bindir}/fringed
    install -D -m 0644 ${S}/systemd/fringed.service ${D}${systemd_system_unitdir}/fringed.service
    install -D -m 0644 ${S}/systemd/fringed.sysusers ${D}${nonarch_libdir}/sysusers.d/fringed.conf
    install -D -m 0644 ${S}/systemd/fringed.tmpfiles ${D}${nonarch_libdir}/tmpfiles.d/fringed.conf
    install -D -m 0644 ${S}/systemd/60-fringed.rules ${D}${nonarch_base_libdir}/udev/rules.d/60-fringed.rules
    install -D -m 0644 ${S}/docs/fringed.toml ${D}${sysconfdir}/fringed/fringed.toml
    install -D -m 0644 ${S}/docs/licences.txt ${D}${datadir}/fringed/licences.txt
    install -d -m 0750 -o fringed -g fringed ${D}${localstatedir}/lib/fringed
}
# The configuration is for a Pi 5; on a Pi 4 the lines are on another chip.
do_install:append:raspberrypi4-64() {
    sed -i 's/"pinctrl-rp1"/"pinctrl-bcm2711"/' ${D}${sysconfdir}/fringed/fringed.toml
}

PACKAGE_ARCH = "${MACHINE_ARCH}"

FILES:${PN} += "\
    ${nonarch_base_libdir}/udev/rules.d \
    ${nonarch_libdir}/sysusers.d \
    ${nonarch_libdir}/tmpfiles.d \
    ${systemd_system_unitdir} \
"
CONFFILES:${PN} = "${sysconfdir}/fringed/fringed.toml"

SYSTEMD_SERVICE:${PN} = "fringed.service"

USERADD_PACKAGES = "${PN}"
# Of the groups below only video always exists; groups that another recipe also creates are not created twice.
GROUPADD_PARAM:${PN} = "--system gpio; --system i2c; --system render; --system fringed"
USERADD_PARAM:${PN} = "--system --no-create-home --home-dir ${localstatedir}/lib/fringed --shell ${base_sbindir}/nologin --gid fringed --groups video,render,gpio,i2c fringed"

# The commit that FRINGED_REPOSITORY has checked out.
def fringed_commit(d):
    repository = d.getVar("FRINGED_REPOSITORY")
    try:
        commit, _ = bb.process.run(["git", "-C", repository, "rev-parse", "--verify", "HEAD"])
    except (bb.process.CmdError, bb.process.ExecutionError) as error:
        raise bb.parse.SkipRecipe(f"{repository} is no git repository with a commit: set FRINGED_REPOSITORY ({error})")
    return commit.strip()
