#!/usr/bin/env python3
"""Heads that send what no head sends harm nobody else, and are named.

    tests/fleet/hostile.py target/release/fringed-fleet [large]

Lines without end, 1 GB in a line, the results of another head, SEQ that falls, NaN, a redirect, silence, half answers, each for 6 s in
47; a certificate of another host. The log must name each of these heads with what is wrong, the results of the others must come in time,
and in the end those of all heads must be there, each once. Small: 40 heads for 40 s. Large: 200 heads for 120 s.
"""

import http.server
import json
import ssl
import subprocess
import sys
import threading
import time

from plant import Head, are_the_heads
from servers import ClickHouse, Collector, Folder, Plant, broken, wait_for

SEED = 3
FAULTS = ["endless", "line", "serial", "falling", "nan", "redirect", "silence", "cut", "slow"]
MOST_MIB = 200
# Of heads that are well a result is there by then; `pace.py` has the promise.
IN_TIME_S = 10


def main(fleet, heads, seconds):
    with Folder() as folder, Impostor(folder) as impostor:
        store = ClickHouse(folder)
        plant = Plant(folder, fleet, heads=heads, results=seconds, seed=SEED, faults=",".join(FAULTS))
        config = folder.path / "fleet.toml"
        config.write_text(
            f'store = "{store.url}/plant"\nca = "{impostor.certificate}"\n'
            f'[[heads]]\nurl = "{plant.heads}"\n[[heads]]\nurl = "{impostor.url}"\n'
        )
        collector = Collector(folder, fleet, config=config)
        said = [Head(plant.said, number, FAULTS) for number in range(1, heads + 1)]
        time.sleep(seconds)

        def last(serials):
            found = dict(store.sql("SELECT serial, max(seq) FROM plant.result GROUP BY serial"))
            return [found.get(serial, 0) for serial in serials]

        well = [head.serial for head in said if head.fault is None]
        behind = seconds - IN_TIME_S
        if min(last(well)) < behind:
            late = [serial for serial, seq in zip(well, last(well)) if seq < behind]
            broken(f"heads that are well are more than {IN_TIME_S} s late: {late[:9]}")
        wait_for("the results of all heads", 120, lambda: min(last(head.serial for head in said)) >= seconds)
        time.sleep(1)
        every = {serial: sorted(seqs) for serial, seqs in store.sql("SELECT serial, groupArray(seq) FROM plant.result_once GROUP BY serial")}
        for head in said:
            # Nobody can know that results do not exist which are of the right form: those that do must be there.
            seqs = [seq for seq in every.pop(head.serial, []) if head.fault != "endless" or seq <= seconds]
            if seqs != list(range(1, seconds + 1)):
                broken(f"{head.serial}, {head.fault}: not each of its results is there once")
        if every:
            broken(f"results of nobody: {list(every)[:9]}")
        for head in said[: len(FAULTS)]:
            query = f"SELECT seq, verdict, gauges.value FROM plant.result_once WHERE serial = '{head.serial}'"
            for seq, verdict, values in store.sql(query):
                expected, numbers = head.result(seq)
                if verdict != expected or not are_the_heads(values, numbers):
                    broken(f"{head.serial}, {head.fault}, {seq}: {verdict} {values}")
        log = collector.log.read_text()
        unnamed = [
            head.fault for head in said[: len(FAULTS)] if head.fault != "slow" and f"/h/{head.number:04}" not in log and head.serial not in log
        ]
        if unnamed:
            broken(f"the log does not name the heads with {', '.join(unnamed)}")
        if impostor.url not in log or "certificate" not in log:
            broken("the log does not name the head with the certificate of another host")
        _, memory = collector.look()
        if memory > MOST_MIB:
            broken(f"the collector took {memory:.0f} MiB, of at most {MOST_MIB}")
        print(f"{heads * seconds} results are there once, {len(FAULTS)} faults on every twentieth head; the collector took {memory:.0f} MiB")


class Impostor:
    """A server whose certificate is signed well and of another host."""

    def __init__(self, folder):
        self.certificate = folder.path / "certificate.pem"
        key = folder.path / "key.pem"
        words = "req -x509 -newkey ec -pkeyopt ec_paramgen_curve:prime256v1 -nodes -days 2 -subj /CN=other -addext subjectAltName=DNS:other.invalid"
        command = ["openssl", *words.split(), "-keyout", str(key), "-out", str(self.certificate)]
        subprocess.run(command, check=True, capture_output=True)
        context = ssl.SSLContext(ssl.PROTOCOL_TLS_SERVER)
        context.load_cert_chain(self.certificate, key)
        self.server = http.server.ThreadingHTTPServer(("127.0.0.1", 0), Silent)
        self.server.socket = context.wrap_socket(self.server.socket, server_side=True)
        self.url = f"https://127.0.0.1:{self.server.server_address[1]}"

    def __enter__(self):
        threading.Thread(target=self.server.serve_forever, daemon=True).start()
        return self

    def __exit__(self, *_):
        self.server.shutdown()


class Silent(http.server.BaseHTTPRequestHandler):
    """What must never be asked: the certificate is seen before."""

    def do_GET(self):
        body = json.dumps({"serial": "IMPOSTOR", "history": "0", "first": None, "last": None}).encode() + b"\n"
        self.send_response(200)
        self.end_headers()
        self.wfile.write(body)

    def log_message(self, *_):
        pass


if __name__ == "__main__":
    main(sys.argv[1], *((200, 120) if sys.argv[2:] == ["large"] else (40, 40)))
