"""Certificates about Assumption 1 and the Corollary, and about scores with a sign."""

from __future__ import annotations

from collections.abc import Iterator
from types import ModuleType

from cpl.conformal.certificates.frame import Certificate, Obligation
from cpl.conformal.certificates.symbols import as_number, setting, step

__all__ = ["CERTIFICATES"]


def _safe_range(z3: ModuleType) -> Iterator[Obligation]:
    here = setting(z3)
    q, s, floor, before, n, j, K, safe = z3.Reals("q s q_floor q_before n j K alpha_safe")
    (miss,), (_, after) = step(z3, here, q, [s])
    rise = (1 - here.alpha) * here.eta
    world = (*here.given, floor >= 0, K >= 1)
    yield Obligation(
        name="an excursion begins less than one rise above the floor",
        given=(*world, s >= 0, q < floor, after >= floor),
        goal=z3.And(miss == 1, after < floor + rise),
    )
    yield Obligation(
        name="its first block lifts it by at most K - 1 rises more",
        given=(*world, before < floor + rise, j >= 0, j <= K - 1, q <= before + j * rise),
        goal=q < floor + K * rise,
    )
    yield Obligation(
        name="a whole block above the floor ends lower than it began",
        given=(
            *world,
            safe < here.alpha,
            n <= safe * K,
            q == before + here.eta * (n - here.alpha * K),
        ),
        goal=q < before,
    )
    yield Obligation(
        name="it never falls below -alpha eta",
        given=(*world, s >= 0, q >= here.low),
        goal=after >= here.low,
    )


def _safe_range_unrolled(z3: ModuleType) -> Iterator[Obligation]:
    here = setting(z3)
    first, floor, safe = z3.Reals("q_first q_floor alpha_safe")
    rise = (1 - here.alpha) * here.eta
    for K in range(1, 5):
        scores = z3.Reals(" ".join(f"s_{i}" for i in range(K)))
        misses, path = step(z3, here, first, scores)
        above = [q >= floor for q in path[:-1]]
        given = (
            *here.given,
            floor >= 0,
            safe < here.alpha,
            first >= floor,
            first < floor + rise,
            *(s >= 0 for s in scores),
            z3.Implies(z3.And(*above), sum(misses) <= safe * K),
        )
        in_block = z3.And(*(q < floor + K * rise for q in path))
        back = z3.Or(path[-1] < first, *(q < floor for q in path))
        yield Obligation(
            name=f"K = {K}: through the first block", given=given, goal=z3.And(in_block, back)
        )


def _safe_overshoot(z3: ModuleType) -> Iterator[Obligation]:
    here = setting(z3)
    first, floor, n, i, K, safe = z3.Reals("q_first q_floor n i K alpha_safe")
    later = first + here.eta * (n - here.alpha * i)
    given = (*here.given, floor >= 0, first >= floor, K >= 1, i >= 0, i <= K, safe < here.alpha)
    yield Obligation(
        name="after alpha K misses the rest of the block stays above the floor",
        given=(*given, n >= here.alpha * K),
        goal=later >= floor,
    )
    yield Obligation(
        name="but then the block has too many misses",
        given=(*given, n <= safe * K),
        goal=n < here.alpha * K,
    )


def _safe_window(z3: ModuleType) -> Iterator[Obligation]:
    here = setting(z3)
    first, last, N, W, K, floor = z3.Reals("q_first q_last N W K q_floor")
    high = floor + K * (1 - here.alpha) * here.eta
    ends = [z3.And(q >= here.low, q < high) for q in (first, last)]
    deviation = here.eta * (N - here.alpha * W)
    bound = floor + here.eta * (K * (1 - here.alpha) + here.alpha)
    given = (*here.given, floor >= 0, K >= 1, *ends, last == first + deviation)
    yield Obligation(
        name="both sides", given=given, goal=z3.And(deviation < bound, deviation > -bound)
    )


def _bounded_is_safe(z3: ModuleType) -> Iterator[Obligation]:
    here = setting(z3)
    q, s = z3.Reals("q s")
    yield Obligation(
        name="at or above B no score is missed",
        given=(*here.given, *here.bounded(s), q >= here.B),
        goal=as_number(z3, s > q) == 0,
    )


def _unbounded_is_not_safe(z3: ModuleType) -> Iterator[Obligation]:
    here = setting(z3)
    q, floor, height, s = z3.Reals("q q_floor height s")
    yield Obligation(
        name="above any floor, at any height, a larger score is missed",
        given=(*here.given, floor >= 0, q >= floor, height >= q, s == height + 1),
        goal=as_number(z3, s > q) == 1,
    )


