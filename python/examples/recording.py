#!/usr/bin/python3
"""What is in a recording: streams with rate and gaps, damage, and the speed of the tracker's target.

    python3 recording.py RUN.MCAP [--plot]
"""

import sys

import abbe
import numpy as np


def rate_hz(time_ns: np.ndarray) -> float:
    return (len(time_ns) - 1) / (1e-9 * (time_ns[-1] - time_ns[0])) if len(time_ns) > 1 else 0.0


def main() -> None:
    recording = abbe.Recording.open(sys.argv[1])
    print(f"machine {recording.machine}, {recording.message_count} messages, "
          f"{'closed' if recording.closed_cleanly else 'not closed'}, abbe {recording.versions.get('abbe', '?')}")
    for loss in recording.losses:
        print(f"loss: {loss}")

    streams = recording.streams()
    for kind, devices in streams.items():
        for device, columns in devices.items():
            time_ns = columns["time_ns"]
            longest_s = 1e-9 * np.max(np.diff(time_ns), initial=0)
            print(f"{kind} {device}: {len(time_ns)} samples, {rate_hz(time_ns):.1f} 1/s, "
                  f"{int(columns['lost_before'].sum())} lost, longest interval {longest_s:.3f} s")

    for device, columns in streams["tracker"].items():
        seconds = 1e-9 * np.diff(columns["device_time_ns"])
        moved_m = np.linalg.norm(np.diff(columns["p_tracker_m"], axis=0), axis=1)
        good = seconds > 0
        if good.any():
            print(f"{device}: fastest target {np.max(moved_m[good] / seconds[good]):.3f} m/s")
        if "--plot" in sys.argv:
            import matplotlib.pyplot as plt
            plt.plot(*columns["p_tracker_m"].T[:2])
            plt.gca().set(xlabel="x, m (tracker)", ylabel="y, m (tracker)", aspect="equal")
            plt.show()


main()
