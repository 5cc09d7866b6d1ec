#!/usr/bin/env python3
"""Readers of results cost a station's cycle nothing: whoever asks all the time, hangs in the middle, or asks for everything.

    tests/fleet/beside.py target/release/fringed [large]

A station with simulated light and a history of 100 000 results is triggered over Modbus, in blocks with and without readers by turns; the
readers run where a core has nothing else to do, because real ones run elsewhere. The median of TOTAL_TIME (trigger to result) with each
reader is compared with that of the blocks around it, and the memory with that before. Small: a head of few pixels, 8 blocks of 15 cycles
per reader; lateness is told. Large: the usual head, 30 blocks of 20; lateness and its bound are compared.
"""

import contextlib
import http.client
import os
import re
import socket
import sqlite3
import statistics
import struct
import sys
import threading
import time

from servers import Folder, Process, broken, wait_for

RESULTS = 100_000
MOST_LATER, MOST_MIB = 0.01, 8
# Bit of register 100.
READY = 1 << 1
FEW_PIXELS = "sub_rays = 2\n\n[rig.camera]\nwidth = 160\nheight = 160\n"
# A small run only tells how much later: a machine that does other things, too, decides no hundredth.
TOLD = float("inf")


class Plc:
    """Triggers by token over Modbus TCP."""

    def __init__(self, port):
        self.socket = socket.create_connection(("127.0.0.1", port), 10)
        self.socket.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
        self.token = 0

    def ask(self, request):
        self.socket.sendall(struct.pack(">HHHB", 1, 0, len(request) + 1, 1) + request)
        header = self.take(7)
        answer = self.take(struct.unpack(">H", header[4:6])[0] - 1)
        if answer[0] & 0x80:
            broken(f"Modbus exception {answer[1]}")
        return answer

    def take(self, count):
        taken = b""
        while len(taken) < count:
            piece = self.socket.recv(count - len(taken))
            if not piece:
                broken("the station closed the connection of its PLC")
            taken += piece
        return taken

    def read(self, address, count):
        answer = self.ask(struct.pack(">BHH", 3, address, count))
        return struct.unpack(f">{count}H", answer[2:])

    def cycle(self):
        """A cycle's TOTAL_TIME in ms."""
        self.token = self.token % 60_000 + 1
        words = (self.token, 1, self.token % 100, 0, self.token, 0, self.token)
        self.ask(struct.pack(">BHHB7H", 16, 1, 7, 14, *words))
        until = time.monotonic() + 20
        while time.monotonic() < until:
            result = self.read(200, 22)
            if result[2] == self.token:
                return (result[20] << 16 | result[21]) / 1000
            time.sleep(0.002)
        broken(f"no result of token {self.token}")


class Reader:
    """A reader of results in a thread of its own, of which the machine takes no notice."""

    def __init__(self, port, what):
        self.port, self.what, self.stopped, self.bytes, self.failed = port, what, False, 0, None
        self.thread = threading.Thread(target=self.run, daemon=True)

    def __enter__(self):
        self.thread.start()
        return self

    def __exit__(self, *_):
        self.stopped = True
        self.thread.join(30)

    def run(self):
        os.sched_setscheduler(0, os.SCHED_IDLE, os.sched_param(0))
        while not self.stopped:
            with contextlib.suppress(OSError, http.client.HTTPException):
                getattr(self, self.what)()

    def asks(self, after, limit):
        connection = http.client.HTTPConnection("127.0.0.1", self.port, timeout=30)
        connection.request("GET", f"/api/results?after={after}&limit={limit}")
        answer = connection.getresponse()
        if answer.status != 200:
            self.failed = f"{answer.status} {answer.read(200)}"
        return connection, answer

    def all_the_time(self):
        connection, answer = self.asks(RESULTS - 5, 100)
        while not self.stopped:
            self.bytes += len(answer.read())
            connection.request("GET", f"/api/results?after={RESULTS - 5}&limit=100")
            answer = connection.getresponse()

    def hanging(self):
        connection, answer = self.asks(0, 10_000)
        self.bytes += len(answer.read(1000))
        while not self.stopped:
            time.sleep(0.05)
        connection.close()

    def everything(self):
        after = 0
        while not self.stopped and after < RESULTS:
            connection, answer = self.asks(after, 10_000)
            while not self.stopped and (piece := answer.read(65_536)):
                self.bytes += len(piece)
            connection.close()
            after += 10_000


