"""Row 48: SLAM errors depend on path and speed."""

from cpl.claims.claim import HARDWARE, Claim, Reader
from cpl.claims.rows._machines import NAMES, leaning, met, recordings, told
from cpl.claims.rows._twin import AS, OPEN, combined, entry, ratio, side
from cpl.claims.verdict import Leaning

__all__ = ["CLAIM"]


def _in_the_twin(read: Reader) -> Leaning:
    logs = read("quadruped_logs")
    names = {"0.1 m/s faster": "0.1 m/s more", "0.1 rad/s more turning": "0.1 rad/s more turning"}
    motion = {text: entry(logs, 48, name, "all", "all") for name, text in names.items()}
    paths = {name: entry(logs, 48, name, "all", "all") for name in ("rectangle", "hexagon")}
    differ = any(each.low > 1 or each.high < 1 for each in paths.values())
    leans = [side(each, above=1.0) for each in motion.values()] + [AS if differ else OPEN]
    odds = [f"{name} {ratio(each)}" for name, each in (motion | paths).items()]
    text = "odds of an error times " + ", ".join(odds) + " (paths against the triangle)"
    return Leaning(leans=combined(leans), text=text)


def _on_other_machines(read: Reader) -> Leaning:
    table = recordings(read)
    leans: list[str] = []
    parts: list[str] = []
    for word, number in (("speed", "with_speed"), ("turning", "with_turning")):
        each = {name: met(table, number, machine) for machine, name in NAMES.items()}
        leans += [leaning(estimate) for estimate in each.values()]
        values = (told(name, estimate, "{:+.2f}") for name, estimate in each.items())
        parts.append(f"with {word} {', '.join(values)}")
    text = f"rank correlation of the drift of the next second {'; '.join(parts)}"
    return Leaning(leans=combined(leans), text=text)


CLAIM = Claim(
    row=48,
    claim="SLAM errors depend on path and speed",
    where="Section V-A",
    rule="coefficients of a logistic fit, with intervals",
    formula=r"\operatorname{logit}P(\mathrm{err})=\beta^\top(\text{path},v,\omega)",
    unit="1",
    margin="none: only the robot decides",
    chapter="run_it",
    flags=(HARDWARE,),
    in_the_twin=_in_the_twin,
    on_other_machines=_on_other_machines,
)
