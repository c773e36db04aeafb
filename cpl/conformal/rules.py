r"""Step rules: how far one piece of feedback moves the threshold.

A tracker follows the (1 - alpha)-quantile of a sequence of scores with

$$q_{t+1} = q_t + \eta_t (\mathrm{err}_t - \alpha), \qquad \mathrm{err}_t = 1\{s_t > q_t\}.$$

Paper: eq. (4), with its sign and argument corrected. A rule says what $\eta_t$ is.

The step belongs to the *event*: $\eta_t$ is what the miss or hit of time t is multiplied with,
and it may depend on the scores $s_0 \dots s_t$, for these are what is known when that event is
fed back. Feedback that comes late (``delay`` h) moves the event, not its step: the threshold
$q_{t+h} = q_0 + \sum_{i \le t} \eta_i (\mathrm{err}_i - \alpha)$ is the first that knows it.

| rule | $\eta_t$ | guarantee |
|---|---|---|
| ``Fixed`` | eta | exact finite-sample bound, every window |
| ``RunningMax`` | c max(abs(s_0) ... abs(s_t)) | yes: it only grows |
| ``Decaying`` | c (t+1)^-power | long-run for power < 1, and convergence on iid scores |
| ``TrailingRange`` | lr (max - min) of the last scores | none: constant scores freeze it |
| ``TrailingMax`` | c max of the last abs(s) | none: see its docstring |

``PI`` wraps any of them and adds the saturated integral of the errors. Rules that keep more than a
step's worth of memory are state rules (`cpl.conformal.state`), the members of
`cpl.conformal.family`.
"""

from abc import ABC, abstractmethod
from dataclasses import KW_ONLY, dataclass
from typing import TypeAlias

import numpy as np
from numpy.typing import NDArray

from cpl.conformal import _kernels
from cpl.conformal._steppers import (
    Constant,
    Decay,
    GreatestEver,
    GreatestLately,
    RangeBefore,
    Stepper,
)
from cpl.conformal._validate import as_integer, as_positive
from cpl.conformal.state import StateRule

__all__ = [
    "PI",
    "Decaying",
    "Fixed",
    "Rule",
    "RunningMax",
    "StepRule",
    "TrailingMax",
    "TrailingRange",
    "as_rule",
]

FloatArray: TypeAlias = NDArray[np.float64]


class StepRule(ABC):
    """What a rule has to say: its steps along whole sequences, and along a sequence as it comes.

    Both must give the same bits. To add a rule, derive a frozen dataclass from this class, and
    put an instance into the list of rules in ``tests/conformal/conftest.py``: every law is then
    run on it.
    """

    __slots__ = ()

    @abstractmethod
    def steps(self, scores: FloatArray) -> FloatArray:
        """Return the steps of all events.

        Args:
            scores: Scores of independent streams, shape (N, T), finite float64.

        Returns:
            The steps, of shape (N, T), (1, T) or (1, 1) where streams or times agree.
        """

    @abstractmethod
    def stepper(self) -> Stepper:
        """Return the rule's state at the start of a sequence, for a tracker that runs online."""


@dataclass(frozen=True, kw_only=True, slots=True)
class Fixed(StepRule):
    r"""One step for all events.

    $$\eta_t = \eta$$

    Paper: Theorem 1. The state is then $q_t = q_0 + \eta (N_t - \alpha t)$, with $N_t$ the number
    of misses so far: an integral controller of the error.

    Args:
        eta: The step [score], > 0. After a miss q rises by (1 - alpha) eta, else falls by
            alpha eta.

    Raises:
        ValueError: If ``eta`` is not finite and positive.

    Examples:
        >>> Fixed(eta=0.05)
        Fixed(eta=0.05)
        >>> Fixed(eta=0.0)
        Traceback (most recent call last):
        ...
        ValueError: eta must be > 0, got 0.0
    """

    eta: float

    def __post_init__(self) -> None:
        object.__setattr__(self, "eta", as_positive("eta", self.eta))

    def steps(self, scores: FloatArray) -> FloatArray:
        """Return the one step, shape (1, 1)."""
        return np.full((1, 1), self.eta)

    def stepper(self) -> Stepper:
        """Return the state of the rule: none."""
        return Constant(self.eta)


