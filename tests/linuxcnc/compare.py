#!/usr/bin/python3
"""Moves a running LinuxCNC to random places, reads its motor commands, and compares them with the
correction c of the model.

  compare.py POINTS CORRECTIONS LARGEST COMPENSATION

POINTS: x,y,z in mm and directions, a line each; CORRECTIONS: output of `abbe model eval
--correction` for these; LARGEST: max_lost_um of `abbe export --json`, three numbers with commas;
COMPENSATION: folder of the export, x.comp, y.comp, z.comp.
Exit code 0: each motor command is the command plus the value of the file, to 1e-9 m, and plus c, but
for what the export reported as lost; 1: not so."""
import sys
import time

import hal
import linuxcnc

REACHED_MM = 1e-8
SETTLED_MM = 1e-9  # LinuxCNC approaches the trim at a limited speed
ALLOWED_UM = 1e-3  # difference from the file


def rows(name):
    lines = [line for line in open(name) if line[0] not in "#x"]
    return [[float(value) for value in line.split(",")[:6]] for line in lines]


def file_um(table, position, direction):
    """Value of a compensation file: straight lines between its rows."""
    column = 1 if direction > 0 else 2
    for left, right in zip(table, table[1:]):
        if position <= right[0]:
            part = (position - left[0]) / (right[0] - left[0])
            return 1e3 * (left[column] + part * (right[column] - left[column]))
    return 1e3 * table[-1][column]


def start(command, status):
    """Machine on, and homed in place."""
    for state in (linuxcnc.STATE_ESTOP_RESET, linuxcnc.STATE_ON):
        command.state(state)
        command.wait_complete()
    command.mode(linuxcnc.MODE_MANUAL)
    command.wait_complete()
    command.teleop_enable(0)
    command.wait_complete()
    command.home(-1)
    end = time.time() + 20
    while time.time() < end:
        status.poll()
        if all(status.homed[:3]):
            return
        time.sleep(0.05)
    sys.exit("compare: the machine is not homed after 20 s")


def move(command, place):
    """Ends when all joints are commanded to the place: LinuxCNC may report an earlier end."""
    command.mode(linuxcnc.MODE_MDI)
    command.wait_complete()
    command.mdi("G21 G90 G1 X%.9f Y%.9f Z%.9f F20000" % tuple(place))
    command.wait_complete(60)
    end = time.time() + 60
    while time.time() < end:
        now = [hal.get_value("joint.%d.pos-cmd" % j) for j in range(3)]
        if all(abs(a - b) < REACHED_MM for a, b in zip(now, place)):
            return
        time.sleep(0.01)
    sys.exit("compare: LinuxCNC did not reach %g %g %g" % tuple(place))


def trims():
    """Motor command minus joint command minus offset of the homing, when it has settled, in mm."""
    before = None
    for _ in range(400):
        now = [hal.get_value("joint.%d.motor-pos-cmd" % j) - hal.get_value("joint.%d.pos-cmd" % j)
               - hal.get_value("joint.%d.motor-offset" % j) for j in range(3)]
        if before and all(abs(a - b) < SETTLED_MM for a, b in zip(now, before)):
            return now
        before = now
        time.sleep(0.02)
    sys.exit("compare: the motor commands do not settle")


def main():
    points, corrections = rows(sys.argv[1]), rows(sys.argv[2])
    largest_um = [float(value) for value in sys.argv[3].split(",")]
    tables = [[[float(v) for v in line.split()] for line in open("%s/%s.comp" % (sys.argv[4], a))]
              for a in "xyz"]
    command, status = linuxcnc.command(), linuxcnc.stat()
    reader = hal.component("compare")
    reader.ready()
    start(command, status)

    wrong, worst_um, without_um, left_um, file_off_um = 0, [0.0] * 3, 0.0, 0.0, 0.0
    for point, correction in zip(points, corrections):
        place, direction = point[:3], point[3:6]
        approach = [p - 2.0 * d for p, d in zip(place, direction)]
        move(command, approach)
        move(command, place)
        trim_um = [1e3 * t for t in trims()]
        off = [t - file_um(*of) for t, of in zip(trim_um, zip(tables, place, direction))]
        file_off_um = max([file_off_um] + [abs(v) for v in off])
        lost = [c - t for c, t in zip(correction[3:6], trim_um)]
        print("place %s trim_um %s c_um %s" % (place, trim_um, correction[3:6]))
        worst_um = [max(w, abs(v)) for w, v in zip(worst_um, lost)]
        without_um += sum(c * c for c in correction[3:6])
        left_um += sum(v * v for v in lost)
        wrong += (any(abs(v) > most for v, most in zip(lost, largest_um))
                  or any(abs(v) > ALLOWED_UM for v in off))

    n = len(points)
    print("figure: LinuxCNC at %d places: motor commands differ from the file by at most %.7f um "
          "(allowed %g um); correction %.3f um rms, %.3f um of it not in the motor "
          "commands; largest %s um (allowed %s um); %d places beyond"
          % (n, file_off_um, ALLOWED_UM, (without_um / n) ** 0.5, (left_um / n) ** 0.5,
             ", ".join("%.3f" % w for w in worst_um), ", ".join("%.3f" % m for m in largest_um),
             wrong))
    sys.exit(1 if wrong else 0)


main()
