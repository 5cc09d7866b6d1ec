"""A head: triggers it, reads its results, follows its state, exchanges recipes."""

from __future__ import annotations

import os
import time
from datetime import datetime, timedelta
from typing import Any, Iterator, Union
from uuid import uuid4

import numpy
from numpy.typing import NDArray

from . import maps, result
from .errors import Busy, DeviceProblem, FringedError, NotThere, TooOld, Unfit, Unreachable
from .http import COMPUTING, Device
from .result import EPOCH, Result

Time = Union[str, datetime]

PAGE = 10_000  # The most results of one answer of the device.
PAUSE = 0.2  # Before a request is repeated, s.
SILENCE = 5.0  # Longest wait for an event, of which the device sends one a second, s.
LOADED, UNKNOWN, INTERRUPTED = 0, 1, 4  # RECIPE_RESULT, register 109.
# Of a table.
COLUMNS = [("seq", "i8"), ("time", "M8[us]"), ("recipe", "i4"), ("part_id", "u4"), ("press_stroke", "u4"),
           ("verdict", "U7")]


class Head:
    """A head at `url`. Reading needs no `secret`; a change does. `timeout`: longest wait for an answer, s. `user`:
    whose secret it is; without it, that of the device. Threads may share a head."""

    def __init__(self, url: str, secret: str | None = None, timeout: float = 10.0, *, user: str | None = None) -> None:
        self._device = Device(url, secret, timeout, user)

    def snapshot(self) -> dict[str, Any]:
        """The present state of the station."""
        return self._device.json("GET", "/api/snapshot")

    def trigger(self, recipe: int | None = None, part_id: int | None = None, press_stroke: int | None = None,
                token: str | None = None, timeout: float = 60.0) -> Result:
        """Measures the part in front of the head and waits for its result.

        The token (1 to 64 ASCII characters without spaces, by default random) names the part: however often it is
        sent, the device measures once. So where a connection breaks or the device restarts, the same token is sent
        again, until `timeout` s have passed.
        """
        wanted = {"token": token or uuid4().hex, "recipe": recipe, "part_id": part_id, "press_stroke": press_stroke}
        order = {key: value for key, value in wanted.items() if value is not None}
        deadline, lost = time.monotonic() + timeout, False
        while True:
            try:
                wait = min(self._device.timeout, max(deadline - time.monotonic(), PAUSE))
                answer = self._device.json("POST", "/api/trigger", order, wait)
                if "result" not in answer:
                    raise TooOld("the firmware of this head takes no tokens", 202)
                return result.of_line(answer["result"], self._device)
            except (Unreachable, Busy, DeviceProblem) as error:
                lost = lost or isinstance(error, Unreachable)
                # After a lost answer the device may have started again, and not be ready yet.
                if not (error.status in (None, 408, 502, 503, 504) or (lost and error.status == 409)):
                    raise
                if time.monotonic() + PAUSE > deadline:
                    remedy = f"trigger(token={order['token']!r}) asks for this result again, without measuring twice"
                    raise type(error)(error.words, error.status, remedy) from error
            time.sleep(PAUSE)

    def load(self, recipe: int, timeout: float = 60.0) -> None:
        """Makes a recipe the active one, and waits until it is."""
        self._device.json("POST", f"/api/recipes/{recipe}/load")
        deadline = time.monotonic() + timeout
        while (now := self.snapshot())["state"] == "loading":
            if time.monotonic() > deadline:
                raise Busy(f"recipe {recipe} is not loaded after {timeout:g} s")
            time.sleep(PAUSE)
        if now["requested_recipe"] != recipe:
            raise Busy(f"recipe {now['requested_recipe']} was requested while recipe {recipe} was loaded")
        if now["recipe_result"] != LOADED:
            kind = {UNKNOWN: NotThere, INTERRUPTED: Busy}.get(now["recipe_result"], Unfit)
            raise kind((now["refusal"] or now["fault"] or {}).get("words") or f"recipe {recipe} could not be loaded")

    def results(self, since: Time | None = None, until: Time | None = None, after: int | None = None,
                recipe: int | None = None) -> Iterator[Result]:
        """Stored results, oldest first, read as they are needed; any number of them.

        `since` and `until` (exclusive) are a datetime or its ISO text; without a time zone they are local time, a
        date is its midnight. Results of unknown time are yielded, too, from the last known one before `since` to the
        first known one at or past `until`. `after`: only results with a larger SEQ.
        """
        begin = max(after or 0, 0 if since is None else self._newest_before(_aware(since)))
        before = None if until is None else _aware(until)
        end = 0 if before is None else self._newest_before(before)
        history, found = None, True
        while found:
            found = False
            try:
                with self._device.ask("GET", f"/api/results?after={begin}&limit={PAGE}") as answer:
                    lines = answer.lines()
                    header = answer.object(next(lines, b""))
                    if history not in (None, header.get("history")):
                        raise FringedError("the history was begun anew while it was read", remedy="read it again")
                    history = header.get("history")
                    for line in lines:
                        one = result.of_line(answer.object(line), self._device)
                        begin, found = one.seq, True
                        late = before is not None and one.time is not None and one.time >= before
                        if late and one.seq > end:
                            return
                        if not late and recipe in (None, one.recipe):
                            yield one
            except Unreachable:
                # The device ends an answer that is read too slowly; the next one goes on behind it.
                if not found:
                    raise

    def result(self, seq: int) -> Result:
        """One stored result."""
        with self._device.ask("GET", f"/api/results?after={seq - 1}&limit=1") as answer:
            found = [result.of_line(answer.object(line), self._device) for line in list(answer.lines())[1:]]
        if found and found[0].seq == seq:
            return found[0]
        raise NotThere(f"there is no result {seq} in the history")

    def table(self, **filters: Any) -> NDArray[numpy.void]:
        """What `results` yields with these filters, as a structured array: seq, time (UTC, NaT if not known), recipe,
        part_id, press_stroke, verdict, and the value of each gauge by its name, NaN where there is none."""
        rows, values, taken = [], [], {name for name, _ in COLUMNS}
        for one in self.results(**filters):
            at = one.time and one.time.replace(tzinfo=None)
            rows.append((one.seq, at, one.recipe, one.part_id, one.press_stroke, one.verdict))
            values.append({f"{name} (slot {gauge.slot})" if name in taken else name: gauge.value
                           for name, gauge in one.gauges.items()})
        names = list(dict.fromkeys(name for row in values for name in row))
        table = numpy.empty(len(rows), COLUMNS + [(name, "f8") for name in names])
        table[[name for name, _ in COLUMNS]] = numpy.array(rows, COLUMNS)
        for name in names:
            table[name] = numpy.array([row.get(name) for row in values], "f8")  # None becomes NaN.
        return table

    def recipes(self) -> list[dict[str, Any]]:
        """The stored recipes: number, name, fingerprint and more."""
        listed: list[dict[str, Any]] = self._device.json("GET", "/api/recipes")["recipes"]
        return listed

    def recipe_maps(self, number: int) -> maps.Maps:
        """The maps of a recipe: golden, as taught."""
        return maps.fetch(self._device, f"/api/recipes/{number}/maps.npz")

    def export_recipe(self, number: int, path: str | os.PathLike[str]) -> None:
        """Writes a recipe to a file."""
        self._device.save(f"/api/recipes/{number}/file", path)

    def import_recipe(self, path: str | os.PathLike[str], number: int | None = None,
                      replace: bool = False) -> dict[str, Any]:
        """Stores the recipe in a file, under its own number or another one. A recipe that has the number is replaced
        only with `replace`. Returns number, name, fingerprint, and perhaps a `note`."""
        query = [f"number={number}"] * (number is not None) + ["replace=true"] * replace
        with open(path, "rb") as file:
            return self._device.json("POST", "/api/recipes?" + "&".join(query), file, COMPUTING)

    def watch(self, patience: float = 30.0) -> Iterator[dict[str, Any]]:
        """The state of the station whenever it changes, and at least once a second. Connects again by itself; raises
        an error after `patience` s without a state."""
        heard = time.monotonic()
        while True:
            try:
                with self._device.ask("GET", "/events", wait=SILENCE) as answer:
                    # The only events are snapshots, each with one line of data.
                    for line in answer.lines():
                        if line.startswith(b"data:"):
                            yield answer.object(line[5:])
                            heard = time.monotonic()
                raise Unreachable("the device ended its events")
            except (Unreachable, DeviceProblem):
                if time.monotonic() - heard > patience:
                    raise
            time.sleep(PAUSE)

    def _newest_before(self, moment: datetime) -> int:
        """SEQ of the newest result with a known time before `moment`, 0 if there is none."""
        us = max((moment - EPOCH) // timedelta(microseconds=1), 0)
        newest = self._device.json("GET", f"/api/history?until_us={us}&limit=1")["results"]
        return int(newest[0]["seq"]) if newest else 0


def _aware(moment: Time) -> datetime:
    if isinstance(moment, str):
        moment = datetime.fromisoformat(moment[:-1] + "+00:00" if moment.endswith("Z") else moment)
    return moment.astimezone(EPOCH.tzinfo)
