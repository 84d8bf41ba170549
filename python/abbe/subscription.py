"""What abbe publishes over DDS, and whether it may be applied.

abbe-watch, a process of its own, is the DDS participant: a packet from the network that stops it does
not stop this program, and the rule for subscribers is written once.
"""

import json
import subprocess
from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any

from abbe.errors import Error


@dataclass(frozen=True)
class Decision:
    """Whether a vector may be applied, by the rule of abbe_v1.idl."""

    compensation: dict[str, Any]  # fields of abbe/v1/Compensation
    apply: bool
    reason: str  # why not


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
                            ("--timeout", timeout_s)):
            if value is not None:
                command += [name, str(value)]
        try:
            self._process = subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.PIPE,
                                             text=True)
        except OSError as fault:
            raise Error("io", f"start {program}: {fault}") from fault

    def __iter__(self) -> Iterator[dict[str, Any]]:
        assert self._process.stdout is not None
        for line in self._process.stdout:
            yield json.loads(line)
        code = self._process.wait()
        # 1: the time is over.
        if code not in (0, 1, -15):
            raise Error("io", f"abbe-watch ended with code {code}: {self._process.stderr.read().strip()}")

    def decisions(self) -> Iterator[Decision]:
        """Every vector of the topic abbe/v1/Compensation with the decision on it."""
        vector = None
        for sample in self:
            if "vector_m" in sample:
                vector = sample
            elif "decision" in sample and vector is not None:
                yield Decision(vector, sample["decision"]["apply"], sample["decision"]["reason"])

    def close(self) -> None:
        self._process.terminate()
        self._process.wait()

    def __enter__(self) -> "Subscription":
        return self

    def __exit__(self, *unused: object) -> None:
        self.close()
