"""What the simulated quadruped shows of the claims that need the robot: rows 42 to 49.

Their verdict is *needs hardware* and no simulation changes it. What is computed here stands beside
it, in a column of its own and in words that no verdict uses: whether the twin leans the way the
paper's robot did, and by how much. Intervals are 95 %, over pairs of runs or over resampled runs.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np

from cpl.claims._reading import Reader, Source
from cpl.stats import Estimate

__all__ = ["IN_THE_TWIN", "Leaning", "combined"]

FOLDER = "quadruped"  # the kinematic twin's logs: the ones with enough runs to say something
LEGGED = "quadruped-legged"
MOST_WINDOWS = 0.95  # "the coverage is higher": in so many windows it would count as true

WHERE = {"in": "in distribution", "out": "out of it"}
AS = "as claimed"
PART = "as claimed in part"
NOT = "not as claimed"
OPEN = "undecided"


@dataclass(frozen=True, kw_only=True)
class Leaning:
    """What a twin shows of a claim about the robot.

    Attributes:
        leans: ``as claimed``, ``as claimed in part``, ``not as claimed`` or ``undecided``.
        text: The numbers.
    """

    leans: str
    text: str

    def __str__(self) -> str:
        return f"{self.leans}: {self.text}"


def combined(parts: Sequence[str]) -> str:
    """Put the parts of a claim together: all, some, none of them, or nobody knows.

    Examples:
        >>> combined(["as claimed", "undecided"]), combined(["undecided", "not as claimed"])
        ('as claimed in part', 'not as claimed')
    """
    if not parts:
        msg = f"parts must not be empty, got {parts!r}"
        raise ValueError(msg)
    if set(parts) == {AS}:
        return AS
    if AS in parts:
        return PART
    return NOT if NOT in parts else OPEN


def _better(read: Reader) -> Leaning:
    logs = read("quadruped_logs")
    parts = {part: _told(logs, 42, "start_end_m", "all", part) for part in ("in", "out")}
    text = "start to end " + _both(parts, "m")
    if LEGGED in logs["folder"]:
        legs = {
            part: _told(logs, 42, "start_end_m", "all", part, folder=LEGGED)
            for part in ("in", "out")
        }
        text += "; with legs " + _both(legs, "m")
    return Leaning(leans=combined([_side(each, below=0.0) for each in parts.values()]), text=text)


def _easy(read: Reader) -> Leaning:
    logs = read("quadruped_logs")
    inside, more = (_told(logs, 43, "start_end_m", "triangle", part) for part in ("in", "out - in"))
    similar = AS if inside.low <= 0 <= inside.high else NOT
    text = f"difference in distribution {_number(inside, 'm')}, more of it out {_number(more, 'm')}"
    # That an interval holds 0 shows nothing by itself; it counts only beside a larger gap out.
    gap = _side(more, below=0.0)
    return Leaning(leans=combined([similar, gap]) if gap == AS else gap, text=text)


def _hard(read: Reader) -> Leaning:
    logs = read("quadruped_logs")
    out, more = (_told(logs, 44, "start_end_m", "hexagon", part) for part in ("out", "out - in"))
    text = f"difference out {_number(out, 'm')}, more than in distribution by {_number(more, 'm')}"
    return Leaning(leans=combined([_side(out, below=0.0), _side(more, below=0.0)]), text=text)


def _medium(read: Reader) -> Leaning:
    logs = read("quadruped_logs")
    inside = _told(logs, 45, "start_end_m", "rectangle", "in")
    auc = {
        shape: _told(logs, 45, "auc", shape, "in") for shape in ("triangle", "rectangle", "hexagon")
    }
    brier = _told(logs, 45, "brier", "rectangle", "in")
    here, others = auc["rectangle"], [auc["triangle"], auc["hexagon"]]
    poor = OPEN
    if here.high < min(each.low for each in others):
        poor = AS
    elif here.low > min(each.high for each in others):
        poor = NOT
    text = (
        f"difference in distribution {_number(inside, 'm')}; AUC of the predictor there "
        f"{here.value:.3f}, on the triangle {auc['triangle'].value:.3f}, on the hexagon "
        f"{auc['hexagon'].value:.3f}; Brier score there {brier.value:.3f}"
    )
    return Leaning(leans=combined([_side(inside, below=0.0), poor]), text=text)


def _time(read: Reader) -> Leaning:
    logs = read("quadruped_logs")
    cells = [(shape, part) for shape in ("triangle", "rectangle") for part in ("in", "out")]
    longer = {cell: _told(logs, 46, "duration_s", *cell) for cell in cells}
    faster = _told(logs, 46, "duration_s", "hexagon", "out")
    alarms = _told(logs, 46, "false_positive_rate", "hexagon", "out")
    leans = [_side(each, above=0.0) for each in longer.values()] + [_side(faster, below=0.0)]
    more = sum(each.low > 0 for each in longer.values())
    text = (
        f"longer on triangle and rectangle in {more} of {len(cells)} cells; hexagon out "
        f"{_number(faster, 's')}, where the predictor gives a false alarm in {alarms.value:.1%} of "
        "the steps that no error follows"
    )
    return Leaning(leans=combined(leans), text=text)


def _coverage(read: Reader) -> Leaning:
    logs = read("quadruped_logs")
    parts = {part: _told(logs, 47, "windows_reached", "hexagon", part) for part in ("in", "out")}
    chance = _told(logs, 47, "both_by_chance", "all", "all").value
    leans = [_side(each, above=MOST_WINDOWS) for each in parts.values()]
    shares = ", ".join(
        f"{each.value:.0%} ({each.low:.0%} to {each.high:.0%}) {WHERE[part]}"
        for part, each in parts.items()
    )
    text = (
        f"on the hexagon the windows at 0.8 or above are {shares}; two runs of one window "
        f"each reach it by chance in {chance:.0%}"
    )
    return Leaning(leans=combined(leans), text=text)


def _odds(read: Reader) -> Leaning:
    logs = read("quadruped_logs")
    names = {"0.1 m/s faster": "0.1 m/s more", "0.1 rad/s more turning": "0.1 rad/s more turning"}
    motion = {text: _told(logs, 48, name, "all", "all") for name, text in names.items()}
    paths = {name: _told(logs, 48, name, "all", "all") for name in ("rectangle", "hexagon")}
    differ = any(each.low > 1 or each.high < 1 for each in paths.values())
    leans = [_side(each, above=1.0) for each in motion.values()] + [AS if differ else OPEN]
    told = [f"{name} {_ratio(each)}" for name, each in (motion | paths).items()]
    text = "odds of an error times " + ", ".join(told) + " (paths against the triangle)"
    return Leaning(leans=combined(leans), text=text)


def _rule(read: Reader) -> Leaning:
    collected = read("quadruped_collect").parameters
    weight = read("quadruped_predictor").parameters["positive_weight"]
    stated = (collected["trajectories"], collected["kp"], weight)
    logs = read("quadruped_logs")
    true, none, excess = (
        _told(logs, 49, number, "all", "all") for number in ("true", "none", "excess")
    )
    helps = _side(excess, below=0.0)
    text = (
        f"trained on {stated[0]} paths with kp = {stated[1]:g} and weight {stated[2]:g}; an error "
        f"follows {true.value:.0%} of the alarms that the rule would overrule and {none.value:.0%} "
        f"of the steps without alarm (difference {_number(excess, '')})"
    )
    return Leaning(leans=helps if stated == (43, 1.5, 5.0) else OPEN, text=text)


IN_THE_TWIN: dict[int, Callable[[Reader], Leaning]] = {
    42: _better,
    43: _easy,
    44: _hard,
    45: _medium,
    46: _time,
    47: _coverage,
    48: _odds,
    49: _rule,
}
"""What the twin shows, by row; it never is a verdict."""


def _told(
    logs: Source, row: int, number: str, shape: str, part: str, *, folder: str = FOLDER
) -> Estimate:
    """Return one number of the table, which must hold it exactly once."""
    wanted = {"folder": folder, "row": row, "number": number, "shape": shape, "part": part}
    chosen = np.ones(len(logs), dtype=bool)
    for name, value in wanted.items():
        chosen &= logs[name] == value
    found = logs.where(chosen)
    if len(found) != 1:
        msg = f"quadruped_logs must have one row for {wanted}, got {len(found)}"
        raise ValueError(msg)
    value, low, high = (float(found[name][0]) for name in ("value", "low", "high"))
    return Estimate(value=value, low=low, high=high, n=int(found["n"][0]))


def _side(told: Estimate, *, below: float | None = None, above: float | None = None) -> str:
    """Say whether an interval lies on the claimed side of a level, on the other, or across it."""
    level = below if above is None else above
    if level is None:
        msg = f"one of below and above must be given, got {below!r} and {above!r}"
        raise ValueError(msg)
    under, over = told.high < level, told.low > level
    if under or over:
        return AS if under == (above is None) else NOT
    return OPEN


def _both(parts: dict[str, Estimate], unit: str) -> str:
    return ", ".join(f"{_number(each, unit)} {WHERE[part]}" for part, each in parts.items())


def _number(told: Estimate, unit: str) -> str:
    return f"{told.value:+.2f}{' ' * bool(unit)}{unit} ({told.low:+.2f} to {told.high:+.2f})"


def _ratio(told: Estimate) -> str:
    return f"{told.value:.2f} ({told.low:.2f} to {told.high:.2f})"
