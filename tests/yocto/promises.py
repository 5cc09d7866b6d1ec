"""Promises about the parsed layer. Each function yields what is wrong; its docstring is the promise."""

import configparser
import hashlib
import re
import subprocess
import tomllib
from pathlib import Path

import bb.fetch2

import firmware

SYSTEM = "recipes-fringed/system/files"
SLOTS = "recipes-fringed/slots/files"
BOOT = "recipes-fringed/boot/files"
WKS = "files/wic"
# Groups of the service that openembedded-core's base-passwd always has.
BASE_GROUPS = {"video"}


def missing(wanted, found):
    """The items of `wanted` that are not in `found`."""
    return [f"missing: {one}" for one in wanted if one not in found]


def ini(text):
    """A file of sections and keys, as used by systemd and RAUC; the last value of a repeated key counts."""
    parser = configparser.RawConfigParser(strict=False)
    parser.optionxform = str
    parser.read_string(text)
    return parser


def fetched(layer, recipe, uris, kind):
    """The downloads that BitBake's fetcher derives from addresses."""
    return [one for one in bb.fetch2.Fetch(uris, layer.recipes[recipe]).ud.values() if one.type == kind]


def version_is_the_workspaces(layer):
    """The recipe has the version of the workspace."""
    version = tomllib.loads((layer.workspace / "Cargo.toml").read_text())["workspace"]["package"]["version"]
    for found in (layer.text("fringed", "PV"), layer.data.getVar("DISTRO_VERSION")):
        if found != version:
            yield f"{found} instead of {version}"


def crates_are_those_of_the_lock_file(layer):
    """BitBake downloads exactly the crates of Cargo.lock, each with its checksum."""
    packages = tomllib.loads((layer.workspace / "Cargo.lock").read_text())["package"]
    wanted = {
        f"https://static.crates.io/crates/{package['name']}/{package['version']}/download": package["checksum"]
        for package in packages
        if "source" in package
    }
    uris = [uri for uri in layer.words("fringed", "SRC_URI") if uri.startswith("crate://")]
    found = {fetch.url: fetch.sha256_expected for fetch in fetched(layer, "fringed", uris, "crate")}
    for url in sorted(wanted.keys() | found.keys()):
        if wanted.get(url) != found.get(url):
            yield f"{url}: {found.get(url)} instead of {wanted.get(url)}"


def source_is_the_checked_out_commit(layer):
    """The recipe builds the commit that is checked out in the workspace that contains the layer."""
    uris = [uri for uri in layer.words("fringed", "SRC_URI") if uri.startswith("git://")]
    head = subprocess.run(
        ["git", "-C", layer.workspace, "rev-parse", "HEAD"], check=True, capture_output=True, text=True
    ).stdout.strip()
    paths = [fetch.path for fetch in fetched(layer, "fringed", uris, "git")]
    revision = layer.text("fringed", "SRCREV")
    if (paths, revision) != ([str(layer.workspace)], head):
        yield f"{paths} at {revision} instead of {layer.workspace} at {head}"
    if layer.text("fringed", "FRINGED_COMMIT") != head[:12]:
        yield f"--version says {layer.text('fringed', 'FRINGED_COMMIT')}"


def licence_texts_are_those_of_the_workspace(layer):
    """The checksums of the licence texts are right."""
    for uri in layer.words("fringed", "LIC_FILES_CHKSUM"):
        name, checksum = re.fullmatch(r"file://(.*);md5=(.*)", uri).groups()
        found = hashlib.md5((layer.workspace / name).read_bytes()).hexdigest()
        if found != checksum:
            yield f"{name}: {checksum} instead of {found}"


def the_build_has_the_devices(layer):
    """The daemon is built with the real head's devices, and with what they need."""
    manifest = tomllib.loads((layer.workspace / "appliance/Cargo.toml").read_text())
    flags = layer.text("fringed", "CARGO_BUILD_FLAGS") + layer.text("fringed", "PACKAGECONFIG_CONFARGS")
    given = dict(re.findall(r"--(package|bin|features) (\S+)", flags))
    if given != {"package": manifest["package"]["name"], "bin": manifest["bin"][0]["name"], "features": "rpi"}:
        yield f"cargo is called with {given}"
    if given.get("features") not in manifest["features"]:
        yield f"appliance has no feature {given.get('features')}"
    if [layer.text("fringed", name) for name in ("BUILD_MODE", "BUILD_DIR")] != ["--profile dist", "dist"]:
        yield "cargo does not build the profile that is shipped"
    yield from missing(["libcamera", "clang-native"], layer.words("fringed", "DEPENDS"))
    yield from missing(["libpisp"], layer.words("libcamera", "DEPENDS"))


