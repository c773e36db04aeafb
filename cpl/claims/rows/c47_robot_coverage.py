"""Row 47: coverage is above 0.8 in and out of distribution."""

from cpl.claims.claim import HARDWARE, Claim, Reader
from cpl.claims.rows._machines import NAMES, leaning, met, recordings, told
from cpl.claims.rows._twin import WHERE, combined, entry, side
from cpl.claims.verdict import Leaning

__all__ = ["CLAIM"]

_MOST_WINDOWS = 0.95  # "the coverage is higher": in so many windows it would count as true


def _in_the_twin(read: Reader) -> Leaning:
    logs = read("quadruped_logs")
    parts = {part: entry(logs, 47, "windows_reached", "hexagon", part) for part in ("in", "out")}
    chance = entry(logs, 47, "both_by_chance", "all", "all").value
    leans = [side(each, above=_MOST_WINDOWS) for each in parts.values()]
    shares = ", ".join(
        f"{each.value:.0%} ({each.low:.0%} to {each.high:.0%}) {WHERE[part]}"
        for part, each in parts.items()
    )
    text = (
        f"on the hexagon the windows at 0.8 or above are {shares}; two runs of one window "
        f"each reach it by chance in {chance:.0%}"
    )
    return Leaning(leans=combined(leans), text=text)


def _on_other_machines(read: Reader) -> Leaning:
    table = recordings(read)
    runs = {name: met(table, "coverage", machine) for machine, name in NAMES.items()}
    below = [met(table, "windows_below", machine).value for machine in NAMES]
    values = (told(name, estimate, "{:.2f}") for name, estimate in runs.items())
    text = (
        f"coverage of the drift of the next second at alpha = 0.2: {', '.join(values)}; of the "
        f"windows of 4 s {min(below):.0%} to {max(below):.0%} lie below 0.8"
    )
    leans = [leaning(each, level=0.8) for each in runs.values()]
    return Leaning(leans=combined(leans), text=text)


CLAIM = Claim(
    row=47,
    claim="coverage is above 0.8 in and out of distribution",
    where="Section V-D, Figure 6",
    paper_value="> 0.8",
    rule="coverage with a block bootstrap; two 40-step runs are both above 0.8 by chance in 35 %",
    formula=r"\hat P(s_t\le q_t)>0.8",
    unit="1",
    margin="none: only the robot decides",
    chapter="run_it",
    flags=(HARDWARE,),
    in_the_twin=_in_the_twin,
    on_other_machines=_on_other_machines,
)
