"""What public code does otherwise, each with scores on which that loses the guarantee."""

from collections.abc import Callable
from dataclasses import dataclass
from types import MappingProxyType

import numpy as np

from cpl.conformal.family.aci import ACI
from cpl.conformal.family.eci import ECI
from cpl.conformal.family.sf_ogd import SFOGD
from cpl.conformal.rules import Fixed, Rule, TrailingRange
from cpl.conformal.state import FloatArray

__all__ = ["VARIANTS", "Variant"]


@dataclass(frozen=True, kw_only=True)
class Variant:
    """A rule as it should be, and a variant of it.

    Attributes:
        scores: From even draws in [0, 1) to the scores that tell the two apart.
        rules: The rule, and the variant.
    """

    scores: Callable[[FloatArray], FloatArray]
    rules: tuple[Rule, Rule]


VARIANTS = MappingProxyType(
    {
        "ECI takes its error term into the state": Variant(
            scores=lambda draws: draws,
            rules=(ECI(eta=0.05, window=0), ECI(eta=0.05, window=0, form="accumulated")),
        ),
        "ACI's level is kept within [0, 1]": Variant(
            scores=lambda draws: np.arange(1.0, draws.size + 1.0),
            rules=(ACI(gamma=0.05, window=50), ACI(gamma=0.05, window=50, clip=True)),
        ),
        "thresholds are kept above 0, scores are negative": Variant(
            scores=lambda draws: draws - 2.0,
            rules=(SFOGD(scale=2.0), SFOGD(scale=2.0, clip=True)),
        ),
        "the step is a share of the recent range": Variant(
            scores=lambda draws: np.full_like(draws, 2.0),
            rules=(Fixed(eta=0.2), TrailingRange(lr=0.1, window=20)),
        ),
    }
)
"""By what is done otherwise."""