def _one_block_only(z3: ModuleType) -> Iterator[Obligation]:
    here = setting(z3)
    floor, *scores = z3.Reals("q_floor s_1 s_2 s_3")
    misses, path = step(z3, here, z3.RealVal(0), scores)
    as_printed = z3.Implies(path[0] >= floor, misses[0] == 0)
    bound = floor + here.eta * ((1 - here.alpha) + here.alpha)
    yield Obligation(
        name="K = 1: only the first step is held to anything",
        given=(
            *here.given,
            floor > 0,
            here.eta == 1,
            here.alpha == z3.Q(1, 10),
            *(s >= 0 for s in scores),
            as_printed,
        ),
        goal=here.eta * (sum(misses) - 3 * here.alpha) >= bound,
    )


def _signed(z3: ModuleType) -> Iterator[Obligation]:
    here = setting(z3)
    q, s, lower, upper = z3.Reals("q s lower upper")
    _, (_, after) = step(z3, here, q, [s])
    low = lower - here.alpha * here.eta
    high = upper + (1 - here.alpha) * here.eta
    world = (*here.given, lower < upper)
    yield Obligation(
        name="no step leaves the shifted range",
        given=(*world, s >= lower, s <= upper, q >= low, q < high),
        goal=z3.And(after >= low, after < high),
    )
    first, last, N, W = z3.Reals("q_first q_last N W")
    ends = [z3.And(p >= low, p < high) for p in (first, last)]
    deviation = here.eta * (N - here.alpha * W)
    width = upper - lower + here.eta
    yield Obligation(
        name="the window bound with B replaced by upper - lower",
        given=(*world, *ends, last == first + deviation),
        goal=z3.And(deviation < width, deviation > -width),
    )


def _signed_naive(z3: ModuleType) -> Iterator[Obligation]:
    here = setting(z3)
    scores = z3.Reals("s_1 s_2 s_3 s_4 s_5")
    misses, _ = step(z3, here, z3.RealVal(0), scores)
    yield Obligation(
        name="T0 = 3, W = 3, scores in [-B, B]",
        given=(
            *here.given,
            here.B == 1,
            here.alpha == z3.Q(1, 2),
            *(z3.And(s >= -here.B, s <= here.B) for s in scores),
        ),
        goal=here.eta * (sum(misses[2:]) - 3 * here.alpha) >= here.B + here.eta,
    )


def _upper_side(z3: ModuleType) -> Iterator[Obligation]:
    truth, forecast, q = z3.Reals("l_tilde l_hat q")
    distance = z3.If(truth >= forecast, truth - forecast, forecast - truth)
    yield Obligation(
        name="a miss of the upper side is a miss of both sides together",
        given=(truth > forecast + q,),
        goal=distance > q,
    )


def _upper_side_never(z3: ModuleType) -> Iterator[Obligation]:
    truth, forecast, q = z3.Reals("l_tilde l_hat q")
    distance = z3.If(truth >= forecast, truth - forecast, forecast - truth)
    yield Obligation(
        name="a miss that the upper side does not see",
        given=(q >= 0, truth >= 0, truth <= 1, forecast >= 0, forecast <= 1),
        goal=z3.And(distance > q, truth <= forecast + q),
    )


