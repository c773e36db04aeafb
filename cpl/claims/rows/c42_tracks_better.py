"""Row 42: on the robot the switch tracks better, in and out of distribution."""

from cpl.claims.claim import HARDWARE, Claim, Reader
from cpl.claims.rows._twin import LEGGED, both, combined, entry, side
from cpl.claims.verdict import Leaning

__all__ = ["CLAIM"]


def _in_the_twin(read: Reader) -> Leaning:
    logs = read("quadruped_logs")
    parts = {part: entry(logs, 42, "start_end_m", "all", part) for part in ("in", "out")}
    text = "start to end " + both(parts, "m")
    if LEGGED in logs["folder"]:
        legs = {
            part: entry(logs, 42, "start_end_m", "all", part, folder=LEGGED)
            for part in ("in", "out")
        }
        text += "; with legs " + both(legs, "m")
    return Leaning(leans=combined([side(each, below=0.0) for each in parts.values()]), text=text)


CLAIM = Claim(
    row=42,
    claim="on the robot the switch tracks better, in and out of distribution",
    where="Section V-D, Figure 4",
    rule="difference of tracking errors; stratified exact permutation on logs",
    formula=r"e_{\mathrm{switch}}<e_{\mathrm{constant}}",
    unit="m",
    margin="none: only the robot decides",
    chapter="run_it",
    flags=(HARDWARE,),
    in_the_twin=_in_the_twin,
)
