"""Row 44: hard path: the gain is mainly out of distribution."""

from cpl.claims.claim import HARDWARE, Claim, Reader
from cpl.claims.rows._twin import combined, entry, number, side
from cpl.claims.verdict import Leaning

__all__ = ["CLAIM"]


def _in_the_twin(read: Reader) -> Leaning:
    logs = read("quadruped_logs")
    out, more = (entry(logs, 44, "start_end_m", "hexagon", part) for part in ("out", "out - in"))
    text = f"difference out {number(out, 'm')}, more than in distribution by {number(more, 'm')}"
    return Leaning(leans=combined([side(out, below=0.0), side(more, below=0.0)]), text=text)


CLAIM = Claim(
    row=44,
    claim="hard path: the gain is mainly out of distribution",
    where="Section V-D",
    rule="interaction of policy and distribution; its interval",
    formula=r"\Delta e_{\mathrm{out}}\gg\Delta e_{\mathrm{in}}",
    unit="m",
    margin="none: only the robot decides",
    chapter="run_it",
    flags=(HARDWARE,),
    in_the_twin=_in_the_twin,
)
