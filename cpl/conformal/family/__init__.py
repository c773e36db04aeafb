"""The family: the published ways to track a quantile online, one module a member.

``MEMBERS`` is the table of all of them, in the order of their years. A module of this folder with
a ``MEMBER`` is found by itself: adding one is writing one file.
"""

import importlib
import pkgutil
from types import MappingProxyType

from cpl.conformal.family._member import Member
from cpl.conformal.family._variants import VARIANTS
from cpl.conformal.family.aci import ACI
from cpl.conformal.family.cop import COP
from cpl.conformal.family.cost_aware import CostAware
from cpl.conformal.family.decision import DecisionTheory
from cpl.conformal.family.dtaci import DtACI
from cpl.conformal.family.eci import ECI
from cpl.conformal.family.ewma import EWMA
from cpl.conformal.family.kt import KT
from cpl.conformal.family.pid import PID
from cpl.conformal.family.rolling import Rolling
from cpl.conformal.family.saocp import SAOCP
from cpl.conformal.family.sf_ogd import SFOGD
from cpl.conformal.family.split import Split
from cpl.conformal.family.up_ocp import UPOCP

__all__ = [
    "ACI",
    "COP",
    "ECI",
    "EWMA",
    "KT",
    "MEMBERS",
    "PID",
    "SAOCP",
    "SFOGD",
    "UPOCP",
    "VARIANTS",
    "CostAware",
    "DecisionTheory",
    "DtACI",
    "Member",
    "Rolling",
    "Split",
]


def _found() -> dict[str, Member]:
    members: list[Member] = []
    for module in pkgutil.iter_modules(__path__):
        if not module.name.startswith("_"):
            loaded = importlib.import_module(f"{__name__}.{module.name}")
            members += getattr(loaded, "MEMBERS", None) or (loaded.MEMBER,)
    return {member.name: member for member in sorted(members, key=lambda m: (m.year, m.name))}


MEMBERS = MappingProxyType(_found())
"""All members by name."""
