"""Row 25: it needs no change of the model and is the simplest method but one."""

from cpl.claims.claim import Claim, Reader
from cpl.claims.rows._forecast import cost_of
from cpl.claims.verdict import Finding, Verdict

__all__ = ["CLAIM"]


def _decide(read: Reader) -> Finding:
    source = read("forecast_cost")
    changed = int(cost_of(source, "conformal", "weights_changed"))
    parameters = int(cost_of(source, "none", "parameters"))
    same = changed == 0 and cost_of(source, "conformal", "parameters") == parameters
    return Finding(
        verdict=Verdict.HOLDS if same else Verdict.FAILS,
        value=float(changed),
        n=parameters,
        n_seeds=1,
        flags=("simplicity is judged, not counted",),
    )


CLAIM = Claim(
    row=25,
    claim="it needs no change of the model and is the simplest method but one",
    where="abstract, Section IV-F",
    rule="number of weights that differ; 0 (simplicity: a table of lines and parameters, judged)",
    formula=r"\theta_{\mathrm{conformal}}=\theta",
    unit="1",
    margin="none: one exception refutes it",
    chapter="forecast",
    decide=_decide,
)
