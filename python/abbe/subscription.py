"""What abbe publishes over DDS, and whether it may be applied.

abbe-watch, a process of its own, is the DDS participant: a packet from the network that stops it does
not stop this program, and the rule for subscribers is written once.
"""

import json
import os
import selectors
import subprocess
import time
from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any

from abbe.errors import Error

_KEPT_MESSAGES = 4096  # bytes of the standard error of abbe-watch


@dataclass(frozen=True)
class Decision:
    """Whether a vector may be applied, by the rule of abbe_v1.idl.

    A decision to apply ends by itself at valid_until_ns: test may_be_applied() when you apply it.
    Times are those of time.monotonic_ns().
    """

    compensation: dict[str, Any]  # fields of abbe/v1/Compensation
    apply: bool
    reason: str  # why not
    made_ns: int
    valid_until_ns: int  # made_ns if not to be applied

    def may_be_applied(self, now_ns: int | None = None) -> bool:
        return self.apply and (time.monotonic_ns() if now_ns is None else now_ns) < self.valid_until_ns


class Subscription:
    """Iterates over the samples of all topics as dicts; a context manager. One thread.

    machine_id: the identity of `machine`, as `abbe machine identity` prints it. Without it the first
    one that publishes under the name is used, and no other one while this object exists.
    """

    def __init__(self, machine: str | None = None, domain: int = 0, *, config: str | None = None,
                 profile: str | None = None, keys: str | None = None, timeout_s: float | None = None,
                 machine_id: str | None = None,
                 program: str = "abbe-watch"):
        command = [program, "--json"]
        command += ["--config", config] if config is not None else ["--domain", str(domain)]
        for name, value in (("--machine", machine), ("--machine-id", machine_id), ("--profile", profile), ("--security", keys),
                            ("--timeout-s", timeout_s)):
            if value is not None:
                command += [name, str(value)]
        try:
            self._process = subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.PIPE)
        except OSError as fault:
            raise Error("io", f"start {program}: {fault}") from fault
        self._selector = selectors.DefaultSelector()
        for pipe in (self._process.stdout, self._process.stderr):
            assert pipe is not None
            self._selector.register(pipe, selectors.EVENT_READ)
        self._lines: list[bytes] = []  # complete lines, the newest first
        self._rest = self._messages = b""

    def __iter__(self) -> Iterator[dict[str, Any]]:
        while (line := self._next_line(None)) is not None:
            yield json.loads(line)
        self._check_end()

    def decisions(self) -> Iterator[Decision]:
        """Every vector of the topic abbe/v1/Compensation with the decision on it, and "do not apply"
        for one that was to be applied when that ends: its validity is over, the publisher or abbe-watch
        has ended or hangs, the model is not active any more."""
        vectors: dict[str, dict[str, Any]] = {}  # by machine
        applied: dict[str, Decision] = {}
        while True:
            first = min((decision.valid_until_ns for decision in applied.values()), default=None)
            line = self._next_line(first)
            if line is None:
                yield from _withdrawn(applied, "abbe-watch has ended", all_of_them=True)
                break
            if not line:
                yield from _withdrawn(applied, "older than its validity: nothing newer was received")
                continue
            sample = json.loads(line)
            if "vector_m" in sample:
                vectors[sample["machine"]] = sample
            elif "decision" in sample and sample["machine"] in vectors:
                machine = sample["machine"]
                decision = _decision(vectors[machine], sample["decision"])
                applied.pop(machine, None)
                if decision.apply:
                    applied[machine] = decision
                yield decision
        self._check_end()

    def close(self) -> None:
        self._process.terminate()
        self._process.wait()
        self._selector.close()
        for pipe in (self._process.stdout, self._process.stderr):
            if pipe is not None:
                pipe.close()

    def __enter__(self) -> "Subscription":
        return self

    def __exit__(self, *unused: object) -> None:
        self.close()

    def _next_line(self, deadline_ns: int | None) -> bytes | None:
        """The next line; empty: the deadline has passed; None: abbe-watch has ended."""
        while not self._lines:
            left_s = None if deadline_ns is None else (deadline_ns - time.monotonic_ns()) * 1e-9
            if left_s is not None and left_s <= 0.0:
                return b""
            for key, _ in self._selector.select(left_s):
                if not self._read(key.fileobj):
                    return None
        return self._lines.pop()

    def _read(self, pipe: Any) -> bool:
        """False: the standard output has ended. The standard error is read, too: abbe-watch must not
        wait until somebody reads it."""
        received = os.read(pipe.fileno(), 65536)
        if pipe is self._process.stderr:
            self._messages = (self._messages + received)[-_KEPT_MESSAGES:]
            if not received:
                self._selector.unregister(pipe)
            return True
        *lines, self._rest = (self._rest + received).split(b"\n")
        self._lines = lines[::-1]
        return bool(received)

    def _check_end(self) -> None:
        code = self._process.wait()
        # 1: the time is over.
        if code in (0, 1, -15):
            return
        while self._process.stderr in [key.fileobj for key, _ in self._selector.select(0)]:
            self._read(self._process.stderr)
        raise Error("io", f"abbe-watch ended with code {code}: {self._messages.decode(errors='replace').strip()}")


def _decision(vector: dict[str, Any], decision: dict[str, Any]) -> Decision:
    """A line may have waited while this program did something else."""
    made_ns = decision["monotonic_ns"]
    valid_until_ns = made_ns + decision["valid_for_ns"]
    if decision["apply"] and valid_until_ns <= (now_ns := time.monotonic_ns()):
        return Decision(vector, False, "older than its validity when it was read", now_ns, now_ns)
    return Decision(vector, decision["apply"], decision["reason"], made_ns, valid_until_ns)


def _withdrawn(applied: dict[str, Decision], reason: str, all_of_them: bool = False) -> Iterator[Decision]:
    """Withdraws the decisions whose validity is over, or all of them."""
    now_ns = time.monotonic_ns()
    for machine, decision in list(applied.items()):
        if all_of_them or not decision.may_be_applied(now_ns):
            del applied[machine]
            yield Decision(decision.compensation, False, reason, now_ns, now_ns)
