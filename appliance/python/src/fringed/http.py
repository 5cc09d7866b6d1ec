"""Requests to a device and their answers, as they arrive; signs in for changes; turns failures into errors."""

from __future__ import annotations

import json
import os
from contextlib import suppress
from http.client import HTTPConnection, HTTPException, HTTPResponse, HTTPSConnection
from pathlib import Path
from typing import Any, BinaryIO, ContextManager, Iterator, Mapping
from urllib.parse import urlsplit

from .errors import OF_STATUS, FringedError, Refused, TooOld, Unreachable

KINDS = {"http": HTTPConnection, "https": HTTPSConnection}
BLOCK = 64 << 10
# Longest wait for an answer that the device first has to compute: maps from frames, the plan of a recipe, s.
COMPUTING = 120.0
# The words of a device that does not know a path.
UNKNOWN_PATH = "there is no such page; start at /"
# Answers that a gateway in front of a device may give in its place.
GATEWAY = (502, 503, 504)


class Device:
    """A device at an address. Each request has its own connection, so threads may share it."""

    def __init__(self, url: str, secret: str | None, timeout: float, user: str | None = None) -> None:
        parts = urlsplit(url)
        if parts.scheme not in KINDS or not parts.hostname or "@" in parts.netloc:
            raise ValueError(f"{url!r} is not the address of a head: write it like http://10.20.1.11")
        self._host, self._port, self._kind = parts.hostname, parts.port, KINDS[parts.scheme]
        # Origin and Host must name the same place, or the device refuses changes.
        self._url, self._place = f"{parts.scheme}://{parts.netloc}", parts.netloc
        self._secret, self._user, self._cookie, self.timeout = secret, user, "", timeout

    def ask(self, method: str, path: str, body: Any = None, wait: float | None = None) -> Answer:
        """Sends a request, with `body` as JSON or as an open file. Signs in if it is a change and the session has
        not begun or has ended. `wait`: longest wait for the next bytes of the answer, s."""
        changes = method != "GET"
        if changes and not self._cookie:
            self._sign_in()
        answer = self._send(method, path, body, wait)
        if changes and answer.response.status == 401:
            with answer:
                self._sign_in()
            answer = self._send(method, path, body, wait)
        return answer.checked()

    def json(self, method: str, path: str, body: Any = None, wait: float | None = None) -> dict[str, Any]:
        """The JSON of an answer."""
        with self.ask(method, path, body, wait) as answer:
            return answer.object(answer.body())

    def save(self, path: str, to: str | os.PathLike[str]) -> None:
        """Writes the body of an answer to a file, which is either whole or not there."""
        part = Path(f"{os.fspath(to)}.part")
        with self.ask("GET", path, wait=COMPUTING) as answer:
            try:
                with open(part, "wb") as file:
                    for block in answer.blocks():
                        file.write(block)
                os.replace(part, to)
            except BaseException:
                part.unlink(missing_ok=True)
                raise

    def _sign_in(self) -> None:
        if self._secret is None:
            raise Refused("a change needs the secret of the device")
        who = {"secret": self._secret} if self._user is None else {"user": self._user, "secret": self._secret}
        with self._send("POST", "/api/session", who, None).checked() as answer:
            answer.object(answer.body())  # Else the cookie may not be whole.
            self._cookie = (answer.response.getheader("Set-Cookie") or "").partition(";")[0]

    def _send(self, method: str, path: str, body: Any, wait: float | None) -> Answer:
        headers = {"Host": self._place, "Connection": "close", "Origin": self._url, "Cookie": self._cookie}
        sent: bytes | BinaryIO | None = None
        if isinstance(body, Mapping):
            sent, headers["Content-Type"] = json.dumps(body).encode(), "application/json"
        elif body is not None:
            body.seek(0)
            sent, headers["Content-Type"] = body, "application/zip"
            headers["Content-Length"] = str(os.fstat(body.fileno()).st_size)
        wait = wait or self.timeout
        connection = self._kind(self._host, self._port, timeout=min(wait, self.timeout))
        what = f"{method} {self._url}{path}"
        try:
            connection.connect()
            connection.sock.settimeout(wait)
            connection.request(method, path, sent, headers)
            return Answer(connection, connection.getresponse(), what, path)
        except (OSError, HTTPException) as error:
            connection.close()
            raise Unreachable(f"{what}: {error or type(error).__name__}") from error


class Answer(ContextManager["Answer"]):
    """An answer whose body is read as it arrives. Close it, or use it in a `with` statement."""

    def __init__(self, connection: HTTPConnection, response: HTTPResponse, what: str, path: str) -> None:
        self._connection, self.response, self._what = connection, response, what
        self._name = path.partition("?")[0].rpartition("/")[2]

    def __exit__(self, *error: object) -> None:
        self.response.close()
        self._connection.close()

    def blocks(self) -> Iterator[bytes]:
        """The bytes of the body, block by block."""
        left = self.response.length
        if left is None and not self.response.chunked:
            # http.client takes a header that breaks off for a whole one.
            raise Unreachable(f"{self._what}: the answer broke off within its header")
        while left is None or left > 0:
            try:
                block = self.response.read1(BLOCK if left is None else min(BLOCK, left))
            except (OSError, HTTPException) as error:
                raise Unreachable(f"{self._what}: the answer broke off: {error or 'timed out'}") from error
            if not block and left is None:
                return
            if not block:
                raise Unreachable(f"{self._what}: the answer broke off {left} bytes before its end")
            left = None if left is None else left - len(block)
            yield block

    def lines(self) -> Iterator[bytes]:
        """The lines of the body."""
        rest = b""
        for block in self.blocks():
            *whole, rest = (rest + block).split(b"\n")
            yield from whole
        if rest:
            raise Unreachable(f"{self._what}: the answer broke off within a line")

    def body(self) -> bytes:
        """All of the body."""
        return b"".join(self.blocks())

    def object(self, text: bytes) -> dict[str, Any]:
        """A JSON object of the body."""
        with suppress(ValueError):
            value = json.loads(text)
            if isinstance(value, dict):
                return value
        status, kind = self.response.status, self.response.getheader("Content-Type")
        raise FringedError(f"{self._what}: unexpected answer {status} ({kind})", status)

    def checked(self) -> Answer:
        """This answer, if the request succeeded."""
        status = self.response.status
        if 200 <= status < 300:
            return self
        with self:
            if status < 400:
                raise FringedError(f"{self._what}: redirected to {self.response.getheader('Location')}", status)
            text, words = self.body(), f"{self._what}: {status} {self.response.reason}"
            if status != 405 and (status not in GATEWAY or text.startswith(b"{")):
                words = str(self.object(text).get("error"))
            if status == 405 or words == UNKNOWN_PATH:
                raise TooOld(f"the firmware of this head has no {self._name}", status)
            later = self.response.getheader("Retry-After")
            raise OF_STATUS.get(status, FringedError)(words, status, f"try again in {later} s" if later else "")
