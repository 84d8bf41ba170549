"""Recordings, models and a running abbed from Python. SI units: m, rad, s, K, Pa; times in ns.

    model = abbe.Model.load("model.json")
    V_m, cov_m2, inside = model.error_at(points_m)         # points_m: N x 3 scale readings
    columns = abbe.Recording.open("run.mcap").streams()["tracker"]["tracker"]
    model = abbe.identify_otf(machine="machine.toml", path="path.csv", tracker="tracker.csv")
    abbe.Control("/run/abbe/control.sock").status()
    for sample in abbe.Subscription(domain=7): ...
"""

from abbe._abbe import (Model, Recording, export_model, identify_evemu, identify_joint, identify_mfb,
                        identify_otf, plan_otf, save_model, verify)
from abbe.control import Control
from abbe.errors import Error
from abbe.subscription import Decision, Subscription

__all__ = ["Control", "Decision", "Error", "Model", "Recording", "Subscription", "export_model",
           "identify_evemu", "identify_joint", "identify_mfb", "identify_otf", "plan_otf", "save_model", "verify"]
