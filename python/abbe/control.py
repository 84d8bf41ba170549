"""The control socket of abbed: one JSON object a line."""

import json
import socket
import time
from collections.abc import Iterator
from typing import Any

from abbe.errors import Error

_LONGEST_ANSWER = 64 << 20


class Control:
    """Sends requests to a running abbed. One connection for each request; any thread.

    What a user may request depends on the groups abbe, abbe-change and abbe-move, as for the command
    line. abbed records the user, and `who` beside it.
    """

    def __init__(self, path: str = "/run/abbe/control.sock", timeout_s: float = 5.0, who: str = "python"):
        self._path = path
        self._timeout_s = timeout_s
        self._who = who

    def ask(self, request: dict[str, Any]) -> dict[str, Any]:
        """The answer to a request, {"do": NAME, ...}. Raises Error with abbed's code and message."""
        answer = self._exchange(request)
        if answer.get("ok") is True:
            return answer
        raise Error(answer.get("code", "refused"), answer.get("error", "abbed gave no reason"),
                    answer.get("details", []))

    def status(self) -> dict[str, Any]:
        """Axes, streams, model, session and devices, as `abbe status --json`."""
        return self.ask({"do": "status"})

    def calibrate_otf(self, path_m: list[list[float]], mode: str | None = None) -> dict[str, Any]:
        """Begins a calibration on the fly along a path of scale readings, m."""
        request: dict[str, Any] = {"do": "calibrate", "method": "otf", "who": self._who,
                                   "path_m": [[float(x) for x in vertex] for vertex in path_m]}
        if mode is not None:
            request["mode"] = mode
        return self.ask(request)

    def cancel(self) -> dict[str, Any]:
        """Cancels the running calibration."""
        return self.ask({"do": "cancel", "who": self._who})

    def activate(self, model_id: str, why: str = "", force: bool = False) -> str:
        """Makes a model active and returns its id. force: although the gate refused it; needs why."""
        return self._change({"do": "activate", "id": model_id, "why": why, "force": force})

    def roll_back(self, active: str, why: str = "") -> str:
        """Makes the model active that was active before `active`, and returns its id.

        Refused if another model is active, so that a repeated call does not go one model further back.
        """
        return self._change({"do": "rollback", "active": active, "why": why})

    def follow(self, period_s: float = 0.2) -> Iterator[dict[str, Any]]:
        """The status of the session whenever it changes, until the session has ended."""
        last = None
        while True:
            session = self.status()["session"]
            if session != last:
                yield session
                last = session
            if session["state"] in ("idle", "active", "refused"):
                return
            time.sleep(period_s)

    def _change(self, request: dict[str, Any]) -> str:
        answer = self.ask({**request, "who": self._who})
        while "id" not in answer:
            time.sleep(0.1)
            answer = self.ask({"do": "change", "number": answer["change"]})
        return answer["id"]

    def _exchange(self, request: dict[str, Any]) -> dict[str, Any]:
        line = json.dumps(request, allow_nan=False).encode() + b"\n"
        try:
            with socket.socket(socket.AF_UNIX, socket.SOCK_STREAM) as connection:
                connection.settimeout(self._timeout_s)
                connection.connect(self._path)
                connection.sendall(line)
                received = bytearray()
                while not received.endswith(b"\n"):
                    part = connection.recv(1 << 16)
                    if not part or len(received) > _LONGEST_ANSWER:
                        break
                    received += part
        except OSError as fault:
            raise Error("io", f"connect {self._path}: {fault} (is abbed running?)") from fault
        try:
            return json.loads(received)
        except ValueError as fault:
            raise Error("io", f"{self._path}: the answer is not JSON: {fault}") from fault
