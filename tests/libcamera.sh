# What both builds of libcamera share, the virtual machine's and the one for aarch64; they source it and say with `unavailable REASON`, which
# ends them, what cannot be had. The source is Debian's package, of the version and the checksum in tests/vm/pins.
source "$(dirname "${BASH_SOURCE[0]}")/apt.sh"
source "$(dirname "${BASH_SOURCE[0]}")/vm/pins"
libcamera_version=${libcamera%-*}

# libcamera_source DIR: unpacks the source into DIR/source. What its build needs is installed as tests/apt.sh says (CI=true).
libcamera_source() {
    local dir=$1 archive
    local tools=(meson ninja-build g++ pkg-config libclang-dev openssl python3-jinja2 python3-ply python3-yaml)
    installed "${tools[@]}" || unavailable "install ${tools[*]}"
    apt_of_its_own "$dir/apt"
    sources_of_its_own "$dir/apt" "deb-src $libcamera_suite" || unavailable "its source is Debian's"
    apt-get update -qq || unavailable "apt cannot read the sources of Debian $libcamera_suite (the reason stands above)"
    (cd "$dir/apt" && apt-get source -qq --download-only "libcamera=$libcamera") ||
        unavailable "Debian $libcamera_suite has left $libcamera behind; it has $(apt-cache showsrc libcamera |
            awk '/^Version:/ { print $2 }' | paste -sd ' '): name another one, and its checksum, in tests/vm/pins"
    unset APT_CONFIG
    archive=$dir/apt/libcamera_$libcamera_version.orig.tar.gz
    echo "$libcamera_checksum  $archive" | sha256sum --check --quiet || unavailable "the source is not the one that was pinned"
    mkdir -p "$dir/source"
    tar -xzf "$archive" -C "$dir/source" --strip-components=1
    rm -rf "$dir/apt"
}

# libcamera_build DIR LIBDIR OPTION…: builds DIR/source with these options of meson, and installs it into DIR/root.
libcamera_build() {
    local dir=$1 libdir=$2 feature
    shift 2
    local options=(--prefix=/usr --sysconfdir=/etc --libdir="$libdir" --buildtype=release --wrap-mode=nodownload -Dudev=enabled -Dtest=false)
    for feature in apps-output-dng cam documentation gstreamer lc-compliance libdw libunwind pycamera qcam rpi-awb-nn softisp-gpu tracing v4l2; do
        options+=("-D$feature=disabled")
    done
    # Debian's own Python has the modules; another one may stand before it in the path.
    {
        PATH=/usr/bin:$PATH meson setup "$dir/build" "$dir/source" "${options[@]}" "$@" &&
            PATH=/usr/bin:$PATH ninja -C "$dir/build" &&
            PATH=/usr/bin:$PATH DESTDIR=$dir/root meson install -C "$dir/build" --no-rebuild
    } >"$dir/build.log" 2>&1 || {
        tail -n 40 "$dir/build.log" >&2
        unavailable "its build failed (the end of $dir/build.log stands above)"
    }
    rm -rf "$dir"/{source,build}
}
