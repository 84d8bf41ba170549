#!/usr/bin/python3
"""Prints what the demo of LinuxCNC measured: the error of the path without and with correction, and in
each fault the largest step of the correction, what of it is applied in part, and whether the machine is
held.

  evaluate.py SAMPLES OFFSETS TRUTH

SAMPLES: output of `halsampler -t`, one line for each servo cycle: number, position (3), drive (3),
applied correction (3), wanted correction (3), following error (3) in mm, active, stale, lost, phase.
OFFSETS: motor-offset of the joints. TRUTH: V of the simulated machine on a grid, from `abbe sim truth`.
The simulated machine follows its drives at once: at the drive reading q its tool is at q + V(q).
Exit code 0: all limits are kept; 1: one is not, or a phase is missing."""
import math
import sys
from bisect import bisect_right

import drive

PERIOD_S = 1e-3
STEP_UM = 1e3 * 2.0 * PERIOD_S          # rate limit, 2 mm/s
CHANGE_UM = 1e3 * 200.0 * PERIOD_S ** 2  # acceleration limit, 200 mm/s2
CORRECTION, WANTED, FOLLOWING = (7, 8, 9), slice(10, 13), slice(13, 16)  # columns of a sample
ACTIVE, LOST, PHASE = 16, 18, 19
IN_PART_UM = 2.0 + 2 * 0.0015  # ABBE_LEFT_BEHIND of correction_limiter.h, with rounding
FADE_IN_PART_UM = 1.0  # off the direction of the vector that fades: a path turns c while it begins
# Until the machine stands after a loss: LinuxCNC needs 0.40 s on the circle, from 100 mm/s. halui and the
# task, programs without a realtime priority, pass a pause on.
STANDS_AFTER_S = {"clamp, paused": 1.0}
STANDS_AFTER_DEFAULT_S = 0.5
NOT_LOST = ("machine off", "not homed")  # the control itself stops the machine
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
        if len(words) != 20:
            continue
        samples.append([int(words[0])] + [float(w) for w in words[1:16]] + [int(w) for w in words[16:]])
        if len(samples) > 1:
            missing += samples[-1][0] - samples[-2][0] - 1
    return samples, missing


def path_errors_um(samples, phase, offsets, truth):
    """|tool - commanded position| in every cycle in which the machine moves."""
    errors = []
    for before, now in zip(samples, samples[1:]):
        if now[PHASE] != phase or math.dist(before[1:4], now[1:4]) < MOVING_MM:
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


def vector(sample):
    return [sample[k] for k in CORRECTION]


def in_part_um(samples):
    """Largest difference of a component from what was wanted, while the correction is active."""
    return max((1e3 * abs(a - w) for s in samples if s[ACTIVE]
                for a, w in zip(vector(s), s[WANTED])), default=0.0)


def fade_in_part_um(during):
    """While the vector fades: largest distance from a fraction of the vector before."""
    first = next((i for i in range(1, len(during)) if during[i - 1][ACTIVE] and not during[i][ACTIVE]), None)
    if first is None:
        return 0.0
    before = vector(during[first - 1])
    square, largest = sum(b * b for b in before), 0.0
    for sample in during[first:]:
        now = vector(sample)
        fraction = sum(n * b for n, b in zip(now, before)) / square
        largest = max([largest] + [1e3 * abs(n - fraction * b) for n, b in zip(now, before)])
        if sample[ACTIVE] or max(abs(n) for n in now) < 1e-3 * FADED_UM:
            break
    return largest


def stands(samples, allowed_s):
    """Longest time from the loss of the correction to the last movement, and how long the machine is held
    after the time that is allowed for it, s."""
    lost = moving = held = 0
    for before, now in zip(samples, samples[1:]):
        lost = lost + 1 if now[LOST] else 0
        held += lost > allowed_s / PERIOD_S
        if lost and 1e3 * math.dist(before[1:4], now[1:4]) > ROUNDING_UM:
            moving = max(moving, lost)
    return moving * PERIOD_S, held * PERIOD_S


def stands_after_s(name):
    return STANDS_AFTER_S.get(name, STANDS_AFTER_DEFAULT_S)


def fault_row(samples, name, phase):
    """Of all axes: largest step, and largest change of the step. Of X: correction at the start, the
    smallest, and at the end. Largest following error of all axes. What fades in part. When the machine
    stands, and how long it is held."""
    inside = [i for i, s in enumerate(samples) if s[PHASE] == phase]
    if len(inside) < 100:
        return None
    during = samples[inside[0] - 1:inside[-1] + 1]
    steps = [changes_um(during, axis) for axis in CORRECTION]
    largest = max(abs(step) for of_axis in steps for step in of_axis)
    change = max(abs(b - a) for of_axis in steps for a, b in zip(of_axis, of_axis[1:]))
    x_um = [1e3 * abs(s[CORRECTION[0]]) for s in during]
    following = max(1e3 * abs(f) for s in during for f in s[FOLLOWING])
    return (largest, change, x_um[0], min(x_um), x_um[-1], following,
            fade_in_part_um(during)) + stands(during, stands_after_s(name))


def fault_fails(name, row):
    largest, change, before, least, _, following, fade, standing, held = row
    return (largest > STEP_UM + ROUNDING_UM or change > CHANGE_UM + 2 * ROUNDING_UM
            or before < LEAST_UNCORRECTED_UM or following > ROUNDING_UM
            or (least > FADED_UM) == (name != "machine off")  # there the correction is held
            or fade > FADE_IN_PART_UM or standing > stands_after_s(name)
            or (held == 0.0) != (name in NOT_LOST))


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

    whole = in_part_um(samples)
    print("\nactive: a component differs by at most %.3f um from what is wanted (asked: <= %g)"
          % (whole, IN_PART_UM))
    failed |= whole > IN_PART_UM
    print("\nfault             largest step   change of step   X before   X least   X at the end   "
          "following error   fade in part   stands after   held   (um, s; asked: step <= %g, change <= %g, "
          "in part <= %g, stands after <= %g)" % (STEP_UM, CHANGE_UM, FADE_IN_PART_UM, STANDS_AFTER_DEFAULT_S))
    for name, phase in drive.FAULTS.items():
        row = fault_row(samples, name, phase)
        if row is None:
            print("%-18s not recorded" % name)
            failed = True
            continue
        print("%-18s      %7.3f          %7.3f     %7.2f   %7.2f        %7.2f           %7.3f        "
              "%7.3f        %7.3f %6.2f" % ((name,) + row))
        failed |= fault_fails(name, row)
    sys.exit(1 if failed else 0)


main()
