#!/usr/bin/python3
"""Begins a calibration and follows it until abbed has accepted or refused the model.

    python3 calibrate.py CONTROL.SOCK otf PATH.CSV
    python3 calibrate.py CONTROL.SOCK evemu CALIBRATOR.TOML
    python3 calibrate.py CONTROL.SOCK mfb BAR.TOML PLAN.TOML

Once it prints "warming", drive the path, or touch what it asks for. With a simulated machine: start
`abbe sim run` and abbed, see `abbe example`. Exit code 0: the model is active; 1: it was refused.
"""

import sys

import abbe


def main() -> None:
    control, method, files = abbe.Control(sys.argv[1]), sys.argv[2], sys.argv[3:]
    begin = {"otf": control.calibrate_otf, "evemu": control.calibrate_evemu, "mfb": control.calibrate_mfb}
    begin[method](*files)

    printed, session = "", {}
    for session in control.follow():
        touch = session.get("next") or {}
        line = f"{session['state']}: {session['reason']}"
        if touch:
            line += f" (position {touch['place']}, {touch['on']}: {touch['touched']} of {touch['points']} touches)"
        if line != printed:
            print(line, flush=True)
        printed = line
    if session["state"] == "active":
        print(f"model {session['model_id']} is active")
    sys.exit(0 if session["state"] == "active" else 1)


main()
