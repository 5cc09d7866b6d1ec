"""The client against a server that fails in every way: python3 -m unittest discover -s tests"""

import io
import json
import subprocess
import sys
import tempfile
import threading
import unittest
from datetime import datetime, timezone
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer
from pathlib import Path
from urllib.parse import parse_qsl

import numpy

import fringed

FIRST_MS = 1_793_000_000_000  # The time of result 0.
MOST_MIB = 60  # Memory of a client that iterates 100,000 results; the interpreter and NumPy take half of it.
ITERATE = """import resource, sys, fringed
count = sum(1 for _ in fringed.Head(sys.argv[1]).results())
print(count, resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024)"""
OLD = (404, {"error": "there is no such page; start at /"})
GONE = (404, {"error": "the frames are not kept"})
LAST, KEPT, RESULTS = "GET /api/last/maps.npz", "GET /api/history/7/maps.npz", "GET /api/results"
SNAPSHOT, TRIGGER, EVENTS = "GET /api/snapshot", "POST /api/trigger", "GET /events"


def gauge(slot, name, value):
    return {"slot": slot, "name": name, "unit": "mm", "value": value, "sigma": .001, "u": .002, "low": -1.0,
            "high": 1.0, "decision": 3, "reason": None}


def line(seq, at=FIRST_MS, **more):
    return {"serial": "S", "history": "h", "seq": seq, "at_unix_ms": at and at + seq * 1000, "clock": "synchronised",
            "recipe": 1, "fingerprint": "3e411687", "part_id": seq, "press_stroke": 0, "verdict": "PASS",
            "error_code": 0, "flags": 0, "exposure_us": 1, "processing_us": 1, "coverage": 1.0, "placement": None,
            "gauges": [gauge(1, "deviation", seq / 8)], **more}


def npz(seq=7, history="h"):
    file, z = io.BytesIO(), numpy.array([[1, numpy.nan, 3], [4, 5, 6]], "f4")
    numpy.savez(file, x=z + 10, y=z + 20, z=z, sigma=z, meta=json.dumps({"seq": seq, "history": history}))
    return file.getvalue()


def cut(_):
    """Ends the connection after the request was taken."""


class Handler(BaseHTTPRequestHandler):
    """Gives the next of the answers that a test has for a path, the last one again and again."""
    protocol_version = "HTTP/1.1"

    def answer(self):
        path, _, query = self.path.partition("?")
        self.query, self.close_connection = dict(parse_qsl(query)), True
        self.body = self.rfile.read(int(self.headers["Content-Length"] or 0))
        answers = self.server.answers.get(f"{self.command} {path}", [OLD])
        answer = answers.pop(0) if len(answers) > 1 else answers[0]
        answer(self) if callable(answer) else self.send(*answer)

    do_GET = do_POST = answer

    def send(self, status, body, kind="application/json", **headers):
        body = body if isinstance(body, bytes) else json.dumps(body).encode()
        self.stream([body], Content_Length=len(body), status=status, Content_Type=kind, **headers)

    def stream(self, blocks, whole=True, status=200, **headers):
        chunked = "Content_Length" not in headers
        self.send_response(status)
        for name, value in (headers or {"Transfer-Encoding": "chunked"}).items():
            self.send_header(name.replace("_", "-"), value)
        self.end_headers()
        for block in blocks:
            self.wfile.write(f"{len(block):x}\r\n".encode() + block + b"\r\n" if chunked else block)
        self.wfile.write(b"0\r\n\r\n" if chunked and whole else b"")

    def log_message(self, *_):
        pass


