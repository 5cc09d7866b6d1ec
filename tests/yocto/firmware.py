"""A model of how the Pi's firmware reads config.txt: the settings in force on one model, started from one partition.

A filter stays in force until the next one of its kind; filters of different kinds have to fit together; `[all]` takes
every filter back (Raspberry Pi's documentation of config.txt, "Conditional filters").
"""

import re

MODELS = ("pi4", "pi5")


def settings(text: str, model: str, partition: int) -> dict[str, list[str]]:
    """All values of each key, in order; raises ValueError for a filter that is not modelled here."""
    filters: dict[str, bool] = {}
    found: dict[str, list[str]] = {}
    for line in map(str.strip, text.splitlines()):
        if not line or line.startswith("#"):
            continue
        if section := re.fullmatch(r"\[(\w+)(?:=(\d+))?\]", line):
            name, value = section.groups()
            if name == "all":
                filters.clear()
            elif name in MODELS:
                filters["model"] = name == model
            elif name == "boot_partition" and value:
                filters["partition"] = int(value) == partition
            else:
                raise ValueError(f"the filter {line} is not modelled")
        elif all(filters.values()):
            key, _, value = line.partition("=")
            found.setdefault(key, []).append(value)
    return found
