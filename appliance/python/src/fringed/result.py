"""A result: the verdict on one part, with what was measured."""

from __future__ import annotations

import os
from collections import Counter
from dataclasses import dataclass, field
from datetime import datetime, timedelta, timezone
from functools import cached_property
from typing import Any, Mapping, Type, TypeVar

from . import maps
from .errors import FringedError
from .http import Device

EPOCH = datetime(1970, 1, 1, tzinfo=timezone.utc)
PASSED, VALID = 1, 2
T = TypeVar("T")


@dataclass(frozen=True)
class Gauge:
    """What a gauge measured: `value`, its `sigma` (1 sigma) and expanded uncertainty `u`, and the limits `low` and
    `high`, None where there is none; `decision` has the bits of the registers 1116 to 1179. `passed`: the value is
    within its limits; `valid`: there is a value."""

    slot: int
    name: str
    unit: str
    value: float | None
    sigma: float | None
    u: float | None
    low: float | None
    high: float | None
    decision: int
    reason: str | None
    passed: bool
    valid: bool


@dataclass(frozen=True)
class Result:
    """A stored result. `verdict` is PASS, FAIL or INVALID; `time` that of the trigger, None if the device did not
    know it. `gauges` by name; where gauges share a name, as "NAME (slot N)"."""

    seq: int
    verdict: str
    reason: str | None
    recipe: int
    fingerprint: str
    part_id: int
    press_stroke: int
    time: datetime | None
    clock: str
    error_code: int
    flags: int
    exposure_us: int
    processing_us: int
    coverage: float
    placement: list[float | None] | None
    token: str | None
    history: str
    gauges: Mapping[str, Gauge]
    _device: Device = field(repr=False, compare=False)

    def __getitem__(self, name: str) -> Gauge:
        if name not in self.gauges:
            raise KeyError(f"result {self.seq} has no gauge {name!r}; it has {', '.join(self.gauges) or 'none'}")
        return self.gauges[name]

    @cached_property
    def maps(self) -> maps.Maps:
        """The maps of the part; fetched once."""
        return maps.of_result(self._device, self.seq, self.history)

    def save_recording(self, path: str | os.PathLike[str]) -> None:
        """Writes the frames of the part, where the device kept them, to a ZIP file."""
        self._device.save(f"/api/history/{self.seq}/recording.zip", path)


def _known(kind: Type[T], values: Mapping[str, Any]) -> T:
    """An instance of a dataclass; newer firmware may send more than its fields."""
    return kind(**{name: values[name] for name in kind.__annotations__})


def of_line(line: Mapping[str, Any], device: Device) -> Result:
    """The result in a line of GET /api/results."""
    try:
        rows = [_known(Gauge, {**row, "passed": bool(row["decision"] & PASSED), "valid": bool(row["decision"] & VALID)})
                for row in line["gauges"]]
        count = Counter(row.name for row in rows)
        gauges = {row.name if count[row.name] == 1 else f"{row.name} (slot {row.slot})": row for row in rows}
        at = line["at_unix_ms"]
        at = None if at is None else EPOCH + timedelta(milliseconds=at)
        return _known(Result, {"reason": None, **line, "time": at, "token": line.get("request"), "gauges": gauges,
                               "_device": device})
    except (KeyError, TypeError, OverflowError) as error:
        raise FringedError(f"a result cannot be read: {error!r}") from error
