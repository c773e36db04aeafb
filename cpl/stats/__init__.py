"""Infer: intervals and laws that are decided before the data are seen.

Every number comes as an :class:`Estimate`, so that a claim's rule reads the same whether it is a
share, a mean, a difference or a hypervolume.
"""

from cpl.stats.bootstrap import Band, Weights, band, hierarchical_weights, interval, p_value, sums
from cpl.stats.estimates import (
    Estimate,
    LawCheck,
    check_law,
    mean_interval,
    paired_difference,
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
from cpl.stats.survival import SurvivalCurve, logrank, restricted_mean, survival
from cpl.stats.tradeoff import Curve, Lead, lead

__all__ = [
    "Band",
    "Curve",
    "Estimate",
    "LawCheck",
    "Lead",
    "SurvivalCurve",
    "Weights",
    "at_levels",
    "band",
    "check_law",
    "common_levels",
    "hierarchical_weights",
    "holm",
    "hypervolume",
    "interval",
    "lead",
    "logrank",
    "mean_interval",
    "p_value",
    "paired_difference",
    "proportion",
    "rank_correlation",
    "restricted_mean",
    "split_conformal_law",
    "split_conformal_rank",
    "sums",
    "survival",
]
