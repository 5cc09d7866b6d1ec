"""What the panels of docs/fleet/results.json must show, worked out from the heads' CSV and snapshots alone.

Each function gets the results of the chosen lines and the range, and gives the rows of its panel.
"""

import csv
import io
import json
import math
import statistics
from collections import defaultdict
from datetime import datetime, timezone

from servers import get

DAY, HOUR = 86_400, 3600


class Result:
    """A line of a head's CSV."""

    def __init__(self, serial, line, cells):
        self.serial, self.line = serial, line
        self.recipe, self.verdict = cells["recipe"], cells["verdict"]
        time = datetime.fromisoformat(cells["time_utc"].replace("Z", "+00:00"))
        self.at = math.floor(time.timestamp())
        names = [name.removesuffix(" decision") for name in cells if name.endswith(" decision")]
        column = {name: next(key for key in cells if key == name or key.startswith(f"{name} [")) for name in names}
        number = lambda text: float(text) if text else None
        self.gauges = {
            name: (number(cells[column[name]]), number(cells[f"{name} low"]), number(cells[f"{name} high"]))
            for name in names
            if cells[f"{name} decision"]
        }


def results(url, serial, line):
    rows = csv.DictReader(io.StringIO(get(f"{url}/api/history.csv?limit=20000"), newline=""))
    return [Result(serial, line, cells) for cells in rows]


def text(second):
    return datetime.fromtimestamp(second, timezone.utc).strftime("%Y-%m-%d %H:%M:%S")


def grouped(items, key):
    groups = defaultdict(list)
    for item in items:
        groups[key(item)].append(item)
    return dict(sorted(groups.items()))


def passed(found):
    return sum(one.verdict == "PASS" for one in found) / len(found)


def values(found, name):
    return [one.gauges[name][0] for one in found if name in one.gauges and one.gauges[name][0] is not None]


def measured(found):
    """Results by line, serial and gauge, of those that have a value."""
    each = [(one, name) for one in found for name, gauge in one.gauges.items() if gauge[0] is not None]
    groups = grouped(each, lambda pair: (pair[0].line, pair[0].serial, pair[1]))
    return {key: [one for one, _ in pairs] for key, pairs in groups.items()}


def cpk(found, name):
    numbers = values(found, name)
    _, low, high = found[0].gauges[name]
    mean, s = statistics.fmean(numbers), statistics.stdev(numbers)
    return min((side for side in (low is not None and mean - low, high is not None and high - mean) if side is not False)) / (3 * s)


class Asked:
    """The state of a dashboard: range in s since 1970 UTC, interval in s, gauge, heads as (url, line)."""

    def __init__(self, every, heads, begin, end, interval, gauge, chosen):
        self.every = [one for one in every if one.line in chosen]
        self.found = [one for one in self.every if begin <= one.at <= end]
        self.heads = [head for head in heads if head.line in chosen]
        self.begin, self.end, self.interval, self.gauge, self.chosen = begin, end, interval, gauge, chosen
        self.all = heads

    def slot(self, one):
        return text(one.at // self.interval * self.interval)

    def means(self):
        """Mean of the gauge by time and serial."""
        groups = grouped(self.found, lambda one: (self.slot(one), one.serial))
        means = {key: values(found, self.gauge) for key, found in groups.items()}
        return {key: statistics.fmean(numbers) for key, numbers in means.items() if numbers}


def shift(asked, found, name):
    middle = (asked.begin + asked.end) // 2
    before, after = [values([one for one in found if (one.at >= middle) == late], name) for late in (False, True)]
    before, after = statistics.fmean(before), statistics.fmean(after)
    s = statistics.stdev(values(found, name))
    return [(after - before) / s, before, after, s]


def across(asked):
    _, low, high = next(one.gauges[asked.gauge] for one in asked.found if asked.gauge in one.gauges)
    times = grouped(asked.means().items(), lambda item: item[0][0])
    for time, items in times.items():
        means = sorted(mean for _, mean in items)
        # Of an even number, quantileExact takes the upper of the middle two.
        yield [time, means[0], means[len(means) // 2], means[-1], low, high]


def lowest_yield(asked):
    groups = grouped(asked.found, lambda one: (one.line, one.serial))
    counts = lambda found: [len(found), *(sum(one.verdict == word for one in found) for word in ("PASS", "FAIL", "INVALID"))]
    rows = [[*key, *counts(found), passed(found)] for key, found in groups.items()]
    return sorted(rows, key=lambda row: (row[6], row[1]))[:20]


def drifting(asked):
    rows = [[*key, *shift(asked, found, key[2])] for key, found in measured(asked.found).items()]
    return sorted(rows, key=lambda row: (-abs(row[3]), row[1], row[2]))[:20]


def least_capable(asked):
    rows = []
    for (line, serial, name), found in measured(asked.found).items():
        numbers = values(found, name)
        rows.append([line, serial, name, len(numbers), statistics.fmean(numbers), statistics.stdev(numbers), cpk(found, name)])
    return sorted(rows, key=lambda row: (row[6], row[1], row[2]))[:20]


def hourly(asked):
    """The view has a row per head, recipe and gauge."""
    hours = grouped(asked.every, lambda one: one.at // HOUR * HOUR)
    for hour, found in hours.items():
        if asked.begin <= hour <= asked.end:
            measured = [one for one in found if one.gauges.get(asked.gauge, [None])[0] is not None]
            # One value has no standard deviation.
            heads = grouped(measured, lambda one: (one.serial, one.recipe)).values()
            if heads:
                yield [text(hour), min((cpk(head, asked.gauge) for head in heads if len(head) > 1), default=None)]


def daily(asked):
    days = grouped(asked.every, lambda one: one.at // DAY)
    return [[text(day * DAY), passed(found)] for day, found in days.items() if asked.begin // DAY <= day <= asked.end // DAY]


def geometry(asked):
    rows = []
    for head in asked.heads:
        if head.reachable:
            said = json.loads(get(f"{head.url}/api/snapshot"))
            rows.append([head.line, head.serial, said["health"]["drift_px"], said["state"], said["recipe"]["name"]])
    return sorted(rows, key=lambda row: (-row[2], row[1]))[:20]


def never_fetched(asked):
    """The first result that a head still has tells how many it had deleted."""
    return [[sum(head.deleted for head in asked.all)]]


PANELS = {
    "Results": lambda asked: [[len(asked.found)]],
    "Yield": lambda asked: [[passed(asked.found)]],
    "Heads that answer": lambda asked: [[sum(head.reachable for head in asked.heads), len(asked.heads)]],
    "Results that nobody fetched": never_fetched,
    "Yield per line": lambda asked: [
        [*key, passed(found)] for key, found in grouped(asked.found, lambda one: (asked.slot(one), one.line)).items()
    ],
    "Heads with the lowest yield": lowest_yield,
    "Run chart of one gauge, per head": lambda asked: [[*key, mean] for key, mean in asked.means().items()],
    "The same gauge across heads": lambda asked: list(across(asked)),
    "Heads that drift": drifting,
    "Gauges that are least capable": least_capable,
    "Heads that are silent": None,
    "Geometry that drifts": geometry,
    "Yield per day": daily,
    "Cpk of one gauge per hour": lambda asked: list(hourly(asked)),
}
