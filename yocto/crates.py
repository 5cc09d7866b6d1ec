#!/usr/bin/env python3
"""Writes the list of crates that the recipe downloads, from Cargo.lock; or checks that the list still matches Cargo.lock.

    yocto/crates.py            writes meta-fringed/recipes-fringed/fringed/fringed-crates.inc
    yocto/crates.py --check    ends with 1 and a difference where that file is not what would be written

Each crate is there with its SHA-256, so that a build takes exactly the crates that were tested. The form is that of
OpenEmbedded's class `cargo-update-recipe-crates`, which does the same inside a build. Standard library only.
"""

import argparse
import difflib
import sys
import tomllib
from pathlib import Path

REGISTRY = "registry+https://github.com/rust-lang/crates.io-index"
HERE = Path(__file__).resolve().parent
LOCK = HERE.parent / "Cargo.lock"
LIST = HERE / "meta-fringed/recipes-fringed/fringed/fringed-crates.inc"


def text(lock: Path) -> str:
    """The list for a lock file; exits if a package is neither from crates.io nor from the workspace."""
    crates = []
    for package in tomllib.loads(lock.read_text())["package"]:
        name, version, source = package["name"], package["version"], package.get("source")
        if source is None:
            continue
        if source != REGISTRY or "checksum" not in package:
            sys.exit(f"{lock}: {name} {version} comes from {source}: the recipe can only take crates.io with a checksum")
        crates.append((f"{name}-{version}", f"{name}/{version}", package["checksum"]))
    crates.sort()
    lines = ["# From Cargo.lock by yocto/crates.py; not to be edited.", "", 'SRC_URI += "\\']
    lines += [f"    crate://crates.io/{path};name={key} \\" for key, path, _ in crates]
    lines += ['"', ""]
    lines += [f'SRC_URI[{key}.sha256sum] = "{checksum}"' for key, _, checksum in crates]
    return "\n".join(lines) + "\n"


def main() -> None:
    """The command line."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--check", action="store_true", help="only compare")
    parser.add_argument("--lock", type=Path, default=LOCK, help="the lock file (default: that of the workspace)")
    parser.add_argument("--list", type=Path, default=LIST, help="the list of crates (default: that of the recipe)")
    arguments = parser.parse_args()
    wanted = text(arguments.lock)
    if not arguments.check:
        arguments.list.write_text(wanted)
        return
    found = arguments.list.read_text() if arguments.list.exists() else ""
    if found != wanted:
        difference = difflib.unified_diff(found.splitlines(), wanted.splitlines(), "is", "should be", lineterm="", n=0)
        print("\n".join(list(difference)[:12]), file=sys.stderr)
        sys.exit(f"{arguments.list.name} is not the list of {arguments.lock.name}: run yocto/crates.py")


if __name__ == "__main__":
    main()
