#!/usr/bin/python3
"""Follows a running abbed: its state over the control socket, and its vectors over DDS.

    python3 follow.py CONTROL.SOCK [DOMAIN PROFILE [SECONDS]]
"""

import sys

import abbe


def main() -> None:
    control = abbe.Control(sys.argv[1])
    status = control.status()
    print(f"machine {status['machine']}: model {status['model']['state']}, session {status['session']['state']}")
    for stream in status["streams"]:
        print(f"stream {stream['name']}: {stream['state']}, {stream['rate_hz']:.1f} 1/s, {stream['gaps']} gaps")
    for session in control.follow():
        print(f"session {session['state']}: {session.get('reason', '')}")
    if len(sys.argv) < 4:
        return

    applied = refused = 0
    with abbe.Subscription(domain=int(sys.argv[2]), profile=sys.argv[3],
                           timeout_s=float(sys.argv[4]) if len(sys.argv) > 4 else 10.0) as subscription:
        shown = None
        for decision in subscription.decisions():
            if decision.apply != shown:
                print("apply" if decision.apply else f"do not apply: {decision.reason}")
            shown = decision.apply
            applied += decision.apply
            refused += not decision.apply
    print(f"vectors: {applied} may be applied, {refused} may not")


main()
