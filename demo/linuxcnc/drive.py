#!/usr/bin/python3
"""Drives the LinuxCNC of the demo: homes, runs the path without and with the correction, then with
faults. The number of the phase is in the signal `phase`, which is recorded with the positions.

Prints one line for each phase. Exit code 1: LinuxCNC did not do what it was told."""
import json
import os
import subprocess
import sys
import time

import hal
import linuxcnc

FEED = 6000  # mm/min, 100 mm/s
HALF_STEP_NM = 5.1  # of the encoders in positions.toml.in, with rounding
# The machine moves to the start, then the part that is measured.
PATHS = {
    "line": ("G1 X-250 Y-200 Z-350", "G1 X250 Y200 Z-50"),
    "arc": ("G1 X150 Y0 Z-200", "G3 X150 Y0 I-150 J0"),
    "helix": ("G1 X120 Y40 Z-320", "G3 X120 Y40 I-120 J0 Z-80 P3"),
}
PHASES = {"without": 10, "with": 20}  # line, arc and helix: + 1, 2, 3
FAULTS = {"abbe-dds killed": 31, "NaN": 32, "machine off": 33, "model not ACTIVE": 34,
          "feeder killed": 35}

command = status = None  # of a running LinuxCNC; evaluate.py reads the names of the phases only


def fail(text):
    sys.exit("drive: " + text)


def wait_until(what, condition, seconds=20):
    end = time.time() + seconds
    while not condition():
        if time.time() > end:
            fail("not within %g s: %s" % (seconds, what))
        time.sleep(0.02)


def phase(number):
    halcmd("sets", "phase", number)


def halcmd(*words):
    done = subprocess.run(["halcmd"] + [str(word) for word in words], capture_output=True)
    if done.returncode != 0:
        fail("halcmd %s: %s" % (" ".join(map(str, words)), done.stderr.decode()))
    return done.stdout.decode()


def enable(on):
    halcmd("setp", "abbe-correction.enable", int(on))


def active():
    return hal.get_value("abbe-correction.active")


def applied_um():
    return max(abs(hal.get_value("abbe-correction.%d.applied" % j)) for j in range(3)) * 1e3


def switch_on():
    """The correction is applied again, which needs a living feeder with a valid model."""
    wait_until("the feeder has a valid correction", lambda: hal.get_value("abbe-feeder.valid"), 60)
    enable(False)
    time.sleep(0.2)
    enable(True)
    wait_until("the correction is active", active)
    time.sleep(0.3)


def machine_on():
    for state in (linuxcnc.STATE_ESTOP_RESET, linuxcnc.STATE_ON):
        command.state(state)
        command.wait_complete()


def home():
    command.mode(linuxcnc.MODE_MANUAL)
    command.wait_complete()
    command.teleop_enable(0)
    command.wait_complete()
    command.home(-1)
    wait_until("all joints are homed", lambda: hal.get_value("motion.is-all-homed"))


def mdi(line):
    command.mode(linuxcnc.MODE_MDI)
    command.wait_complete()
    command.mdi("G21 G90 G64 F%d %s" % (FEED, line))


def standing():
    status.poll()
    return status.inpos and status.queue == 0 and hal.get_value("motion.in-position")


def move(line):
    mdi(line)
    time.sleep(0.2)
    wait_until(line + " is done", standing, 60)


def drive_path(first):
    for number, (start, measured) in enumerate(PATHS.values(), 1):
        move(start)
        phase(first + number)
        move(measured)
        if first == PHASES["with"] and not active():
            fail("the correction was switched off on the path: the feeder or the model failed, see feeder.log")
        phase(0)


def write_request(name):
    """The programs of abbe belong to another user: demo/linuxcnc/run does what is asked."""
    open(name, "w").close()
    wait_until(name + " is answered", lambda: os.path.exists(name + ".done"))


def compare_positions():
    """What abbed reads from its encoders, at standstill, against the joint positions with correction."""
    write_request("read-positions")
    status = json.load(open("status.json"))
    stream = next(s for s in status["streams"] if s["name"] == "encoder")
    reading_mm = [hal.get_value("joint.%d.pos-cmd" % j) + hal.get_value("abbe-correction.%d.applied" % j)
                  for j in range(3)]
    off_nm = max(1e6 * abs(1e3 * p - r) for p, r in zip(status["position_m"], reading_mm))
    with open("positions.txt", "w") as out:
        out.write("abbed reads the axes of LinuxCNC at %.1f Hz, %d gaps in %d samples; at standstill they "
                  "differ by %.1f nm (allowed: half a step, %g nm)\n"
                  % (stream["rate_hz"], stream["gaps"], stream["samples"], off_nm, HALF_STEP_NM))
    if off_nm > HALF_STEP_NM:
        fail("abbed reads %s m, the joints are at %s mm" % (status["position_m"], reading_mm))


def not_a_number():
    halcmd("unlinkp", "abbe-correction.0.wanted")
    halcmd("setp", "abbe-correction.0.wanted", "nan")
    time.sleep(1.0)
    halcmd("net", "x-correction", "abbe-correction.0.wanted")


def machine_off():
    command.state(linuxcnc.STATE_OFF)
    time.sleep(1.0)
    held = applied_um()
    time.sleep(0.5)
    if held < 1.0 or applied_um() != held:
        fail("the correction is not held while the machine is off: %g um" % held)


def model_not_active():
    write_request("stop-machine")
    wait_until("the correction is off", lambda: not hal.get_value("abbe-feeder.valid"))
    time.sleep(0.5)
    write_request("continue-machine")


def feeder_killed():
    write_request("kill-feeder")
    wait_until("the correction is stale", lambda: hal.get_value("abbe-correction.stale"))
    time.sleep(0.5)
    if applied_um() > 1e-3:
        fail("the correction did not fade: %g um" % applied_um())


ACTIONS = {"abbe-dds killed": lambda: (write_request("kill-dds"), time.sleep(2.5)),
           "NaN": not_a_number, "machine off": machine_off, "model not ACTIVE": model_not_active,
           "feeder killed": feeder_killed}


def fault(name):
    """Happens while the machine drives circles in the volume."""
    if not hal.get_value("motion.motion-enabled"):
        machine_on()
    command.mode(linuxcnc.MODE_MDI)
    command.wait_complete()
    move("G1 X150 Y0 Z-200")
    switch_on()
    mdi("G3 X150 Y0 I-150 J0 P9")
    time.sleep(1.0)
    phase(FAULTS[name])
    ACTIONS[name]()
    time.sleep(0.5)
    phase(0)
    command.abort()
    command.wait_complete()
    print("drive: %s" % name, flush=True)


def main():
    global command, status
    command, status = linuxcnc.command(), linuxcnc.stat()
    reader = hal.component("drive")
    reader.ready()
    machine_on()
    home()
    offsets = [hal.get_value("joint.%d.motor-offset" % j) for j in range(3)]
    with open("offsets.txt", "w") as out:
        out.write(" ".join("%.9f" % o for o in offsets) + "\n")

    wait_until("the feeder has a valid correction", lambda: hal.get_value("abbe-feeder.valid"), 60)
    enable(False)
    drive_path(PHASES["without"])
    print("drive: path without correction", flush=True)
    switch_on()
    drive_path(PHASES["with"])
    print("drive: path with correction", flush=True)
    time.sleep(0.5)
    compare_positions()
    for name in FAULTS:
        fault(name)


if __name__ == "__main__":
    main()