def files_are_there(layer):
    """Every source file of a recipe exists, and a recipe installs only its source files."""
    for name, recipe in layer.recipes.items():
        local = [uri for uri in layer.words(name, "SRC_URI") if uri.startswith("file://")]
        for uri in local:
            path = Path(bb.fetch2.Fetch([uri], recipe).localpath(uri))
            if not path.exists() and path.name != "fringed-ca.cert.pem":
                yield f"{name}: {uri} is nowhere in {layer.text(name, 'FILESPATH')}"
        tasks = "".join(layer.text(name, task) for task in ("do_compile", "do_install", "do_deploy"))
        for path in re.findall(re.escape(layer.text(name, "S")) + r"/([\w./-]+)", tasks):
            if f"file://{path}" not in local and not (name == "fringed" and (layer.workspace / path).is_file()):
                yield f"{name}: {path} is installed and not among the sources"


def services_are_installed(layer):
    """Every unit that is switched on is installed."""
    services = {"fringed": ["fringed.service"], "fringed-slots": ["boot-select.mount"]}
    services["fringed-system"] = ["data.mount", "var-lib-fringed.mount"]
    for name, units in services.items():
        if layer.words(name, f"SYSTEMD_SERVICE:{name}") != units:
            yield f"{name}: {layer.words(name, f'SYSTEMD_SERVICE:{name}')} instead of {units}"
        for unit in units:
            if not re.search(rf"/usr/lib/systemd/system/{re.escape(unit)}$|\$units/{re.escape(unit)}$", layer.text(name, "do_install"), re.M):
                yield f"{name}: {unit} is not installed"


def the_user_is_that_of_sysusers(layer):
    """The image's user is the one in systemd/fringed.sysusers, and its groups exist."""
    parameters = layer.text("fringed", "USERADD_PARAM:fringed")
    home = re.search(r"--home-dir (\S+)", parameters)
    groups = re.search(r"--groups (\S+)", parameters)
    made = set(re.findall(r"--system (\S+)(?:;|$)", layer.text("fringed", "GROUPADD_PARAM:fringed")))
    yield from missing(sorted(set(groups[1].split(",")) | {"fringed"}), made | BASE_GROUPS)
    found = {("u", "fringed", home and home[1])} | {("m", "fringed", one) for one in groups[1].split(",")}
    wanted = set()
    for line in (layer.workspace / "systemd/fringed.sysusers").read_text().splitlines():
        word = re.findall(r'"[^"]*"|\S+', line)
        if word[:1] == ["u"]:
            wanted.add(("u", word[1], word[4]))
        elif word[:1] == ["m"]:
            wanted.add(("m", word[1], word[2]))
    if found != wanted:
        yield f"{sorted(found)} instead of {sorted(wanted)}"


def the_image_has_what_it_needs(layer):
    """The image is read-only, has the daemon and updates, and allows no login."""
    development = "allow-root-login" in layer.text("fringed-image", "IMAGE_FEATURES")
    if not development and layer.words("fringed-image", "IMAGE_FEATURES") != ["read-only-rootfs"]:
        yield f"IMAGE_FEATURES are {layer.text('fringed-image', 'IMAGE_FEATURES')}"
    installed = layer.words("fringed-image", "IMAGE_INSTALL")
    wanted = ["fringed", "fringed-system", "fringed-slots", "kernel-modules", "packagegroup-core-boot"]
    yield from missing(wanted + ["rauc", "rauc-mark-good", "rauc-service"], installed)
    for package in installed:
        if re.search("ssh|getty|dropbear|telnet|packagegroup-base", package):
            yield f"{package} is installed"
    units = ["getty.target", "serial-getty@.service", "getty@.service", "debug-shell.service", "emergency.service", "rescue.service"]
    yield from missing(units, layer.text("fringed-image", "fringed_no_logins"))
    yield from missing(["fringed_no_logins"], layer.words("fringed-image", "ROOTFS_POSTPROCESS_COMMAND"))
    if layer.words("systemd", "PACKAGECONFIG") != ["logind", "networkd", "timesyncd"]:
        yield f"systemd comes with {layer.text('systemd', 'PACKAGECONFIG')}"
    yield from missing(["ext4", "wic.xz"], layer.words("fringed-image", "IMAGE_FSTYPES"))