@dataclass(frozen=True, kw_only=True, slots=True)
class RunningMax(StepRule):
    r"""A share of the greatest score so far, this event's included.

    $$\eta_t = c \max(|s_0|, \dots, |s_t|)$$

    Paper: "in practice ... $\eta_t = 0.1 \hat B_t$", where $\hat B_t$ is not defined; read as the
    running maximum the step never falls, and the guarantee survives (with B / eta_{T0} for
    B / eta).

    The event's own score is known when the event is fed back, so it counts, and there is never
    "no score yet": the step is zero only while all scores were zero, and nothing is missed then
    at q0 = 0. The magnitude is taken because a score may be signed: for the scores in [0, B] of
    the paper it is the score itself, for others it is the scale that keeps the step from turning
    negative.

    Args:
        c: The share [-], > 0; the paper uses 0.1.

    Examples:
        >>> RunningMax(c=0.5).steps(np.array([[0.0, 2.0, 1.0, -4.0]]))
        array([[0., 1., 1., 2.]])
    """

    c: float

    def __post_init__(self) -> None:
        object.__setattr__(self, "c", as_positive("c", self.c))

    def steps(self, scores: FloatArray) -> FloatArray:
        """Return the steps, shape (N, T)."""
        return self.c * _rolling_max(np.abs(scores), scores.shape[1])

    def stepper(self) -> Stepper:
        """Return the state of the rule: one number."""
        return GreatestEver(self.c)


@dataclass(frozen=True, kw_only=True, slots=True)
class TrailingMax(StepRule):
    r"""A share of the greatest of the last ``window`` scores: UNSAFE, kept to show the failure.

    $$\eta_t = c \max(|s_{t-w+1}|, \dots, |s_t|)$$

    Another reading of the paper's $\hat B_t$, and one for which no guarantee holds. As soon as a
    great score leaves the window the steps up shrink and those down, made before, stay: the
    threshold can be frozen below zero, where even a perfect forecast (score 0) is a miss.

    Args:
        c: The share [-], > 0.
        window: The number of scores that count [steps], >= 1, this event's included.

    Examples:
        A great score, a small one, then nothing but perfect forecasts. The miss of the first lifts
        the threshold by (1 - alpha) c, and each covered score lowers it by alpha c, to zero (a
        tie, covered), and once more, by a share of the small one. The steps back up are shares of
        scores that are all zero by then: every forecast is rejected, for ever.

        >>> from cpl.conformal import track
        >>> scores = [1.0, 0.5] + [0.0] * 98
        >>> q, err = track(scores, TrailingMax(c=1.0, window=8), alpha=0.125)
        >>> float(q[9]), bool((q[9:] == q[9]).all()), bool(err[9:].all())
        (-0.0625, True, True)

        The running maximum keeps its step, and errs once in eight times, as it should:

        >>> float(track(scores, RunningMax(c=1.0), alpha=0.125).err[10:90].mean())
        0.125
    """

    c: float
    window: int

    def __post_init__(self) -> None:
        object.__setattr__(self, "c", as_positive("c", self.c))
        object.__setattr__(self, "window", as_integer("window", self.window, minimum=1))

    def steps(self, scores: FloatArray) -> FloatArray:
        """Return the steps, shape (N, T)."""
        return self.c * _rolling_max(np.abs(scores), self.window)

    def stepper(self) -> Stepper:
        """Return the state of the rule: at most ``window`` numbers."""
        return GreatestLately(self.c, self.window)


@dataclass(frozen=True, kw_only=True, slots=True)
class TrailingRange(StepRule):
    r"""A share of the range of the ``window`` scores before this event's, as in the PID code.

    $$\eta_0 = \mathrm{lr}, \qquad
      \eta_t = \mathrm{lr}\,\bigl(\max - \min\bigr)(s_{\max(t-w, 0)}, \dots, s_{t-1})$$

    The convention of the public code of Angelopoulos, Candes and Tibshirani (2023), number for
    number: this event's score is excluded, so the step of event 1 is always zero (the range of
    one number), and the first step is ``lr`` itself, which has the unit of a score only by
    convention.

    With a delay their code measures the range up to the newest score, one that is not known yet
    in the sense used here; ours ends where the event's does, so that the two agree at delay 1.

    There is no guarantee: constant scores have no range, and the threshold freezes wherever it
    is, if need be at 100 % error.

    Args:
        lr: The share, and the first step, > 0.
        window: The number of scores that count [steps], >= 1.

    Examples:
        >>> TrailingRange(lr=0.5, window=2).steps(np.array([[1.0, 3.0, 4.0, 4.0, 4.0]]))
        array([[0.5, 0. , 1. , 0.5, 0. ]])

        The score 2, always: the first miss lifts q by (1 - alpha) lr, and that was all.

        >>> from cpl.conformal import track
        >>> q, err = track([2.0] * 100, TrailingRange(lr=0.5, window=20), alpha=0.1)
        >>> float(q[-1]), float(err.mean())
        (0.45, 1.0)
    """

    lr: float
    window: int

    def __post_init__(self) -> None:
        object.__setattr__(self, "lr", as_positive("lr", self.lr))
        object.__setattr__(self, "window", as_integer("window", self.window, minimum=1))

    def steps(self, scores: FloatArray) -> FloatArray:
        """Return the steps, shape (N, T)."""
        steps = np.empty_like(scores)
        steps[:, :1] = self.lr
        before = np.ascontiguousarray(scores[:, :-1])
        spread = _rolling_max(before, self.window) + _rolling_max(-before, self.window)
        np.multiply(spread, self.lr, out=steps[:, 1:])
        return steps

    def stepper(self) -> Stepper:
        """Return the state of the rule: at most twice ``window`` numbers."""
        return RangeBefore(self.lr, self.window)


