#!/usr/bin/env python3
"""The embedded store has every result once, although its collector is killed again and again.

    tests/fleet/embedded.py target/release/fringed-fleet [large]

Small: 20 kills. Large: 100.
"""

import contextlib
import random
import sqlite3
import sys
import time

from plant import Head
from servers import Collector, Folder, Plant, broken, get, wait_for

SEED, HEADS, RATE = 5, 30, 1


def main(fleet, kills):
    dice = random.Random(SEED)
    with Folder() as folder:
        file = folder.path / "plant.db"
        plant = Plant(folder, fleet, heads=HEADS, rate=RATE, seed=SEED)
        collector = Collector(folder, fleet, plant, f"sqlite:{file}")
        for _ in range(kills):
            time.sleep(dice.uniform(0.1, 1.2))
            collector.kill()
            collector.start()
        last = {}
        for number in range(1, HEADS + 1):
            last[f"SIM{number:05}"] = int(get(f"{plant.url}/{number:04}/api/history.csv?limit=1").split("\r\n")[1].split(",")[0])

        def rows():
            with contextlib.closing(sqlite3.connect(f"file:{file}?mode=ro", uri=True)) as database:
                return database.execute("SELECT serial, history, seq, verdict FROM result ORDER BY serial, seq").fetchall()

        def reached():
            found = {}
            for serial, _, seq, _ in rows():
                found[serial] = seq
            return all(found.get(serial, 0) >= seq for serial, seq in last.items())

        wait_for("the results that were there", 30, reached)
        collector.stop()
        found = {}
        for serial, history, seq, verdict in rows():
            found.setdefault((serial, history), []).append((seq, verdict))
        if len(found) != HEADS:
            broken(f"{len(found)} histories of {HEADS} heads")
        for number in range(1, HEADS + 1):
            head = Head(plant.said, number)
            results = found[head.serial, head.history()]
            if results != [(seq, head.result(seq)[0]) for seq in range(1, len(results) + 1)]:
                broken(f"{head.serial}: results are missing, there twice, or others than the head's")
        print(f"{sum(map(len, found.values()))} results of {HEADS} heads are there once after {kills} kills")


if __name__ == "__main__":
    main(sys.argv[1], 100 if sys.argv[2:] == ["large"] else 20)
