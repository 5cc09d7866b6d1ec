# What the scripts share that fetch Debian's packages; they source it.

# apt_of_its_own DIR [LINE…]: from here on, apt resolves and downloads with lists of its own, all of it in DIR, from the machine's sources:
# nothing is installed and nothing of the machine changes, so no root is needed. LINE… are further lines of apt.conf.
apt_of_its_own() {
    local dir=$1
    shift
    mkdir -p "$dir"/{lists,archives}/partial
    printf '%s\n' >"$dir/apt.conf" \
        "APT::Sandbox::User \"$(id -un)\";" \
        'APT::Update::Post-Invoke { "true"; };' \
        "Dir::State::Lists \"$dir/lists\";" \
        "Dir::Cache::Archives \"$dir/archives\";" \
        'Dir::Cache::pkgcache "";' \
        'Dir::Cache::srcpkgcache "";' \
        'Debug::NoLocking "true";' \
        "$@"
    export APT_CONFIG=$dir/apt.conf
}

# sources_of_its_own DIR 'KIND SUITE'…: as apt_of_its_own, from other suites of Debian: where the machine's own packages come from, these are
# as well. Fails where the machine's apt knows of no Debian.
sources_of_its_own() {
    local dir=$1 archive source
    shift
    archive=$(env -u APT_CONFIG apt-get indextargets --format '$(SITE) $(RELEASE) $(CREATED_BY)' |
        awk '$3 == "Packages" && $2 !~ /security/ { print $1; exit }')
    [[ -n $archive ]] || { echo "apt knows of no Debian archive" >&2; return 1; }
    for source in "$@"; do
        echo "${source% *} [signed-by=/usr/share/keyrings/debian-archive-keyring.gpg] $archive ${source#* } main"
    done >"$dir/sources.list"
    printf '%s\n' "Dir::Etc::SourceList \"$dir/sources.list\";" 'Dir::Etc::SourceParts "/dev/null";' >>"$APT_CONFIG"
}

# installed PACKAGE…: with CI=true, installs what is not there yet. Fails where that is not possible, as without root, and without CI=true.
installed() {
    local states
    # dpkg also shows packages that are not installed, where others name them.
    if states=$(dpkg-query --show --showformat '${db:Status-Status}\n' "$@" 2>/dev/null) && ! grep -qvx installed <<<"$states"; then
        return 0
    fi
    if [[ ${CI:-} != true ]]; then
        echo "not installed, and installed only with CI=true: $*" >&2
        return 1
    fi
    [[ $(id -u) -eq 0 ]] && command -v apt-get >/dev/null || return 1
    { apt-get install -y -qq --no-install-recommends "$@" ||
        { apt-get update -qq && apt-get install -y -qq --no-install-recommends "$@"; }; } >&2
}