CERTIFICATES: tuple[Certificate, ...] = (
    Certificate(
        name="range under an eventually safe policy",
        kind="proof",
        statement="If K steps in a row at or above q_floor never hold more than alpha_safe K "
        "misses, from every start time, then q < q_floor + K (1 - alpha) eta, although the scores "
        "have no upper limit.",
        formula=r"-\alpha\eta \le q_t < q^{floor}+K(1-\alpha)\eta",
        machine="the beginning of an excursion above the floor, its first block, the fall over any "
        "whole block, and the lower end; for all real K at once",
        by_hand="cutting an excursion into its first block and the blocks that end at each later "
        "time; induction over t",
        paper="Corollary 1",
        errata=(15,),
        build=_safe_range,
    ),
    Certificate(
        name="eventually safe, step by step",
        kind="proof",
        statement="The same for K = 1, 2, 3, 4 with every single score of the first block: it "
        "stays below q_floor + K (1 - alpha) eta, and by its end the quantile is lower than where "
        "the excursion began, or has been below the floor.",
        formula=r"q < q^{floor}+K(1-\alpha)\eta \quad (K=1,\dots,4)",
        machine="all paths of K steps",
        by_hand="later blocks (as above)",
        paper="Corollary 1",
        build=_safe_range_unrolled,
    ),
    Certificate(
        name="overshoot is ceil(alpha K) rises, not K",
        kind="proof",
        statement="If the run goes on, an excursion's first block has fewer than alpha K misses: "
        "with more, the quantile could not be back below the floor before the block ends, and the "
        "block would break the assumption. (K rises are possible only where the end of a run cuts "
        "the block short.)",
        formula=r"q_t < q^{floor}+\lceil\alpha K\rceil(1-\alpha)\eta",
        machine="that the block stays above the floor, and the contradiction",
        by_hand="the same cutting into blocks; before the misses reach alpha K the quantile is "
        "above the floor because the excursion has not ended",
        paper="sharper than the Corollary",
        build=_safe_overshoot,
    ),
    Certificate(
        name="window bound under an eventually safe policy",
        kind="proof",
        statement="The misses in W steps differ from alpha W by less than q_floor / eta + "
        "K (1 - alpha) + alpha, which makes the paper's o(1) explicit.",
        formula=r"|N_W-\alpha W| < \frac{q^{floor}}{\eta}+K(1-\alpha)+\alpha",
        machine="both sides from the range at both end points",
        by_hand="",
        paper="Corollary 1",
        build=_safe_window,
    ),
    Certificate(
        name="bounded scores are eventually safe",
        kind="proof",
        statement="With scores in [0, B], every policy satisfies Assumption 1: q_floor = B, K = 1, "
        "no misses at all. The Corollary then says nothing that Theorem 1 has not said.",
        formula=r"q_t \ge B \;\Rightarrow\; \mathrm{err}_t = 0",
        machine="the implication",
        by_hand="",
        paper="Assumption 1; 'this policy satisfies Assumption 1 by design'",
        errata=(13, 14),
        build=_bounded_is_safe,
    ),
    Certificate(
        name="unbounded scores need an assumption",
        kind="counterexample",
        statement="Without a bound on the scores no floor protects by itself: whatever q is, a "
        "larger score misses. A switch satisfies the assumption only if its safe policy does.",
        formula=r"s = q + 1 \;\Rightarrow\; \mathrm{err} = 1 \text{ with } q \ge q^{floor}",
        machine="a floor, a quantile above it and a score",
        by_hand="",
        paper="'this policy satisfies Assumption 1 by design'",
        errata=(14,),
        build=_unbounded_is_not_safe,
    ),
    Certificate(
        name="assumption about one block is too weak",
        kind="counterexample",
        statement="As printed, Assumption 1 speaks of the steps 1, ..., K only. A sequence can "
        "satisfy that and break the bound; it must hold from every start time.",
        formula=r"\text{(printed Assumption 1)} \;\not\Rightarrow\; "
        r"N_W < \alpha W+\frac{q^{floor}}{\eta}+1",
        machine="a floor and three scores for K = 1, W = 3, with alpha = 1/10 and eta = 1",
        by_hand="",
        paper="Assumption 1",
        errata=(15,),
        build=_one_block_only,
    ),
    Certificate(
        name="scores with a sign",
        kind="proof",
        statement="For scores in [lower, upper] everything holds with B replaced by upper - lower "
        "and the range shifted to [lower - alpha eta, upper + (1 - alpha) eta).",
        formula=r"s_t\in[l,u] \;\Rightarrow\; |N_W-\alpha W| < \frac{u-l}{\eta}+1",
        machine="one step, and the window bound",
        by_hand="induction over t; a start value inside the shifted range",
        paper="the highway's score, which the paper does not define",
        errata=(17,),
        build=_signed,
    ),
    Certificate(
        name="scores with a sign break the printed bound",
        kind="counterexample",
        statement="With scores in [-B, B] and the B of Theorem 1, the theorem is false.",
        formula=r"s_t\in[-B,B]:\quad N_3 \ge 3\alpha+\frac B\eta+1",
        machine="five scores and a step size for T0 = 3, W = 3, with alpha = 1/2 and B = 1",
        by_hand="",
        paper="Theorem 1 applied to l_tilde - l_hat",
        errata=(17,),
        build=_signed_naive,
    ),
    Certificate(
        name="upper side alone is covered more often",
        kind="proof",
        statement="With the absolute score, a true value above l_hat + q is a miss; so the side "
        "that the switch looks at is missed at most as often as both together.",
        formula=r"\tilde l > \hat l+q \;\Rightarrow\; |\tilde l-\hat l| > q",
        machine="the implication",
        by_hand="",
        paper="the switching policy and its score",
        errata=(17,),
        build=_upper_side,
    ),
    Certificate(
        name="upper side alone has no guarantee from below",
        kind="counterexample",
        statement="A miss of the absolute score need not be one of the upper side: the misses that "
        "drive q may all be of the harmless kind, and the switch is then more cautious than alpha.",
        formula=r"|\tilde l-\hat l| > q,\quad \tilde l \le \hat l+q",
        machine="a true value and a forecast in [0, 1]",
        by_hand="",
        paper="the switching policy and its score",
        errata=(17,),
        build=_upper_side_never,
    ),
)
