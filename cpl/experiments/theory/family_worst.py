"""What can the worst scores do to each member of the family, and how fast does each follow a shift?

Adversaries that see the threshold play against every member's plain settings, for scores in
[0, 1]. What they attain stands beside what is promised, where a promise says something about so
short a window, and beside the exact worst case, where there are few enough states to search.
"""

import math
from dataclasses import dataclass

import pandas as pd

from cpl.conformal.attack import attack, counts_worst, level_worst, shift
from cpl.conformal.bounds import max_errors
from cpl.conformal.family import ACI, COP, MEMBERS, UPOCP, CostAware
from cpl.conformal.rules import Fixed, Rule
from cpl.experiments.run.spec import Experiment, Shard, grid

__all__ = ["EXPERIMENT", "PROFILES", "Config"]


@dataclass(frozen=True, kw_only=True)
class Config:
    """The window.

    Attributes:
        alpha: Miscoverage aimed at [-].
        W: Window [steps].
        steps: How long each adversary plays [steps].
        horizon: Windows of a rule that counts are searched exactly up to this time [steps].
        stretch: Steps before, during and after the shift [steps].
    """

    alpha: float = 0.1
    W: int = 40
    steps: int = 800
    horizon: int = 800
    stretch: int = 400


PROFILES = {
    "smoke": Config(steps=80, horizon=60, stretch=60),
    "book": Config(),
    "paper": Config(),
}


def run_shard(config: Config, shard: Shard) -> pd.DataFrame:
    """Attack one member, and shift the world under it.

    Returns:
        One row: `member`; `promised` and `exact`, the most misses in `W` steps, missing where
        nothing is promised or known; `attained`, `by`, `run`, `run_by` of the adversaries;
        `react`, `forget` [steps], missing for longer than the stretch; `before`, the mean threshold
        before the shift, and `missed`, the share of errors while scores are three times as large.
    """
    name = shard.text("member")
    rule, a = MEMBERS[name].make(1.0), config.alpha
    worst = attack(rule, alpha=a, W=config.W, steps=config.steps)
    moved = shift(rule, alpha=a, stretch=config.stretch)
    promised, exact = _promised(rule, a, config.W), _exact(rule, a, config)
    row = {
        "member": name,
        "promised": promised,
        "exact": exact,
        "attained": worst.misses,
        "by": worst.by,
        "run": worst.run,
        "run_by": worst.run_by,
        "react": moved.react,
        "forget": moved.forget,
        "before": moved.before,
        "missed": moved.missed,
    }
    floats = dict.fromkeys(("promised", "exact", "react", "forget"), "float64")
    return pd.DataFrame([row]).astype(floats)


EXPERIMENT = Experiment(
    run=run_shard,
    profiles=PROFILES,
    shards=grid("{member}", member=tuple(MEMBERS)),
    label="exact",
)


def _promised(rule: Rule, alpha: float, W: int) -> int | None:
    """Return the most misses that the published or derived bound allows in W steps, B = 1."""
    match rule:
        case Fixed(eta=eta):
            return min(W, math.floor(alpha * W + 1 / eta + 1))
        case ACI(gamma=gamma):  # its published bound is for the start; a window has both walls
            return min(W, math.floor(alpha * W + 1 / gamma + 1 + max(alpha, 1 - alpha) / gamma))
        case COP() | CostAware():
            return rule.most_errors(alpha=alpha, B=1.0, T=W)
        case _:
            return None


def _exact(rule: Rule, alpha: float, config: Config) -> int | None:
    """Return the most misses that any scores can cause, where that can be searched."""
    match rule:
        case Fixed(eta=eta):
            return max_errors(alpha, eta, 1, config.W)
        case ACI(gamma=gamma):
            return level_worst(gamma, alpha=alpha, W=config.W)
        case UPOCP(wealth=wealth):
            return counts_worst(
                lambda misses, events: _portfolio(misses, events, alpha, wealth),
                W=config.W,
                T=config.horizon,
            )
        case _:
            return None


def _portfolio(misses: int, events: int, alpha: float, wealth: float) -> float:
    """Return UPOCP's threshold from the counts."""
    if not events:
        return 0.0
    covers = events - misses
    log_wealth = (
        math.lgamma(misses + 0.5)
        + math.lgamma(covers + 0.5)
        - math.lgamma(events + 1)
        - 2 * math.lgamma(0.5)
        - misses * math.log(alpha)
        - covers * math.log(1 - alpha)
    )
    share = (misses + 0.5) / (events + 1)
    return wealth * (share - alpha) / (alpha * (1 - alpha)) * math.exp(min(log_wealth, 600.0))
