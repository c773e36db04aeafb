"""How the claims of the theory and the road are decided: from published tables to a finding.

A rule only counts and compares. It is handed a reader of tables, so that it can be asked what it
would say of other results; the tests corrupt a table and demand another verdict.
"""

from collections.abc import Callable

import numpy as np
from scipy import stats as sp

from cpl.claims._reading import Reader, Source
from cpl.claims._verdicts import Finding, Verdict
from cpl.stats import mean_interval, proportion, split_conformal_law, split_conformal_rank

__all__ = ["RULES"]

_SE = 4.0  # [standard errors] how far chance may go
_NEAR = 1.0  # [m/s] a speed level counts as reached; cars approach it exponentially
_TAIL = 2 * sp.norm.sf(_SE)  # the same as a two-sided probability


def _split_conformal(read: Reader) -> Finding:
    source = read("split_conformal")
    alpha, n = source.parameters["alpha"], source.parameters["n"]
    target = split_conformal_rank(n, alpha) / (n + 1)
    kinds = {kind: source.where(source["kind"] == kind) for kind in sorted(set(source["kind"]))}
    fine = {"independent", "shared level", "urn", "ties"} <= kinds.keys()
    for kind, part in kinds.items():
        draws = part.total("draws")
        off = part.total("covered") / draws - target
        allowed = _SE * np.sqrt(target * (1 - target) / draws)
        # With ties more is covered, never less.
        fine &= draws >= 100_000 and (off >= -allowed if kind == "ties" else abs(off) <= allowed)
        fine &= kind in ("urn", "ties") or _follows_beta(part, n, alpha)
    # The coverage given the calibration scores is less noisy than counting covered test scores.
    exact = source.where((source["kind"] == "independent") | (source["kind"] == "shared level"))
    mean = float(exact["coverage_sum"].sum() / exact.total("draws"))
    error = split_conformal_law(n, alpha).std() / np.sqrt(exact.total("draws"))
    half = float(sp.norm.ppf(0.975) * error)
    return Finding(
        verdict=Verdict.HOLDS if fine else Verdict.FAILS,
        value=mean,
        low=mean - half,
        high=mean + half,
        n=source.total("draws"),
        n_seeds=1,
    )


def _follows_beta(part: Source, n: int, alpha: float) -> bool:
    """Compare mean, variance and shape of the coverage with the Beta law, from sums."""
    law, draws = split_conformal_law(n, alpha), part.total("draws")
    mean, variance, excess = (float(moment) for moment in law.stats(moments="mvk"))
    average = part["coverage_sum"].sum() / draws
    spread = part["coverage_sumsq"].sum() / draws - average**2
    cells = [part.total(name) for name in part.table.columns if name.startswith("pit_")]
    return bool(
        abs(average - mean) <= _SE * np.sqrt(variance / draws)
        and abs(spread - variance) <= _SE * variance * np.sqrt((excess + 2) / draws)
        and sum(cells) == draws
        and sp.chisquare(cells).pvalue >= _TAIL
    )


def _pathwise(read: Reader) -> Finding:
    paths = read("pathwise")
    final = paths.where(paths["T"] == paths["T"].max())
    sequences, broken = final.total("sequences"), paths.total("above", "below")
    within = np.maximum(abs(paths["largest"]), abs(paths["smallest"])) < paths["bound"]
    near = abs(final["mean_error"] - final["alpha"]) < final["bound"] / final["T"]
    fine = broken == 0 and bool(within.all()) and bool(near.all())
    return _counted(_decided(fine, sequences, 10_000), min(broken, sequences), sequences, seeds=1)


def _miscoverage(read: Reader) -> Finding:
    runs = read("miscoverage")
    points = runs.total("points")
    wrong = int(np.maximum(runs["wrong_report"], runs["wrong_set"]).sum())
    # A tracker that never met a tie, or never missed, would not have been tested.
    tried = bool((runs["ties"] > 0).all() and (runs["misses"] > 0).all())
    return _counted(_decided(wrong == 0, points if tried else 0, 1), wrong, points, seeds=1)


def _theorem(read: Reader) -> Finding:
    settings = read("windows")
    windows, printed = settings.total("windows"), settings.total("printed")
    true = settings.total("corrected", "beyond_exact") == 0 and _certified(
        read, "window bound is strict and two-sided", "telescoping equality"
    )
    example = settings.where(settings["origin"] == "counterexample")
    false = example.total("printed") > 0 and _certified(read, "printed window of Theorem 1 fails")
    return _counted(_erratum(false, true, windows, 1_000_000), printed, windows, seeds=1)


def _range(read: Reader) -> Finding:
    settings = read("quantile_range")
    inside = (settings["q_min"] >= settings["low"]) & (settings["q_max"] < settings["high"])
    true = bool(inside.all()) and not settings["leaves"].any()
    prompt = settings.where(settings["delay"] == 1)  # the paper's own setting
    too_low, too_high = prompt["leaves_printed_low"], prompt["leaves_printed_high"]
    true = true and _certified(read, "range of the quantile")
    false = bool(too_low.any() and too_high.any()) and _certified(
        read, "printed upper end of the range fails", "printed lower end of the range fails"
    )
    left, n = int((too_low | too_high).sum()), len(prompt)
    return _counted(_erratum(false, true, n, 100), left, n, seeds=1)


