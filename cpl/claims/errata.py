r"""The errata of the paper's Section III, as data: what is printed, what is meant, what decides it.

A *checkable* erratum makes a statement that can be true or false. It has two tests in
`tests/claims/test_errata.py`: the printed statement, which must fail, and the corrected one, which
must hold. A *wording* erratum is about what a word means, what is left unsaid, or an index; it has
a note, and a symbolic check where one is possible.

The paper's theorem survives all of this: the constant is right, and so is the idea of the proof.
"""

# pyright: reportMissingTypeStubs=false
from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Literal

if TYPE_CHECKING:
    import pandas as pd

__all__ = ["ERRATA", "Erratum", "as_table", "erratum"]


@dataclass(frozen=True, kw_only=True)
class Erratum:
    """One place where the paper says something other than what is true or meant."""

    number: int
    """1 to 20."""
    where: str
    """Where in the paper."""
    printed: str
    """What the paper prints, in Markdown with LaTeX."""
    corrected: str
    """What holds instead, in Markdown with LaTeX."""
    kind: Literal["checkable", "wording"]
    """Whether it has the two tests."""
    explanation: str
    """Why, in a sentence or two."""
    evidence: tuple[Literal["proof", "counterexample", "search", "simulation", "note"], ...]
    """What kinds of evidence there are."""
    certificates: tuple[str, ...] = ()
    """Names of certificates in `cpl.conformal.certificates`."""
    chapter: str
    """The chapter that explains it (its slug and label)."""

    @property
    def tests(self) -> tuple[str, ...]:
        """Names of its tests in `tests/claims/test_errata.py`."""
        if self.kind == "wording":
            return (f"test_erratum_{self.number:02}_note",)
        return (
            f"test_erratum_{self.number:02}_printed",
            f"test_erratum_{self.number:02}_corrected",
        )


