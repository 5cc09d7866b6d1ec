"""What the heads of the example `plant` of `fringed-fleet` have made, worked out without it.

A result is a function of (seed, head, history, seq); values are whole millionths of their unit.
"""

import math

WORD = (1 << 64) - 1
SPREAD = 37_837
DRIFT = 3600
PERIOD_MS, LENGTH_MS, FIRST_MS, SHARE = 47_000, 6_000, 24_000, 20

# Name, unit, centre, spread, lower and upper limit, in millionths.
GAUGES = [
    ("deviation", "mm", 0, 12_000, -100_000, 100_000),
    ("opening 1", "mm", 6_000_000, 10_000, 5_920_000, 6_080_000),
    ("flatness", "mm", 30_000, 5_000, None, 80_000),
    ("bend", "°", 90_000_000, 60_000, 89_500_000, 90_500_000),
    ("cup volume", "mm³", 250_000_000, 1_000_000, 242_000_000, 258_000_000),
    ("step, left", "mm", 1_500_000, 6_000, 1_450_000, 1_550_000),
    ('rim "A"', "", 970_000, 8_000, 900_000, None),
    ("height", "mm", 12_000_000, 7_000, 11_940_000, 12_060_000),
]


def mixed(number):
    z = (number + 0x9E3779B97F4A7C15) & WORD
    z = ((z ^ z >> 30) * 0xBF58476D1CE4E5B9) & WORD
    z = ((z ^ z >> 27) * 0x94D049BB133111EB) & WORD
    return z ^ z >> 31


def bell(number):
    return sum(number >> shift & 0xFFFF for shift in (0, 16, 32, 48)) - 131_070


def are_the_heads(values, millionths):
    """Whether the values of a store are those of a head. ClickHouse 18.16 reads numbers up to a last bit wrong."""
    exact = [None if number is None else number / 1e6 for number in millionths]
    close = (left == right or None not in (left, right) and math.isclose(left, right, rel_tol=1e-15) for left, right in zip(values, exact))
    return len(values) == len(exact) and all(close)


class Head:
    """A head of a plant: `said` is the first line of the simulator, `faults` its list of faults."""

    def __init__(self, said, number, faults=()):
        self.seed, self.rate, self.start_ms = said["seed"], said["rate"], said["start_unix_ms"]
        self.number, self.gauges = number, said["gauges"]
        self.key = mixed(mixed(self.seed) ^ number)
        self.phase_ms = self.key % FIRST_MS
        place = (number - 1) % SHARE
        self.fault = faults[place] if place < len(faults) else None
        self.serial = f"SIM{number:05}"

    def history(self, begun=0):
        return f"{mixed(self.key ^ mixed(begun)):016x}"

    def begun_ms(self, begun):
        """When history number `begun` began."""
        return self.start_ms + (self.phase_ms + (begun - 1) * PERIOD_MS if begun else 0)

    def at_ms(self, seq, begun=0):
        return self.begun_ms(begun) + int(seq * 1000.0 / self.rate)

    def seqs(self, results):
        """The SEQ of a first history that has come to `results`."""
        for seq in range(1, results + 1):
            since = self.at_ms(seq) - self.start_ms - self.phase_ms
            if self.fault != "restart" or since < 0 or since % PERIOD_MS >= LENGTH_MS:
                yield seq

    def value(self, slot, seq, begun=0):
        _, _, centre, spread, _, high = GAUGES[min(slot, len(GAUGES)) - 1]
        place = mixed(mixed(self.key ^ begun) ^ slot)
        if self.number % 8 == 6 and slot == 1:
            offset = high - centre - spread * 13 // 10
        else:
            offset = bell(place) * spread // (2 * SPREAD)
        phase = (seq + (place >> 32) % DRIFT) % DRIFT
        wave = 4 * abs(phase - DRIFT // 2) - DRIFT
        width = 4 * spread if self.number % 8 == 3 else spread // 2
        return centre + offset + width * wave // (2 * DRIFT) + bell(mixed(place ^ seq)) * spread // SPREAD

    def result(self, seq, begun=0):
        """Verdict and values, in millionths; None where there is none."""
        luck = mixed(mixed(mixed(self.key ^ begun)) ^ seq)
        if luck % 3000 == 1:
            return "INVALID", []
        values = [self.value(slot, seq, begun) for slot in range(1, self.gauges + 1)]
        unseen = luck % 500 == 0
        if unseen:
            values[(luck >> 40) % self.gauges] = None
        failed = False
        for slot, value in enumerate(values):
            low, high = GAUGES[min(slot, len(GAUGES) - 1)][4:]
            if value is not None:
                failed |= low is not None and value < low or high is not None and value > high
        return ("INVALID" if unseen else "FAIL" if failed else "PASS"), values
