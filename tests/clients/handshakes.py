#!/usr/bin/env python3
"""Both handshakes of the register map with pymodbus, against the daemon.

    python3 tests/clients/handshakes.py target/release/fringed [CYCLES]

Ends with an exit code other than 0 at the first broken promise. Needs pymodbus 3.16 and nothing else.
"""

import contextlib
import re
import signal
import struct
import subprocess
import sys
import tempfile
import time
from pathlib import Path

from pymodbus.client import ModbusTcpClient

ONLINE, TRIGGER, RESULT_ACK, RECIPE_LOAD = 1 << 0, 1 << 1, 1 << 2, 1 << 3
READY, BUSY, PROCESSING, EXPOSURE_DONE = 1 << 1, 1 << 2, 1 << 3, 1 << 4
RESULT_VALID, RESULT_TOGGLE, TRIGGER_ACK, MISSED_TRIGGER = 1 << 5, 1 << 6, 1 << 7, 1 << 12
PASS = 1
PATIENCE_S = 30.0


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
        self.last_token, self.reject_reason, self.map_version = words[16], words[20], words[21]

    def has(self, bits):
        return self.bits & bits == bits


class Plc:
    def __init__(self, port):
        self.client = ModbusTcpClient("127.0.0.1", port=port, timeout=5, retries=0)
        expect(self.client.connect(), "the daemon accepts a connection")

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

    def wait(self, what, condition):
        until = time.monotonic() + PATIENCE_S
        while time.monotonic() < until:
            status = self.status()
            if condition(status):
                return status
            time.sleep(0.005)
        raise Broken(f"{what} within {PATIENCE_S} s")

    def result(self, status):
        """The RESULT block in one read, checked against the status that announced it."""
        words = self.read(200, 120)
        expect(len(words) == 120, "one read gives 120 registers")
        expect(long(words, 0) == long(words, 118), "SEQ is the same at both ends of the block")
        expect(long(words, 0) == status.seq, "SEQ of the result is RESULT_SEQ")
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
        return words


def trigger_fields(token, part, stroke):
    """Registers 1 to 7: TRIGGER_TOKEN, RECIPE_SELECT, PLC_HEARTBEAT, PART_ID, PRESS_STROKE."""
    return [token, 0, token & 0xFF, part >> 16, part & 0xFFFF, stroke >> 16, stroke & 0xFFFF]


def identity(plc):
    words = plc.read(900, 40)
    expect(long(words, 0) == 0x46524E47, "the identity block starts with FRNG")
    expect(long(words, 36) == 0x12345678, "the test pattern is 0x12345678, high word first")
    value = struct.unpack(">f", struct.pack(">HH", *words[38:40]))[0]
    expect(value == struct.unpack(">f", struct.pack(">f", 123.456))[0], "the test pattern is 123.456")
    expect(plc.status().map_version == 0x0100, "the map has version 1.0")
    same = plc.answer(plc.client.read_input_registers(900, count=40)).registers
    expect(same == words, "FC4 reads what FC3 reads")
    expect(plc.read(0, 1) == [ONLINE], "CONTROL starts as ONLINE")


def edge(plc, cycle):
    before = plc.wait("READY", lambda s: s.has(READY))
    part, stroke = 0x10000 + cycle, 0x20000 + cycle
    # The first write of a connection only sets the level that edges are counted from.
    plc.write(0, [ONLINE])
    fields = trigger_fields(0, part, stroke)
    after = plc.write_and_read_status(0, [ONLINE | TRIGGER, *fields])
    expect(after.has(BUSY | TRIGGER_ACK), "the snapshot after the write is BUSY with TRIGGER_ACK")
    expect(not after.bits & (READY | EXPOSURE_DONE | RESULT_VALID), "READY, EXPOSURE_DONE and RESULT_VALID fell")
    expect(after.triggers == before.triggers + 1, "the trigger was counted")
    # TRIGGER may stay at 1 and be written again: that is no edge.
    plc.write(0, [ONLINE | TRIGGER, *fields])
    plc.write(0, [ONLINE])
    plc.wait("EXPOSURE_DONE", lambda s: s.has(EXPOSURE_DONE))
    done = plc.wait("a new RESULT_SEQ", lambda s: s.seq != before.seq)
    expect(done.seq == before.seq + 1, "RESULT_SEQ counts by one")
    expect((done.bits ^ before.bits) & RESULT_TOGGLE, "RESULT_TOGGLE inverted")
    expect(done.has(READY | RESULT_VALID) and not done.bits & (BUSY | PROCESSING | TRIGGER_ACK), "READY, RESULT_VALID")
    expect((done.triggers, done.missed) == (before.triggers + 1, before.missed), "one trigger, none missed")
    words = plc.result(done)
    expect(words[2] == 0, "a trigger by edge has TOKEN 0")
    expect((long(words, 6), long(words, 28)) == (part, stroke), "PART_ID and PRESS_STROKE are those of the trigger")
    plc.write(0, [ONLINE | RESULT_ACK])
    acknowledged = plc.status()
    expect(not acknowledged.bits & RESULT_VALID, "RESULT_ACK takes RESULT_VALID away")
    expect(plc.read(200, 120) == words, "an acknowledged result can still be read")
    plc.write(0, [ONLINE])