def history(count, broken=0, undated=(), identity=lambda after: "h"):
    """The answers of a device with `count` results; the first one that reaches result `broken` breaks off there."""
    def results(request):
        after, last = int(request.query["after"]), min(int(request.query["after"]) + int(request.query["limit"]), count)
        end = broken if after < broken <= last else last
        rows = (line(seq, None if seq in undated else FIRST_MS) for seq in range(after + 1, end + 1))
        head = {"serial": "S", "history": identity(after), "first": 1, "last": count}
        request.stream((json.dumps(row).encode() + b"\n" for row in [head, *rows]), whole=end == last)

    def newest(request):
        seqs = range(min((int(request.query["until_us"]) // 1000 - FIRST_MS - 1) // 1000, count), 0, -1)
        request.send(200, {"results": [{"seq": seq} for seq in seqs if seq not in undated][:1]})
    return {RESULTS: [results], "GET /api/history": [newest]}


class Client(unittest.TestCase):
    def setUp(self):
        fringed.head.PAUSE = .01
        server = ThreadingHTTPServer(("127.0.0.1", 0), Handler)
        self.addCleanup(server.server_close)
        self.addCleanup(server.shutdown)
        threading.Thread(target=server.serve_forever, args=(.01,), daemon=True).start()
        self.url = f"http://127.0.0.1:{server.server_port}"
        sign_in = lambda request: request.send(200, {}, Set_Cookie="fringed-session=A; Path=/")  # noqa: E731
        self.answers = server.answers = {"POST /api/session": [sign_in]}
        self.head = fringed.Head(self.url, secret="7K2QF", timeout=2)

    def fails(self, kind, words, call, *arguments, **named):
        with self.assertRaises(kind) as caught:
            call(*arguments, **named)
        self.assertIs(type(caught.exception), kind)
        self.assertRegex(str(caught.exception), f"({words}).*; [a-z]")

    def test_a_lost_answer_is_asked_for_again_with_the_same_token(self):
        orders, steps = [], [cut, (503, {"error": "crowded"}), (409, {"error": "it starts"}), None]

        def take(request):
            orders.append(json.loads(request.body))
            step = steps.pop(0) or (200, {"result": line(7, request=orders[0]["token"], reason=None)})
            step(request) if callable(step) else request.send(*step)
        self.answers[TRIGGER] = [take]
        result = self.head.trigger(part_id=4711)
        self.assertEqual(orders, [{"token": result.token, "part_id": 4711}] * 4)
        self.assertEqual((result.seq, result["deviation"].value, result["deviation"].passed), (7, 7 / 8, True))
        self.assertEqual(result.time, datetime.fromtimestamp(FIRST_MS / 1000 + 7, timezone.utc))
        with self.assertRaisesRegex(KeyError, "it has deviation"):
            result["hole"]
        self.answers[TRIGGER] = [cut]
        self.fails(fringed.Unreachable, "POST.*token='abc'|POST", self.head.trigger, token="abc", timeout=.1)

    def test_each_failure_has_its_error_which_ends_with_the_remedy(self):
        for status, kind in [(400, "Unfit"), (401, "Refused"), (403, "Refused"), (404, "NotThere"), (409, "Busy"),
                             (422, "Unfit"), (429, "Refused"), (500, "DeviceProblem"), (507, "StorageFull")]:
            self.answers[TRIGGER] = [(status, {"error": "words of the device"})]
            self.fails(getattr(fringed, kind), "words of the device", self.head.trigger)
        self.answers[TRIGGER] = [(202, {"accepted": True})]
        self.fails(fringed.TooOld, "takes no tokens", self.head.trigger)
        self.fails(fringed.TooOld, "has no maps.npz", self.head.recipe_maps, 1)
        page, plain, problem = (b"<html>", "text/html"), fringed.FringedError, fringed.DeviceProblem
        for kind, words, answer in [(plain, "200 .text/html", (200, *page)), (plain, "404 .text/html", (404, *page)),
                                    (plain, "redirected", (302, b"")), (plain, "200", (200, b"[]")),
                                    (problem, "502", (502, *page)), (problem, "full", (503, {"error": "full"})),
                                    (fringed.TooOld, "no snapshot", (405, b"")), (fringed.Unreachable, "GET", cut)]:
            self.answers[SNAPSHOT] = [answer]
            self.fails(kind, words, self.head.snapshot)
        self.answers["GET /api/recipes/1/maps.npz"] = [(200, b"PK no maps")]
        self.fails(fringed.FringedError, "maps cannot be read", self.head.recipe_maps, 1)
        self.fails(fringed.Refused, "needs the secret", fringed.Head(self.url).trigger)

    def test_a_session_is_begun_with_the_first_change_and_renewed_once(self):
        seen = []
        self.answers[TRIGGER] = [lambda request: (seen.append((request.headers["Cookie"], request.headers["Origin"])),
                                                  request.send(401, {"error": "sign in"}))]
        self.fails(fringed.Refused, "sign in", self.head.trigger)
        self.assertEqual(seen, [("fringed-session=A", self.url)] * 2)

    def test_a_user_signs_in_by_name_and_not_again_where_a_role_is_missing(self):
        for head, who in [(self.head, {}), (fringed.Head(self.url, "7K2QF", user="ada"), {"user": "ada"})]:
            seen = []
            self.answers["POST /api/session"] = [lambda request: (seen.append(json.loads(request.body)), request.send(
                200, {}, Set_Cookie="fringed-session=A; Path=/"))]
            self.answers[TRIGGER] = [(403, {"error": "this needs the role technician"})]
            self.fails(fringed.Refused, "the role technician", head.trigger)
            self.fails(fringed.Refused, "the role technician", head.trigger)
            self.assertEqual(seen, [{"secret": "7K2QF", **who}])
            self.answers[TRIGGER] = [(401, {"error": "sign in"})]
            self.fails(fringed.Refused, "sign in", head.trigger)
            self.assertEqual(seen, [{"secret": "7K2QF", **who}] * 2)

    def test_results_of_any_number_are_read_in_pages_and_little_memory(self):
        self.answers.update(history(100_000))
        ran = subprocess.run([sys.executable, "-c", ITERATE, self.url], check=True, capture_output=True, text=True)
        count, mib = map(float, ran.stdout.split())
        self.assertEqual(count, 100_000)
        self.assertLess(mib, MOST_MIB)
        print(f"100,000 results: {mib:.1f} MiB")

    def test_results_are_selected_by_time_and_go_on_after_an_answer_that_broke_off(self):
        self.answers.update(history(12, broken=6, undated={4, 9}))
        at = [datetime.fromtimestamp(FIRST_MS / 1000 + seq, timezone.utc) for seq in range(13)]
        for seqs, filters in [(range(4, 10), {"since": at[5], "until": at[9].isoformat()}), ([11, 12], {"after": 10}),
                              (range(6, 13), {"since": at[6]}), ([], {"since": "2099-01-01"}), ([], {"recipe": 2})]:
            self.assertEqual([one.seq for one in self.head.results(**filters)], list(seqs))
        self.assertEqual(self.head.result(3).seq, 3)
        self.fails(fringed.NotThere, "no result 13", self.head.result, 13)
        self.answers.update(history(12, identity=str))
        self.fails(fringed.FringedError, "begun anew", list, self.head.results())

    def test_a_table_has_a_field_for_each_gauge(self):
        rows = [line(1), line(2, None, gauges=[gauge(1, "gap", 1.5), gauge(2, "gap", None), gauge(3, "seq", 2.5)])]
        text = "".join(json.dumps(row) + "\n" for row in [{"history": "h"}, *rows])
        self.answers[RESULTS] = [(200, text.encode()), (200, b'{"history": "h"}\n')]
        table = self.head.table()
        self.assertEqual(table.dtype.names[6:], ("deviation", "gap (slot 1)", "gap (slot 2)", "seq (slot 3)"))
        self.assertEqual((table["gap (slot 1)"][1], table["seq (slot 3)"][1], table["seq"][1]), (1.5, 2.5, 2))
        self.assertTrue(numpy.isnan(table["gap (slot 2)"]).all() and numpy.isnat(table["time"])[1])
        self.assertEqual(len(self.head.table()), 0)

    def test_maps_and_recordings_are_those_of_the_result(self):
        fresh = lambda: fringed.result.of_line(line(7), self.head._device)  # noqa: E731
        self.answers.update({SNAPSHOT: [(200, {"counters": {"sequence": 7}})], LAST: [(200, npz())]})
        maps = fresh().maps
        self.assertEqual((maps.points()[1].tolist(), maps.resolved.sum()), ([13, 23, 3], 5))
        self.assertTrue(numpy.isnan(maps.deviation).all())
        self.answers.update({LAST: [(200, npz(seq=8))], KEPT: [GONE]})
        self.fails(fringed.NotThere, "not kept", getattr, fresh(), "maps")
        self.answers.update({LAST: [GONE], KEPT: [(200, npz()), (200, npz(history="other"))]})
        self.assertEqual(fresh().maps.z.shape, (2, 3))
        self.fails(fringed.NotThere, "begun anew", getattr, fresh(), "maps")
        with tempfile.TemporaryDirectory() as folder:
            path = Path(folder) / "7.zip"
            half = lambda request: request.stream([b"half"], whole=False)  # noqa: E731
            self.answers["GET /api/history/7/recording.zip"] = [half, (200, b"whole")]
            self.fails(fringed.Unreachable, "broke off", fresh().save_recording, path)
            self.assertEqual(list(Path(folder).iterdir()), [])
            fresh().save_recording(path)
            self.assertEqual(path.read_bytes(), b"whole")

    def test_a_watch_connects_again_until_its_patience_ends(self):
        event = b'event: snapshot\ndata: {"heartbeat": 1}\n\n'
        self.answers[EVENTS] = [lambda request: request.stream([event[:9], event[9:]], whole=False), cut,
                                lambda request: request.stream([event]), cut]
        watch = self.head.watch(patience=.1)
        self.assertEqual([next(watch), next(watch)], [{"heartbeat": 1}] * 2)
        self.fails(fringed.Unreachable, "events", next, watch)

    def test_a_load_ends_with_the_outcome(self):
        state = {"state": "loading", "requested_recipe": 7, "recipe_result": 0, "refusal": None, "fault": None}
        failed = {**state, "state": "ready", "recipe_result": 1, "refusal": {"words": "there is no such recipe"}}
        self.answers["POST /api/recipes/7/load"] = [(202, {"accepted": True})]
        self.answers[SNAPSHOT] = [(200, state), (200, {**state, "state": "ready"}), (200, failed)]
        self.head.load(7)
        self.fails(fringed.NotThere, "no such recipe", self.head.load, 7)
