"""In what does one policy differ from another, run by run on the same noise?"""

from __future__ import annotations

from collections.abc import Mapping
from itertools import combinations
from typing import Any

import numpy as np
import pandas as pd
from numpy.typing import ArrayLike

from cpl.quadruped.permutation import sign_flip
from cpl.rng import stream
from cpl.stats import mean_interval

__all__ = ["compare", "comparisons", "effects", "reversals"]

PAIR = ("shape", "range", "repeat")


def compare(
    scored: pd.DataFrame,
    value: str,
    rng: np.random.Generator,
    *,
    treated: str = "paper",
    control: str = "no_quantile",
) -> pd.DataFrame:
    """Compare two policies in pairs that share shape, range and noise.

    Args:
        scored: What `score_runs` returned.
        value: The number that is compared.
        rng: For the permutation tests of more than 20 pairs.
        treated: The policy.
        control: The policy it is compared with.

    Returns:
        One row a shape and range, and one a range for all shapes together, which is the stratified
        test: `range`, `shape`, `n`, `treated`, `control` (means), `difference`, `p` (exact sign
        flips), `least_p`, `better` (share of pairs in which the treated one is lower) and
        `reversed_by_3` (see `reversals`, over repeats). Empty if there is no pair.
    """
    wide = scored.pivot_table(index=list(PAIR), columns="policy", values=value, aggfunc="first")
    columns = ["range", "shape", "n", "treated", "control", "difference", "p", "least_p", "better"]
    if not {treated, control} <= set(wide.columns):
        return pd.DataFrame(columns=[*columns, "reversed_by_3"])
    pairs = wide.dropna(subset=[treated, control]).reset_index()
    groups: list[tuple[str, str, pd.DataFrame]] = []
    for gains, of_range in pairs.groupby("range"):
        groups += [(str(gains), str(shape), part) for shape, part in of_range.groupby("shape")]
        groups.append((str(gains), "all", of_range))
    rows: list[dict[str, Any]] = []
    for gains, shape, part in groups:
        difference = (part[treated] - part[control]).to_numpy(dtype=np.float64)
        test = sign_flip(difference, rng)
        told = (gains, shape, test.n, part[treated].mean(), part[control].mean(), test.value)
        row = dict(zip(columns, (*told, test.p, test.least_p), strict=False))
        row["better"] = float((difference < 0).mean())
        of_repeat = np.bincount(pd.factorize(part["repeat"])[0], weights=difference)
        row["reversed_by_3"] = reversals(of_repeat, 3)
        rows.append(row)
    return pd.DataFrame(rows, columns=[*columns, "reversed_by_3"])


def comparisons(scored: pd.DataFrame, values: Mapping[str, str], seed: int) -> pd.DataFrame:
    """Compare the paper's two policies in several numbers.

    Args:
        scored: What `score_runs` returned.
        values: Column by what it is called.
        seed: Draws the sign patterns where there are too many to count.

    Returns:
        The rows of `compare`, with `what` in front.
    """
    parts = [
        compare(scored, value, stream(seed, "compare", value)).assign(what=what)
        for what, value in values.items()
    ]
    told = pd.concat([part for part in parts if len(part)] or parts[:1], ignore_index=True)
    return told.reindex(columns=["what", *(name for name in told if name != "what")])


def reversals(differences: ArrayLike, repeats: int) -> float:
    """Return how often so few repeats would have shown the other sign than all of them do.

    Args:
        differences: One per pair, shape (n,).
        repeats: Size of the small experiment; the paper's 3.

    Returns:
        The share of all choices of that many pairs, counted exactly; NaN if there are too few.

    Three of four: 5, 5, 1 and 5, 5, -9 keep the sign of the whole, the two with one 5 turn it:

    >>> reversals([5.0, 5.0, 1.0, -9.0], 3)
    0.5
    """
    d = np.asarray(differences, dtype=np.float64)
    if len(d) < repeats:
        return float("nan")
    sign = np.sign(d.sum())
    sums = [sum(chosen) for chosen in combinations(d.tolist(), repeats)]
    return float((np.sign(sums) == -sign).mean())


def effects(
    scored: pd.DataFrame, value: str, *, treated: str = "paper", control: str = "no_quantile"
) -> pd.DataFrame:
    """Return what the treated policy changes, with intervals, and whether it changes more out.

    Args:
        scored: What `score_runs` returned.
        value: The number that is compared.
        treated: The policy.
        control: The policy it is compared with, on the same noise.

    Returns:
        One row a shape (and `all`) and part: `shape`, `part` (`in`, `out`, and `out - in`, the
        interaction, paired by repeat), `value` (mean difference, treated minus control), `low`,
        `high` (95 %, Student) and `n` pairs. Parts with fewer than two pairs are left out.
    """
    wide = scored.pivot_table(index=list(PAIR), columns="policy", values=value, aggfunc="first")
    found: list[dict[str, Any]] = []
    columns = ["shape", "part", "value", "low", "high", "n"]
    if not {treated, control} <= set(wide.columns):
        return pd.DataFrame(columns=columns)
    change = (wide[treated] - wide[control]).dropna()
    pairs = pd.DataFrame({"change": change}).reset_index()
    change = pairs.pivot_table(index=["shape", "repeat"], columns="range", values="change")
    for shape in ["all", *sorted(set(pairs["shape"]))]:
        part = change if shape == "all" else change.xs(shape, level="shape")
        parts = {str(gains): part[gains].dropna() for gains in part}
        if {"in", "out"} <= set(part):
            parts["out - in"] = (part["out"] - part["in"]).dropna()
        for name, differences in parts.items():
            if len(differences) < 2:
                continue
            told = mean_interval(differences.tolist())
            ends = {"value": told.value, "low": told.low, "high": told.high, "n": told.n}
            found.append({"shape": shape, "part": name} | ends)
    return pd.DataFrame(found, columns=columns)
