"""Two clients trigger a real station over connections that are cut, while it is killed and started again.

    python3 tests/station.py PROGRAM [COUNT]

Each token must have exactly one result. Then runs the first example of docs/python.md as printed. Exits with a code
other than 0 at the first broken promise.
"""

import contextlib
import io
import random
import re
import signal
import socket
import subprocess
import sys
import tempfile
import threading
import time
from collections import Counter
from pathlib import Path

import fringed

SEED, CUT, KILLS, CLIENTS = 20, .25, 3, 2
GUIDE = Path(__file__).parents[3] / "docs/python.md"
SCENARIO = "sub_rays = 2\n[rig.camera]\nwidth = 256\nheight = 256\n"
CONFIG = 'state = "state"\n[head]\nbackend = "sim"\nscenario = "part.toml"\n'


def expect(condition, promise):
    if not condition:
        sys.exit(f"broken promise: {promise}")


class Station:
    """The daemon, its state, and a proxy in front of it that cuts connections."""

    def __init__(self, program, folder):
        self.random, self.secret, self.cuts = random.Random(SEED), None, 0
        (folder / "part.toml").write_text(SCENARIO)
        (folder / "station.toml").write_text(CONFIG)
        self.command = [program, "serve", "--config", folder / "station.toml",
                        "--http", "127.0.0.1:0", "--modbus", "127.0.0.1:0"]
        self.start()
        self.listener = socket.create_server(("127.0.0.1", 0))
        self.proxy = f"http://127.0.0.1:{self.listener.getsockname()[1]}"
        threading.Thread(target=self.serve, daemon=True).start()

    def start(self):
        self.process = subprocess.Popen(self.command, stdout=subprocess.DEVNULL, stderr=subprocess.PIPE, text=True)
        log = ""
        while not (found := re.search(r"page on (http://127\.0\.0\.1:(\d+))", log)):
            line = self.process.stderr.readline()
            expect(line, f"the station starts:\n{log}")
            log += line
        secret = re.search(r"shown this once: (\S+)", log)
        self.secret = secret[1] if secret else self.secret
        self.url, self.port = found[1], int(found[2])
        threading.Thread(target=self.process.stderr.read, daemon=True).start()

    def end(self, how=signal.SIGKILL):
        self.process.send_signal(how)
        self.process.wait()

    def serve(self):
        while True:
            threading.Thread(target=self.forward, args=(self.listener.accept()[0],), daemon=True).start()

    def forward(self, client):
        # A connection that fails is one that is cut: the station is down.
        with contextlib.suppress(OSError), client, socket.create_connection(("127.0.0.1", self.port)) as daemon:
            threading.Thread(target=pump, args=(client, daemon), daemon=True).start()
            if self.random.random() > CUT:
                pump(daemon, client)
            else:
                self.cuts += 1
                answer = daemon.recv(1 << 16)
                client.sendall(answer[:self.random.randrange(len(answer) + 1)])
            client.shutdown(socket.SHUT_RDWR)  # The other direction still waits on this socket.


def pump(source, drain):
    with contextlib.suppress(OSError):
        while block := source.recv(1 << 16):
            drain.sendall(block)


def trigger(station, parts, results):
    head = fringed.Head(station.proxy, station.secret, timeout=5)
    for part in parts:
        while part not in results:
            # Busy: the other client's part is measured.
            with contextlib.suppress(fringed.Busy):
                results[part] = head.trigger(part_id=part, token=f"part-{part}")


def tokens(station, count):
    results, parts = {}, range(1, count + 1)
    clients = [threading.Thread(target=trigger, args=(station, parts[first::CLIENTS], results), daemon=True)
               for first in range(CLIENTS)]
    for client in clients:
        client.start()
    for kill in range(1, KILLS + 1):
        while len(results) < kill * count // (KILLS + 1) and any(client.is_alive() for client in clients):
            time.sleep(station.random.random() / 10)
        station.end()
        station.start()
    for client in clients:
        client.join()
    expect(len(results) == count, f"each of {count} triggers has a result, not {len(results)}")
    head = fringed.Head(station.url, station.secret)
    again = head.trigger(part_id=1, token="part-1")
    expect(again.seq == results[1].seq, "a token is answered with its result after a restart, without measuring")
    stored = list(head.results())
    found = Counter(one.part_id for one in stored)
    expect(found == Counter(parts), f"each token has exactly one result, not {found}")
    expect(all(results[one.part_id].seq == one.seq for one in stored), "results are those that the clients got")
    expect(all(one.token == f"part-{one.part_id}" for one in stored), "results have their tokens")
    print(f"{count} triggers, {station.cuts} answers cut, {KILLS} times killed: each token has one result")


def example(station):
    code, names = re.search(r"```python\n(.*?)```", GUIDE.read_text(), re.DOTALL)[1], {}
    code = code.replace("http://10.20.1.11", station.url).replace("7K2QF-90HXT-M4WZB-E8N1C", station.secret)
    with contextlib.redirect_stdout(io.StringIO()):
        exec(code, names)
    shape = names["z"].shape
    expect(len(shape) == 2 and shape == names["sigma"].shape, "the example gives maps of H x W")
    expect(names["old"].seq == names["result"].seq, "the example reads all results")
    print(f"the example of docs/python.md: maps of {shape[0]} x {shape[1]}")


def main():
    with tempfile.TemporaryDirectory() as folder:
        station = Station(sys.argv[1], Path(folder))
        try:
            tokens(station, int(sys.argv[2]) if len(sys.argv) > 2 else 30)
            example(station)
        finally:
            station.end(signal.SIGTERM)


if __name__ == "__main__":
    main()
