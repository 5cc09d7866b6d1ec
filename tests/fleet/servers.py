"""Starts and stops what a plant runs, below a temporary folder and on free ports of this machine."""

import json
import os
import pathlib
import random
import shutil
import signal
import socket
import subprocess
import sys
import tempfile
import time
import urllib.error
import urllib.request

CONFIG = """<yandex>
<logger><level>warning</level><log>{folder}/log</log><errorlog>{folder}/errors</errorlog></logger>
<http_port>{http}</http_port><tcp_port>{tcp}</tcp_port><interserver_http_port>{between}</interserver_http_port>
<interserver_http_host>127.0.0.1</interserver_http_host><listen_host>127.0.0.1</listen_host>
<path>{folder}/data/</path><tmp_path>{folder}/tmp/</tmp_path><format_schema_path>{folder}/formats/</format_schema_path>
<users_config>{folder}/users.xml</users_config><default_profile>default</default_profile><default_database>default</default_database>
<mark_cache_size>67108864</mark_cache_size><timezone>UTC</timezone>
<merge_tree><old_parts_lifetime>5</old_parts_lifetime></merge_tree>
{cluster}
</yandex>
"""
USERS = """<yandex><profiles><default><max_memory_usage>2000000000</max_memory_usage>
<load_balancing>in_order</load_balancing><connect_timeout>2</connect_timeout></default></profiles>
<users><default><password></password><networks><ip>127.0.0.1</ip></networks><profile>default</profile><quota>default</quota></default></users>
<quotas><default><interval><duration>3600</duration><queries>0</queries><errors>0</errors><result_rows>0</result_rows>
<read_rows>0</read_rows><execution_time>0</execution_time></interval></default></quotas></yandex>
"""


def broken(words):
    sys.exit(f"broken promise: {words}")


# Below the ephemeral ports (Linux: 32768 to 60999), so that no outgoing connection takes one before its server listens.
PORTS = range(10000, 32768)
# Ports that `ports` has returned: their servers may not listen yet.
given = set()


def ports(count):
    """Ports that are free now and were not given before."""
    numbers = []
    while len(numbers) < count:
        number = random.choice(PORTS)
        try:
            socket.create_server(("127.0.0.1", number)).close()
        except OSError:
            continue
        if number not in given:
            numbers.append(number)
            given.add(number)
    return numbers


def wait_for(what, seconds, asked):
    """Calls `asked` until it returns something true, and returns that."""
    until = time.monotonic() + seconds
    while time.monotonic() < until:
        try:
            found = asked()
        except (OSError, urllib.error.URLError):
            found = None
        if found:
            return found
        time.sleep(0.05)
    broken(f"{what}: not within {seconds} s")


def get(url, timeout=30):
    with urllib.request.urlopen(url, timeout=timeout) as answer:
        return answer.read().decode()


class Folder:
    """A temporary folder and the processes that live with it; all end with the `with`."""

    def __enter__(self):
        self.path = pathlib.Path(tempfile.mkdtemp(prefix="fleet-"))
        self.processes = []
        return self

    def __exit__(self, kind, *_):
        for process in self.processes:
            process.end()
        if kind is not None:
            for log in sorted(self.path.glob("*.log")):
                print(f"-- {log.name}:\n{log.read_text(errors='replace')[-3000:]}", file=sys.stderr)
        shutil.rmtree(self.path, ignore_errors=True)


class Process:
    """A program that can be killed and started again; what it says is in a file of its name."""

    def __init__(self, folder, name, command, **options):
        self.name, self.command, self.options = name, [str(word) for word in command], options
        self.log = folder.path / f"{name}.log"
        # Processor seconds and largest memory (MiB) of the runs that have ended.
        self.cpu, self.memory = 0.0, 0.0
        self.running = None
        folder.processes.append(self)
        self.start()

    def start(self):
        with open(self.log, "ab") as log:
            self.running = subprocess.Popen(
                self.command, stdin=subprocess.DEVNULL, stdout=log, stderr=log, start_new_session=True, **self.options
            )

    def is_alive(self):
        return self.running is not None and self.running.poll() is None

    def look(self):
        """Processor seconds, and the largest memory so far in MiB."""
        cpu, memory = self.cpu, self.memory
        if self.is_alive():
            fields = pathlib.Path(f"/proc/{self.running.pid}/stat").read_text().rsplit(")", 1)[1].split()
            cpu += (int(fields[11]) + int(fields[12])) / os.sysconf("SC_CLK_TCK")
            for line in pathlib.Path(f"/proc/{self.running.pid}/status").read_text().splitlines():
                if line.startswith("VmHWM"):
                    memory = max(memory, int(line.split()[1]) / 1024)
        return cpu, memory

    def kill(self):
        if self.is_alive():
            self.cpu, self.memory = self.look()
            self.running.kill()
            self.running.wait()

    def stop(self, seconds=20):
        """SIGTERM; returns the exit code."""
        self.cpu, self.memory = self.look()
        self.running.send_signal(signal.SIGTERM)
        return self.running.wait(seconds)

    def end(self):
        if self.is_alive():
            self.running.kill()
            self.running.wait()