class Station(Process):
    """`fringed serve` with simulated light."""

    def __init__(self, folder, fringed, name, scenario):
        state, config = folder.path / "state", folder.path / "fringed.toml"
        (folder.path / "scenario.toml").write_text(scenario)
        config.write_text(f'[head]\nscenario = "{folder.path}/scenario.toml"\n')
        ports = ["--modbus", "127.0.0.1:0", "--http", "127.0.0.1:0"]
        super().__init__(folder, name, [fringed, "serve", "--state", state, "--config", config, *ports])
        port = lambda words: wait_for(f"the station says {words}", 120, lambda: re.search(words + r" on (?:http://)?127\.0\.0\.1:(\d+)", self.log.read_text()))
        self.modbus, self.http = int(port("Modbus TCP")[1]), int(port("page")[1])

    def resident(self):
        with open(f"/proc/{self.running.pid}/status") as status:
            return next(int(line.split()[1]) for line in status if line.startswith("VmRSS")) / 1024


def fill(file):
    """Copies the results that are there until there are so many; SEQ and time go on."""
    with contextlib.closing(sqlite3.connect(file)) as database, database:
        columns = [row[1] for row in database.execute("PRAGMA table_info(result)")]
        gauges = [row[1] for row in database.execute("PRAGMA table_info(gauge)")]
        last, first = database.execute("SELECT max(id), min(seq) FROM result").fetchone()
        take = lambda column: {"id": "numbers.n", "seq": f"numbers.n - {last} + {first} + (SELECT max(seq) FROM result)"}.get(column, column)
        numbers = f"WITH RECURSIVE numbers(n) AS (SELECT {last} + 1 UNION ALL SELECT n + 1 FROM numbers WHERE n < {RESULTS})"
        picked = ", ".join(map(take, columns))
        database.execute(f"{numbers} INSERT INTO result SELECT {picked} FROM numbers, result WHERE result.id = {last}")
        picked = ", ".join("numbers.n" if column == "result" else column for column in gauges)
        database.execute(f"{numbers} INSERT INTO gauge SELECT {picked} FROM numbers, gauge WHERE gauge.result = {last}")
        return database.execute("SELECT count(*), max(seq) FROM result").fetchone()


def main(fringed, blocks, cycles, slack, scenario):
    with Folder() as folder:
        station = Station(folder, fringed, "teaching", scenario)
        plc = Plc(station.modbus)
        wait_for("the station is ready", 180, lambda: plc.read(100, 1)[0] & READY)
        for _ in range(3):
            plc.cycle()
        station.stop()
        count, last = fill(folder.path / "state" / "history.db")
        station = Station(folder, fringed, "station", scenario)
        plc = Plc(station.modbus)
        wait_for("the station is ready", 180, lambda: plc.read(100, 1)[0] & READY)
        for _ in range(3 * cycles):
            plc.cycle()
        failed = []
        for what in ("all_the_time", "hanging", "everything"):
            before = station.resident()
            ratios, alone, sent, peak = [], [], 0, before
            quiet = statistics.median(plc.cycle() for _ in range(cycles))
            for _ in range(blocks):
                with Reader(station.http, what) as reader:
                    time.sleep(0.1)
                    times = []
                    for _ in range(cycles):
                        times.append(plc.cycle())
                        peak = max(peak, station.resident())
                    read = statistics.median(times)
                sent += reader.bytes
                if reader.failed:
                    broken(f"{what}: {reader.failed}")
                after = statistics.median(plc.cycle() for _ in range(cycles))
                ratios.append(2 * read / (quiet + after))
                alone.append(quiet)
                quiet = after
            later = statistics.median(ratios) - 1
            spread = statistics.stdev(ratios) / len(ratios) ** 0.5 * 1.25
            print(
                f"{what}: {100 * later:+.1f} % (± {100 * spread:.1f} %) of {statistics.median(alone):.0f} ms, {peak - before:+.1f} MiB;"
                f" {sent >> 10} KiB were read"
            )
            if sent == 0:
                failed.append(f"{what} read nothing")
            if later > MOST_LATER + max(slack, 2 * spread):
                failed.append(f"{what}: a cycle's median is {100 * later:.1f} % later")
            if peak - before > MOST_MIB:
                failed.append(f"{what}: {peak - before:.1f} MiB more")
        if failed:
            broken("; ".join(failed))
        print(f"the history has {count} results, up to SEQ {last}")


if __name__ == "__main__":
    main(sys.argv[1], *((30, 20, 0, "") if sys.argv[2:] == ["large"] else (8, 15, TOLD, FEW_PIXELS)))
