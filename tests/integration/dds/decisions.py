"""Prints each change between "apply" and "do not apply: REASON" that abbe.Subscription.decisions()
yields, and before the first one "watching PID" of abbe-watch.

  decisions.py PACKAGE abbe-watch DOMAIN PROFILE

PACKAGE: the folder abbe of the source. Its extension module is not needed and not loaded: an
interpreter cannot load one with sanitizers."""
import sys
import time
import types

package = types.ModuleType("abbe")
package.__path__ = [sys.argv[1]]
sys.modules["abbe"] = package
from abbe.subscription import Subscription  # noqa: E402

with Subscription(domain=int(sys.argv[3]), profile=sys.argv[4], program=sys.argv[2]) as subscription:
    print("watching", subscription._process.pid, flush=True)
    shown = None
    for decision in subscription.decisions():
        now_ns = time.monotonic_ns()
        assert decision.made_ns <= now_ns, "made before it was received"
        assert decision.apply == (decision.valid_until_ns > decision.made_ns), "valid while it may be applied"
        assert decision.may_be_applied(decision.valid_until_ns) is False
        if decision.apply != shown:
            print("apply" if decision.apply else "do not apply: " + decision.reason, flush=True)
        shown = decision.apply
