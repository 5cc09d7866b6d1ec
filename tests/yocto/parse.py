"""Parses the layer with BitBake's own parser and reports which promises its variables do not keep.

    parse.py WORKSPACE FOLDER CONFIGURATION

CONFIGURATION is the output of `kas dump --format json`, FOLDER is for BitBake's files. The folder `layers` has substitutes for
the other layers: the recipes that are appended to, and classes that do nothing. So this shows that the layer can be
parsed and has the right content, not that it builds.
"""

import json
import logging
import os
import shutil
import subprocess
import sys
import types
from pathlib import Path

# PyPI's BitBake has no hash and revision servers; parsing does not need them.
for absent in ("hashserv", "hashserv.client", "prserv", "prserv.serv"):
    sys.modules[absent] = types.ModuleType(absent)

import bb.cooker
import bb.cookerdata

import promises


class Layer:
    """All recipes of the layer, as BitBake sees them for one configuration."""

    def __init__(self, workspace: Path, folder: Path, configuration: dict):
        self.workspace = workspace
        self.root = workspace / "yocto/meta-fringed"
        self.configuration = configuration
        self.data, files = self.configured(folder)
        recipes, _, _ = files.collect_bbfiles(self.data, self.data)
        self.recipes = {}
        used = set()
        for recipe in recipes:
            appends = files.get_file_appends(recipe)
            used.update(appends)
            self.data.setVar("FILE", recipe)
            parsed = self.builder.parseRecipeVariants(recipe, appends, mc="", layername="fringed")[""]
            if parsed.getVar("__SKIPPED", False):
                sys.exit(f"{recipe}: skipped: {parsed.getVar('__SKIPPED', False)}")
            self.recipes[parsed.getVar("PN")] = parsed
        self.dangling = [append for _, append in files.bbappends if append not in used]

    def configured(self, folder: Path):
        """The configuration as kas would write it."""
        stand_ins = Path(__file__).resolve().parent / "layers"
        layers = [stand_ins / "core", stand_ins / "others", self.root]
        (folder / "conf").mkdir(parents=True, exist_ok=True)
        (folder / "conf/bblayers.conf").write_text(
            f'BBPATH = "{folder}"\nBBFILES = ""\nBBLAYERS = "{" ".join(map(str, layers))}"\n'
        )
        headers = self.configuration.get("local_conf_header", {}).values()
        names = f'MACHINE = "{self.configuration["machine"]}"\nDISTRO = "{self.configuration["distro"]}"\n'
        (folder / "conf/local.conf").write_text(names + "\n".join(headers))
        os.chdir(folder)
        settings = bb.cookerdata.CookerConfiguration()
        settings.env = {"PATH": os.environ["PATH"]}
        self.builder = bb.cookerdata.CookerDataBuilder(settings, True)
        self.builder.parseBaseConfiguration()
        return self.builder.data, bb.cooker.CookerCollectFiles([])

    def text(self, recipe: str, variable: str) -> str:
        """A variable of a recipe, as BitBake expands it."""
        return self.recipes[recipe].getVar(variable) or ""

    def words(self, recipe: str, variable: str) -> list[str]:
        """The same as a list."""
        return self.text(recipe, variable).split()

    def run(self, recipe: str, task: str, variable: str) -> Path:
        """Runs a shell task on the recipe's own files, as BitBake would; returns the folder in `variable` afterwards."""
        sources, result = Path(self.text(recipe, "UNPACKDIR")), Path(self.text(recipe, variable))
        for folder in (sources, result):
            shutil.rmtree(folder, ignore_errors=True)
            folder.mkdir(parents=True)
        for uri in self.words(recipe, "SRC_URI"):
            path = Path(bb.fetch2.Fetch([uri], self.recipes[recipe]).localpath(uri))
            # The certificate is made by yocto/keys.sh, a different one for each product.
            (sources / path.name).write_bytes(path.read_bytes() if path.exists() else b"certificate\n")
        shell = f"set -eu\n{self.text(recipe, task)}"
        ended = subprocess.run(["sh", "-c", shell], cwd=sources, capture_output=True, text=True, check=False)
        if ended.returncode != 0:
            sys.exit(f"{recipe}: {task} ends with {ended.returncode}: {ended.stderr.strip()}")
        return result

    def file(self, path: str) -> str:
        """The text of a file of the layer."""
        return (self.root / path).read_text()


def main() -> None:
    """The command line."""
    workspace, folder, configuration = map(Path, sys.argv[1:])
    logging.basicConfig(level=logging.WARNING, format="%(message)s")
    try:
        layer = Layer(workspace.resolve(), folder.resolve(), json.loads(configuration.read_text()))
    except (bb.BBHandledException, bb.parse.ParseError, bb.data_smart.ExpansionError, SyntaxError) as error:
        sys.exit(f"BitBake does not parse the layer: {error}")
    broken = 0
    for promise in promises.ALL:
        for message in promise(layer):
            print(f"{promise.__doc__}\n    {message}", file=sys.stderr)
            broken += 1
    print(f"{layer.configuration['machine']}: {len(layer.recipes)} recipes parsed, {len(promises.ALL)} promises, {broken} broken")
    sys.exit(1 if broken else 0)


if __name__ == "__main__":
    main()
