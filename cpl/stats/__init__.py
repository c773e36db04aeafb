"""Infer: intervals and laws that are decided before the data are seen.

Every number comes as an :class:`Estimate`, so that a claim's rule reads the same whether it is a
share, a mean, a difference or a hypervolume.
"""

from cpl.stats.bootstrap import Band, Weights, band, hierarchical_weights, interval, p_value, sums
from cpl.stats.estimates import (
    Estimate,
    mean_interval,
    proportion,
    rank_correlation,
    split_conformal_law,
    split_conformal_rank,
)
from cpl.stats.fronts import (
    at_levels,
    common_levels,
    hypervolume,
)
from cpl.stats.multiple import holm
from cpl.stats.survival import SurvivalCurve, survival
from cpl.stats.tradeoff import Curve, Lead, lead

__all__ = [
    "Band",
    "Curve",
    "Estimate",
    "Lead",
    "SurvivalCurve",
    "Weights",
    "at_levels",
    "band",
    "common_levels",
    "hierarchical_weights",
    "holm",
    "hypervolume",
    "interval",
    "lead",
    "mean_interval",
    "p_value",
    "proportion",
    "rank_correlation",
    "split_conformal_law",
    "split_conformal_rank",
    "sums",
    "survival",
]
