#!/usr/bin/env bash
# Builds libcamera with its virtual and vimc pipelines into DIR; what Debian 12 packages is too old for the crate.
#
#     tests/vm/libcamera.sh DIR
#     export PKG_CONFIG_PATH=DIR/root/usr/lib/x86_64-linux-gnu/pkgconfig     to build against it
#     export LD_LIBRARY_PATH=DIR/root/usr/lib/x86_64-linux-gnu               to run with it
#
# DIR/root is laid out as it lies in the virtual machine's root. The source is Debian's package, of the version and the checksum
# in `pins`, fetched by apt with lists of its own. What its build needs is installed where this runs as root. DIR keeps it: a second
# call only looks whether it is there. Ends with 69 (EX_UNAVAILABLE) and the reason where it cannot be had.
set -euo pipefail

here=$(cd "$(dirname "${BASH_SOURCE[0]}")" && pwd)
source "$here/pins"
version=${libcamera%-*}
tools=(meson ninja-build g++ pkg-config libclang-dev libssl-dev libudev-dev libyaml-dev libyuv-dev openssl
    python3-jinja2 python3-ply python3-yaml)
pipelines=virtual,vimc

mkdir -p "${1:?usage: libcamera.sh DIR}"
dir=$(cd "$1" && pwd)
wanted=$({ cat "$here/libcamera.sh" && echo "$libcamera $libcamera_checksum"; } | sha256sum)

unavailable() {
    echo "no libcamera $version: $1" >&2
    exit 69
}

[[ $(cat "$dir/complete" 2>/dev/null) == "$wanted" ]] && exit 0
if [[ ! -f $dir/.libcamera && -n $(ls -A "$dir") ]]; then
    echo "$dir holds files that are not from this script: name a folder of its own" >&2
    exit 64
fi
[[ $(dpkg --print-architecture 2>/dev/null) == amd64 ]] || unavailable "this is no Debian on x86-64"
rm -rf "$dir"
mkdir -p "$dir"/apt/lists/partial
touch "$dir/.libcamera"

if ! dpkg-query --show "${tools[@]}" >/dev/null 2>&1; then
    [[ $(id -u) -eq 0 ]] || unavailable "install ${tools[*]}"
    { apt-get install -y -qq --no-install-recommends "${tools[@]}" ||
        { apt-get update -qq && apt-get install -y -qq --no-install-recommends "${tools[@]}"; }; } >&2 ||
        unavailable "apt cannot install ${tools[*]} (the reason stands above)"
fi

# Where this machine's own packages come from, its newest suite is as well.
archive=$(apt-get indextargets --format '$(SITE) $(RELEASE) $(CREATED_BY)' |
    awk '$3 == "Packages" && $2 !~ /security/ { print $1; exit }')
[[ -n $archive ]] || unavailable "apt knows of no Debian archive"

cat >"$dir/apt/apt.conf" <<END_OF_CONF
APT::Sandbox::User "$(id -un)";
APT::Update::Post-Invoke { "true"; };
Dir::Etc::SourceList "$dir/apt/sources.list";
Dir::Etc::SourceParts "/dev/null";
Dir::State::Lists "$dir/apt/lists";
Dir::Cache::pkgcache "";
Dir::Cache::srcpkgcache "";
Debug::NoLocking "true";
END_OF_CONF
echo "deb-src [signed-by=/usr/share/keyrings/debian-archive-keyring.gpg] $archive $libcamera_suite main" >"$dir/apt/sources.list"
export APT_CONFIG=$dir/apt/apt.conf
apt-get update -qq || unavailable "apt cannot read the sources of Debian $libcamera_suite (the reason stands above)"
(cd "$dir/apt" && apt-get source -qq --download-only "libcamera=$libcamera") ||
    unavailable "Debian $libcamera_suite has left $libcamera behind; it has $(apt-cache showsrc libcamera |
        awk '/^Version:/ { print $2 }' | paste -sd ' '): name another one, and its checksum, in tests/vm/pins"
unset APT_CONFIG
source=$dir/apt/libcamera_$version.orig.tar.gz
echo "$libcamera_checksum  $source" | sha256sum --check --quiet || unavailable "the source is not the one that was pinned"
mkdir "$dir/source"
tar -xzf "$source" -C "$dir/source" --strip-components=1

# Debian's own Python has the modules; another one may stand before it in the path.
export PATH=/usr/bin:$PATH
features=()
for feature in apps-output-dng cam documentation gstreamer lc-compliance libdw libunwind pycamera qcam rpi-awb-nn softisp-gpu tracing v4l2; do
    features+=("-D$feature=disabled")
done
{
    meson setup "$dir/build" "$dir/source" --prefix=/usr --sysconfdir=/etc --libdir=lib/x86_64-linux-gnu \
        --buildtype=release --wrap-mode=nodownload -Dpkgconfig.relocatable=true \
        -Dpipelines=$pipelines -Dipas=vimc -Dudev=enabled -Dtest=false "${features[@]}" &&
        ninja -C "$dir/build" &&
        DESTDIR=$dir/root meson install -C "$dir/build" --no-rebuild
} >"$dir/build.log" 2>&1 || {
    tail -n 40 "$dir/build.log" >&2
    unavailable "its build failed (the end of $dir/build.log stands above)"
}

rm -rf "$dir"/{apt,source,build}
echo "$wanted" >"$dir/complete"
