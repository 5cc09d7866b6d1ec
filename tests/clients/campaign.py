"""Many cycles of a PLC with communication faults: repeated writes, lost answers, lost connections, results read in two halves.

The handshake is chosen at random. Every result is queued (BUFFERED) and taken from OLDEST; meanwhile a second client reads
RESULT in two halves with pauses between them. A result whose SEQ is the same at both ends must be one that was measured.
"""

import random
import threading
import time

from plc import (BUFFER_OVERFLOW, BUFFERED, ONLINE, PATIENCE_S, READY, RESULT_ACK, TRIGGER, Plc, check_result, expect, long,
                 trigger_fields)

LEVEL = ONLINE | BUFFERED
RETRIED_WRITE = 10
LOST_ANSWERS = 0.05
DISCONNECTS = 0.05
TORN_CYCLES = 0.2


def halves(plc, block, pause=lambda: None):
    """A block of 120 registers in two reads; None if SEQ shows that the halves are of different results."""
    first = plc.read(block, 60)
    pause()
    words = first + plc.read(block + 60, 60)
    return words if long(words, 0) == long(words, 118) else None


class Onlooker(threading.Thread):
    """Reads RESULT in two halves continuously, and keeps the results whose SEQ is the same at both ends."""

    def __init__(self, port, seed):
        super().__init__(daemon=True)
        self.plc, self.luck = Plc(port), random.Random(seed)
        self.accepted, self.reads, self.torn, self.failure = {}, 0, 0, None
        self.over = threading.Event()

    def run(self):
        try:
            while not self.over.is_set():
                words = halves(self.plc, 200, lambda: time.sleep(self.luck.uniform(0, 0.06)))
                self.reads += 1
                if words is None:
                    self.torn += 1
                else:
                    known = self.accepted.setdefault(long(words, 0), words)
                    expect(known == words, f"result {long(words, 0)} reads the same every time")
        except Exception as failure:  # Raised again in the main thread.
            self.failure = failure
        self.plc.disconnect()