def the_distribution_is_an_appliances(layer):
    """systemd, RAUC and an SBOM are on; no package is named like the distribution, whose override would catch it."""
    if layer.data.getVar("INIT_MANAGER") != "systemd":
        yield f"INIT_MANAGER is {layer.data.getVar('INIT_MANAGER')}"
    yield from missing(["rauc"], layer.data.getVar("DISTRO_FEATURES").split())
    yield from missing(["create-spdx"], layer.data.getVar("INHERIT").split())
    overrides = (layer.data.getVar("DISTROOVERRIDES") + ":" + layer.data.getVar("MACHINEOVERRIDES")).split(":")
    for name in layer.recipes:
        if name in overrides:
            yield f"{name} is a recipe and an override"


def layers_and_branches_are_of_one_release(layer):
    """kas has every layer that this one depends on, all of one release, and every append has a recipe."""
    repositories = layer.configuration["repos"]
    taken = {one for repository in repositories.values() for one in repository.get("layers") or {}}
    needed = ["yocto/meta-fringed", "meta", "meta-oe", "meta-python", "meta-multimedia"]
    yield from missing(needed, taken)
    yield from missing(["meta-raspberrypi", "meta-rauc"], repositories)
    series = layer.data.getVar("LAYERSERIES_COMPAT_fringed")
    for name, repository in repositories.items():
        branch = {"bitbake": "2.18", "fringed": None}.get(name, series)
        if repository.get("branch") != branch:
            yield f"{name}: branch {repository.get('branch')} instead of {branch}"
        if branch and not re.fullmatch("[0-9a-f]{40}|38da0e5866", repository.get("commit", "")):
            yield f"{name}: its commit is {repository.get('commit')}, which pins nothing"
    for collection in layer.data.getVar("LAYERDEPENDS_fringed").split():
        if collection not in layer.data.getVar("BBFILE_COLLECTIONS").split():
            yield f"depends on {collection}, which no layer is"
    yield from (f"{append} is appended to nothing" for append in layer.dangling)


def the_layer_says_whom_to_ask(layer):
    """The layer's README has what yocto-check-layer asks for: maintainers, dependencies, how to build."""
    readme = layer.root / "README.md"
    text = readme.read_text() if readme.exists() else ""
    yield from missing(["Maintainer", "@", "patch", "## Dependencies", "## Build"], text)
    for repository in layer.configuration["repos"].values():
        if repository.get("url"):
            yield from missing([repository["url"], (repository.get("commit") or "no commit")[:10]], text)


def partitions_have_one_name_everywhere(layer):
    """Partitions have the same names in the image, for RAUC, in the mounts and on the command lines."""
    # BitBake refuses to start if a layer has a folder `wic`, as was usual before wrynose.
    if (layer.root / "wic").exists() or not (layer.root / WKS / layer.text("fringed-image", "WKS_FILE")).is_file():
        yield f"{layer.text('fringed-image', 'WKS_FILE')} is not in {WKS}"
        return
    parts = [line for line in layer.file(f"{WKS}/fringed.wks.in").splitlines() if line.startswith("part ")]
    names = [re.search(r"--part-name (\S+)", part)[1] for part in parts]
    if names != ["select", "boot-a", "boot-b", "root-a", "root-b", "data"]:
        yield f"the image has {names}"
    rauc = layer.file("recipes-core/rauc/files/system.conf")
    mounts = layer.file(f"{SYSTEM}/data.mount") + layer.file(f"{SLOTS}/boot-select.mount")
    built = layer.run("fringed-boot", "do_compile", "B")
    lines = "".join((built / f"cmdline-{slot}.txt").read_text() for slot in "ab")
    named = re.findall(r"by-partlabel/([\w-]+)$", rauc + mounts, re.M) + re.findall(r"PARTLABEL=([\w-]+)", lines)
    if set(named) != set(names):
        yield f"{sorted(set(named) ^ set(names))} is named in one place only"
    for slot in "ab":
        yield from missing([f"root=PARTLABEL=root-{slot} rauc.slot={slot.upper()}"], lines)
        number = names.index(f"boot-{slot}") + 1
        for model in firmware.MODELS:
            line = firmware.settings((built / "config.txt").read_text(), model, number).get("cmdline")
            if line != [f"cmdline-{slot}.txt"]:
                yield f"{model}: the slot of partition {number} starts with the command line {line}"


