#!/usr/bin/python3
"""Drives the LinuxCNC of the demo: homes, drives the path of the calibration as a G-code program, then
the path that is measured without and with the correction, then faults, and last the calibration of the
machine that has changed. The number of the phase is in the signal `phase`, which is recorded with the positions.

Prints one line for each phase. Exit code 1: LinuxCNC did not do what it was told."""
import json
import math
import os
import signal
import subprocess
import sys
import time

import hal
import linuxcnc

import hand_over

FEED = 6000  # mm/min, 100 mm/s
HALF_STEP_NM = 5.1  # of the encoders in positions.toml.in, with rounding
# The machine moves to the start, then the part that is measured.
PATHS = {
    "line": ("G1 X-125 Y-100 Z-175", "G1 X125 Y100 Z-25"),
    "arc": ("G1 X75 Y0 Z-100", "G3 X75 Y0 I-75 J0"),
    "helix": ("G1 X60 Y20 Z-160", "G3 X60 Y20 I-60 J0 Z-40 P3"),
}
CALIBRATION_FEED = 6000  # mm/min
STANDSTILL_S = 2.0       # before the calibration, at its first vertex
DWELL_S = 0.2            # at each vertex
PHASES = {"without": 10, "with": 20}  # line, arc and helix: + 1, 2, 3
FAULTS = {"abbe-dds killed": 31, "NaN": 32, "machine off": 33, "model not ACTIVE": 34,
          "tool change": 38, "clamp": 39, "clamp, paused": 40, "feeder killed": 35, "not homed": 37,
          "model DRIFT": 36}
FEEDER_BACK_S = 5.0  # asked
INHIBIT, PAUSE = 1, 2  # abbe-correction.on-loss
# What the operator reads on the screen.
MESSAGES = {"abbe-dds killed": "the feed is inhibited: the ModelState publisher is not alive",
            "NaN": "the feed is inhibited: a component of the correction is not a number",
            "model not ACTIVE": "the feed is inhibited: ModelState is ",
            "tool change": "the feed is inhibited: the model is for the tool offset "
                           "(20.000, -15.000, -120.000) mm, T2 has (20.000, -15.000, -150.000) mm",
            "clamp": "the feed is inhibited: a component of the correction is beyond abbe-correction.clamp",
            "clamp, paused": "the program is paused: a component of the correction is beyond "
                             "abbe-correction.clamp",
            "feeder killed": "the feed is inhibited: the feeder did not answer",
            "model DRIFT": "the feed is inhibited: ModelState is DRIFT"}

command = status = errors = None  # of a running LinuxCNC; evaluate.py reads the names of the phases only


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


def valid():
    return hal.get_value("abbe-correction.valid")


def lost():
    return hal.get_value("abbe-correction.lost")


def switch_on():
    """The correction is applied again, which needs a living feeder with a valid model."""
    wait_until("the feeder has a valid correction", valid, 60)
    enable(False)
    time.sleep(0.2)
    enable(True)
    wait_until("the correction is active", active)
    time.sleep(0.3)


def machine_on():
    for state in (linuxcnc.STATE_ESTOP_RESET, linuxcnc.STATE_ON):
        command.state(state)
        command.wait_complete()


def joint_mode():
    command.mode(linuxcnc.MODE_MANUAL)
    command.wait_complete()
    command.teleop_enable(0)
    command.wait_complete()


def home():
    joint_mode()
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
    status = abbe_status()
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


def abbe_status():
    if os.path.exists("read-positions.done"):
        os.remove("read-positions.done")
    write_request("read-positions")
    return json.load(open("status.json"))


def vertices_mm():
    lines = [line.split(",")[:3] for line in open("path.csv") if line[0] not in "#x"]
    return [[float(v) for v in line] for line in lines]


def drive_calibration(name):
    """abbed calibrates while LinuxCNC drives the path, a program with an exact stop at each vertex."""
    path = vertices_mm()
    with open("path.ngc", "w") as out:
        out.write("G21 G90 G61 F%g\n" % CALIBRATION_FEED)
        for vertex in path[1:]:
            out.write("G1 X%.6f Y%.6f Z%.6f\nG4 P%g\n" % (*vertex, DWELL_S))
        out.write("M2\n")
    enable(False)
    move("G1 X%.6f Y%.6f Z%.6f" % tuple(path[0]))
    open("calibrate-" + name, "w").close()
    wait_until("abbed is ready for the path",
               lambda: (abbe_status().get("session") or {}).get("state") == "warming", 60)
    time.sleep(STANDSTILL_S)
    command.mode(linuxcnc.MODE_AUTO)
    command.wait_complete()
    command.program_open(os.path.abspath("path.ngc"))
    command.auto(linuxcnc.AUTO_RUN, 0)
    time.sleep(1.0)
    wait_until("the path is driven", lambda: status.poll() or status.interp_state == linuxcnc.INTERP_IDLE,
               600)
    print("drive: %d vertices of the calibration driven" % len(path), flush=True)


