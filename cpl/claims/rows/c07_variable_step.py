"""Row 7: with the step 0.1 B_hat_t a guarantee is trivial."""

from cpl.claims.claim import Claim, Reader
from cpl.claims.rows._theory import certified
from cpl.claims.verdict import Finding, Verdict

__all__ = ["CLAIM"]


def _decide(read: Reader) -> Finding:
    runs = read("adaptive_step")
    running = runs.where(runs["reading"] == "running")
    trailing = runs.where(runs["reading"] == "trailing")
    safe = running.total("violations") == 0 and bool((running["ratio"] <= 1 + 1e-12).all())
    safe = safe and certified(read, "running maximum")
    too_many = trailing["error_rate"] > trailing["alpha"] + 0.02
    unsafe = bool(((trailing["violations"] > 0) & too_many).all()) and certified(
        read, "trailing maximum can freeze below zero"
    )
    verdict = Verdict.FAILS if not safe else Verdict.IN_PART if unsafe else Verdict.HOLDS
    return Finding(
        verdict=verdict,
        value=float(running["ratio"].max()),
        n=running.total("windows"),
        n_seeds=1,
    )


CLAIM = Claim(
    row=7,
    claim="with the step 0.1 B_hat_t a guarantee is trivial",
    where="Section III-A, after Theorem 1",
    rule="largest deviation as a share of the bound for the running maximum; it holds in full if "
    "no reading of B_hat fails, in part if the running maximum holds and a trailing one fails",
    formula=r"\eta_t=0.1\,\hat B_t",
    unit="1",
    margin="none: one exception refutes it",
    chapter="stretching",
    decide=_decide,
)