class ClickHouse(Process):
    """A server of one's own. `cluster` is further configuration, in which its ports may stand."""

    def __init__(self, folder, name="clickhouse", numbers=None, cluster=""):
        self.http, self.tcp, self.between = numbers or ports(3)
        place = folder.path / name
        place.mkdir()
        config = CONFIG.format(folder=place, http=self.http, tcp=self.tcp, between=self.between, cluster=cluster)
        (place / "config.xml").write_text(config)
        (place / "users.xml").write_text(USERS)
        self.url = f"http://127.0.0.1:{self.http}"
        server = shutil.which("clickhouse-server", path=os.environ["PATH"] + ":/usr/sbin")
        super().__init__(folder, name, [server, f"--config-file={place}/config.xml"])
        self.serves()

    def serves(self):
        wait_for(f"{self.name} serves", 30, lambda: get(self.url, 2))

    def sql(self, query, timeout=60, database="default"):
        """The rows of the answer; the values are those of JSON."""
        request = urllib.request.Request(
            f"{self.url}/?database={database}&output_format_json_quote_64bit_integers=0", f"{query} FORMAT JSONCompact".encode()
        )
        try:
            with urllib.request.urlopen(request, timeout=timeout) as answer:
                return json.load(answer)["data"]
        except urllib.error.HTTPError as error:
            raise SystemExit(f"{self.name}: {query}\n{error.read().decode(errors='replace')}") from error

    def asked(self, query, database):
        """The rows of the answer, and how many rows the server read for it."""
        with urllib.request.urlopen(f"{self.url}/?database={database}", f"{query} FORMAT JSONCompact".encode(), 60) as answer:
            found = json.load(answer)
        return found["data"], found["statistics"]["rows_read"]

    def run(self, statement, timeout=60, database="default"):
        """A statement without an answer."""
        request = urllib.request.Request(f"{self.url}/?database={database}", statement.encode())
        try:
            with urllib.request.urlopen(request, timeout=timeout) as answer:
                answer.read()
        except urllib.error.HTTPError as error:
            raise SystemExit(f"{self.name}: {statement}\n{error.read().decode(errors='replace')}") from error


class ZooKeeper(Process):
    """One server, with its data in the temporary folder."""

    def __init__(self, folder):
        (self.port,) = ports(1)
        place = folder.path / "zookeeper"
        place.mkdir()
        (place / "zoo.cfg").write_text(
            f"tickTime=1000\ndataDir={place}/data\nclientPort={self.port}\nclientPortAddress=127.0.0.1\nadmin.enableServer=false\n"
        )
        jars = "/usr/share/java/zookeeper.jar:/usr/share/java/slf4j-simple.jar"
        main = "org.apache.zookeeper.server.quorum.QuorumPeerMain"
        super().__init__(folder, "zookeeper", ["java", "-Xmx256m", "-cp", jars, main, place / "zoo.cfg"])
        wait_for("zookeeper serves", 60, self.serves)

    def serves(self):
        """Whether it answers for its data: it accepts connections before it reads them."""
        with socket.create_connection(("127.0.0.1", self.port), 1) as connection:
            connection.sendall(b"srvr")
            return b"Mode: standalone" in connection.makefile("rb").read()


class Plant(Process):
    """The example `plant` of the package fringed-fleet, which Cargo puts beside the program; `said` is its first line."""

    def __init__(self, folder, fleet, name="plant", **options):
        words = [f"--{key}={value}" for key, value in {"listen": "127.0.0.1:0", **options}.items()]
        super().__init__(folder, name, [pathlib.Path(fleet).parent / "examples" / "plant", *words])
        self.said = json.loads(wait_for("the simulated heads answer", 20, lambda: self.log.read_text().partition("\n")[0]))
        self.url = f"http://{self.said['listen']}/h"
        self.heads = f"{self.url}/{{0001..{self.said['heads']:04}}}"


class Collector(Process):
    """`fringed-fleet collect` of all heads of a plant, or of those of a configuration."""

    def __init__(self, folder, fleet, plant=None, store=None, name="collector", more=(), config=None):
        words = ["--config", config] if config else ["--heads", plant.heads, "--store", store]
        super().__init__(folder, name, [fleet, "collect", *words, *more])
