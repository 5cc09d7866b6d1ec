#!/usr/bin/env python3
"""Both handshakes of the register map with pymodbus and the daemon: each in detail, then a campaign with communication faults.

    python3 tests/clients/handshakes.py target/release/fringed [CYCLES]

Exits with a code other than 0 at the first broken promise. Needs only pymodbus 3.16.
"""

import struct
import sys
import time

from campaign import Campaign
from plc import (BUSY, EXPOSURE_DONE, MISSED_TRIGGER, ONLINE, PATIENCE_S, PROCESSING, READY, RECIPE, RECIPE_LOAD,
                 RECIPE_OK, RESULT_ACK, RESULT_TOGGLE, RESULT_VALID, TRIGGER, TRIGGER_ACK, Broken, Plc, check_result,
                 daemon, expect, long, trigger_fields)

# Cycles of each handshake that are checked in detail.
STEPS = 3
SEED = 20261121
# Slots of gauges, and what an empty one reads as: value, steps, sigma, U.
SLOTS = 64
EMPTY = (0x7FC00000, 0x80000000, 0x7FC00000, 0x7FC00000)


def result(plc, status):
    """The RESULT block in one read, checked against the status that announced it."""
    words = plc.read(200, 120)
    check_result(words)
    expect(long(words, 0) == status.seq, "SEQ of the result is RESULT_SEQ")
    return words


def identity(plc):
    words = plc.read(900, 40)
    expect(long(words, 0) == 0x46524E47, "the identity block starts with FRNG")
    expect(long(words, 36) == 0x12345678, "the test pattern is 0x12345678, high word first")
    value = struct.unpack(">f", struct.pack(">HH", *words[38:40]))[0]
    expect(value == struct.unpack(">f", struct.pack(">f", 123.456))[0], "the test pattern is 123.456")
    expect(plc.status().map_version == 0x0104, "the map has version 1.4")
    same = plc.answer(plc.client.read_input_registers(900, count=40)).registers
    expect(same == words, "FC4 reads what FC3 reads")
    expect(plc.read(0, 1) == [ONLINE], "CONTROL starts as ONLINE")


def edge(plc, cycle):
    before = plc.wait("READY", lambda s: s.has(READY))
    part, stroke = 0x10000 + cycle, 0x20000 + cycle
    # The first write of a connection only sets the initial level.
    plc.write(0, [ONLINE])
    fields = trigger_fields(0, part, stroke)
    after = plc.write_and_read_status(0, [ONLINE | TRIGGER, *fields])
    expect(after.has(BUSY | TRIGGER_ACK), "the snapshot after the write is BUSY with TRIGGER_ACK")
    expect(not after.bits & (READY | EXPOSURE_DONE | RESULT_VALID), "READY, EXPOSURE_DONE and RESULT_VALID fell")
    expect(after.triggers == before.triggers + 1, "the trigger was counted")
    # Writing TRIGGER = 1 again while it is 1 is not an edge.
    plc.write(0, [ONLINE | TRIGGER, *fields])
    plc.write(0, [ONLINE])
    plc.wait("EXPOSURE_DONE", lambda s: s.has(EXPOSURE_DONE))
    done = plc.wait("a new RESULT_SEQ", lambda s: s.seq != before.seq)
    expect(done.seq == before.seq + 1, "RESULT_SEQ counts by one")
    expect((done.bits ^ before.bits) & RESULT_TOGGLE, "RESULT_TOGGLE inverted")
    expect(done.has(READY | RESULT_VALID) and not done.bits & (BUSY | PROCESSING | TRIGGER_ACK), "READY, RESULT_VALID")
    expect((done.triggers, done.missed) == (before.triggers + 1, before.missed), "one trigger, none missed")
    words = result(plc, done)
    detail = plc.read(520, 64)
    expect(long(detail, 0) == long(detail, 62) == done.seq, "GAUGE_DETAIL is of the same result")
    expect(words[2] == 0, "a trigger by edge has TOKEN 0")
    expect((long(words, 6), long(words, 28)) == (part, stroke), "PART_ID and PRESS_STROKE are those of the trigger")
    plc.write(0, [ONLINE | RESULT_ACK])
    acknowledged = plc.status()
    expect(not acknowledged.bits & RESULT_VALID, "RESULT_ACK takes RESULT_VALID away")
    expect(plc.read(200, 120) == words, "an acknowledged result can still be read")
    plc.write(0, [ONLINE])


