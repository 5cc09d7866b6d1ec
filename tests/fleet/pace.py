#!/usr/bin/env python3
"""How soon a result is in the store, and how fast a collector catches up.

    tests/fleet/pace.py target/release/fringed-fleet [large]

Small: 50 heads for 12 s, then one that was away for 20 000 results. Large: 1000 heads for 60 s, then one that was away for 100 000, and
ten of them. Simulator, collector and server share the machine.
"""

import sys
import time

from plant import Head
from servers import ClickHouse, Collector, Folder, Plant, broken, wait_for

MOST_SECONDS, LEAST_ROWS = 2.0, 5000


def latency(fleet, heads, seconds):
    """99th percentile of the time from a result to its row, seen by asking the store again and again."""
    with Folder() as folder:
        store = ClickHouse(folder)
        plant = Plant(folder, fleet, heads=heads, results=seconds)
        collector = Collector(folder, fleet, plant, f"{store.url}/plant")
        table = "SELECT count() FROM system.tables WHERE database = 'plant' AND name = 'result_once'"
        wait_for("tables", 20, lambda: store.sql(table)[0][0])
        said = {f"SIM{number:05}": Head(plant.said, number) for number in range(1, heads + 1)}
        seen, late = dict.fromkeys(said, 0), []
        # Those of the first seconds come while the collector starts.
        until = time.monotonic() + seconds + 5
        while time.monotonic() < until and len(late) < heads * (seconds - 5):
            rows = store.sql("SELECT serial, max(seq) FROM plant.result GROUP BY serial")
            now = time.time() * 1000
            for serial, last in rows:
                fresh = range(max(seen[serial], 5) + 1, last + 1)
                late += [(now - said[serial].at_ms(seq)) / 1000 for seq in fresh]
                seen[serial] = max(seen[serial], last)
            time.sleep(0.1)
        late.sort()
        if len(late) < heads * (seconds - 5):
            broken(f"{len(late)} of {heads * (seconds - 5)} results within {seconds + 5} s")
        middle, worst = late[len(late) // 2], late[len(late) * 99 // 100]
        usage = "; ".join(used(process, seconds) for process in (plant, collector, store))
        print(f"{heads} heads, one result/s each: a row after {middle:.2f} s (median), {worst:.2f} s (99 %), {late[-1]:.2f} s (last)")
        print(f"  {usage}")
        if worst > MOST_SECONDS:
            broken(f"1 % of the results come later than {worst:.2f} s, of at most {MOST_SECONDS} s")


def used(process, seconds):
    cpu, memory = process.look()
    return f"{process.name}: {100 * cpu / seconds:.0f} % of a core, {memory:.0f} MiB"


def catching_up(fleet, heads, backlog):
    """Rows per second of a collector that finds results of a long time."""
    with Folder() as folder:
        store = ClickHouse(folder)
        plant = Plant(folder, fleet, heads=heads, backlog=backlog, results=backlog)
        began = time.monotonic()
        collector = Collector(folder, fleet, plant, f"{store.url}/plant")
        table = "SELECT count() FROM system.tables WHERE database = 'plant' AND name = 'result_once'"
        wait_for("tables", 20, lambda: store.sql(table)[0][0])
        expected = heads * backlog
        wait_for(f"{expected} rows", 300, lambda: store.sql("SELECT count() FROM plant.result")[0][0] >= expected)
        seconds = time.monotonic() - began
        rate = expected / seconds
        print(f"{heads} heads that were away for {backlog} results: {rate:.0f} rows/s")
        print("  " + "; ".join(used(process, seconds) for process in (plant, collector, store)))
        once = store.sql("SELECT count() FROM plant.result_once")[0][0]
        if once != expected:
            broken(f"{once} rows of {expected}")
        # Parts that were merged are not counted.
        size = store.sql("SELECT sum(bytes_on_disk) FROM system.parts WHERE active AND table = 'result'")[0][0]
        print(f"  {size / expected:.0f} bytes of a row on the disk")
        if rate < LEAST_ROWS:
            broken(f"{rate:.0f} rows/s, of at least {LEAST_ROWS}")


if __name__ == "__main__":
    program = sys.argv[1]
    if sys.argv[2:] == ["large"]:
        latency(program, 1000, 60)
        catching_up(program, 1, 100_000)
        catching_up(program, 10, 100_000)
    else:
        latency(program, 50, 12)
        catching_up(program, 1, 20_000)