@dataclass(frozen=True, kw_only=True, slots=True)
class Decaying(StepRule):
    r"""A step that shrinks with the number of events.

    $$\eta_t = c\,(t + 1)^{-p}$$

    Angelopoulos, Barber and Bates (2024) take p = 1/2 + epsilon: the long-run error is alpha on
    any bounded sequence, with a bound of order 1 / (T eta_T), and on iid scores the threshold
    converges. What is lost is the reaction to a shift that comes late, and from p = 1 on the
    bound as well.

    Args:
        c: The first step [score], > 0.
        power: The exponent p [-], > 0.

    Examples:
        >>> Decaying(c=1.0, power=0.5).steps(np.zeros((1, 4))).round(3)
        array([[1.   , 0.707, 0.577, 0.5  ]])
    """

    c: float
    power: float

    def __post_init__(self) -> None:
        object.__setattr__(self, "c", as_positive("c", self.c))
        object.__setattr__(self, "power", as_positive("power", self.power))

    def steps(self, scores: FloatArray) -> FloatArray:
        """Return the steps, shape (1, T)."""
        steps = np.empty((1, scores.shape[1]))
        _kernels.decay(self.c, self.power, steps[0])
        return steps

    def stepper(self) -> Stepper:
        """Return the state of the rule: the number of events."""
        return Decay(self.c, self.power)


@dataclass(frozen=True, slots=True)
class PI:
    r"""A step rule and the saturated integral of the errors: the P and the I of conformal PID.

    $$p_{t+1} = p_t + \eta_t (\mathrm{err}_t - \alpha), \qquad
      q_{t+1} = p_{t+1} + K_I \tan\Bigl(\frac{x_t \log(t+1)}{C_{sat}\,(t+1)}\Bigr)$$

    with $\tan$ taken as $\pm\infty$ from $\pm\pi/2$ on. Angelopoulos, Candes and Tibshirani
    (2023). The integral is $x_t = \sum_{i < t} (\mathrm{err}_i - \alpha)$ with ``lag=1``, as in
    their public code, number for number: the newest error is not in it yet. With ``lag=0`` it is
    $\sum_{i \le t}$, the form of their text, and the one for which the bound on the error holds.
    Infinite thresholds are part of the rule: all or nothing is covered until the sum recovers.

    With a delay h, t counts the events fed back, and the sum given is of q_{t+h}.

    Args:
        rule: The step rule, positional.
        K_I: The gain of the integral [score], >= 0; zero leaves the step rule alone.
        C_sat: The saturation [-], > 0: the integral becomes infinite at an error sum of
            C_sat (t+1) pi / (2 log(t+1)).
        lag: 1 as in the public code, 0 as in the text.

    Raises:
        ValueError: If a number is out of range, or ``rule`` is no step rule.

    Examples:
        >>> from cpl.conformal import track
        >>> q, _ = track([1.0, 1.0, 1.0], PI(Fixed(eta=0.1), K_I=1.0, C_sat=1.0), alpha=0.1)
        >>> p2, x1 = 0.18, 0.9                              # after two misses; one in the sum
        >>> bool(np.isclose(q[2], p2 + np.tan(x1 * np.log(2) / 2)))
        True
    """

    rule: StepRule
    _: KW_ONLY
    K_I: float
    C_sat: float
    lag: int = 1

    def __post_init__(self) -> None:
        if not isinstance(self.rule, StepRule):  # pyright: ignore[reportUnnecessaryIsInstance]
            msg = f"rule must be a step rule such as Fixed(eta=0.05), got {self.rule!r}"
            raise ValueError(msg)
        object.__setattr__(self, "K_I", as_positive("K_I", self.K_I, or_zero=True))
        object.__setattr__(self, "C_sat", as_positive("C_sat", self.C_sat))
        object.__setattr__(self, "lag", as_integer("lag", self.lag, minimum=0))
        if self.lag > 1:
            msg = f"lag must be 0 or 1, got {self.lag!r}"
            raise ValueError(msg)


Rule: TypeAlias = StepRule | PI | StateRule


def as_rule(value: object) -> Rule:
    """Return a rule; anything else is refused."""
    if not isinstance(value, StepRule | PI | StateRule):
        msg = f"rule must be a rule such as Fixed(eta=0.05), got {value!r}"
        raise ValueError(msg)
    return value


def _rolling_max(rows: FloatArray, window: int) -> FloatArray:
    out = np.empty_like(rows)
    # A window longer than the rows is the rows' length: no int64 can overflow in the kernel.
    _kernels.rolling_max(rows, max(min(window, rows.shape[1]), 1), out)
    return out