def token(plc, cycle):
    before = plc.wait("READY", lambda s: s.has(READY))
    number, part, stroke = 1000 + cycle, 0x30000 + cycle, 0x40000 + cycle
    fields = trigger_fields(number, part, stroke)
    after = plc.write_and_read_status(1, fields)
    expect(after.has(BUSY) and not after.has(READY), "the snapshot after the write is BUSY")
    expect(after.last_token == number, "LAST_TOKEN echoes the token")
    # The answer was lost, the PLC writes again: while it measures and when it is done.
    plc.write(1, fields)
    until = time.monotonic() + PATIENCE_S
    while plc.read(200, 120)[2] != number:
        expect(time.monotonic() < until, f"a result with token {number} within {PATIENCE_S} s")
        time.sleep(0.005)
    plc.write(1, fields)
    done = plc.wait("READY", lambda s: s.has(READY))
    expect(done.seq == before.seq + 1, "a retried write measures once")
    expect((done.triggers, done.missed) == (before.triggers + 1, before.missed), "one trigger, none missed")
    expect((done.bits ^ before.bits) & RESULT_TOGGLE, "RESULT_TOGGLE inverted")
    words = plc.result(done)
    expect(words[2] == number, "TOKEN is the one written")
    expect((long(words, 6), long(words, 28)) == (part, stroke), "PART_ID and PRESS_STROKE are those of the trigger")


def missed(plc):
    """What is not ready is told in registers, never by an exception."""
    before = plc.wait("READY", lambda s: s.has(READY))
    offline = plc.write_and_read_status(0, [0, *trigger_fields(5001, 1, 1)])
    expect(offline.missed == before.missed + 1, "a trigger while offline is counted as missed")
    expect(offline.has(MISSED_TRIGGER) and offline.reject_reason == 2, "REJECT_REASON says offline")
    expect(offline.last_token == before.last_token, "a rejected token is not the last accepted one")
    expect(plc.write_and_read_status(0, [ONLINE]).has(READY), "ONLINE makes it ready again")
    both = plc.write_and_read_status(0, [ONLINE | TRIGGER | RECIPE_LOAD, 0, 1])
    expect(both.missed == before.missed + 2, "a trigger in the write that loads a recipe is missed")
    expect(both.reject_reason == 1, "REJECT_REASON says not ready")
    plc.write(0, [ONLINE, 0, 0])
    after = plc.wait("READY", lambda s: s.has(READY))
    expect((after.triggers, after.seq) == (before.triggers, before.seq), "nothing was measured")


def exceptions(plc):
    def refused(response, code, what):
        expect(response.isError() and getattr(response, "exception_code", 0) == code,
               f"{what} gives exception {code} ({response})")

    before = plc.status()
    read, write = plc.client.read_holding_registers, plc.client.write_registers
    refused(read(40, count=1), 2, "an address outside every block")
    refused(read(100, count=33), 2, "a range that crosses a block's end")
    refused(write(200, [1]), 2, "a write to a read-only register")
    refused(write(0, [ONLINE | 1 << 8]), 3, "a reserved bit")
    refused(write(1, [6001, 10_000]), 3, "a recipe number out of range")
    after = plc.status()
    expect((after.triggers, after.last_token) == (before.triggers, before.last_token),
           "a refused write changes nothing")


@contextlib.contextmanager
def daemon(program):
    with tempfile.TemporaryDirectory() as folder:
        log = Path(folder, "log")
        with log.open("wb") as errors:
            running = subprocess.Popen(
                [program, "serve", "--state", str(Path(folder, "state")),
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


def main():
    program, cycles = sys.argv[1], int(sys.argv[2]) if len(sys.argv) > 2 else 5
    try:
        with daemon(program) as port:
            plc = Plc(port)
            identity(plc)
            for cycle in range(cycles):
                edge(plc, cycle)
                token(plc, cycle)
            missed(plc)
            exceptions(plc)
            plc.client.close()
    except Broken as promise:
        sys.exit(f"broken promise: {promise}")
    print(f"pymodbus: {cycles} cycles by edge and {cycles} by token, each write retried and measured once")


if __name__ == "__main__":
    main()