class Campaign:
    def __init__(self, port, seed):
        self.port, self.luck = port, random.Random(seed)
        self.plc, self.other = Plc(port), Plc(port)
        self.writes = self.retried = self.lost_answers = self.disconnects = self.torn = 0
        self.by_edge = self.by_token = self.number = 0
        self.taken = []

    def write(self, address, values):
        """A write; every tenth is sent again as after a lost answer, half of these over another connection."""
        self.writes += 1
        self.plc.write(address, values)
        if self.writes % RETRIED_WRITE == 0:
            self.retried += 1
            if self.luck.random() < 0.5:
                self.reconnect()
            self.plc.write(address, values)

    def reconnect(self):
        self.disconnects += 1
        self.plc.disconnect()
        self.plc.connect()

    def bad_luck(self):
        """Loses the connection now and then, with or without an incomplete request."""
        if self.luck.random() < DISCONNECTS:
            if self.luck.random() < 0.5:
                self.plc.send_and_disconnect(0, [LEVEL], share=self.luck.uniform(0.1, 0.9))
            self.reconnect()

    def token(self, plc=None):
        """Triggers by token; returns PART_ID."""
        self.number += 1
        self.by_token += 1
        token, part = self.number % 0xFFFF + 1, 0x30000 + self.number
        fields = trigger_fields(token, part, self.number)
        if plc is not None:
            plc.write(1, fields)
            return part
        if self.luck.random() < LOST_ANSWERS:
            self.lost_answers += 1
            self.plc.send_and_disconnect(1, fields)
            self.reconnect()
        self.write(1, fields)
        return part

    def edge(self):
        """Triggers by edge; returns PART_ID. After a lost answer TRIGGERS shows whether the trigger was counted."""
        self.number += 1
        self.by_edge += 1
        part = 0x10000 + self.number
        words = [LEVEL | TRIGGER, *trigger_fields(0, part, self.number)]
        # The first write of a connection only sets the initial level.
        self.write(0, [LEVEL])
        before = self.plc.status().triggers
        if self.luck.random() < LOST_ANSWERS:
            self.lost_answers += 1
            self.plc.send_and_disconnect(0, words)
            self.reconnect()
            until = time.monotonic() + 1.0
            while self.plc.status().triggers == before and time.monotonic() < until:
                time.sleep(0.01)
        if self.plc.status().triggers == before:
            self.plc.write(0, [LEVEL])
            self.write(0, words)
        self.write(0, [LEVEL])
        return part

    def wait_for(self, seq):
        """Waits for this result or a later one, and READY; returns the status."""
        return self.plc.wait(f"result {seq}", lambda s: (s.seq - seq) & 0xFFFFFFFF < 0x80000000 and s.has(READY))

    def take(self, seq, part):
        """Reads the oldest result in two halves and acknowledges it, repeatedly if necessary."""
        words = halves(self.plc, 400)
        expect(words is not None, "OLDEST stands still until it is acknowledged")
        check_result(words)
        expect(long(words, 0) == seq, f"the oldest result is {seq}, not {long(words, 0)}")
        expect(long(words, 6) == part, f"result {seq} is that of part {part:#x}, not {long(words, 6):#x}")
        expect(long(words, 28) == part & 0xFFFF, "PRESS_STROKE is that of the trigger")
        self.taken.append(words)
        until = time.monotonic() + PATIENCE_S
        while long(self.plc.read(400, 2), 0) == seq:
            expect(time.monotonic() < until, f"result {seq} can be acknowledged")
            self.plc.write(0, [LEVEL])
            self.write(0, [LEVEL | RESULT_ACK])
            self.write(0, [LEVEL])

    def tear(self, seq):
        """Another client measures between the two halves of a read: the two SEQ must differ."""
        first = self.plc.read(200, 60)
        part = self.token(self.other)
        self.wait_for(seq + 1)
        second = self.plc.read(260, 60)
        expect((long(first, 0), long(second, 58)) == (seq, seq + 1), "a torn read is known by SEQ at its two ends")
        self.torn += 1
        return part

    def run(self, cycles):
        before = self.plc.wait("READY", lambda s: s.has(READY))
        onlooker = Onlooker(self.port, self.luck.random())
        onlooker.start()
        self.plc.write(0, [LEVEL])
        while self.number < cycles:
            self.bad_luck()
            self.plc.wait("READY", lambda s: s.has(READY))
            seq = before.seq + self.number + 1
            parts = [self.edge() if self.luck.random() < 0.5 else self.token()]
            self.bad_luck()
            self.wait_for(seq)
            if self.number < cycles and self.luck.random() < TORN_CYCLES:
                parts.append(self.tear(seq))
            self.bad_luck()
            for at, part in enumerate(parts):
                self.take(seq + at, part)
        onlooker.over.set()
        onlooker.join(PATIENCE_S)
        self.check(before, onlooker)
        self.plc.write(0, [ONLINE])
        for client in (self.plc, self.other):
            client.disconnect()
        return (f"{cycles} cycles, {self.by_edge} by edge and {self.by_token} by token; {self.writes} writes, {self.retried} "
                f"of them sent twice, {self.lost_answers} answers lost, {self.disconnects} disconnects; "
                f"{self.torn} results torn on purpose and {onlooker.torn} by chance of {onlooker.reads} "
                f"read in halves: 0 double measurements, 0 torn results accepted, 0 lost, SEQ gapless")

    def check(self, before, onlooker):
        if onlooker.failure:
            raise onlooker.failure
        after, cycles = self.plc.status(), self.number
        sequence = [long(words, 0) for words in self.taken]
        expect(sequence == list(range(before.seq + 1, before.seq + cycles + 1)), "SEQ is gapless and none is lost")
        expect(after.triggers - before.triggers == cycles, f"{cycles} cycles were {after.triggers - before.triggers} triggers")
        expect(after.seq - before.seq == cycles, f"{cycles} cycles gave {after.seq - before.seq} results")
        expect(after.missed == before.missed, f"{after.missed - before.missed} triggers were missed")
        expect(after.buffered == 0 and not after.has(BUFFER_OVERFLOW), "no result is left over, none found the queue full")
        expect(len({long(words, 6) for words in self.taken}) == cycles, "every part was measured once")
        measured = {long(words, 0): words for words in self.taken}
        for seq, words in onlooker.accepted.items():
            expect(seq <= before.seq or measured[seq] == words, f"what passed as result {seq} is what was measured")
