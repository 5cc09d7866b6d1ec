"""Client of a fringed 3-D smart sensor: triggers it, and reads its results and maps over HTTP."""

from .errors import (Busy, DeviceProblem, FringedError, NotThere, Refused, StorageFull, TooOld, Unfit,
                     Unreachable)
from .head import Head
from .maps import Maps
from .result import Gauge, Result

__all__ = ["Busy", "DeviceProblem", "FringedError", "Gauge", "Head", "Maps", "NotThere", "Refused", "Result",
           "StorageFull", "TooOld", "Unfit", "Unreachable"]
