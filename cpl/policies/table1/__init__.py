"""What is said about Table I: cells with intervals, the printed ones, ranks, and a coin's."""

from cpl.policies.table1._cells import MEASURES, Cells, tabulate
from cpl.policies.table1._compare import beside_hull, beside_hull_printed, differences, ranks
from cpl.policies.table1._print import (
    CARRIED,
    LEARNED,
    MARGINS,
    PRINTED,
    ROWS,
    SWITCH,
    Printed,
    against_print,
    agreement,
    equivalent,
)

__all__ = [
    "CARRIED",
    "LEARNED",
    "MARGINS",
    "MEASURES",
    "PRINTED",
    "ROWS",
    "SWITCH",
    "Cells",
    "Printed",
    "against_print",
    "agreement",
    "beside_hull",
    "beside_hull_printed",
    "differences",
    "equivalent",
    "ranks",
    "tabulate",
]
