#!/usr/bin/env bash
# Checks the Python client: installs it, checks its types, runs its tests, and triggers a real station.
#
#     appliance/python/check.sh PYTHON PROGRAM [COUNT]
#
# PYTHON has numpy and mypy; PROGRAM is the daemon. Leaves nothing behind.
set -euo pipefail

python=$1 program=$2 count=${3:-30}
here=$(cd "$(dirname "$0")" && pwd)
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT
export PYTHONDONTWRITEBYTECODE=1 PYTHONPATH=$work/installed

version=$(sed -n 's/^version = "\(.*\)"$/\1/p' "$here/../../Cargo.toml" | head -n 1)
grep -qx "version = \"$version\"" "$here/pyproject.toml" || {
    echo "the version in pyproject.toml is not that of the workspace, $version" >&2
    exit 1
}

# A build writes beside its sources: build a copy.
cp -r "$here/pyproject.toml" "$here/src" "$work"
isolated=()
"$python" -c 'import setuptools; assert int(setuptools.__version__.split(".")[0]) >= 77' 2>/dev/null &&
    isolated=(--no-build-isolation)
"$python" -m pip install --quiet --disable-pip-version-check --no-deps ${isolated[@]+"${isolated[@]}"} \
    --target "$work/installed" "$work"
test -e "$work/installed/fringed/py.typed"

export MYPYPATH=$here/src
"$python" -m mypy --strict --cache-dir "$work/mypy" "$here/src/fringed"
"$python" -m mypy --strict --cache-dir "$work/mypy" --ignore-missing-imports "$here/examples/ros2_node.py"
"$python" -m unittest discover -s "$here/tests"
"$python" "$here/tests/station.py" "$program" "$count"
