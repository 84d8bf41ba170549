"""The control socket of abbed: one JSON object a line."""

import json
import os
import socket
import time
from collections.abc import Callable, Iterator, Sequence
from typing import Any

from abbe import _abbe
from abbe.errors import Error

_LONGEST_ANSWER = 64 << 20
_POLL_PERIOD_S = 0.2
_STOP_PERIOD_S = 0.05
# A request reaches the machine's thread within some ms. Later a smaller number is that of a restarted abbed.
_STOP_RECEIVED_S = 2.0
# abbed connects again (3 s at most) and waits for the answer to AbortE (5 s at most).
_LONGEST_STOP_S = 10.0

File = str | os.PathLike[str]


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

    def calibrate_otf(self, path: File | Sequence[Sequence[float]], mode: str | None = None) -> dict[str, Any]:
        """Begins a calibration on the fly. path: file path.csv, or scale readings of the vertices, m.

        mode: "on-the-fly" or "standstill"; None: as in abbed.toml. Then the machine drives the path.
        """
        if isinstance(path, (str, os.PathLike)):
            task = json.loads(_abbe.otf_task(os.fspath(path)))
        else:
            task = {"method": "otf", "path_m": [[float(x) for x in vertex] for vertex in path]}
        return self._calibrate(task, mode=mode)

    def calibrate_evemu(self, calibrator: File, *, rotation_reference: File | None = None,
                        u_reference_m: float | None = None, points_per_ball: int | None = None,
                        points_per_block: int | None = None) -> dict[str, Any]:
        """Begins a calibration with the ball array of calibrator.toml.

        rotation_reference: file errors.csv of points where V is known independently, with the standard
        uncertainty u_reference_m, which it needs. "next" of the session is the next touch.
        """
        reference = None if rotation_reference is None else os.fspath(rotation_reference)
        return self._calibrate(json.loads(_abbe.evemu_task(os.fspath(calibrator), reference, u_reference_m)),
                               points_per_ball=points_per_ball, points_per_block=points_per_block)

    def calibrate_mfb(self, bar: File, plan: File) -> dict[str, Any]:
        """Begins a calibration with the Multi-Feature Bar of bar.toml, by the measurements of plan.toml.

        "next" of the session is the next touch.
        """
        return self._calibrate(json.loads(_abbe.mfb_task(os.fspath(bar), os.fspath(plan))))

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

    def follow(self, period_s: float = _POLL_PERIOD_S) -> Iterator[dict[str, Any]]:
        """The status of the session whenever it changes, until the session has ended."""
        return self._changes("session", lambda session: session["state"] in ("idle", "active", "refused"), period_s)

    def reference(self, period_s: float = _POLL_PERIOD_S) -> Iterator[dict[str, Any]]:
        """Searches for the reference marks while each axis is driven slowly over at least four of them.

        The result yields "reference" of the status whenever it changes, until the search has ended.
        Not to iterate does not end the search; cancel_reference() does.
        """
        self.ask({"do": "reference"})
        return self._changes("reference", lambda found: not found["running"], period_s)

    def reference_here(self, axes: Sequence[str] = (), u: float | None = None) -> None:
        """States that axes without marks read their offset at their present position.

        axes: none means all of them. u: standard uncertainty of the position, m (rotary axis: rad);
        None: 100e-6, set by eye. Refused while they move or a calibration takes readings.
        """
        request: dict[str, Any] = {"do": "reference", "here": True, "axes": list(axes)}
        if u is not None:
            request["u"] = u
        self.ask(request)

    def accept_sensor(self, name: str, why: str) -> None:
        """States that a sensor in doubt is right; it is used when its next two readings agree.

        why: the reason, which is recorded. Refused for a sensor that is in use or has no usable
        reading, and while a calibration takes readings.
        """
        self.ask({"do": "sensors", "accept": True, "sensor": name, "why": why})

    def cancel_reference(self) -> None:
        """Ends the search for the reference marks."""
        self.ask({"do": "reference", "cancel": True})

    def tracker(self) -> dict[str, Any]:
        """State of the tracker and its latest orders."""
        tracker = self.status().get("tracker")
        if tracker is None:
            raise Error("refused", "tracker: abbed has none that takes orders")
        return tracker

    def tracker_initialize(self) -> str:
        """Initializes the tracker, whose head moves; waits for the outcome and returns its text."""
        return self._order({"do": "tracker", "order": "initialize"})["text"]

    def tracker_home(self) -> str:
        """Sends the beam to the home position; waits for the outcome and returns its text."""
        return self._order({"do": "tracker", "order": "home"})["text"]

    def tracker_find(self, distance_m: float) -> str:
        """Searches for a reflector at about this distance; waits for the outcome and returns its text."""
        return self._order({"do": "tracker", "order": "find", "distance_m": distance_m})["text"]

    def tracker_use_reflector(self, reflector: str) -> str:
        """Sets the reflector, by name or id; waits for the outcome and returns its text."""
        return self._order({"do": "tracker", "order": "reflector set", "reflector": reflector})["text"]

    def tracker_reflectors(self) -> list[dict[str, Any]]:
        """The reflectors that the tracker knows: id, name, in_use."""
        return self._order({"do": "tracker_reflectors"}).get("reflectors", [])

    def machine(self) -> dict[str, Any]:
        """Of a measuring machine: release_awaited, reason; tip_m and tip_age_s once it reported the tip; stop."""
        return self.ask({"do": "machine"})

    def stop_machine(self) -> str:
        """Stops every motion that abbed has commanded, waits for the outcome and returns its text.

        The machine does not move before a release. Error "stop_not_confirmed" if AbortE was refused or
        not answered, "stop_not_sent" if there is no connection: the machine may then be moving.
        """
        number = self.ask({"do": "machine", "stop": True}).get("stop")
        if number is None:
            raise Error("stop_not_confirmed", "machine: abbed does not report whether it has stopped")
        stop = self._outcome_of_stop(number)
        if stop["outcome"] == "stopped":
            return stop["text"]
        code = "stop_not_sent" if stop["outcome"] == "not sent" else "stop_not_confirmed"
        raise Error(code, f"machine: stop {stop['outcome']}: {stop['text']}")

    def _outcome_of_stop(self, number: int) -> dict[str, Any]:
        asked = time.monotonic()
        while True:
            stop = self.machine().get("stop", {"number": 0, "outcome": "pending"})
            if stop["number"] >= number and stop["outcome"] != "pending":
                return stop
            waited_s = time.monotonic() - asked
            if stop["number"] < number and waited_s >= _STOP_RECEIVED_S:
                raise Error("stop_not_confirmed", "machine: abbed does not know the stop: it may have restarted")
            if waited_s >= _LONGEST_STOP_S:
                raise Error("stop_not_confirmed", f"machine: no outcome of the stop in {_LONGEST_STOP_S:g} s")
            time.sleep(_STOP_PERIOD_S)

    def release_machine(self) -> str:
        """States that a person has checked the machine, which may move from then on; returns what was released."""
        return self.ask({"do": "machine", "release": True})["released"]

    def verification_points(self, count: int, period_s: float = _POLL_PERIOD_S) -> Iterator[dict[str, Any]]:
        """Points for a verification: the machine stands still for some seconds at each, then moves on.

        The result yields reading_m, tracker_m, tracker_points and scatter_m of each; `abbe verify`
        evaluates such points. Error "refused" if another client begins a verification meanwhile, or if
        abbed stops it.
        """
        number = self.ask({"do": "verification", "step": "begin"})["number"]
        return self._points(number, count, period_s)

    def _points(self, number: int, count: int, period_s: float) -> Iterator[dict[str, Any]]:
        seen = 0
        while seen < count:
            answer = self.ask({"do": "verification", "step": "look", "number": number, "from": seen})
            for point in answer["points"][:count - seen]:
                seen += 1
                yield point
            if seen < count and answer.get("stopped"):
                raise Error("refused", f"verification: after {seen} points: {answer['stopped']}")
            if seen < count:
                time.sleep(period_s)
        self.ask({"do": "verification", "step": "end", "number": number, "from": seen})

    def _changes(self, member: str, has_ended: Callable[[dict[str, Any]], bool],
                 period_s: float) -> Iterator[dict[str, Any]]:
        """A member of the status whenever it changes, until it has ended."""
        last = None
        while True:
            now = self.status()[member]
            if now != last:
                yield now
                last = now
            if has_ended(now):
                return
            time.sleep(period_s)

    def _calibrate(self, task: dict[str, Any], **options: Any) -> dict[str, Any]:
        given = {name: value for name, value in options.items() if value is not None}
        return self.ask({**task, **given, "do": "calibrate", "who": self._who})

    def _order(self, request: dict[str, Any]) -> dict[str, Any]:
        """The order to the tracker once it has ended; Error if it was refused or failed."""
        number = self.ask({**request, "who": self._who})["order"]
        while True:
            order = next((o for o in self.tracker()["orders"] if o["number"] == number), None)
            if order is None:
                raise Error("io", f"tracker: the outcome of order {number} is lost: abbed keeps the latest ones only")
            if order["outcome"] == "done":
                return order
            if order["outcome"] != "running":
                code = "refused" if order["outcome"] == "refused" else "io"
                raise Error(code, f"tracker: {order['order']}: {order['text']}")
            time.sleep(_POLL_PERIOD_S)

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
