#!/usr/bin/env bash
# Makes in DIR the Python environment that checks the Yocto layer: the pinned versions of requirements.txt, from PyPI.
#
#     tests/yocto/tools.sh DIR
#
# DIR keeps it: a second call only looks whether it is complete. Ends with 69 (EX_UNAVAILABLE) and the reason where it
# cannot be had.
set -euo pipefail
mkdir -p "${1:?usage: tools.sh DIR}"
dir=$(cd "$1" && pwd)
requirements=$(cd "$(dirname "${BASH_SOURCE[0]}")" && pwd)/requirements.txt

unavailable() {
    echo "the layer cannot be checked: $1" >&2
    exit 69
}

# The folder may have been copied from elsewhere, and its programs name their place.
made="$dir $(cksum <"$requirements")"
[[ $(cat "$dir/complete" 2>/dev/null) == "$made" ]] && exit 0
python3 -c 'import tomllib' 2>/dev/null || unavailable "there is no Python of 3.11 or newer"
command -v git >/dev/null || unavailable "there is no git, which the recipe asks for its commit"
python3 -m venv --clear "$dir/python" || unavailable "Python makes no environment (Debian package python3-venv)"
"$dir/python/bin/python" -m pip install --quiet --disable-pip-version-check -r "$requirements" ||
    unavailable "PyPI does not give what requirements.txt names (the reason stands above)"
echo "$made" >"$dir/complete"
