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
def evemu_task(calibrator: str, rotation_reference: str | None = None, u_reference_m: float | None = None) -> str:
    """The request for a calibration with the ball array of calibrator.toml, as JSON. For abbe.Control."""
def mfb_task(bar: str, plan: str) -> str:
    """The request for a calibration with the bar of bar.toml by plan.toml, as JSON. For abbe.Control."""

# The use cases of the command line. Names of files and values are those of its options; without a
# value: that of the configuration. `compare_with`: the store with whose active model the gate compares.
# An identified model has its verdict; `save_model` writes it as model.json.

def identify_otf(*, machine: str | None = None, path: str | None = None, tracker: str | None = None,
                 encoder: str | None = None, recording: str | None = None, targets: Sequence[str] = (),
                 tracker_centres_mm: Sequence[str] = (),
                 mode: str | None = None, estimator: str | None = None, tables: str | None = None,
                 backlash: str | None = None, smoothness_um: str | None = None,
                 u_scale_ppm: float | None = None, scales_corrected: bool = False,
                 accept_path_orientation: bool = False, compare_with: str | None = None) -> Model:
    """`abbe identify otf`; targets: "X,Y,Z=FILE" in mm, one per run."""
def identify_evemu(*, machine: str | None = None, touches: str | None = None,
                   calibrator: str | None = None, errors: str | None = None,
                   recording: str | None = None, rotation_reference: str | None = None, u_reference_um: float | None = None,
                   artefact_C: float | None = None, u_artefact_K: float | None = None,
                   estimator: str | None = None, folds: str | None = None,
                   order: int | None = None, scales_corrected: bool = False,
                   compare_with: str | None = None) -> Model:
    """`abbe identify evemu`."""
def identify_mfb(*, machine: str | None = None, bar: str | None = None, plan: str | None = None,
                 points: str | None = None, recording: str | None = None, estimator: str | None = None,
                 scales_corrected: bool = False, compare_with: str | None = None) -> Model:
    """`abbe identify mfb`."""
def identify_joint(*, machine: str, parts: str, estimator: str | None = None,
                   compare_with: str | None = None) -> Model:
    """`abbe identify joint`; abbe.Error "data_insufficient" for parts that contradict each other."""
def save_model(model: Model, file: str) -> None: ...
def verify(model: str | Sequence[str], *, points: str | None = None, recording: str | None = None,
           store: str | None = None, tool_mm: str | None = None) -> dict[str, Any]:
    """`abbe verify`: effect ("better", "not seen", "worse"), places, inside, before and after (mean_m,
    rms_m, max_m), cautions, points_off, cut_short (why points are missing; empty: none are).

    Of a list of models: places, inside (where all models are valid), points_off, cut_short, and models, one
    per model: name, model, machine, effect, before, after, cautions."""
def plan_otf(*, machine: str, trackers_at_mm: Sequence[str] = (), length_m: float | None = None,
             duration_min: float | None = None, feed_mm_per_min: float = ...) -> dict[str, Any]:
    """`abbe plan otf`: vertices_m (N, 3), tracker_m, prediction (rms_u_m, max_u_m, length_m, duration_s)."""
def export_model(model: str, *, to: str, out: str, store: str | None = None, tool_mm: str | None = None,
                 step_mm: float | None = None, positive: str | None = None, force: bool = False,
                 why: str = "") -> dict[str, Any]:
    """`abbe export`, with its report. abbe.Error "refused" for a model that must not be used."""
