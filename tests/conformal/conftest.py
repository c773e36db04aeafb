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
from cpl.conformal.family import (
    ACI,
    COP,
    ECI,
    EWMA,
    KT,
    MEMBERS,
    PID,
    SAOCP,
    SFOGD,
    UPOCP,
    CostAware,
    DecisionTheory,
    DtACI,
    Rolling,
    Split,
)
from cpl.conformal.state import StateRule
from tests.conformal.family.naive import thresholds

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
# The members with their plain settings, and settings that reach what those do not.
STATE_RULES = [
    *(rule for rule in (m.make(1.0) for m in MEMBERS.values()) if isinstance(rule, StateRule)),
    ACI(gamma=0.5, window=3, quantile="corrected"),
    ACI(gamma=0.2, window=1, quantile="higher", clip=True),
    ACI(gamma=0.1, window=4, quantile="linear"),
    COP(eta=2.0, window=2),
    CostAware(eta=0.3, cost=0.0, reach=1.0),
    DecisionTheory(eta=1.0, reach=0.1),
    DtACI(gammas=(0.5,), window=2, interval=2),
    DtACI(gammas=(0.01, 0.3), window=5, interval=10, quantile="higher", clip=True, wait=3),
    ECI(eta=0.5, window=0, form="accumulated"),
    ECI(eta=0.5, window=3, slope=0.2, cutoff=True),
    ECI(eta=0.5, window=2, decay=0.9),
    EWMA(memory=1.0, deviations=0.0),
    KT(wealth=10.0),
    PID(eta=0.1, K_I=1.0, C_sat=0.05, level=0.5, trend=0.3),
    Rolling(window=2, quantile="corrected"),
    SAOCP(scale=0.1, lifetime=1, clip=True),
    SFOGD(scale=5.0, clip=True),
    Split(calibration=3),
    UPOCP(wealth=0.01),
]


def pytest_generate_tests(metafunc):
    """Run a test on every rule, or on the kind of rules that its argument names."""
    rules = {
        "any_rule": STEP_RULES + PI_RULES + STATE_RULES,
        "stepping_rule": STEP_RULES + PI_RULES,
        "step_rule": STEP_RULES,
        "state_rule": STATE_RULES,
    }
    for name, chosen in rules.items():
        if name in metafunc.fixturenames:
            metafunc.parametrize(name, chosen, ids=repr)


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
    if isinstance(rule, StateRule):
        return _naive_state(scores, rule, alpha, delay, q0)
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


def _naive_state(scores, rule, alpha, delay, q0):
    member = thresholds(rule, alpha, q0)
    q = [next(member)]
    for t in range(1, len(scores)):
        k = t - delay
        q.append(member.send((scores[k], q[k])) if k >= 0 else q0)
    return q[: len(scores)]


@pytest.fixture(scope="session")
def naive():
    """The naive tracker, as a function of (scores, rule, alpha, delay, q0)."""
    return naive_track
