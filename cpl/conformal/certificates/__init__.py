"""Machine proofs for all reals, and counterexamples with exact numbers: what z3 says of the theory.

>>> verdict = certificate("printed upper end of the range fails").check()
>>> verdict.holds, verdict.status, verdict.model["alpha"]
(True, 'found', Fraction(1, 4))
>>> all(verdict.holds for verdict in check_all())
True
"""

# pyright: reportMissingTypeStubs=false
from __future__ import annotations

from typing import TYPE_CHECKING

from cpl.conformal.certificates import (
    assumption,
    feedback,
    printed,
    theorem,
    traps,
    trouble,
    update,
)
from cpl.conformal.certificates.frame import Certificate, Kind, Obligation, Status, Verdict

if TYPE_CHECKING:
    import pandas as pd

__all__ = [
    "CERTIFICATES",
    "Certificate",
    "Kind",
    "Obligation",
    "Status",
    "Verdict",
    "as_table",
    "certificate",
    "check_all",
]

CERTIFICATES: dict[str, Certificate] = {
    proof.name: proof
    for part in (update, theorem, printed, feedback, trouble, assumption, traps)
    for proof in part.CERTIFICATES
}
"""All certificates by name, in the order of the paper's argument."""


def certificate(name: str) -> Certificate:
    """Return a certificate by its name.

    Raises:
        ValueError: if there is none of this name.

    Examples:
        >>> print(certificate("integer strengthening").by_hand or "nothing")
        nothing
    """
    if name not in CERTIFICATES:
        msg = f"name must be one of {', '.join(CERTIFICATES)}; got {name!r}"
        raise ValueError(msg)
    return CERTIFICATES[name]


def check_all() -> list[Verdict]:
    """Check every certificate, in order."""
    return [proof.check() for proof in CERTIFICATES.values()]


def as_table(verdicts: list[Verdict] | None = None) -> pd.DataFrame:
    """Return certificates and verdicts as a table, one row a certificate.

    Args:
        verdicts: what `check_all` returned; without it, everything is checked now.

    Returns:
        Columns `name`, `kind`, `statement`, `by_machine`, `by_hand`, `verdict`, `queries`,
        `numbers`.
    """
    import pandas as pd

    rows = [
        {
            "name": verdict.name,
            "kind": verdict.kind,
            "statement": CERTIFICATES[verdict.name].statement,
            "by_machine": CERTIFICATES[verdict.name].machine,
            "by_hand": CERTIFICATES[verdict.name].by_hand,
            "verdict": verdict.status,
            "queries": verdict.queries,
            "numbers": ", ".join(f"{key} = {value}" for key, value in verdict.model.items()),
        }
        for verdict in (check_all() if verdicts is None else verdicts)
    ]
    return pd.DataFrame(rows)
