#!/usr/bin/env python3
"""Every result of every head is in the store once, although collectors and the store are killed.

    tests/fleet/complete.py target/release/fringed-fleet [large]

Two collectors share the heads, some of which are slow, break off or restart; collectors and ClickHouse are killed at seeded times and
started again. Then the folded view must have each result once, with the values that the heads gave. Small: 50 heads × 40 s, three kills.
Large: 1000 heads × 300 s, a kill every 20 s.
"""

import random
import sys
import time

from plant import Head, are_the_heads
from servers import ClickHouse, Collector, Folder, Plant, broken, wait_for

SEED = 11
FAULTS = ["slow", "cut", "restart"]


def main(fleet, heads, seconds, kills):
    dice = random.Random(SEED)
    with Folder() as folder:
        store = ClickHouse(folder)
        plant = Plant(folder, fleet, heads=heads, results=seconds, seed=SEED, faults=",".join(FAULTS))
        began = time.monotonic()
        url = f"{store.url}/plant"
        collectors = [
            Collector(folder, fleet, plant, url, f"collector-{part}", ["--part", f"{part}/2"]) for part in (1, 2)
        ]
        victims = [*collectors, store]
        killed = []
        for kill in range(kills):
            at = seconds * (kill + dice.uniform(0.4, 0.9)) / kills
            time.sleep(max(0.0, began + at - time.monotonic()))
            # Each is killed, however few kills there are.
            victim = victims[kill] if kill < len(victims) else dice.choice(victims)
            killed.append(victim.name)
            victim.kill()
            time.sleep(dice.uniform(0.0, 2.0))
            victim.start()
        store.serves()
        said = [Head(plant.said, number, FAULTS) for number in range(1, heads + 1)]
        due = {head.serial: list(head.seqs(seconds)) for head in said}
        expected = sum(len(seqs) for seqs in due.values())

        def rows(view="result_once"):
            return store.sql(f"SELECT count() FROM plant.{view}")[0][0]

        time.sleep(max(0.0, began + seconds - time.monotonic()))
        ended = time.monotonic()
        wait_for(f"{expected} rows", 120, lambda: rows() >= expected)
        late = time.monotonic() - ended
        # What a repeat would add comes within a batch.
        time.sleep(2)
        found = store.sql("SELECT serial, history, groupArray(seq), count() FROM plant.result_once GROUP BY serial, history")
        if len(found) != heads:
            broken(f"{len(found)} histories of {heads} heads")
        for serial, _, seqs, _ in found:
            if sorted(seqs) != due[serial]:
                missing, twice = set(due[serial]) - set(seqs), len(seqs) - len(set(seqs))
                broken(f"{serial}: {len(seqs)} of {len(due[serial])} results; missing {sorted(missing)[:9]}, {twice} twice")
        for head in dice.sample(said, 50):
            check_values(store, head, dice.sample(due[head.serial], 9))
        # A history may begin with numbers that a restart skipped; no result is in a gap.
        for serial, first, last in store.sql("SELECT serial, first, last FROM plant.gap_once"):
            if any(first <= seq <= last for seq in due[serial]):
                broken(f"{serial}: {first} to {last} are said to be lost")
        print(
            f"{rows()} results of {heads} heads are there once, {late:.0f} s after the last one; {rows('result') - expected} rows were"
            f" written twice; killed: {', '.join(killed)}"
        )


def check_values(store, head, seqs):
    chosen = ", ".join(map(str, seqs))
    query = f"SELECT seq, verdict, gauges.value FROM plant.result_once WHERE serial = '{head.serial}' AND seq IN ({chosen})"
    for seq, verdict, values in store.sql(query):
        expected, numbers = head.result(seq)
        if verdict != expected or not are_the_heads(values, numbers):
            broken(f"{head.serial}, {seq}: the store has {verdict} {values}, the head had {expected} {numbers}")


if __name__ == "__main__":
    large = sys.argv[2:] == ["large"]
    main(sys.argv[1], *((1000, 300, 15) if large else (50, 40, 3)))
