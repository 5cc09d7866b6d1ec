"""Errors, one class for each kind of failure. The message is the device's words, and ends with the remedy."""

from __future__ import annotations

from typing import ClassVar, Dict, Type


class FringedError(Exception):
    """A request failed: `words` is what the device said, `status` its HTTP status, None without an answer."""

    remedy: ClassVar[str] = "check that the address is that of a head, and that no proxy answers in its place"

    def __init__(self, words: str, status: int | None = None, remedy: str = "") -> None:
        super().__init__(words, status, remedy)
        self.words, self.status, self._remedy = words, status, remedy

    def __str__(self) -> str:
        return f"{self.words}; {self._remedy or self.remedy}"


class Unreachable(FringedError):
    """No connection, or it broke before the answer was complete."""
    remedy = "check network and address"

class Refused(FringedError):
    """The device does not accept the secret, a change was requested without one, or its user may not make it."""
    remedy = "open the head with a secret that allows it: Head(url, secret=..., user=...)"

class Busy(FringedError):
    """Not possible in the present state of the station."""
    remedy = "try again when head.snapshot() shows the state ready and no refusal"

class NotThere(FringedError):
    """There is no such result, recipe or map, or it is no longer kept."""
    remedy = "head.results() and head.recipes() list what is stored"

class Unfit(FringedError):
    """A value is outside its bounds, or the content of a file cannot be used."""
    remedy = "correct the value that is named"

class StorageFull(FringedError):
    """The storage of the device is full."""
    remedy = "free storage on the device: delete recipes or studies, or let it keep fewer recordings"

class DeviceProblem(FringedError):
    """The device or its daemon is at fault, or has too many requests at the moment."""
    remedy = "see the log of the device, and run `fringed doctor` on it"

class TooOld(FringedError):
    """The firmware of the device does not have what was requested."""
    remedy = "update it"


OF_STATUS: Dict[int, Type[FringedError]] = {
    400: Unfit, 401: Refused, 403: Refused, 404: NotThere, 405: TooOld, 408: Unreachable, 409: Busy, 413: Unfit,
    421: Unfit, 422: Unfit, 429: Refused, 500: DeviceProblem, 502: DeviceProblem, 503: DeviceProblem,
    504: DeviceProblem, 507: StorageFull,
}
