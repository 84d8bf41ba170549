"""Types of the extension module."""

from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

Columns = dict[str, NDArray[Any]]

class Model:
    """A model of abbe. V = actual - nominal at the scale reading; see "The sign of V" in calib/README.md."""
    @staticmethod
    def load(file: str) -> "Model": ...
    @property
    def id(self) -> str: ...
    @property
    def hash(self) -> str: ...
    @property
    def machine(self) -> str: ...
    @property
    def method(self) -> str: ...
    @property
    def simulated(self) -> bool | None:
        """True: the devices were those of abbe-sim. None: not known, a file of an earlier version."""
    @property
    def estimator(self) -> str: ...
    @property
    def created_utc_ns(self) -> int: ...
    @property
    def chain(self) -> str: ...
    @property
    def tool_offsets_m(self) -> NDArray[np.float64]: ...
    @property
    def validity_hull_m(self) -> NDArray[np.float64]: ...
    @property
    def parameters(self) -> Columns:
        """name (ISO 230-1), position_m of the node (NaN: squareness), value (m or rad), u (k = 1)."""
    @property
    def covariance(self) -> NDArray[np.float64]:
        """Of the parameters, in their order; m^2, m rad, rad^2."""
    def error_at(self, points_m: ArrayLike, tool_m: ArrayLike | None = None,
                 direction: Sequence[int] | None = None
                 ) -> tuple[NDArray[np.float64], NDArray[np.float64], NDArray[np.bool_]]:
        """(V (N, 3) in m, its covariance (N, 3, 3) in m^2, inside (N)) at N x 3 scale readings.

        inside: the reading is in the validity volume, and the model holds for the tool. direction:
        of the travel of X, Y, Z, -1, 0 (unknown) or 1 each; abbe.Error if the model has no backlash.
        Where it is unknown, V is the mean of both directions, and the covariance contains half the
        difference. It also contains the misfit of the model, which `covariance` does not.
        """
    @property
    def verdict(self) -> dict[str, Any] | None:
        """Of the gate: state ("accepted", "refused", "forced"), reasons, notes, forced_by, forced_why.

        None: not judged, as files of earlier versions of abbe.
        """
    @property
    def statements(self) -> list[str]:
        """What a user of the model must know, the verdict first: write them into files made of it."""
    def correction_at(self, points_m: ArrayLike, tool_m: ArrayLike | None = None,
                      direction: Sequence[int] | None = None, force: bool = False, why: str = ""
                      ) -> tuple[NDArray[np.float64], NDArray[np.bool_]]:
        """(c (N, 3) in m, inside (N)): to reach the nominal position p, command p + c.

        direction: as for error_at(), in which the axes reach p. abbe.Error with the code "refused" for
        a model that must not correct a machine, because the gate refused it; unless force, which needs
        a reason.
        """

class Recording:
    """A recording of abbed (MCAP), also a damaged one."""
    @staticmethod
    def open(file: str) -> "Recording": ...
    @property
    def machine(self) -> str: ...
    @property
    def configuration(self) -> str:
        """The text of abbed.toml."""
    @property
    def versions(self) -> dict[str, str]: ...
    @property
    def speed(self) -> float: ...
    @property
    def utc_offset_ns(self) -> int:
        """UTC = time_ns + utc_offset_ns."""
    @property
    def closed_cleanly(self) -> bool: ...
    @property
    def damage(self) -> str: ...
    @property
    def losses(self) -> list[str]: ...
    @property
    def message_count(self) -> int: ...
    @property
    def attachments(self) -> dict[str, bytes]: ...
    def sha256(self) -> str: ...
    def streams(self) -> dict[str, dict[str, Columns]]:
        """{"tracker", "axes", "environment", "touches"} -> {device -> columns}.

        All have time_ns (host time), u_time_ns, flags, lost_before. tracker: device_time_ns,
        device_status, p_tracker_m (N, 3). axes: cycle, missing_mask, count, position (m or rad).
        environment: air_temperature_K, air_pressure_Pa, relative_humidity, temperature_K.
        touches: touch, position.
        """

def otf_task(path: str) -> str:
    """The request for a calibration on the fly along the path of path.csv, as JSON. For abbe.Control."""
def evemu_task(calibrator: str, rotation_reference: str | None = None, u_reference_m: float = 1e-6) -> str:
    """The request for a calibration with the ball array of calibrator.toml, as JSON. For abbe.Control."""
def mfb_task(bar: str, plan: str) -> str:
    """The request for a calibration with the bar of bar.toml by plan.toml, as JSON. For abbe.Control."""