def wait_for_end_of_path():
    wait_until("abbed has seen the end of the path",
               lambda: abbe_status()["session"]["state"] != "acquiring", 30)


def wait_for_calibration(name):
    """The exit code of abbe calibrate."""
    wait_until("the calibration has ended", lambda: os.path.exists("calibrate-%s.done" % name), 200)
    return int(open("calibrate-%s.done" % name).read())


def feeder_said(text):
    return text in open("feeder.log").read()


def model_drifts():
    """The calibration shows that the machine has changed."""
    wait_until("the correction is off", lambda: not valid(), 100)
    time.sleep(0.5)
    if not feeder_said("ModelState is DRIFT"):
        fail("the correction is off, but not because the model drifted: see feeder.log")
    wait_for_calibration("changed")
    write_request("activate-newest")
    wait_until("the correction of the new model is active", active, 60)


def not_a_number():
    """A feeder that sends NaN in X: the real one is stopped meanwhile."""
    with hand_over.attached() as memory:
        feeder = memory.feeder
        os.kill(feeder, signal.SIGSTOP)
        time.sleep(0.01)  # of its loop at most a copy is left, which takes 1 us
        end = time.time() + 1.0
        while time.time() < end:
            memory.write((math.nan, 0.0, 0.0))
            time.sleep(0.001)
        os.kill(feeder, signal.SIGCONT)
    wait_until("the correction is active again", lambda: active() or hal.get_value("abbe-correction.stale"))
    if hal.get_value("abbe-correction.stale"):
        switch_on()  # the stopped feeder needed longer than the timeout to go on


def machine_off():
    command.state(linuxcnc.STATE_OFF)
    time.sleep(1.0)
    held = applied_um()
    time.sleep(0.5)
    if held < 1.0 or applied_um() != held:
        fail("the correction is not held while the machine is off: %g um" % held)


def model_not_active():
    write_request("stop-encoder")
    wait_until("the correction is off", lambda: not valid())
    time.sleep(1.0)
    write_request("continue-encoder")


def not_homed():
    """At standstill: LinuxCNC unhomes in joint mode only. It is homed again at the same place, so the
    machine has the same coordinates."""
    command.unhome(-1)
    wait_until("the correction is off", lambda: not valid())
    time.sleep(1.0)  # abbed calls an axis missing after 150 ms
    condition = next(s for s in abbe_status()["streams"] if s["name"] == "encoder")["condition"]
    if "LinuxCNC is not homed" not in condition or not feeder_said("not all joints are homed"):
        fail("the cause is not reported: the condition of the encoders is \"%s\"" % condition)
    home()
    wait_until("the correction is active again", active, 60)
    time.sleep(0.5)


def feeder_killed():
    """It comes back by itself; the user switches the correction on again."""
    with hand_over.attached() as memory:
        before = memory.feeder
        killed_at = time.time()
        os.kill(before, signal.SIGKILL)
        wait_until("the correction is stale", lambda: hal.get_value("abbe-correction.stale"))
        wait_until("the feeder is back", lambda: memory.feeder not in (0, before) and valid())
        back_s = time.time() - killed_at
    if back_s > FEEDER_BACK_S:
        fail("the feeder came back after %.1f s" % back_s)
    time.sleep(0.5)
    if applied_um() > 1e-3:
        fail("the correction did not fade: %g um" % applied_um())
    report("feeder killed: it writes a valid correction again after %.1f s (asked: %g)"
           % (back_s, FEEDER_BACK_S))
    switch_on()


def use_tool(number):
    command.mode(linuxcnc.MODE_MDI)
    command.wait_complete()
    for line in ("T%d M6" % number, "G43 H%d" % number):
        command.mdi(line)
        command.wait_complete()


def run_program(*lines):
    with open("fault.ngc", "w") as out:
        out.write("\n".join(("G21 G90 G64 F%g" % FEED,) + lines + ("M2", "")))
    command.mode(linuxcnc.MODE_AUTO)
    command.wait_complete()
    command.program_open(os.path.abspath("fault.ngc"))
    command.auto(linuxcnc.AUTO_RUN, 0)
    time.sleep(0.5)


def drive_to_tool_change():
    """A circle with T1, then T2 in the spindle, whose offset is 30 mm longer, and circles with it."""
    run_program("G3 X75 Y0 I-75 J0", "T2 M6", "G43 H2", "G3 X75 Y0 I-75 J0 P60")


