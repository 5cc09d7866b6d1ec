#!/usr/bin/env python3
"""Every panel of the dashboards gets from real servers what the heads' CSV says.

    tests/fleet/panels.py target/release/fringed-fleet

The SQL of docs/fleet/results.json runs on ClickHouse with what a collector wrote; each panel must have the rows that tests/fleet/boards.py
works out. The expressions of docs/fleet/health.json and docs/fleet/alerts.yml run on Prometheus, if it is installed.
"""

import json
import math
import pathlib
import re
import shutil
import subprocess
import sys
import time
import urllib.parse

from boards import PANELS, Asked, results
from servers import ClickHouse, Collector, Folder, Plant, Process, broken, get, ports, wait_for

DOCS = pathlib.Path(__file__).parents[2] / "docs" / "fleet"
RATE, RESULTS, KEPT, INTERVAL = 0.5, 3000, 2900, 300
GAUGE = 'rim "A"'
# A line whose heads have no time, and one whose heads go on measuring.
CHOSEN, CLOCKLESS, GOING_ON = ["press 1", "press 2"], "no clock", "press 3"


class Head:
    def __init__(self, url, number, line, reachable=True):
        self.url, self.serial, self.line, self.reachable = url, f"SIM{number:05}", line, reachable
        self.deleted = 0


def lines_of(number):
    return CLOCKLESS if number == 5 else CHOSEN[number > 8]


def same(left, right):
    # stddevSamp loses digits to squares, where a value is large to its spread.
    if isinstance(left, float) or isinstance(right, float):
        return left is not None and right is not None and math.isclose(left, right, rel_tol=1e-7, abs_tol=1e-12)
    return left == right


def panels_of(name):
    """Title and query of each panel."""
    for panel in json.loads((DOCS / name).read_text())["panels"]:
        for target in panel["targets"]:
            yield panel["title"], target.get("rawSql") or target["expr"]


def sql_of(target, begin, end, chosen, gauge=GAUGE):
    """The panel's SQL with the macros of Grafana's data source replaced."""
    quoted = lambda text: "'" + text.replace("'", "\\'") + "'"
    sql = re.sub(r"\$__timeFilter\((\w+)\)", rf"(\1 >= toDateTime({begin}) AND \1 <= toDateTime({end}))", target)
    for macro, value in {
        "$__interval_s": str(INTERVAL),
        "$__fromTime": f"toDateTime({begin})",
        "$__toTime": f"toDateTime({end})",
        "${line:sqlstring}": ", ".join(map(quoted, chosen)),
        "${gauge:sqlstring}": quoted(gauge),
    }.items():
        sql = sql.replace(macro, value)
    if "$" in sql:
        broken(f"a macro is unknown: {sql}")
    return sql