def updates_fit_the_device(layer):
    """A bundle has the slots and the name that a device's RAUC expects, and the backend is where RAUC expects it."""
    rauc = ini(layer.file("recipes-core/rauc/files/system.conf"))
    compatible = rauc["system"]["compatible"].replace("@MACHINE@", layer.configuration["machine"])
    if layer.text("fringed-bundle", "RAUC_BUNDLE_COMPATIBLE") != compatible:
        yield f"bundle for {layer.text('fringed-bundle', 'RAUC_BUNDLE_COMPATIBLE')}, device {compatible}"
    device = layer.run("rauc-conf", "do_install", "D")
    rauc = ini((device / "usr/lib/rauc/system.conf").read_text())
    if rauc["system"]["compatible"] != compatible:
        yield f"a device is {rauc['system']['compatible']} instead of {compatible}"
    slots = {section.split(".")[1] for section in rauc.sections() if section.startswith("slot.")}
    if slots != set(layer.words("fringed-bundle", "RAUC_BUNDLE_SLOTS")):
        yield f"bundle with {layer.text('fringed-bundle', 'RAUC_BUNDLE_SLOTS')}, device with {slots}"
    backend = rauc["handlers"]["bootloader-custom-backend"]
    if not (layer.run("fringed-slots", "do_install", "D") / backend.lstrip("/")).is_file():
        yield f"no {backend} is installed"
    if layer.text("fringed-bundle", "RAUC_BUNDLE_FORMAT") != "verity":
        yield "the bundle is not verified while it is read"
    for variable in ("RAUC_KEY_FILE", "RAUC_CERT_FILE"):
        if not layer.text("fringed-bundle", variable).startswith(layer.data.getVar("FRINGED_KEYS")):
            yield f"{variable} is {layer.text('fringed-bundle', variable)}"
    keyring = layer.text("rauc-conf", "RAUC_KEYRING_FILE")
    if not (device / rauc["keyring"]["path"].lstrip("/")).is_file() or keyring == "ca.cert.pem":
        yield f"the keyring is {keyring}, and the device looks for {rauc['keyring']['path']}"
    yield from missing([f"file://{keyring}"], layer.words("rauc-conf", "SRC_URI"))
    yield from missing([layer.data.getVar("FRINGED_KEYS")], layer.text("rauc-conf", "FILESEXTRAPATHS").split(":"))


def a_slot_is_good_when_fringed_is_ready(layer):
    """A slot is marked good only after fringed has reported READY."""
    complete = ini(layer.file(f"{SYSTEM}/boot-complete.conf"))["Unit"]
    if (complete.get("Requires"), complete.get("After")) != ("fringed.service", "fringed.service"):
        yield "boot-complete.target does not wait for fringed.service"
    yield from missing(["boot-complete.target.d/"], layer.text("fringed-system", "do_install"))
    if ini((layer.workspace / "systemd/fringed.service").read_text())["Service"].get("Type") not in ("notify", "notify-reload"):
        yield "fringed.service is active before READY"


def state_is_on_the_data_partition(layer):
    """The state of fringed is a folder of the data partition, and the journal is bounded."""
    mount = ini(layer.file(f"{SYSTEM}/var-lib-fringed.mount"))
    if (mount["Mount"]["What"], mount["Mount"]["Where"]) != ("/data/fringed", "/var/lib/fringed"):
        yield "/var/lib/fringed is not /data/fringed"
    yield from missing(["/var/lib/fringed"], layer.text("fringed", "do_install"))
    yield from missing(["d /data/fringed 0750 fringed fringed"], layer.file(f"{SYSTEM}/fringed-data.conf"))
    journal = ini(layer.file(f"{SYSTEM}/journald.conf"))["Journal"]
    if journal.get("Storage") != "volatile" or not journal.get("RuntimeMaxUse"):
        yield f"the journal is {dict(journal)}"


