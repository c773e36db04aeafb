"""Row 17: DQN with two layers of 256, 200,000 steps and the stated rewards."""

from dataclasses import replace

import numpy as np

from cpl.claims.claim import Claim, Reader
from cpl.claims.judging import Condition, found
from cpl.claims.verdict import Finding, Verdict
from cpl.stats import mean_interval

__all__ = ["CLAIM"]

_LEVEL = 0.05  # of what the return rose by in training
_ENOUGH = 10  # [seeds] the rule asks for


def _decide(read: Reader) -> Finding:
    curves = read("base_policies")
    settings = curves.parameters
    as_stated = (
        settings["steps"] == 200_000
        and list(settings["hidden"]) == [256, 256]
        and settings["collision_reward"] == -1.0
        and settings["high_speed_reward"] == 0.5
    )
    half = settings["steps"] / 2
    conditions = []
    for kind, rows in curves.table.groupby("kind"):
        late = rows[rows["step"] > half]
        slopes = [
            np.polyfit(one["step"] / half, one["episode_return"], 1)[0]
            for _, one in late.groupby("pair")
        ]
        first = rows.loc[rows["step"] <= 0.05 * settings["steps"], "episode_return"].mean()
        learned = float(late["episode_return"].mean() - first)
        conditions.append(
            Condition(
                name=str(kind),
                effect=mean_interval(np.asarray(slopes) / learned),
                margin=_LEVEL,
                same=True,
            )
        )
    made = found(conditions, n=len(curves))
    if not as_stated:
        return replace(made, verdict=Verdict.FAILS, flags=("the settings are not the stated ones",))
    if made.verdict is Verdict.HOLDS and made.n_seeds < _ENOUGH:
        return replace(made, verdict=Verdict.UNDECIDED, flags=(f"fewer than {_ENOUGH} seeds",))
    return made


CLAIM = Claim(
    row=17,
    claim="DQN with two layers of 256, 200,000 steps and the stated rewards",
    where="Section IV-B",
    paper_value="200,000 steps",
    rule=(
        "change of the return over the last half of the training as a share of what was "
        "learned, 10 seeds; within the margin for both policies, and the specification "
        "must match"
    ),
    formula=r"\pi=\mathrm{DQN}(256,256),\ 200{,}000\ \text{steps}",
    unit="1",
    margin=f"{_LEVEL:g}: a twentieth of what the return rose by in training",
    revised=(
        "The first rule wanted the interval of the slope to contain 0, so that more data "
        "could only hurt. A plateau is now a change within a margin, over the last half "
        "of the training."
    ),
    chapter="switch",
    decide=_decide,
)
