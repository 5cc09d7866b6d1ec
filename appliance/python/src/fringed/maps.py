"""Maps of a measured part or of a recipe: coordinates, uncertainty, deviation and modulation of each pixel."""

from __future__ import annotations

import io
import json
import zipfile
from contextlib import suppress
from dataclasses import dataclass
from typing import Any

import numpy
from numpy.typing import NDArray

from .errors import FringedError, NotThere
from .http import COMPUTING, Device

Map = NDArray[numpy.float32]
NAMES = ("x", "y", "z", "sigma", "deviation", "modulation")


@dataclass(frozen=True, eq=False)
class Maps:
    """Arrays of H x W, f4, NaN where there is no value: `x`, `y`, `z`, `sigma` (1 sigma of z) and `deviation` in mm,
    `modulation` in counts. `meta` names device, result, recipe, units and axes."""

    meta: dict[str, Any]
    x: Map
    y: Map
    z: Map
    sigma: Map
    deviation: Map
    modulation: Map

    @property
    def resolved(self) -> NDArray[numpy.bool_]:
        """Which pixels have coordinates, H x W."""
        return ~numpy.isnan(self.z)

    def points(self) -> Map:
        """x, y, z of the resolved pixels, N x 3, row by row, mm."""
        resolved = self.resolved
        return numpy.stack([self.x[resolved], self.y[resolved], self.z[resolved]], axis=1)


def fetch(device: Device, path: str) -> Maps:
    """The maps at a path, in an NPZ file. An array that the file lacks has no value anywhere."""
    with device.ask("GET", path, wait=COMPUTING) as answer:
        npz = io.BytesIO(answer.body())
    try:
        with numpy.load(npz, allow_pickle=False) as file:
            none = numpy.full(file["z"].shape, numpy.nan, "<f4")
            return Maps(json.loads(str(file["meta"][()])), *(file[name] if name in file else none for name in NAMES))
    except (AttributeError, KeyError, OSError, ValueError, zipfile.BadZipFile) as error:
        raise FringedError(f"the maps cannot be read: {error}") from error


def of_result(device: Device, seq: int, history: str) -> Maps:
    """The maps of a result: those of the last measured part if it is that, else worked out from its frames."""
    if device.json("GET", "/api/snapshot")["counters"]["sequence"] == seq:
        with suppress(NotThere):  # After a restart there is no last part.
            maps = fetch(device, "/api/last/maps.npz")
            if (maps.meta["seq"], maps.meta["history"]) == (seq, history):
                return maps
    try:
        maps = fetch(device, f"/api/history/{seq}/maps.npz")
    except NotThere as error:
        remedy = "read maps before the next part is measured, or let the device keep frames: history.good_every"
        raise NotThere(error.words, error.status, remedy) from error
    if maps.meta["history"] != history:
        raise NotThere(f"the history was begun anew: result {seq} is another one now")
    return maps
