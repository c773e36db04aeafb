"""How did many runs go? From logs to one row a run, and from there to what can be said of all.

Everything here works on whatever the logs hold: a number whose channel is missing is NaN, and a
comparison that cannot be made has no rows. The tables are those of `cpl.logs.read_runs`.
"""

from cpl.quadruped.analysis.alarms import alarms, alarms_by_policy, overruled
from cpl.quadruped.analysis.failures import Logistic, failure_odds, failure_shares, logistic
from cpl.quadruped.analysis.forecasts import foreseen, judged, weighted_auc
from cpl.quadruped.analysis.pairs import compare, comparisons, effects, reversals
from cpl.quadruped.analysis.resample import resampled
from cpl.quadruped.analysis.runs import NEEDS, possible, score_runs
from cpl.quadruped.analysis.windows import (
    both_by_chance,
    coverage_beside_bound,
    guaranteed_coverage,
    windows_covered,
)

__all__ = [
    "NEEDS",
    "Logistic",
    "alarms",
    "alarms_by_policy",
    "both_by_chance",
    "compare",
    "comparisons",
    "coverage_beside_bound",
    "effects",
    "failure_odds",
    "failure_shares",
    "foreseen",
    "guaranteed_coverage",
    "judged",
    "logistic",
    "overruled",
    "possible",
    "resampled",
    "reversals",
    "score_runs",
    "weighted_auc",
    "windows_covered",
]