def the_kernel_has_the_devices(layer):
    """The kernel has the lines, the display, the bus of its controller, the camera, partitions by name and what RAUC needs."""
    yield from missing(["file://fringed.cfg"], layer.words("linux-raspberrypi", "SRC_URI"))
    options = layer.file("recipes-kernel/linux/files/fringed.cfg").splitlines()
    wanted = ["CONFIG_GPIO_CDEV_V1=y", "CONFIG_DRM_VC4=m", "CONFIG_I2C_CHARDEV=y", "CONFIG_VIDEO_IMX296=m", "CONFIG_EFI_PARTITION=y", "CONFIG_DM_VERITY=y"]
    yield from missing(wanted + ["CONFIG_SQUASHFS=y", "CONFIG_BLK_DEV_LOOP=y", "CONFIG_BCM2835_WDT=y"], options)
    overlays = layer.text("fringed-image", "RPI_KERNEL_DEVICETREE_OVERLAYS").split()
    yield from missing(["overlays/imx296.dtbo"], overlays)


def limits_of_memory_hold(layer):
    """The service's memory limits work: the Pi's kernel counts memory per service only if its command line enables this."""
    service = ini((layer.workspace / "systemd/fringed.service").read_text())["Service"]
    if any(key.startswith("Memory") for key in service):
        yield from missing(["cgroup_enable=memory"], layer.words("fringed-boot", "FRINGED_CMDLINE"))


def the_head_is_that_of_the_hardware_guide(layer):
    """config.txt, the command line and the camera's trigger are those of docs/hardware.md."""
    guide = (layer.workspace / "docs/hardware.md").read_text()
    blocks = re.findall(r"^```\w*\n(.*?)^```", guide, re.M | re.S)
    config = next(block for block in blocks if "camera_auto_detect" in block)
    cameras = {"pi4": "imx296,always-on", "pi5": "imx296,cam0,always-on"}
    for model, camera in cameras.items():
        found = firmware.settings(layer.file(f"{BOOT}/config.txt"), model, 2)
        for line in config.replace(f"={cameras['pi5']}\n", f"={camera}\n").split():
            key, _, value = line.partition("=")
            if value not in found.get(key, []):
                yield f"{model}: {line} is not in force"
        if (others := set(found["dtoverlay"]) & (set(cameras.values()) - {camera})):
            yield f"{model}: {others} of another model is in force"
    line = next(block for block in blocks if block.startswith("video="))
    yield from missing(line.split(), layer.words("fringed-boot", "FRINGED_CMDLINE"))
    trigger = next(block for block in blocks if block.startswith("options imx296"))
    yield from missing(trigger.splitlines(), layer.file(f"{SYSTEM}/imx296.conf").splitlines())
    chip = {"raspberrypi4-64": "bcm2835"}.get(layer.configuration["machine"], "pisp")
    if layer.text("fringed-system", "CAMERA_PIPELINE") != chip:
        yield f"the camera's pipeline is {layer.text('fringed-system', 'CAMERA_PIPELINE')} instead of {chip}"
    if ("pinctrl-bcm2711" in layer.text("fringed", "do_install")) != (chip == "bcm2835"):
        yield "the configuration is for the lines of another Pi"


ALL = [
    version_is_the_workspaces,
    crates_are_those_of_the_lock_file,
    source_is_the_checked_out_commit,
    licence_texts_are_those_of_the_workspace,
    the_build_has_the_devices,
    files_are_there,
    services_are_installed,
    the_user_is_that_of_sysusers,
    the_image_has_what_it_needs,
    the_distribution_is_an_appliances,
    layers_and_branches_are_of_one_release,
    the_layer_says_whom_to_ask,
    partitions_have_one_name_everywhere,
    updates_fit_the_device,
    a_slot_is_good_when_fringed_is_ready,
    state_is_on_the_data_partition,
    the_kernel_has_the_devices,
    limits_of_memory_hold,
    the_head_is_that_of_the_hardware_guide,
]
