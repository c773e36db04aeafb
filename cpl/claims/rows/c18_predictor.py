"""Row 18: the predictor (64-128-64, 30,000 rollouts) is trained to convergence."""

from dataclasses import replace

import numpy as np

from cpl.claims.claim import Claim, Reader
from cpl.claims.judging import Condition, found
from cpl.claims.verdict import Finding, Verdict
from cpl.stats import mean_interval

__all__ = ["CLAIM"]

_PARAMETERS, _ROLLOUTS = 24_705, 30_000  # of a 125-64-128-64-1 network; Section IV-C
_LATE, _FLAT = 5, 0.01  # [epochs] looked at; relative slope an epoch that counts as none


def _decide(read: Reader) -> Finding:
    source = read("forecasts")
    plain = source.table.loc[source.table["subject"] == "plain"]
    losses = plain.loc[plain["quantity"] == "validation_loss"]
    slopes = [
        float(np.polyfit(part["epoch"][-_LATE:], np.log(part["value"][-_LATE:]), 1)[0])
        for _, part in losses.groupby("pair")
    ]
    slope = mean_interval(slopes)
    counts = plain.loc[plain["quantity"] == "parameters", "value"]
    as_stated = bool((counts == _PARAMETERS).all()) and len(counts) > 0
    as_stated &= source.parameters["rollouts"] == _ROLLOUTS
    flat = Condition(name="validation loss", effect=slope, margin=_FLAT, same=True)
    made = found([flat], n=len(losses))
    return made if as_stated else replace(made, verdict=Verdict.FAILS)


CLAIM = Claim(
    row=18,
    claim="the predictor (64-128-64, 30,000 rollouts) is trained to convergence",
    where="Section IV-C",
    paper_value="30,000 rollouts",
    rule="slope of the validation loss at the end; the number of parameters must match",
    formula=r"f_\theta:125\to64\to128\to64\to1",
    unit="1/epoch",
    margin=f"{_FLAT:g}: one per cent an epoch",
    chapter="forecast",
    decide=_decide,
)
