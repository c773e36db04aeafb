"""What the rules of the theory share: certificates, counts, and the verdict on an erratum."""

from dataclasses import replace

from cpl.claims.claim import Reader
from cpl.claims.verdict import Finding, Verdict
from cpl.stats import proportion

__all__ = ["certified", "counted", "decided", "erratum"]


def certified(read: Reader, *names: str) -> bool:
    """Say whether z3 proved (or found, for a counterexample) all the named certificates."""
    table = read("certificates")
    good = {"proof": "proved", "counterexample": "found"}
    answers = zip(table["name"], table["kind"], table["verdict"], strict=True)
    fine = {name for name, kind, verdict in answers if verdict == good[kind]}
    return set(names) <= fine


def decided(fine: bool, n: int, enough: int) -> Verdict:
    """Return *does not hold* for one failure, and *undecided* for too few tries."""
    if not fine:
        return Verdict.FAILS
    return Verdict.HOLDS if n >= enough else Verdict.UNDECIDED


def erratum(false_as_printed: bool, true_as_corrected: bool, n: int, enough: int) -> Verdict:
    """Return the verdict on a statement that is thought to be a misprint."""
    if not true_as_corrected:
        return Verdict.FAILS
    if n < enough:
        return Verdict.UNDECIDED
    return Verdict.CORRECTED if false_as_printed else Verdict.HOLDS


def counted(verdict: Verdict, hits: int, n: int, *, seeds: int) -> Finding:
    """Return a finding whose number is a share of what was counted."""
    share = proportion(hits, n)
    return replace(Finding.of(verdict, share, n=n), n_seeds=seeds)