def results_board(folder, fleet):
    store = ClickHouse(folder)
    # Their last result is some minutes old.
    old = Plant(folder, fleet, heads=12, rate=RATE, backlog=RESULTS + 300, results=RESULTS, kept=KEPT, seed=2)
    new = Plant(folder, fleet, "going-on", heads=14, rate=RATE, backlog=300, seed=4)
    heads = [Head(f"{old.url}/{number:04}", number, lines_of(number)) for number in range(1, 13)]
    going_on = [Head(f"{new.url}/{number:04}", number, GOING_ON) for number in (13, 14)]
    gone = Head(f"http://127.0.0.1:{ports(1)[0]}", 0, CHOSEN[0], False)
    config = folder.path / "fleet.toml"
    tables = "".join(f'[[heads]]\nurl = "{head.url}"\nline = "{head.line}"\n' for head in [*heads, *going_on, gone])
    config.write_text(f'store = "{store.url}/plant"\nstate_s = 1\n{tables}')
    Collector(folder, fleet, config=config)
    exists = "SELECT count() FROM system.tables WHERE database = 'plant' AND name = 'result_once'"
    wait_for("tables", 20, lambda: store.sql(exists)[0][0])
    counted = "SELECT count() FROM plant.result WHERE serial <= 'SIM00012'"
    wait_for("results", 60, lambda: store.sql(counted)[0][0] >= 12 * KEPT)
    # As a collector does that was killed before it knew what it had written.
    store.run("INSERT INTO plant.result SELECT * FROM plant.result WHERE serial < 'SIM00004'")
    states = "SELECT count() FROM plant.head_once WHERE state != '' OR error != ''"
    wait_for("states", 30, lambda: store.sql(states)[0][0] == len(heads) + 3)
    every = []
    for head in heads:
        if head.line != CLOCKLESS:
            found = results(head.url, head.serial, head.line)
            every += found
        first = json.loads(get(f"{head.url}/api/results?limit=1").split("\n")[0])["first"]
        head.deleted = first - 1
    start = old.said["start_unix_ms"] // 1000
    # An hour begins within it.
    begin, end = start + 300, start + 5400
    asked = Asked(every, [*heads, *going_on, gone], begin, end, INTERVAL, GAUGE, CHOSEN)
    board = json.loads((DOCS / "results.json").read_text())
    titles = [title for title, _ in panels_of("results.json")]
    if titles != list(PANELS):
        broken(f"panels {titles}, of which {list(PANELS)} are checked")
    for variable in board["templating"]["list"][1:]:
        if not store.sql(sql_of(variable["query"], begin, end, CHOSEN), database="plant"):
            broken(f"the variable {variable['name']} has no values")
    for title, sql in panels_of("results.json"):
        if title == "Heads that are silent":
            check_silent(store, sql, begin, end, heads, gone, every)
            continue
        rows = store.sql(sql_of(sql, begin, end, CHOSEN), database="plant")
        expected = [list(row) for row in PANELS[title](asked)]
        if not expected or len(rows) != len(expected):
            broken(f"{title}: {len(rows)} rows, of {len(expected)}")
        for row, other in zip(rows, expected):
            if len(row) != len(other) or not all(map(same, row, other)):
                broken(f"{title}: {row}, by the CSV {other}")
    # Without a collector nothing is known of the heads.
    later = dict(panels_of("results.json"))["Heads that answer"].replace("now()", "(now() + 300)")
    if store.sql(sql_of(later, begin, end, CHOSEN), database="plant")[0][0] != 0:
        broken("heads answer that no collector has written for five minutes")
    check_reads(store)
    config.write_text(f"keep_days = 400\n{config.read_text()}")
    Collector(folder, fleet, name="forgetful", config=config)
    old = "SELECT (SELECT count() FROM plant.result WHERE at < now() - 86400 * 500) + (SELECT count() FROM plant.result_at WHERE at < now() - 86400 * 500)"
    wait_for("old results are deleted", 30, lambda: store.sql(old)[0][0] == 0)
    print(f"{len(titles)} panels of results.json show what the CSV of {len(heads)} heads says")


def check_reads(store):
    """The example queries of docs/fleet.md read little: an hour of a million results, and one of them."""
    columns = "serial, history, seq, at, received_unix_ms, verdict, gauges.slot, gauges.name, gauges.value"
    values = (
        "concat('SIM9', toString(number % 1000)), 'a', toUInt32(intDiv(number, 1000) + 1), toDateTime(1700000000 + intDiv(number, 1000) * 86),"
        " 1, 'PASS', [1], ['width'], [1.5]"
    )
    for part in range(10):
        store.run(
            f"INSERT INTO result ({columns}) SELECT {values} FROM system.numbers WHERE number >= {part * 100_000} LIMIT 100000", database="plant"
        )
    store.run("OPTIMIZE TABLE result", database="plant")
    queries = re.findall(r"```sql\n-- (.*?)\n(.*?)```", (DOCS.parent / "fleet.md").read_text(), re.DOTALL)
    marks = {"FROM_TIME": "1700036000", "TO_TIME": "1700039600", "SERIAL": "SIM9500", "HISTORY": "a", "SEQ": "500"}
    parts = store.sql("SELECT count() FROM system.parts WHERE active AND database = 'plant' AND table = 'result'")[0][0]
    most = {"results of an hour": 2 * 42_000 + 8192 * parts, "one result": 4 * 8192}
    for title, sql in queries:
        for mark, value in marks.items():
            sql = sql.replace(mark, value)
        rows, read = store.asked(sql.strip().rstrip(";"), "plant")
        if title in most and (not rows or read > most.pop(title)):
            broken(f"{title}: {len(rows)} rows found, {read} read of {parts} parts")
    if most:
        broken(f"docs/fleet.md has no query for {list(most)}")


