#!/usr/bin/python3
"""Prints what the demo of LinuxCNC measured: the error of the path without and with correction, and
the largest step of the correction in each fault.

  evaluate.py SAMPLES OFFSETS TRUTH

SAMPLES: output of `halsampler -t`, one line for each servo cycle: number, position (3), drive (3),
applied correction (3), following error (3) in mm, active, stale, phase, sequence number. OFFSETS:
motor-offset of the joints. TRUTH: V of the simulated machine on a grid, from `abbe sim truth`.
The simulated machine follows its drives at once: at the drive reading q its tool is at q + V(q).
Exit code 0: all limits are kept; 1: one is not, or a phase is missing."""
import math
import sys
from bisect import bisect_right

import drive

PERIOD_S = 1e-3
STEP_UM = 1e3 * 2.0 * PERIOD_S          # rate limit, 2 mm/s
CHANGE_UM = 1e3 * 200.0 * PERIOD_S ** 2  # acceleration limit, 200 mm/s2
CORRECTION = (7, 8, 9)  # columns of a sample
FADED_UM = 0.001
LARGEST_RMS_UM = 0.5
LEAST_UNCORRECTED_UM = 10.0  # below, the path shows nothing
ROUNDING_UM = 0.0015  # halsampler prints 6 decimals of a mm; a step is a difference of two
MOVING_MM = 0.05      # in a cycle: half the feed


class Truth:
    """V on a grid, linear between its nodes."""

    def __init__(self, name):
        rows = [[float(v) for v in line.split(",")[:6]]
                for line in open(name) if line[0] not in "#x"]
        self.axes = [sorted({row[i] for row in rows}) for i in range(3)]
        self.V = {tuple(row[:3]): row[3:6] for row in rows}

    def at_um(self, place):
        corners = [((), 1.0)]
        for axis, value in zip(self.axes, place):
            i = min(max(bisect_right(axis, value) - 1, 0), len(axis) - 2)
            part = (value - axis[i]) / (axis[i + 1] - axis[i])
            corners = [(node + (axis[i + k],), weight * (part if k else 1.0 - part))
                       for node, weight in corners for k in (0, 1)]
        return [sum(weight * self.V[node][k] for node, weight in corners) for k in range(3)]


def read_samples(name):
    """Samples in order, and how many are missing."""
    samples, missing = [], 0
    for line in open(name):
        words = line.split()
        if len(words) != 17:
            continue
        samples.append([int(words[0])] + [float(w) for w in words[1:13]] + [int(w) for w in words[13:]])
        if len(samples) > 1:
            missing += samples[-1][0] - samples[-2][0] - 1
    return samples, missing


def path_errors_um(samples, phase, offsets, truth):
    """|tool - commanded position| in every cycle in which the machine moves."""
    errors = []
    for before, now in zip(samples, samples[1:]):
        if now[15] != phase or math.dist(before[1:4], now[1:4]) < MOVING_MM:
            continue
        reading = [drive_mm - offset for drive_mm, offset in zip(now[4:7], offsets)]
        V = truth.at_um(reading)
        errors.append(math.sqrt(sum((1e3 * (q - p) + v) ** 2
                                    for q, p, v in zip(reading, now[1:4], V))))
    return errors


def rms(values):
    return math.sqrt(sum(v * v for v in values) / len(values))


def changes_um(samples, axis):
    """Step of the correction of an axis in every cycle."""
    return [1e3 * (now[axis] - before[axis]) for before, now in zip(samples, samples[1:])]


def fault_row(samples, phase):
    """Of all axes: largest step, and largest change of the step. Of X: correction at the start, the
    smallest, and at the end. Largest following error of all axes."""
    inside = [i for i, s in enumerate(samples) if s[15] == phase]
    if len(inside) < 100:
        return None
    during = samples[inside[0] - 1:inside[-1] + 1]
    steps = [changes_um(during, axis) for axis in CORRECTION]
    largest = max(abs(step) for of_axis in steps for step in of_axis)
    change = max(abs(b - a) for of_axis in steps for a, b in zip(of_axis, of_axis[1:]))
    x_um = [1e3 * abs(s[CORRECTION[0]]) for s in during]
    following = max(1e3 * abs(f) for s in during for f in s[10:13])
    return largest, change, x_um[0], min(x_um), x_um[-1], following


def fault_fails(name, row):
    largest, change, before, least, _, following = row
    return (largest > STEP_UM + ROUNDING_UM or change > CHANGE_UM + 2 * ROUNDING_UM
            or before < LEAST_UNCORRECTED_UM or following > ROUNDING_UM
            or (least > FADED_UM) == (name != "machine off"))  # there the correction is held


def main():
    samples, missing = read_samples(sys.argv[1])
    offsets = [float(v) for v in open(sys.argv[2]).read().split()]
    truth = Truth(sys.argv[3])
    failed = missing > 0
    print("%d servo cycles recorded, %d missing" % (len(samples), missing))
    print("\npath at 100 mm/s      without      with   largest with   (um; asked: rms <= %g)" % LARGEST_RMS_UM)
    for number, name in enumerate(drive.PATHS, 1):
        without = path_errors_um(samples, drive.PHASES["without"] + number, offsets, truth)
        corrected = path_errors_um(samples, drive.PHASES["with"] + number, offsets, truth)
        if not without or not corrected:
            print("%-18s not recorded" % name)
            failed = True
            continue
        print("%-18s rms %7.2f   %7.3f        %7.3f   %d cycles"
              % (name, rms(without), rms(corrected), max(corrected), len(corrected)))
        failed |= rms(corrected) > LARGEST_RMS_UM or rms(without) < LEAST_UNCORRECTED_UM

    print("\nfault             largest step   change of step   X before   X least   X at the end   "
          "following error   (um; asked: step <= %g, change <= %g)" % (STEP_UM, CHANGE_UM))
    for name, phase in drive.FAULTS.items():
        row = fault_row(samples, phase)
        if row is None:
            print("%-18s not recorded" % name)
            failed = True
            continue
        print("%-18s      %7.3f          %7.3f     %7.2f   %7.2f        %7.2f           %7.3f"
              % ((name,) + row))
        failed |= fault_fails(name, row)
    sys.exit(1 if failed else 0)


main()
