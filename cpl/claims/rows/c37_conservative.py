"""Row 37: pi_RL^2 is conservative only when the risk rises too."""

import pandas as pd

from cpl.claims.claim import Claim, Reader
from cpl.claims.judging import Condition, found
from cpl.claims.margins import SHARE
from cpl.claims.verdict import Finding
from cpl.policies.effects import over_pairs

__all__ = ["CLAIM"]


def _decide(read: Reader) -> Finding:
    source = read("why_inside")
    table = source.where((source["agent"] == "rl_2") & (source["question"] == "risk")).table
    wide = table.pivot_table(index="pair", columns="of", values="value")
    gain = over_pairs(pd.Series(wide["q and q l_hat"] - wide["q"]))
    return found(
        [Condition(name="braking of pi_RL^2", effect=gain, margin=SHARE.value)],
        n=int(table.drop_duplicates("pair")["n"].to_numpy().sum()),
    )


CLAIM = Claim(
    row=37,
    claim="pi_RL^2 is conservative only when the risk rises too",
    where="Section IV-F",
    rule=(
        "deviance of its braking that q l_tilde explains beside q, on episodes that were not fitted"
    ),
    formula=r"R^2(q,\,q\hat\ell)-R^2(q)>0",
    unit="1",
    margin=str(SHARE),
    revised="A margin.",
    chapter="ignored",
    decide=_decide,
)
