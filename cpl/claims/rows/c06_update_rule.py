"""Row 6: the update q - eta grad rho(err - alpha) brings err close to 1 - alpha."""

from cpl.claims.claim import INCONSISTENT, Claim, Reader
from cpl.claims.rows._theory import certified, erratum
from cpl.claims.verdict import Finding
from cpl.stats import mean_interval

__all__ = ["CLAIM"]


def _decide(read: Reader) -> Finding:
    runs = read("update_rule")
    deviation = runs["errors"] / runs["T"] - runs["alpha"]
    bound = (1 / runs.parameters["eta"] + 1) / runs["T"]  # Theorem 1 with B = 1, as a rate
    nearer = abs(deviation) < abs(deviation + 2 * runs["alpha"] - 1)  # to alpha than to 1 - alpha
    corrected = runs["rule"] == "corrected"
    true = bool(((abs(deviation) < bound) & nearer)[corrected].all()) and certified(
        read,
        "mean error is near alpha, not 1 - alpha",
        "corrected update descends the quantile loss",
    )
    false = bool((abs(deviation) > bound)[~corrected].all()) and certified(
        read, "printed update absorbs misses"
    )
    estimate = mean_interval(deviation[corrected])
    return Finding(
        verdict=erratum(false, true, estimate.n, 30),
        value=estimate.value,
        low=estimate.low,
        high=estimate.high,
        n=estimate.n,
        n_seeds=1,
    )


CLAIM = Claim(
    row=6,
    claim="the update q - eta grad rho(err - alpha) brings err close to 1 - alpha",
    where="Section III-A, eq. (4)",
    paper_value="1 - alpha",
    rule="mean of (error rate - alpha) under q + eta (err - alpha); that rule must reach alpha "
    "within its bound, the printed one leave it, and the target be proved to be alpha",
    formula=r"q_{t+1}=q_t-\eta\nabla\rho_{1-\alpha}(\mathrm{err}_t-\alpha)",
    unit="1",
    margin="the bound on the distance from alpha after T steps",
    chapter="tracking",
    flags=(INCONSISTENT,),
    decide=_decide,
)
