"""Tables of the family: its members, its traps, its worst cases."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np
import pandas as pd

from cpl.conformal.family import MEMBERS
from cpl.figures.family import effect, excess, rates
from cpl.figures.table import Table, table

__all__ = ["loop", "members", "traps", "worst"]


def members() -> Table:
    """Return the table of members: guarantee, tuning, memory."""
    rows = pd.DataFrame(
        [
            {
                "member": f"`{m.name}`",
                "year": str(m.year),
                "promise": m.guarantee,
                "to choose": m.tuning,
                "memory": m.memory,
            }
            for m in MEMBERS.values()
        ]
    )
    return table(rows, columns={name: name for name in rows.columns})


def traps(found: Mapping[str, Sequence[float]]) -> Table:
    """Return what two variants of a rule do on the same scores.

    Args:
        found: By trap, the share of errors of the rule as it should be and of its variant.
    """
    rows = pd.DataFrame(
        [{"trap": name, "sound": a, "variant": b} for name, (a, b) in found.items()]
    )
    return table(rows, {"sound": "{:.3f}", "variant": "{:.3f}"}, columns={
        "trap": "variant", "sound": "errors, as it should be", "variant": "errors, the variant",
    })  # fmt: skip


def worst(rows: pd.DataFrame) -> Table:
    """Return promised beside attained, from `family_worst`."""
    whole = ("promised", "exact", "attained", "run")
    shown = rows.assign(
        member="`" + rows["member"] + "`",
        **{name: [_count(value, "") for value in rows[name]] for name in whole},
        **{name: [_count(value, "never") for value in rows[name]] for name in ("react", "forget")},
    )
    return table(
        shown,
        {"missed": "{:.0%}"},
        columns={
            "member": "member", "promised": "promised", "exact": "exact", "attained": "attained",
            "by": "by", "run": "run", "react": "to react", "forget": "to forget",
            "missed": "missed meanwhile",
        },
    )  # fmt: skip


def _count(value: float, nothing: str) -> str:
    return nothing if np.isnan(value) else f"{value:.0f}"


def loop(streams: pd.DataFrame) -> Table:
    """Return what everybody did in the loop, by speed, beside the constants at equal speed.

    Args:
        streams: One setting of `gate_family`.
    """
    names = [name for name in streams["method"].unique() if name != "constant"]
    above = {name: effect(found) for name, found in excess(streams, *names).items()}
    found = rates(streams, "method", "value").sort_values("speed_mps")
    found = found.assign(
        value=["" if value == 0 else f"{value:g}" for value in found["value"]],
        coverage=["" if np.isnan(share) else f"{share:.3f}" for share in found["coverage"]],
        above=[above.get(name, "") for name in found["method"]],
    )
    return table(
        found,
        {"crash_rate": "{:.3f}", "speed_mps": "{:.1f}", "episodes": "{:,}"},
        columns={
            "method": "who", "value": "setting", "episodes": "episodes",
            "crash_rate": "crash rate", "speed_mps": "m/s",
            "above": "minus constants at equal speed", "coverage": "coverage",
        },
    )  # fmt: skip
