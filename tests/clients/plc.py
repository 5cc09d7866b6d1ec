"""A PLC for the test clients: the daemon on a small simulated head, and one connection to it. Needs pymodbus 3.16."""

import contextlib
import re
import signal
import struct
import subprocess
import tempfile
import time
from pathlib import Path

from pymodbus.client import ModbusTcpClient

ONLINE, TRIGGER, RESULT_ACK, RECIPE_LOAD, BUFFERED = 1 << 0, 1 << 1, 1 << 2, 1 << 3, 1 << 6
READY, BUSY, PROCESSING, EXPOSURE_DONE = 1 << 1, 1 << 2, 1 << 3, 1 << 4
RECIPE_LOADING, RECIPE_OK = 1 << 8, 1 << 9
RESULT_VALID, RESULT_TOGGLE, TRIGGER_ACK = 1 << 5, 1 << 6, 1 << 7
MISSED_TRIGGER, BUFFER_OVERFLOW = 1 << 12, 1 << 13
PASS = 1
# The recipe that the daemon teaches at its first start.
RECIPE = 1
PATIENCE_S = 30.0
# Few pixels, so that rendering takes little time: only the protocol is tested.
SCENARIO = "sub_rays = 2\n\n[rig.camera]\nwidth = 160\nheight = 160\n"


class Broken(Exception):
    """A promise of the register map that was not kept."""


def expect(condition, promise):
    if not condition:
        raise Broken(promise)


def long(words, at):
    return words[at] << 16 | words[at + 1]


class Status:
    """The STATUS block, from one read."""

    def __init__(self, words):
        self.bits, self.words = words[0], words
        self.error_code, self.state = words[2], words[4]
        self.triggers, self.seq, self.missed = long(words, 10), long(words, 12), long(words, 14)
        self.active_recipe, self.requested_recipe, self.recipe_result = words[5], words[8], words[9]
        self.last_token, self.buffered = words[16], words[17]
        self.reject_reason, self.map_version = words[20], words[21]

    def has(self, bits):
        return self.bits & bits == bits


class Plc:
    """One connection at a time."""

    def __init__(self, port):
        self.client = ModbusTcpClient("127.0.0.1", port=port, timeout=5, retries=0)
        self.connect()

    def connect(self):
        expect(self.client.connect(), "the daemon accepts a connection")

    def disconnect(self):
        self.client.close()

    def send_and_disconnect(self, address, values, share=1.0):
        """Sends a write, or the first part of its bytes, and closes the connection before the answer comes."""
        data = struct.pack(f">{len(values)}H", *values)
        pdu = struct.pack(">BHHB", 16, address, len(values), len(data)) + data
        frame = struct.pack(">HHHB", 0x7777, 0, len(pdu) + 1, 1) + pdu
        self.client.socket.sendall(frame[:int(len(frame) * share)])
        self.disconnect()

    def answer(self, response):
        expect(not response.isError(), f"the daemon answers and does not refuse ({response})")
        return response

    def read(self, address, count):
        return self.answer(self.client.read_holding_registers(address, count=count)).registers

    def write(self, address, values):
        self.answer(self.client.write_registers(address, values))

    def write_and_read_status(self, address, values):
        """FC23: writes, then reads the snapshot after the write."""
        response = self.client.readwrite_registers(
            read_address=100, read_count=32, write_address=address, values=values)
        return Status(self.answer(response).registers)

    def status(self):
        return Status(self.read(100, 32))

    def load_recipe(self, number):
        """A changeover: requests a recipe and returns the status when the load has ended."""
        # The first write of a connection only sets the initial level.
        self.write(0, [ONLINE])
        self.write(0, [ONLINE | RECIPE_LOAD, 0, number])
        self.write(0, [ONLINE])
        ended = self.wait("the end of the load", lambda status: not status.has(RECIPE_LOADING))
        expect(ended.requested_recipe == number, f"REQUESTED_RECIPE is {number}")
        return ended

    def wait(self, what, condition):
        until = time.monotonic() + PATIENCE_S
        while time.monotonic() < until:
            status = self.status()
            if condition(status):
                return status
            time.sleep(0.005)
        raise Broken(f"{what} within {PATIENCE_S} s")


def check_result(words):
    """Checks what must hold for every result of a good part."""
    expect(len(words) == 120, "a result has 120 registers")
    expect(long(words, 0) == long(words, 118), "SEQ is the same at both ends of the block")
    expect(words[3] == RECIPE, f"it was measured with recipe {RECIPE}, not {words[3]}")
    expect(words[8] == PASS, f"a good part passes (verdict {words[8]}, error {words[9]})")
    gauges = words[27]
    expect(gauges > 0, "the recipe has gauges")
    expect(long(words, 10) == long(words, 12) == (1 << gauges) - 1, "every gauge is valid and passes")
    for k in range(gauges):
        value = struct.unpack(">f", struct.pack(">HH", *words[64 + 2 * k:66 + 2 * k]))[0]
        steps = struct.unpack(">i", struct.pack(">HH", *words[32 + 2 * k:34 + 2 * k]))[0]
        expect(abs(steps * 1e-4 - value) <= 0.51e-4, f"gauge {k} is {value} as float and {steps} steps")
        expect(words[96 + k] & 0b11 == 0b11, f"the decision of gauge {k} is pass and valid")
    expect(words[96 + gauges:118] == [0] * (22 - gauges), "what is not used reads 0")


def trigger_fields(token, part, stroke, recipe=RECIPE):
    """Registers 1 to 7: TRIGGER_TOKEN, RECIPE_SELECT, PLC_HEARTBEAT, PART_ID, PRESS_STROKE.

    RECIPE_SELECT goes with every trigger: it is rejected where another recipe is active.
    """
    return [token, recipe, token & 0xFF, part >> 16, part & 0xFFFF, stroke >> 16, stroke & 0xFFFF]


@contextlib.contextmanager
def daemon(program):
    """Runs the daemon on a free port; yields the port."""
    with tempfile.TemporaryDirectory() as folder:
        Path(folder, "small.toml").write_text(SCENARIO)
        config = Path(folder, "fringed.toml")
        config.write_text('state = "state"\n[head]\nscenario = "small.toml"\n')
        log = Path(folder, "log")
        with log.open("wb") as errors:
            running = subprocess.Popen(
                [program, "serve", "--config", str(config),
                 "--modbus", "127.0.0.1:0", "--http", "127.0.0.1:0"], stderr=errors)
        try:
            until = time.monotonic() + 60
            while not (found := re.search(r"Modbus TCP on 127\.0\.0\.1:(\d+),", log.read_text())):
                expect(running.poll() is None, "the daemon serves: " + log.read_text())
                expect(time.monotonic() < until, "the daemon serves within a minute")
                time.sleep(0.05)
            yield int(found[1])
            running.send_signal(signal.SIGTERM)
            started = time.monotonic()
            code = running.wait(timeout=10)
            expect(code == 0, f"SIGTERM ends the daemon with exit code 0, not {code}")
            expect(time.monotonic() - started < 5, "SIGTERM ends the daemon within 5 s")
        finally:
            if running.poll() is None:
                running.kill()
                running.wait()