def _update(read: Reader) -> Finding:
    runs = read("update_rule")
    deviation = runs["errors"] / runs["T"] - runs["alpha"]
    bound = (1 / runs.parameters["eta"] + 1) / runs["T"]  # Theorem 1 with B = 1, as a rate
    nearer = abs(deviation) < abs(deviation + 2 * runs["alpha"] - 1)  # to alpha than to 1 - alpha
    corrected = runs["rule"] == "corrected"
    true = bool(((abs(deviation) < bound) & nearer)[corrected].all()) and _certified(
        read,
        "mean error is near alpha, not 1 - alpha",
        "corrected update descends the quantile loss",
    )
    false = bool((abs(deviation) > bound)[~corrected].all()) and _certified(
        read, "printed update absorbs misses"
    )
    estimate = mean_interval(deviation[corrected])
    return Finding(
        verdict=_erratum(false, true, estimate.n, 30),
        value=estimate.value,
        low=estimate.low,
        high=estimate.high,
        n=estimate.n,
        n_seeds=1,
    )


def _adaptive(read: Reader) -> Finding:
    runs = read("adaptive_step")
    running = runs.where(runs["reading"] == "running")
    trailing = runs.where(runs["reading"] == "trailing")
    safe = running.total("violations") == 0 and bool((running["ratio"] <= 1 + 1e-12).all())
    safe = safe and _certified(read, "running maximum")
    too_many = trailing["error_rate"] > trailing["alpha"] + 0.02
    unsafe = bool(((trailing["violations"] > 0) & too_many).all()) and _certified(
        read, "trailing maximum can freeze below zero"
    )
    verdict = Verdict.FAILS if not safe else Verdict.IN_PART if unsafe else Verdict.HOLDS
    return Finding(
        verdict=verdict,
        value=float(running["ratio"].max()),
        low=None,
        high=None,
        n=running.total("windows"),
        n_seeds=1,
    )


def _two_sided(read: Reader) -> Finding:
    settings = read("windows")
    below, n = settings.total("lower"), settings.total("windows")
    fine = below + read("pathwise").total("below") == 0 and _certified(
        read, "window bound is strict and two-sided", "lower worst case is attained"
    )
    return _counted(_decided(fine, n, 1_000_000), below, n, seeds=1)


def _corollary(read: Reader) -> Finding:
    processes = read("eventually_safe")
    broken, safe = processes.total("violations"), processes.total("safe")
    bounded = processes.where(processes["condition"] == "bounded")
    unbounded = processes.where(processes["condition"] == "unbounded")
    fine = (
        broken == 0
        and bool((processes["ratio"] < 1).all())
        and bounded.total("safe") == bounded.total("processes") > 0
        and bool((unbounded["unsafe_broken"] > 0).all())  # else nothing would depend on safety
        and _certified(
            read,
            "window bound under an eventually safe policy",
            "bounded scores are eventually safe",
        )
    )
    return _counted(_decided(fine, safe, 1_000), broken, safe, seeds=0)


def _road(read: Reader) -> Finding:
    throttle = read("speed_cap")
    as_stated = bool(
        (throttle["lanes_count"] == 4).all() and (throttle["vehicles_count"] == 50).all()
    )
    tops = np.unique(throttle["top_mps"])
    reached = [throttle.where(throttle["top_mps"] == top)["speed_mps"].max() for top in tops]
    possible = [speed >= top - _NEAR for speed, top in zip(reached, tops, strict=True)]
    some = Verdict.IN_PART if any(possible) else Verdict.FAILS
    return Finding(
        verdict=Verdict.HOLDS
        if all(possible) and as_stated
        else some
        if as_stated
        else Verdict.FAILS,
        value=float(reached[-1]),
        low=None,
        high=None,
        n=len(throttle),
        n_seeds=0,
    )


def _proximity(read: Reader) -> Finding:
    grid = read("proximity")
    l_tilde = grid["l_tilde"][np.argsort(grid["l_m"])]
    inside = bool((l_tilde > 0).all() and (l_tilde <= 1).all() and l_tilde[0] == 1)
    falls = bool((np.diff(l_tilde) < 0).all())
    return Finding(
        verdict=Verdict.HOLDS if inside and falls else Verdict.FAILS,
        value=float(l_tilde.max()),
        low=float(l_tilde.min()),
        high=float(l_tilde.max()),
        n=len(grid),
        n_seeds=0,
    )


RULES: dict[int, Callable[[Reader], Finding]] = {
    1: _split_conformal,
    2: _pathwise,
    3: _miscoverage,
    4: _theorem,
    5: _range,
    6: _update,
    7: _adaptive,
    8: _two_sided,
    9: _corollary,
    15: _road,
    16: _proximity,
}
"""The rules by row; a row without one is pending, or needs hardware."""


def _certified(read: Reader, *names: str) -> bool:
    """Say whether z3 proved (or found, for a counterexample) all the named certificates."""
    table = read("certificates")
    good = {"proof": "proved", "counterexample": "found"}
    answers = zip(table["name"], table["kind"], table["verdict"], strict=True)
    fine = {name for name, kind, verdict in answers if verdict == good[kind]}
    return set(names) <= fine


def _decided(fine: bool, n: int, enough: int) -> Verdict:
    """Return *does not hold* for one failure, and *undecided* for too few tries."""
    if not fine:
        return Verdict.FAILS
    return Verdict.HOLDS if n >= enough else Verdict.UNDECIDED


def _erratum(false_as_printed: bool, true_as_corrected: bool, n: int, enough: int) -> Verdict:
    if not true_as_corrected:
        return Verdict.FAILS
    if n < enough:
        return Verdict.UNDECIDED
    return Verdict.CORRECTED if false_as_printed else Verdict.HOLDS


def _counted(verdict: Verdict, hits: int, n: int, *, seeds: int) -> Finding:
    share = proportion(hits, n)
    return Finding(
        verdict=verdict,
        value=share.value,
        low=share.low,
        high=share.high,
        n=n,
        n_seeds=seeds,
    )
