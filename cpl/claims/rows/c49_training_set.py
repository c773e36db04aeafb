"""Row 49: trained on 43 paths with kp = 1.5 and weight 5; the false-positive rule helps."""

from cpl.claims.claim import HARDWARE, Claim, Reader
from cpl.claims.rows._twin import OPEN, entry, number, side
from cpl.claims.verdict import Leaning

__all__ = ["CLAIM"]


def _in_the_twin(read: Reader) -> Leaning:
    collected = read("quadruped_collect").parameters
    weight = read("quadruped_predictor").parameters["positive_weight"]
    stated = (collected["trajectories"], collected["kp"], weight)
    logs = read("quadruped_logs")
    true, none, excess = (
        entry(logs, 49, number, "all", "all") for number in ("true", "none", "excess")
    )
    helps = side(excess, below=0.0)
    text = (
        f"trained on {stated[0]} paths with kp = {stated[1]:g} and weight {stated[2]:g}; an error "
        f"follows {true.value:.0%} of the alarms that the rule would overrule and {none.value:.0%} "
        f"of the steps without alarm (difference {number(excess, '')})"
    )
    return Leaning(leans=helps if stated == (43, 1.5, 5.0) else OPEN, text=text)


CLAIM = Claim(
    row=49,
    claim="trained on 43 paths with kp = 1.5 and weight 5; the false-positive rule helps",
    where="Section V-B, V-C",
    paper_value="43 paths",
    rule="counterfactual effect of the rule on logs; the manifest of the data must match",
    formula=r"43\ \text{paths},\ k_p=1.5,\ w=5",
    unit="1",
    margin="none: only the robot decides",
    chapter="run_it",
    flags=(HARDWARE,),
    in_the_twin=_in_the_twin,
)
