"""Row 43: easy path: similar in distribution, a larger gap out of it."""

from cpl.claims.claim import HARDWARE, Claim, Reader
from cpl.claims.rows._twin import AS, NOT, combined, entry, number, side
from cpl.claims.verdict import Leaning

__all__ = ["CLAIM"]


def _in_the_twin(read: Reader) -> Leaning:
    logs = read("quadruped_logs")
    inside, more = (entry(logs, 43, "start_end_m", "triangle", part) for part in ("in", "out - in"))
    similar = AS if inside.low <= 0 <= inside.high else NOT
    text = f"difference in distribution {number(inside, 'm')}, more of it out {number(more, 'm')}"
    # That an interval holds 0 shows nothing by itself; it counts only beside a larger gap out.
    gap = side(more, below=0.0)
    return Leaning(leans=combined([similar, gap]) if gap == AS else gap, text=text)


CLAIM = Claim(
    row=43,
    claim="easy path: similar in distribution, a larger gap out of it",
    where="Section V-D",
    rule="interaction of policy and distribution; its interval",
    formula=r"\Delta e_{\mathrm{out}}>\Delta e_{\mathrm{in}}",
    unit="m",
    margin="none: only the robot decides",
    chapter="run_it",
    flags=(HARDWARE,),
    in_the_twin=_in_the_twin,
)
