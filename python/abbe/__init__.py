"""Recordings, models and a running abbed from Python. SI units: m, rad, s, K, Pa; times in ns.

    model = abbe.Model.load("model.json")
    V_m, cov_m2, inside = model.error_at(points_m)         # points_m: N x 3 scale readings
    columns = abbe.Recording.open("run.mcap").streams()["tracker"]["tracker"]
    abbe.Control("/run/abbe/control.sock").status()
    for sample in abbe.Subscription(domain=7): ...
"""

from abbe._abbe import Model, Recording
from abbe.control import Control
from abbe.errors import Error
from abbe.subscription import Decision, Subscription

__all__ = ["Control", "Decision", "Error", "Model", "Recording", "Subscription"]