ERRATA: tuple[Erratum, ...] = (
    Erratum(
        number=1,
        where="quantile update",
        printed=r"$q_{t+1} = q_t - \eta\nabla\rho_{1-\alpha}(\mathrm{err}_t-\alpha)$",
        corrected=r"$q_{t+1} = q_t - \eta\,\partial_q\,\rho_{1-\alpha}(s_t-q_t)$ "
        r"$= q_t + \eta(\mathrm{err}_t-\alpha)$",
        kind="checkable",
        explanation="The slope of the quantile loss at the printed argument is err - alpha itself, "
        "so the printed minus sign lowers q after a miss. Below zero every score is missed and q "
        "falls for ever.",
        evidence=("proof", "counterexample", "simulation"),
        certificates=(
            "printed update absorbs misses",
            "printed update reaches the trap",
            "corrected update descends the quantile loss",
            "printed argument hides the wrong sign",
        ),
        chapter="tracking",
    ),
    Erratum(
        number=2,
        where="Theorem 1, first display of the proof",
        printed=r"$(q_{T_0+W}-q_{T_0})/(\eta W)$ $= +\frac1W\sum\nabla\rho_{1-\alpha}$, which does "
        "not follow from the printed update",
        corrected="the plus sign is right; it is the update that has the wrong one (erratum 1)",
        kind="wording",
        explanation="Telescoping the printed update would give a minus sign. The proof silently "
        "uses the corrected one.",
        evidence=("proof", "note"),
        certificates=("telescoping equality", "printed argument hides the wrong sign"),
        chapter="theory",
    ),
    Erratum(
        number=3,
        where="Theorem 1",
        printed=r"$\frac1W\sum_{t=T_0}^{T_0+W}\mathrm{err}_t$",
        corrected=r"$\frac1W\sum_{t=T_0}^{T_0+W-1}\mathrm{err}_t$",
        kind="checkable",
        explanation="The printed sum has W + 1 terms, and for those the theorem is false. At "
        "alpha = 1/m with an integer B / eta (the paper's own eta = 0.1 B) it survives, because "
        "misses are whole.",
        evidence=("proof", "counterexample", "search"),
        certificates=(
            "printed window of Theorem 1 fails",
            "printed window survives at alpha = 1/m",
            "window bound is strict and two-sided",
            "telescoping equality",
            "printed rearrangement fails",
        ),
        chapter="theory",
    ),
    Erratum(
        number=4,
        where="Theorem 1, last line of the proof",
        printed=r"$q_{T_0+W} \le B+\alpha\eta$",
        corrected=r"$q_{T_0+W} < B+(1-\alpha)\eta$",
        kind="checkable",
        explanation="A miss just below B lifts q by (1 - alpha) eta, not by alpha eta.",
        evidence=("proof", "counterexample"),
        certificates=(
            "printed upper end of the range fails",
            "range of the quantile",
            "width survives the swapped ends",
        ),
        chapter="theory",
    ),
    Erratum(
        number=5,
        where="Theorem 1, last line of the proof",
        printed=r"$q_{T_0} \ge -(1-\alpha)\eta$",
        corrected=r"$q_{T_0} \ge -\alpha\eta$",
        kind="checkable",
        explanation="A cover at 0 lowers q by alpha eta. The printed end is loose for alpha up to "
        "1/2 and false above; the swap with erratum 4 leaves the width B + eta, so the final "
        "constant survives.",
        evidence=("proof", "counterexample"),
        certificates=(
            "printed lower end of the range fails",
            "printed lower end is loose or false",
            "range of the quantile",
            "width survives the swapped ends",
        ),
        chapter="theory",
    ),
    Erratum(
        number=6,
        where="Theorem 1",
        printed=r"no condition on $q_1$",
        corrected=r"$q_1 \in [-\alpha\eta,\ B+(1-\alpha)\eta)$, else the range grows to include it",
        kind="checkable",
        explanation="From a start far below, many misses in a row are needed to climb into the "
        "range.",
        evidence=("proof", "counterexample"),
        certificates=("start far outside breaks Theorem 1", "start value of the quantile"),
        chapter="theory",
    ),
    Erratum(
        number=7,
        where="Theorem 1, last display of the proof",
        printed=r"$\frac1W\sum_{t=T_0}^{T_0+W}\mathrm{err}_t$ "
        r"$\le \alpha+\frac{q_{T_0+W}-q_{T_0}}{\eta W} \le \dots$",
        corrected=r"$\frac1W\sum_{t=T_0}^{T_0+W-1}\mathrm{err}_t$ "
        r"$= \alpha+\frac{q_{T_0+W}-q_{T_0}}{\eta W} < \dots$",
        kind="checkable",
        explanation="Rearranging an equality gives an equality (with the extra term of the printed "
        "sum even the inequality is false), and the last step is strict because the upper end of "
        "the range is never attained.",
        evidence=("proof", "counterexample", "search"),
        certificates=(
            "printed rearrangement fails",
            "telescoping equality",
            "window bound is strict and two-sided",
        ),
        chapter="theory",
    ),
    Erratum(
        number=8,
        where="multi-resolution remark; first display of the proof",
        printed=r"$(B+\eta)/\eta W$ and $\frac1W\sum\mathrm{err}_t-\alpha$",
        corrected=r"$\frac{B+\eta}{\eta W}$ and $\bigl(\frac1W\sum\mathrm{err}_t\bigr)-\alpha$",
        kind="checkable",
        explanation="Brackets are missing. Read from left to right the first grows with W, and if "
        "alpha is divided by W with the sum, the second is another number.",
        evidence=("proof",),
        certificates=("printed brackets of the correction",),
        chapter="theory",
    ),
    Erratum(
        number=9,
        where="below the quantile update",
        printed=r"we would like $\mathrm{err}_t$ close to $1-\alpha$",
        corrected=r"its mean should be close to $\alpha$",
        kind="checkable",
        explanation="1 - alpha is the coverage; err is one where coverage fails.",
        evidence=("proof", "simulation"),
        certificates=("mean error is near alpha, not 1 - alpha",),
        chapter="tracking",
    ),
    Erratum(
        number=10,
        where="below the quantile update",
        printed="a simple form of P-control",
        corrected=r"integral control of the error: "
        r"$q_t = q_1+\eta\sum_{i<t}(\mathrm{err}_i-\alpha)$",
        kind="wording",
        explanation="With a fixed step the quantile is the running sum of the error. What is "
        "called P in the conformal PID literature is proportional in the quantile's own loss, "
        "not in the error that a control engineer would name.",
        evidence=("proof", "counterexample", "note"),
        certificates=("telescoping equality", "not proportional control"),
        chapter="tracking",
    ),
    Erratum(
        number=11,
        where="after Theorem 1",
        printed=r"with $\eta_t = 0.1\hat B_t$ it is trivial to get a guarantee",
        corrected=r"true for a running maximum, false for a trailing maximum; $\hat B_t$ is not "
        "defined",
        kind="checkable",
        explanation="A trailing maximum lets the step shrink to zero while q is below zero, and "
        "then every perfect prediction is rejected. A running maximum never shrinks.",
        evidence=("proof", "counterexample", "simulation"),
        certificates=(
            "trailing maximum can freeze below zero",
            "a step of zero freezes",
            "range with a variable step",
            "misses with a variable step",
            "running maximum",
        ),
        chapter="stretching",
    ),
    Erratum(
        number=12,
        where="multi-resolution remark",
        printed="for all possible windows in time, the coverage will be met",
        corrected=r"only windows with $W \ge (B/\eta+1)/(1-\alpha)$ are promised anything",
        kind="checkable",
        explanation="At eta = 0.1 B all predictions of a window of 12 steps may be wrong (13 at "
        "alpha = 0.2). The paper's figure with windows of 5 steps lies in that range.",
        evidence=("proof", "search"),
        certificates=("short windows promise nothing", "longest run of misses"),
        chapter="theory",
    ),
    Erratum(
        number=13,
        where="Corollary 1",
        printed="needs Assumption 1",
        corrected="not for bounded scores: Theorem 1 holds along every path, for any policy",
        kind="checkable",
        explanation="With scores in [0, B] the assumption holds for every policy (q_floor = B, "
        "K = 1, no misses), so it cannot be what makes the Corollary true.",
        evidence=("proof", "search"),
        certificates=("bounded scores are eventually safe",),
        chapter="stretching",
    ),
    Erratum(
        number=14,
        where="definition of the switching policy",
        printed=r"$\pi_{switch}$ satisfies Assumption 1 by design, $\pi_{RL}$ perhaps not",
        corrected="with scores in [0, 1] both do, trivially; with unbounded scores neither does "
        r"without an assumption about $\pi_{safe}$",
        kind="checkable",
        explanation="The design of the switch does not enter: the bound on the score decides.",
        evidence=("proof", "counterexample"),
        certificates=("bounded scores are eventually safe", "unbounded scores need an assumption"),
        chapter="stretching",
    ),
    Erratum(
        number=15,
        where="Assumption 1",
        printed=r"$\{\forall k\in[K],\ q_k \ge q^{safe}\} \Rightarrow \dots$",
        corrected="from every start time and for every sequence that can happen; its $q^{safe}$ "
        r"(here $q^{floor}$) is not the switch's; the policy's $q_k$ produces step $k+1$",
        kind="wording",
        explanation="As printed it speaks of the first K steps only, which is too weak to imply "
        "anything later.",
        evidence=("counterexample", "note"),
        certificates=(
            "assumption about one block is too weak",
            "range under an eventually safe policy",
        ),
        chapter="stretching",
    ),
    Erratum(
        number=16,
        where="last paragraph of Section III",
        printed="Theorem 1 as it stands; delay is tacit",
        corrected=r"with delay $h$: $|N_W-\alpha W| < B/\eta+h$",
        kind="checkable",
        explanation="The prediction made at t is scored 3 steps later on the highway, 2 on the "
        "robot. The bound without a delay term is false then.",
        evidence=("proof", "counterexample", "search"),
        certificates=(
            "delay breaks the prompt bound",
            "range of the virtual quantile",
            "what can be pending",
            "window bound with delay",
            "interleaved trackers",
            "range with lost and wrong feedback",
            "what the queue of wrong feedback can hold",
            "inside a window with wrong feedback",
            "window bound with lost and wrong feedback",
        ),
        chapter="stretching",
    ),
    Erratum(
        number=17,
        where="simulation experiments",
        printed="the score is never defined; Theorem 1 has scores in [0, B]",
        corrected=r"a signed score in $[l,u]$ works with $B$ replaced by $u-l$; the absolute score "
        "is two-sided, and the switch uses one side",
        kind="checkable",
        explanation="With the absolute score the upper side that the switch looks at may never be "
        "missed; with the signed score and the B of the theorem the bound is false.",
        evidence=("proof", "counterexample"),
        certificates=(
            "scores with a sign break the printed bound",
            "scores with a sign",
            "upper side alone is covered more often",
            "upper side alone has no guarantee from below",
        ),
        chapter="stretching",
    ),
    Erratum(
        number=18,
        where="Section I, conformal prediction in brief",
        printed=r"$\{(X_1,Y_1)\}_{i=1}^n$ and $\sum_{i=1}^T\mathrm{err}_t$",
        corrected=r"$\{(X_i,Y_i)\}_{i=1}^n$ and $\sum_{t=1}^T\mathrm{err}_t$",
        kind="wording",
        explanation="Indices: as printed the set holds one pair n times, and the sum is T times "
        "one term.",
        evidence=("note",),
        chapter="promise",
    ),
    Erratum(
        number=19,
        where="experiments",
        printed="conformal PID controller",
        corrected="not decided: Section III defines the P part only; both are run and reported",
        kind="wording",
        explanation="Whether an integrator was used is not said. It matters: the saturated "
        "integrator has its own bound, and the lag in the public code weakens that.",
        evidence=("proof", "counterexample", "note"),
        certificates=(
            "saturated integrator without lag",
            "saturated integrator with lag",
            "lag breaks the range without lag",
        ),
        chapter="stretching",
    ),
    Erratum(
        number=20,
        where="introduction; Section III-B ('formal safety guarantees')",
        printed="coverage is read as safety",
        corrected="coverage is an average over time; every dangerous step may be missed",
        kind="checkable",
        explanation="If danger is rarer than alpha, all misses can fall on it.",
        evidence=("proof", "simulation"),
        certificates=("every dangerous step missed",),
        chapter="limits",
    ),
)
"""All errata, by number."""