def in_parts(plc, first, count, parts):
    """A block of more than 125 registers; both of its numbers are equal unless a result came in between."""
    size = -(-count // parts)
    words = [word for at in range(0, count, size) for word in plc.read(first + at, min(size, count - at))]
    expect(long(words, 0) == long(words, count - 2), f"the parts from {first} on are of one result")
    return words


def slots(plc):
    """All 64 slots of the last result: decisions in one read, values in two parts, names in nine."""
    result, gauges = plc.read(200, 120), plc.read(1100, 84)
    expect(long(gauges, 0) == long(gauges, 82) == long(result, 0), "GAUGES is of the same result")
    last = gauges[3]
    expect(gauges[2] == result[8] and gauges[80] == result[2], "VERDICT and TOKEN are those of RESULT")
    expect(gauges[16:32] == result[96:112], "slots 1 to 16 have the decisions that RESULT has")
    blocks = {first: in_parts(plc, first, 132, 2) for first in (1200, 1400, 1600, 1800)}
    names = in_parts(plc, 4000, 1028, 9)
    for slot in range(1, SLOTS + 1):
        place, bit = divmod(slot - 1, 16)
        passed, valid, failed = (gauges[first + place] >> bit & 1 for first in (4, 8, 12))
        decision = gauges[15 + slot]
        expect(passed == decision & 1 and valid == decision >> 1 & 1, f"PASS and VALID of slot {slot}")
        expect(failed == (decision & 0b101100 != 0), f"FAILED of slot {slot}")
        name = struct.pack(">16H", *names[16 * slot - 14:16 * slot + 2]).rstrip(b"\0")
        value, steps, sigma, u = (long(words, 2 * slot) for words in blocks.values())
        expect(steps != 0x80000000 if valid else (value, steps, sigma, u) == EMPTY, f"values of slot {slot}")
        expect(bool(name) if slot == last else slot < last or not (name or decision), f"the name of slot {slot}")
        if slot <= 16:
            expect(value == long(result, 62 + 2 * slot), f"slot {slot} has the value that RESULT has")


def token(plc, cycle):
    before = plc.wait("READY", lambda s: s.has(READY))
    number, part, stroke = 1000 + cycle, 0x30000 + cycle, 0x40000 + cycle
    fields = trigger_fields(number, part, stroke)
    after = plc.write_and_read_status(1, fields)
    expect(after.has(BUSY) and not after.has(READY), "the snapshot after the write is BUSY")
    expect(after.last_token == number, "LAST_TOKEN echoes the token")
    # As after a lost answer, the PLC writes again: during the measurement and after it.
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
    words = result(plc, done)
    expect(words[2] == number, "TOKEN is the one written")
    expect((long(words, 6), long(words, 28)) == (part, stroke), "PART_ID and PRESS_STROKE are those of the trigger")


def missed(plc):
    """A station that is not ready says so in registers, never by an exception."""
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


def other_recipe(plc):
    """No part is measured with a recipe that was not asked for."""
    before = plc.wait("READY", lambda s: s.has(READY))

    def rejected(status, triggers, how):
        expect(not status.has(READY), f"READY is 0 {how}")
        expect((status.missed, status.reject_reason) == (before.missed + triggers, 6), f"reason 6 {how}")
        expect((status.triggers, status.seq, status.last_token) == (before.triggers, before.seq, before.last_token),
               f"nothing was measured {how}")

    plc.write(0, [ONLINE])
    rejected(plc.write_and_read_status(1, trigger_fields(5101, 1, 1, recipe=77)), 1, "by token")
    edge_write = [ONLINE | TRIGGER, *trigger_fields(0, 1, 1, recipe=77)]
    rejected(plc.write_and_read_status(0, edge_write), 2, "by edge")
    failed = plc.load_recipe(77)
    expect((failed.recipe_result, failed.active_recipe) == (1, RECIPE), "the load failed, the recipe before is active")
    expect(not failed.bits & (READY | RECIPE_OK), "a failed load takes READY and RECIPE_OK away")
    # Neither RECIPE_SELECT 0 nor selecting the active recipe is a load.
    for at, select in enumerate([0, RECIPE]):
        fields = trigger_fields(5102 + at, 1, 1, recipe=select)
        rejected(plc.write_and_read_status(1, fields), 3 + at, f"after a failed load, with RECIPE_SELECT {select}")
    back = plc.load_recipe(RECIPE)
    expect(back.has(READY | RECIPE_OK) and back.recipe_result == 0, "loading the active recipe makes it ready again")


def exceptions(plc):
    def refused(response, code, what):
        expect(response.isError() and getattr(response, "exception_code", 0) == code,
               f"{what} gives exception {code} ({response})")

    before = plc.status()
    read, write = plc.client.read_holding_registers, plc.client.write_registers
    refused(read(40, count=1), 2, "an address outside every block")
    refused(read(100, count=33), 2, "a range that crosses a block's end")
    refused(write(200, [1]), 2, "a write to a read-only register")
    refused(write(0, [ONLINE | 1 << 9]), 3, "a reserved bit")
    refused(write(1, [6001, 10_000]), 3, "a recipe number out of range")
    after = plc.status()
    expect((after.triggers, after.last_token) == (before.triggers, before.last_token),
           "a refused write changes nothing")


def main():
    program, cycles = sys.argv[1], int(sys.argv[2]) if len(sys.argv) > 2 else 20
    began = time.monotonic()
    try:
        with daemon(program) as port:
            plc = Plc(port)
            identity(plc)
            for cycle in range(STEPS):
                edge(plc, cycle)
                token(plc, cycle)
                slots(plc)
            missed(plc)
            other_recipe(plc)
            exceptions(plc)
            plc.disconnect()
            told = Campaign(port, SEED).run(cycles)
    except Broken as promise:
        sys.exit(f"broken promise: {promise}")
    print(f"pymodbus: {told} ({time.monotonic() - began:.0f} s)")


if __name__ == "__main__":
    main()