def check_silent(store, sql, begin, end, heads, gone, every):
    rows = store.sql(sql_of(sql, begin, end, [*CHOSEN, GOING_ON]), database="plant")
    expected = [gone, *(head for head in heads if head.line in CHOSEN)]
    if [row[1] for row in rows] != [head.url for head in expected]:
        broken(f"silent are {[row[1] for row in rows]}, not {[head.url for head in expected]}")
    last = {}
    for one in every:
        last[one.serial] = max(last.get(one.serial, 0), one.at)
    for row, head in zip(rows[1:], expected[1:]):
        if row[2] != head.serial or abs(row[6] - (time.time() - last[head.serial])) > 5:
            broken(f"silent: {row}, and {head.serial} has had no result for {time.time() - last[head.serial]:.0f} s")


def health_board(folder, fleet):
    plant = Plant(folder, fleet, "scraped", heads=12, rate=10, backlog=1000, seed=2)
    (port,) = ports(1)
    config = folder.path / "prometheus.json"
    jobs = [
        {
            "job_name": "fringed",
            "static_configs": [
                {"targets": [plant.said["listen"]], "labels": {"line": lines_of(number), "__metrics_path__": f"/h/{number:04}/metrics", "instance": f"SIM{number:05}"}}
                for number in range(1, 13)
            ],
        }
    ]
    shutil.copy(DOCS / "alerts.yml", folder.path)
    config.write_text(json.dumps({"global": {"scrape_interval": "1s", "evaluation_interval": "1s"}, "rule_files": ["alerts.yml"], "scrape_configs": jobs}))
    subprocess.run(["promtool", "check", "config", DOCS / "prometheus.yml", config], check=True, capture_output=True)
    Process(folder, "prometheus", ["prometheus", f"--config.file={config}", f"--storage.tsdb.path={folder.path}/series", f"--web.listen-address=127.0.0.1:{port}"])
    url = f"http://127.0.0.1:{port}/api/v1"

    def query(expression):
        text = expression.replace("$__rate_interval", "10s").replace("$line", ".*").replace("$gauge", GAUGE.replace('"', '\\"'))
        answer = json.loads(get(f"{url}/query?{urllib.parse.urlencode({'query': text})}"))
        return answer["data"]["result"]

    wait_for("Prometheus scrapes", 30, lambda: len(query("rate(fringed_results_total[10s]) >= 0")) >= 36)
    titles = set()
    for title, expression in panels_of("health.json"):
        titles.add(title)
        # Heads that are well have none of these.
        found, none = query(expression), title in ("Heads that are silent", "Rejected triggers")
        if bool(found) == none:
            broken(f"{title}: {len(found)} series")
    alerts = {alert["labels"]["alertname"] for alert in json.loads(get(f"{url}/alerts"))["data"]["alerts"]}
    if alerts != {"HeadDrifts"}:
        broken(f"alerts {alerts}, and heads that drift are all that is wrong")
    drifting = {series["metric"]["instance"] for series in query("fringed_drift_pixels > 0.5")}
    if drifting != {"SIM00003", "SIM00011"}:
        broken(f"{drifting} drift")
    print(f"{len(titles)} panels of health.json have series, and the alerts are those of heads that drift")


if __name__ == "__main__":
    with Folder() as place:
        results_board(place, sys.argv[1])
        if shutil.which("prometheus") and shutil.which("promtool"):
            health_board(place, sys.argv[1])
        else:
            print("skipped: health.json, because Prometheus is not installed (Debian package prometheus)")
