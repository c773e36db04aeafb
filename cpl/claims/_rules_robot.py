"""How the claim about the robot's loop is decided: row 50, from runs against an emulator.

The paper gives the period, 10 Hz, and no timing of its own. What can be said without its robot is
that a loop with these rules keeps that period, and that the rules were followed as stated.
"""

from collections.abc import Callable

from cpl.claims._reading import Reader
from cpl.claims._verdicts import Finding, Verdict

__all__ = ["RULES"]

_PERIOD_S = 0.1  # [s] 10 Hz
_STEPS = 300  # at least; a 99th percentile of fewer says little


def _loop(read: Reader) -> Finding:
    runs = read("robot_loop")
    steps = runs.total("steps")
    worst = float(runs["loop_p99_s"].max())
    as_stated = runs.total("gain_wrong", "stop_wrong") == 0
    in_time = 0 < worst < _PERIOD_S and float(runs["policy_p99_s"].max()) <= worst
    if not (as_stated and in_time):
        verdict = Verdict.FAILS
    elif steps < _STEPS or runs.total("quiet") == steps:
        verdict = Verdict.UNDECIDED  # too few, or a rule that never spoke was not tried
    else:
        verdict = Verdict.HOLDS
    return Finding(
        verdict=verdict,
        value=1e3 * worst,
        low=None,
        high=None,
        n=steps,
        n_seeds=len(runs),
    )


RULES: dict[int, Callable[[Reader], Finding]] = {50: _loop}
"""The rule by row."""
