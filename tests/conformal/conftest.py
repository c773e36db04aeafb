"""What the laws are run over: one list of all rules, and a naive tracker that knows no tricks."""

import math

import pytest

from cpl.conformal import (
    PI,
    Decaying,
    Fixed,
    RunningMax,
    TrailingMax,
    TrailingRange,
)

STEP_RULES = [
    Fixed(eta=0.05),
    Fixed(eta=3.0),
    RunningMax(c=0.1),
    RunningMax(c=2.0),
    TrailingMax(c=0.1, window=1),
    TrailingMax(c=0.3, window=4),
    TrailingRange(lr=0.1, window=1),
    TrailingRange(lr=0.5, window=3),
    TrailingRange(lr=0.1, window=10**30),
    Decaying(c=1.0, power=0.6),
]
PI_RULES = [
    PI(Fixed(eta=0.05), K_I=0.0, C_sat=1.0),
    PI(Fixed(eta=0.05), K_I=1.0, C_sat=5.0, lag=0),
    PI(RunningMax(c=0.1), K_I=10.0, C_sat=0.1),
    PI(TrailingRange(lr=0.1, window=5), K_I=2.0, C_sat=0.5),
    PI(Decaying(c=1.0, power=0.5), K_I=0.3, C_sat=0.02, lag=0),
]


def pytest_generate_tests(metafunc):
    """Run a test that takes ``any_rule`` on every rule, ``step_rule`` on those without integral."""
    if "any_rule" in metafunc.fixturenames:
        metafunc.parametrize("any_rule", STEP_RULES + PI_RULES, ids=repr)
    if "step_rule" in metafunc.fixturenames:
        metafunc.parametrize("step_rule", STEP_RULES, ids=repr)


def naive_step(rule, known):
    """Return the step of the event whose score is the last of ``known``, from the definition."""
    match rule:
        case Fixed(eta=eta):
            return eta
        case RunningMax(c=c):
            return c * max(abs(s) for s in known)
        case TrailingMax(c=c, window=window):
            return c * max(abs(s) for s in known[-window:])
        case TrailingRange(lr=lr, window=window):
            before = known[:-1][-window:]
            return lr * (max(before) - min(before)) if before else lr
        case Decaying(c=c, power=power):
            return c * len(known) ** -power
    raise AssertionError(rule)


def naive_track(scores, rule, alpha, delay, q0):
    """Return the thresholds, written down from the definitions in the docstrings."""
    base = rule.rule if isinstance(rule, PI) else rule
    q, errors, p = [], [], q0
    for t, score in enumerate(scores):
        k = t - delay  # the newest event that q[t] knows
        shown = p
        if k >= 0:
            p = p + naive_step(base, scores[: k + 1]) * (errors[k] - alpha)
            shown = p
            if isinstance(rule, PI) and rule.K_I > 0:
                summed = errors[: k + 1 - rule.lag]
                x = sum(summed) - alpha * len(summed)
                angle = x * math.log(k + 1) / (rule.C_sat * (k + 1))
                saturated = abs(angle) >= math.pi / 2
                tan = math.copysign(math.inf, angle) if saturated else math.tan(angle)
                shown = p + rule.K_I * tan
        q.append(shown)
        errors.append(score > shown)
    return q


@pytest.fixture(scope="session")
def naive():
    """The naive tracker, as a function of (scores, rule, alpha, delay, q0)."""
    return naive_track
