#!/usr/bin/env python3
"""A cluster of two shards with two replicas each has every result once, although one server is gone for a while.

    tests/fleet/cluster.py target/release/fringed-fleet [large]

Small: 40 heads × 30 s, a server is killed for 8 s. Large: 300 heads × 90 s, a server is killed for 30 s.
"""

import random
import subprocess
import sys
import time

from panels import panels_of, sql_of
from plant import Head
from servers import ClickHouse, Collector, Folder, Plant, ZooKeeper, broken, ports, wait_for

SEED = 17


def configuration(zookeeper, numbers, shard, replica):
    """The cluster `plant`, as docs/fleet.md has it."""
    replicas = [
        f"<replica><host>127.0.0.1</host><port>{tcp}</port></replica>" for _, tcp, _ in numbers
    ]
    shards = "".join(
        f"<shard><internal_replication>true</internal_replication>{first}{second}</shard>"
        for first, second in (replicas[:2], replicas[2:])
    )
    return (
        f"<remote_servers><plant>{shards}</plant></remote_servers>"
        f"<zookeeper><node><host>127.0.0.1</host><port>{zookeeper.port}</port></node><session_timeout_ms>5000</session_timeout_ms></zookeeper>"
        f"<macros><shard>{shard}</shard><replica>{replica}</replica></macros>"
    )


def main(fleet, heads, seconds, gone):
    dice = random.Random(SEED)
    with Folder() as folder:
        zookeeper = ZooKeeper(folder)
        numbers = [ports(3) for _ in range(4)]
        servers = [
            ClickHouse(folder, f"shard{at // 2 + 1}-{at % 2 + 1}", numbers[at], configuration(zookeeper, numbers, at // 2 + 1, at % 2 + 1))
            for at in range(4)
        ]
        schema = subprocess.run([fleet, "schema", "--store", "cluster"], check=True, capture_output=True, text=True).stdout
        statements = [line for line in schema.splitlines() if not line.lstrip().startswith("--")]
        for server in servers:
            server.run("CREATE DATABASE plant")
            for statement in "\n".join(statements).split(";\n"):
                if statement.strip():
                    server.run(statement.strip().rstrip(";"), database="plant")
        plant = Plant(folder, fleet, heads=heads, results=seconds, seed=SEED)
        hosts = ",".join(server.url.removeprefix("http://") for server in servers)
        collectors = [
            Collector(folder, fleet, plant, f"http://{hosts}/plant", f"collector-{part}", ["--part", f"{part}/2"]) for part in (1, 2)
        ]
        began = time.monotonic()
        time.sleep(seconds * 0.25)
        # One that collectors write to in the first place, or any other.
        killed = dice.randrange(4)
        servers[killed].kill()
        other = servers[killed ^ 1]
        count = "SELECT count() FROM plant.result_once"
        before = other.sql(count)[0][0]
        time.sleep(gone)
        during = other.sql(count)[0][0]
        if during <= before:
            broken(f"while {servers[killed].name} was gone no results came in: {before}, then {during}")
        servers[killed].start()
        servers[killed].serves()
        time.sleep(max(0.0, began + seconds - time.monotonic()))
        expected = heads * seconds
        for server in servers:
            wait_for(f"{expected} results seen by {server.name}", 90, lambda server=server: server.sql(count)[0][0] >= expected)
        wait_for("equal replicas", 60, lambda: all(shards_agree(servers)))
        rows = servers[killed].sql("SELECT serial, groupArray(seq) FROM plant.result_once GROUP BY serial")
        if {serial: sorted(seqs) for serial, seqs in rows} != {
            Head(plant.said, number).serial: list(range(1, seconds + 1)) for number in range(1, heads + 1)
        }:
            broken("not each result is there once")
        shares = [servers[at].sql("SELECT uniqExact(serial) FROM plant.result_local")[0][0] for at in (0, 2)]
        if sum(shares) != heads or min(shares) == 0:
            broken(f"the shards have {shares} of {heads} heads")
        begin = plant.said["start_unix_ms"] // 1000
        for title, sql in panels_of("results.json"):
            shown = other.sql(sql_of(sql, begin, begin + seconds, [""], gauge="deviation"), database="plant")
            if not shown and title not in ("Heads that are silent", "Cpk of one gauge per hour"):
                broken(f"{title}: nothing is shown of a cluster")
        for collector in collectors:
            if not collector.is_alive():
                broken(f"{collector.name} ended")
        print(
            f"{expected} results of {heads} heads are there once, {shares[0]} heads in one shard and {shares[1]} in the other;"
            f" {servers[killed].name} was gone for {gone} s, in which {during - before} results came in"
        )


def shards_agree(servers):
    """For each shard, whether its two servers have the same results."""
    own = [server.sql("SELECT count(), sum(cityHash64(serial, seq)) FROM plant.result_local FINAL") for server in servers]
    return own[0] == own[1], own[2] == own[3]


if __name__ == "__main__":
    main(sys.argv[1], *((300, 90, 30) if sys.argv[2:] == ["large"] else (40, 30, 8)))
