"""Row 50: the gain rule, the false-positive rule and the stop rule as stated, at 10 Hz.

The paper gives the period, 10 Hz, and no timing of its own. What can be said without its robot is
that a loop with these rules keeps that period, and that the rules were followed as stated.
"""

from cpl.claims.claim import Claim, Reader
from cpl.claims.verdict import Finding, Verdict

__all__ = ["CLAIM"]

_PERIOD_S = 0.1  # [s] 10 Hz
_STEPS = 300  # at least; a 99th percentile of fewer says little


def _decide(read: Reader) -> Finding:
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
        n=steps,
        n_seeds=len(runs),
    )


CLAIM = Claim(
    row=50,
    claim="gain rule, false-positive rule and stop rule as stated, at 10 Hz",
    where="Section V-A, V-C, V-D",
    paper_value="10 Hz",
    rule="99th percentile of the loop's time on the emulator [ms], worst run; below 100 ms, and "
    "the rules as stated",
    formula=r"T_{\mathrm{loop}}\le100\,\mathrm{ms}",
    unit="ms",
    margin="100 ms is the level, the period of 10 Hz; the worst of the runs decides",
    chapter="run_it",
    decide=_decide,
)
