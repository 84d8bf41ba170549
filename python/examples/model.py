#!/usr/bin/python3
"""The errors of a model with U (k = 2), and the volumetric error over its volume.

    python3 model.py MODEL.JSON [--plot]
"""

import sys

import abbe
import numpy as np


def table_of(parameters: dict, name: str) -> np.ndarray:
    return parameters["name"] == name


def main() -> None:
    model = abbe.Model.load(sys.argv[1])
    print(f"model {model.id} of {model.machine}, method {model.method}, chain {model.chain}")
    print("\n".join(model.statements))

    p = model.parameters
    for name in dict.fromkeys(p["name"]):
        rows = table_of(p, name)
        # The second letter of an angular error is A, B or C; squareness is an angle, too.
        unit = "urad" if name[1] in "ABC" else "um"
        value, U = 1e6 * p["value"][rows], 2e6 * p["u"][rows]
        print(f"{name}: {len(value)} nodes, {value.min():.2f} to {value.max():.2f} {unit}, U <= {U.max():.2f} {unit}")

    low, high = model.validity_hull_m.min(axis=0), model.validity_hull_m.max(axis=0)
    points_m = np.random.default_rng(1).uniform(low, high, size=(2000, 3))
    V_m, cov_m2, inside = model.error_at(points_m, model.tool_offsets_m[0])
    length_um = 1e6 * np.linalg.norm(V_m[inside], axis=1)
    U_um = 2e6 * np.sqrt(np.trace(cov_m2[inside], axis1=1, axis2=2))
    print(f"volume: |V| mean {length_um.mean():.3f} um, largest {length_um.max():.3f} um, "
          f"U (k = 2) largest {U_um.max():.3f} um, {inside.sum()} of {len(inside)} places inside")

    if "--plot" in sys.argv:
        import matplotlib.pyplot as plt
        for name in ("EXX", "EYY", "EZZ"):
            rows = table_of(p, name)
            if rows.any():
                plt.errorbar(1e3 * p["position_m"][rows], 1e6 * p["value"][rows], 2e6 * p["u"][rows], label=name)
        plt.gca().set(xlabel="position, mm", ylabel="error, um (bars: U, k = 2)")
        plt.legend()
        plt.show()


main()
