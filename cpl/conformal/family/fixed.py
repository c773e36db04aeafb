"""The step rules' rows of the table; the rules themselves are in `cpl.conformal.rules`."""

from cpl.conformal.family._member import Member
from cpl.conformal.rules import PI, Decaying, Fixed, RunningMax, TrailingRange

__all__ = ["MEMBERS"]

MEMBERS = (
    Member(
        name="fixed",
        title="Fixed step",
        year=2021,
        paper="gibbs2021adaptive",
        make=lambda scale: Fixed(eta=0.1 * scale),
        guarantee="every window within (B + eta) / (eta W), exactly known, attained",
        tuning="step",
        memory="1",
        vectors="conformalopt 0.1.0",
    ),
    Member(
        name="running_max",
        title="Running maximum",
        year=2023,
        paper="huang2023conformal",
        make=lambda scale: RunningMax(c=0.1),
        guarantee="every window within (B + H) / eta_T0",
        tuning="share",
        memory="2",
    ),
    Member(
        name="decaying",
        title="Decaying step",
        year=2024,
        paper="angelopoulos2024decaying",
        make=lambda scale: Decaying(c=scale, power=0.6),
        guarantee="long-run error, and convergence on iid scores",
        tuning="first step, power",
        memory="2",
        vectors="conformalopt 0.1.0",
    ),
    Member(
        name="trailing_range",
        title="Trailing range",
        year=2023,
        paper="angelopoulos2023pid",
        make=lambda scale: TrailingRange(lr=0.1, window=20),
        guarantee="none: it can freeze",
        tuning="share, window",
        memory="O(window)",
        vectors="conformal-time-series",
    ),
    Member(
        name="pi",
        title="PI",
        year=2023,
        paper="angelopoulos2023pid",
        make=lambda scale: PI(Fixed(eta=0.1 * scale), K_I=0.5 * scale, C_sat=5.0),
        guarantee="long-run error, any scores",
        tuning="step, gain, saturation",
        memory="4",
        vectors="conformal-time-series",
    ),
)
