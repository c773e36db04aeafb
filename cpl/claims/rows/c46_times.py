"""Row 46: it takes longer on some paths and is faster on the hard one out of distribution."""

from cpl.claims.claim import HARDWARE, Claim, Reader
from cpl.claims.rows._twin import combined, entry, number, side
from cpl.claims.verdict import Leaning

__all__ = ["CLAIM"]


def _in_the_twin(read: Reader) -> Leaning:
    logs = read("quadruped_logs")
    cells = [(shape, part) for shape in ("triangle", "rectangle") for part in ("in", "out")]
    longer = {cell: entry(logs, 46, "duration_s", *cell) for cell in cells}
    faster = entry(logs, 46, "duration_s", "hexagon", "out")
    alarms = entry(logs, 46, "false_positive_rate", "hexagon", "out")
    leans = [side(each, above=0.0) for each in longer.values()] + [side(faster, below=0.0)]
    more = sum(each.low > 0 for each in longer.values())
    text = (
        f"longer on triangle and rectangle in {more} of {len(cells)} cells; hexagon out "
        f"{number(faster, 's')}, where the predictor gives a false alarm in {alarms.value:.1%} of "
        "the steps that no error follows"
    )
    return Leaning(leans=combined(leans), text=text)


CLAIM = Claim(
    row=46,
    claim="it takes longer on easy and medium paths and is faster on the hard one out of "
    "distribution, by catching false positives",
    where="Section V-D, Figure 5",
    rule="signs of the differences in time, with the rate of false positives",
    formula=r"\Delta T>0,\ \Delta T_{\mathrm{hard,out}}<0",
    unit="s",
    margin="none: only the robot decides",
    chapter="run_it",
    flags=(HARDWARE,),
    in_the_twin=_in_the_twin,
)