def erratum(number: int) -> Erratum:
    """Return an erratum by its number.

    Raises:
        ValueError: if there is none of this number.

    Examples:
        >>> print(erratum(4).where)
        Theorem 1, last line of the proof
        >>> erratum(10).kind, erratum(3).tests
        ('wording', ('test_erratum_03_printed', 'test_erratum_03_corrected'))
    """
    if not 1 <= number <= len(ERRATA):
        msg = f"number must lie between 1 and {len(ERRATA)}, got {number!r}"
        raise ValueError(msg)
    return ERRATA[number - 1]


def as_table() -> pd.DataFrame:
    """Return the errata as a table, one row each.

    Returns:
        Columns `number`, `where`, `printed`, `corrected`, `kind`, `explanation`, `evidence`,
        `certificates`, `tests` and `chapter`; texts are Markdown with LaTeX.

    Examples:
        >>> as_table().kind.value_counts().to_dict()
        {'checkable': 15, 'wording': 5}
    """
    import pandas as pd

    rows = [
        {
            "number": row.number,
            "where": row.where,
            "printed": row.printed,
            "corrected": row.corrected,
            "kind": row.kind,
            "explanation": row.explanation,
            "evidence": ", ".join(row.evidence),
            "certificates": ", ".join(row.certificates),
            "tests": ", ".join(row.tests),
            "chapter": row.chapter,
        }
        for row in ERRATA
    ]
    return pd.DataFrame(rows)
