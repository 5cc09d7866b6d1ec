#!/usr/bin/env bash
# Times other decoders and ours, in a virtual environment of its own.
#
#     tests/peers/run.sh target/dist/fringed-lab               kernels and peers, printed
#     tests/peers/run.sh target/dist/fringed-lab DIR           the whole benchmark, to a folder
#
# Needs python3 with venv, a C compiler, and the network for the first run.
set -euo pipefail
lab=$1
out=${2:-}
here=$(dirname "${BASH_SOURCE[0]}")
environment=${CARGO_TARGET_DIR:-target}/peers
frames=$(mktemp -d)
trap 'rm -rf "$frames"' EXIT

if [[ ! -x $environment/bin/python ]]; then python3 -m venv "$environment"; fi
"$environment/bin/python" -m pip install --quiet --disable-pip-version-check -r "$here/requirements.txt"
"$lab" bench --quiet --frames "$frames"
if [[ -n $out ]]; then
    "$lab" bench --quiet --out "$out"
    "$environment/bin/python" "$here/peers.py" "$frames" "$out"
    "$environment/bin/python" "$here/plots.py" "$out"
else
    "$lab" bench kernel --quiet --out "$frames"
    "$environment/bin/python" "$here/peers.py" "$frames" "$frames"
fi
