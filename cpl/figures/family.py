"""The family: thresholds side by side, and what the policies did."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
import pandas as pd
from numpy.typing import ArrayLike

from cpl.conformal.family import MEMBERS
from cpl.figures.style import Card, card, drawn, span
from cpl.rng import stream
from cpl.stats import Estimate, hierarchical_weights
from cpl.stats.matched import Ratio, apart, beside_curve, ratio

__all__ = ["at_equal_speed", "effect", "excess", "followed", "in_words", "rates"]

_HUES = ("C0", "C1", "C2", "C3", "C4")
_DASHES = ("-", "--", "-.", ":", (0, (3, 1, 1, 1)))
_NAMED = ("eci", "saocp")  # the members at the ends; the others lie between them
_PLACES = {  # where names would meet
    **dict.fromkeys(("near misses", "pi_speed", "EWMA tuned"), ((-5, -3), "right")),
    **dict.fromkeys(("quantile", "costly near misses"), ((0, -12), "center")),
    "donor quantile": ((6, -6), "left"),
}


@drawn
def followed(scores: ArrayLike, paths: Mapping[str, ArrayLike], *, start: int, end: int) -> Card:
    """Scores as dots, and the thresholds of a few members over them.

    Args:
        scores: Shape (T,).
        paths: Thresholds by member, each (T,); infinite ones leave the picture.
        start: Where the world changes.
        end: Where it is as it was.
    """
    figure, axes = card(height=3.8)
    values = np.asarray(scores)
    axes.plot(values, ".", color="0.7", markersize=2, label="score")
    top = 1.6 * float(np.quantile(values, 0.99))
    for (name, path), hue, dash in zip(paths.items(), _HUES, _DASHES, strict=False):
        shown = np.clip(np.asarray(path), -0.2 * top, top)
        axes.step(
            np.arange(values.size), shown, where="post", color=hue, linestyle=dash, label=name
        )
    span(axes, start, end, "another world")
    axes.set_ylim(-0.2 * top, top)
    axes.set_xlabel("time step t")
    axes.set_ylabel("score, threshold")
    axes.legend(loc="upper left", ncols=3, frameon=False, fontsize="small")
    return figure


def rates(streams: pd.DataFrame, *keys: str) -> pd.DataFrame:
    """Sum `gate_family` up: crash rate, mean speed, coverage and mean margin by some keys."""
    sums = ["episodes", "crashes", "steps", "speed_sum", "scored", "missed", "margin_sum"]
    found = streams.groupby(list(keys), sort=False, as_index=False).agg(dict.fromkeys(sums, "sum"))
    return found.assign(
        crash_rate=found["crashes"] / found["episodes"],
        speed_mps=found["speed_sum"] / found["steps"],
        coverage=1 - found["missed"] / found["scored"].where(found["scored"] > 0),
        margin_m=found["margin_sum"] / found["steps"],
    )


def excess(streams: pd.DataFrame, *methods: str, than: str | None = None) -> dict[str, Estimate]:
    """Return how far methods' crash shares lie above the constants' at their own mean speed.

    The resamples are those of the ledger's rows 54 to 57, so that a page says the same numbers.

    Args:
        streams: One setting of `gate_family`.
        methods: Which methods.
        than: Another method: how much farther above the constants than that one, then.
    """
    curve = _shares(_of(streams, "constant"), "value")
    pairs, units = curve[0].over.shape[:2]
    weights = hierarchical_weights(pairs, units, stream(0, "claims", "gate"))
    each = {name: _shares(_of(streams, name)) for name in methods}
    if than is None:
        return {name: beside_curve(*own, *curve, weights) for name, own in each.items()}
    other = _shares(_of(streams, than))
    return {name: apart(own, other, curve, weights) for name, own in each.items()}


def in_words(gate: pd.DataFrame, switch: pd.DataFrame) -> dict[str, str]:
    """Return the numbers of the loop as a page says them, by name.

    Args:
        gate: The gate's part of `gate_family`.
        switch: The switch's part.
    """
    above = excess(gate, *MEMBERS, "quantile", "oracle")
    by = sorted(MEMBERS, key=lambda name: above[name].value)
    helped = excess(switch, *MEMBERS)
    best = min(MEMBERS, key=lambda name: helped[name].value)
    chosen = {"most": by[0], "least": by[-1], "quantile": "quantile", "oracle": "oracle"}
    rivals = {
        "tuned": "EWMA tuned",
        "ewma": "ewma",
        "rolling": "rolling",
        "donor": "donor quantile",
    }
    apart_from = excess(gate, *rivals.values(), than="quantile")
    found = rates(gate, "method", "value")
    curve = _of(found, "constant").sort_values("value")
    margins, speeds = curve["value"].to_numpy(), curve["speed_mps"].to_numpy()
    gap = int(np.argmin(np.diff(speeds)))
    own = found.loc[found["method"].isin(list(MEMBERS)), "speed_mps"]
    near = found.set_index("method").loc["near misses"]
    return {
        **{f"{name}_who": method for name, method in chosen.items()},
        **{f"{name}_gain": effect(above[method], -1) for name, method in chosen.items()},
        **{f"{name}_apart": effect(apart_from[method]) for name, method in rivals.items()},
        "best_who": best,
        "best_gain": effect(helped[best], -1),
        "below": str(sum(above[name].high < 0 for name in MEMBERS)),
        "members": str(len(MEMBERS)),
        "narrow_margin": f"{margins[gap]:g}",
        "narrow_speed": f"{speeds[gap]:.1f}",
        "wide_margin": f"{margins[gap + 1]:g}",
        "wide_speed": f"{speeds[gap + 1]:.1f}",
        "slowest": f"{own.min():.1f}",
        "fastest": f"{own.max():.1f}",
        "near_crashes": f"{near['crash_rate']:.0%}",
        "near_covered": f"{near['coverage']:.0%}",
        "near_margin": f"{near['margin_m']:.1f}",
    }


def effect(found: Estimate, sign: int = 1) -> str:
    """Write an estimate with its interval.

    Args:
        found: What was estimated.
        sign: -1 turns it round, so that a difference in crashes becomes a gain.

    Examples:
        >>> effect(Estimate(value=-0.05, low=-0.07, high=-0.03, n=5), -1)
        '+0.050 (+0.030 to +0.070)'
    """
    low, high = sorted((sign * found.low, sign * found.high))
    return f"{sign * found.value:+.3f} ({low:+.3f} to {high:+.3f})"


@drawn
def at_equal_speed(streams: pd.DataFrame) -> Card:
    """Crash rate over mean speed: the curve of constants, and everybody else as a point.

    Args:
        streams: One setting of `gate_family`.
    """
    found = rates(streams, "method", "value").set_index("method")
    figure, axes = card(height=4.6)
    line = found.loc["constant"].sort_values("speed_mps")
    axes.plot(line["speed_mps"], line["crash_rate"], "o-", color="0.6", label="constants")
    for hue, mark, label, members in (
        (_HUES[0], "o", "members", True),
        (_HUES[1], "s", "rivals", False),
    ):
        named = (found.index != "constant") & (found.index.isin(list(MEMBERS)) == members)
        points = found[named]
        axes.plot(
            points["speed_mps"], points["crash_rate"], mark, color=hue, markersize=4, label=label
        )
        for name, speed, share in zip(
            points.index, points["speed_mps"], points["crash_rate"], strict=True
        ):
            if not members or name in _NAMED:
                offset, side = _PLACES.get(name, ((5, -3), "left"))
                axes.annotate(
                    name, (speed, share), fontsize="x-small", textcoords="offset points",
                    xytext=offset, ha=side,
                )  # fmt: skip
    axes.set_xlabel("mean speed [m/s]")
    axes.set_ylabel("share of episodes that crash")
    axes.legend(loc="upper left", frameon=False, fontsize="small")
    return figure


def _of(rows: pd.DataFrame, method: str) -> pd.DataFrame:
    return pd.DataFrame(rows[rows["method"] == method])


def _shares(rows: pd.DataFrame, *point: str) -> tuple[Ratio, Ratio]:
    """Crashes an episode, and metres a second, by pair, stream and, for a curve, its point."""
    labels = [rows[name].to_numpy() for name in ("pair", "stream", *point)]
    return (
        ratio(rows["crashes"].to_numpy(), rows["episodes"].to_numpy(), *labels),
        ratio(rows["speed_sum"].to_numpy(), rows["steps"].to_numpy(), *labels),
    )