def tool_change():
    wait_until("T2 is in the spindle", lambda: hal.get_value("iocontrol.0.tool-number") == 2)
    wait_until("the correction is lost", lost)
    time.sleep(1.0)
    if applied_um() > 1e-3:
        fail("the correction of T1 is applied to T2: %g um" % applied_um())
    command.abort()
    command.wait_complete()
    use_tool(1)
    wait_until("the correction is active with T1", active)


def clamp_reached():
    """The clamp is less than c of X, more than c of the other axes."""
    halcmd("setp", "abbe-correction.clamp", 0.02)
    wait_until("the correction is lost", lost)
    time.sleep(2.0)
    halcmd("setp", "abbe-correction.clamp", 0.2)
    wait_until("the correction is active", active)


def clamp_reached_paused():
    clamp_reached()
    status.poll()
    if not status.paused:
        fail("the program is not paused")
    halcmd("setp", "abbe-correction.on-loss", INHIBIT)
    command.auto(linuxcnc.AUTO_RESUME)
    wait_until("the program continues", lambda: status.poll() or not status.paused)


def drive_paused():
    halcmd("setp", "abbe-correction.on-loss", PAUSE)
    run_program("G3 X75 Y0 I-75 J0 P60")


def kill_dds():
    write_request("kill-dds")
    time.sleep(2.5)


def go_to_circles():
    """To the beginning of the circles in the volume, with the correction on."""
    if not hal.get_value("motion.motion-enabled"):
        machine_on()
    move("G1 X75 Y0 Z-100")
    switch_on()


def drive_changed_machine():
    """The path of a calibration, which ends at the beginning of the circles. The correction is switched
    on when abbed has seen the end of the path: before, it would move the machine away from the last
    vertex. The identification, which shows that the machine changed, takes some seconds more."""
    write_request("change-machine")
    drive_calibration("changed")
    wait_for_end_of_path()
    enable(True)
    wait_until("the correction is active", active)
    phase(FAULTS["model DRIFT"])


def drive_circles():
    mdi("G3 X75 Y0 I-75 J0 P60")
    time.sleep(1.0)


# Of each fault: what is done before it, what the machine does at it, the fault.
ACTIONS = {"tool change": (go_to_circles, drive_to_tool_change, tool_change),
           "clamp": (go_to_circles, drive_circles, clamp_reached),
           "clamp, paused": (go_to_circles, drive_paused, clamp_reached_paused),
           "abbe-dds killed": (go_to_circles, drive_circles, kill_dds),
           "NaN": (go_to_circles, drive_circles, not_a_number),
           "machine off": (go_to_circles, drive_circles, machine_off),
           "model not ACTIVE": (go_to_circles, drive_circles, model_not_active),
           "not homed": (go_to_circles, joint_mode, not_homed),
           "model DRIFT": (drive_changed_machine, drive_circles, model_drifts),
           "feeder killed": (go_to_circles, drive_circles, feeder_killed)}


def report(line):
    with open("faults.txt", "a") as out:
        out.write(line + "\n")


def shown():
    """The messages since the last call, as the user interface of an operator takes them."""
    lines = []
    while True:
        message = errors.poll()
        if message is None:
            return lines
        lines.append(message[1].strip())


def check_messages(name):
    lines = [line for line in shown() if line.startswith("abbe: ")]
    expected = MESSAGES.get(name)
    if expected is None:  # the control itself stops the machine
        return
    if not any(expected in line for line in lines):
        fail("%s: the screen shows %s, not \"%s\"" % (name, lines, expected))
    report("%s: the screen shows \"%s\"" % (name, next(line for line in lines if expected in line)))


def fault(name):
    prepare, drive, act = ACTIONS[name]
    shown()
    prepare()
    drive()
    phase(FAULTS[name])
    act()
    time.sleep(0.5)
    phase(0)
    check_messages(name)
    command.abort()
    command.wait_complete()
    print("drive: %s" % name, flush=True)


def use_tool_of_model():
    """T1 is the reflector of the calibration. The work offset makes the coordinates of its centre those
    of the machine, so that the path of the calibration can be driven with it."""
    use_tool(1)
    offset = [hal.get_value("motion.tooloffset." + axis) for axis in "xyz"]
    command.mdi("G10 L2 P1 X%g Y%g Z%g" % tuple(-o for o in offset))
    command.wait_complete()


def main():
    global command, status, errors
    command, status, errors = linuxcnc.command(), linuxcnc.stat(), linuxcnc.error_channel()
    reader = hal.component("drive")
    reader.ready()
    machine_on()
    home()
    offsets = [hal.get_value("joint.%d.motor-offset" % j) for j in range(3)]
    with open("offsets.txt", "w") as out:
        out.write(" ".join("%.9f" % o for o in offsets) + "\n")

    use_tool_of_model()
    drive_calibration("first")
    wait_for_end_of_path()
    if wait_for_calibration("first") != 0:
        fail("the calibration was refused")
    wait_until("the feeder has a valid correction", valid, 60)
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
