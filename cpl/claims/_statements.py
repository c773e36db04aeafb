"""The paper's 50 checkable claims in our own words, with where they stand and how we decide.

Each `rule` begins with what our number is.
"""

from dataclasses import dataclass

__all__ = ["CLAIMS", "Claim"]

_INCONSISTENT = "paper inconsistent"
_HARDWARE = "needs hardware"


@dataclass(frozen=True)
class Claim:
    """One claim.

    Attributes:
        row: Its number.
        claim: What is claimed.
        where: Place in the paper.
        paper_value: The number that the paper gives, if any.
        rule: What our number is, and what decides.
        chapter: Slug of the chapter that shows it.
        flags: ``paper inconsistent``, ``needs hardware``.
    """

    row: int
    claim: str
    where: str
    paper_value: str | None
    rule: str
    chapter: str
    flags: tuple[str, ...] = ()


_THEORY = (
    Claim(
        1,
        "split conformal prediction covers with probability at least 1 - alpha",
        "Section I",
        ">= 1 - alpha",
        "mean coverage over calibration sets; in 1e5 draws of each kind mean, variance and shape "
        "meet the Beta law within 4 standard errors, and ties only add",
        "promise",
    ),
    Claim(
        2,
        "the average error tends to alpha for any sequence of data",
        "Section I",
        "alpha + o(1)",
        "share of sequences that leave the finite bound at any horizon; 0 of at least 1e4 random "
        "and adversarial ones",
        "theory",
    ),
    Claim(
        3,
        "an error happens exactly when the score exceeds the quantile",
        "Section III-A",
        "err = 1 iff s > q",
        "share of scores whose reported error contradicts s > q; 0, ties included, for every rule",
        "tracking",
    ),
    Claim(
        4,
        "Theorem 1: in every window the error rate is at most alpha + (B + eta) / (eta W)",
        "Section III-A, Theorem 1",
        "all W and T0",
        "share of windows that break the printed form (W + 1 terms); the corrected form (W terms) "
        "must hold in at least 1e6 windows and be proved, the counterexample be found",
        "theory",
        (_INCONSISTENT,),
    ),
    Claim(
        5,
        "the quantile stays in [-(1 - alpha) eta, B + alpha eta]",
        "Section III-A, proof of Theorem 1",
        "[-(1 - alpha) eta, B + alpha eta]",
        "share of settings that leave the printed range; the corrected range [-alpha eta, "
        "B + (1 - alpha) eta) must hold in all and be proved",
        "theory",
        (_INCONSISTENT,),
    ),
    Claim(
        6,
        "the update q - eta grad rho(err - alpha) brings err close to 1 - alpha",
        "Section III-A, eq. (4)",
        "1 - alpha",
        "mean of (error rate - alpha) under q + eta (err - alpha); that rule must reach alpha "
        "within its bound, the printed one leave it, and the target be proved to be alpha",
        "tracking",
        (_INCONSISTENT,),
    ),
    Claim(
        7,
        "with the step 0.1 B_hat_t a guarantee is trivial",
        "Section III-A, after Theorem 1",
        None,
        "largest deviation as a share of the bound for the running maximum; it holds in full if "
        "no reading of B_hat fails, in part if the running maximum holds and a trailing one fails",
        "stretching",
    ),
    Claim(
        8,
        "a two-sided guarantee exists",
        "Section III-A, after Theorem 1",
        None,
        "share of windows below alpha W - B/eta - 1; 0 in at least 1e6, and proved",
        "theory",
    ),
    Claim(
        9,
        "Corollary: an eventually safe policy has error rate at most alpha + o(1)",
        "Section III-B, Corollary 1",
        "alpha + o(1)",
        "share of safe processes that leave the finite bound; 0 of all small decision processes "
        "(bounded scores need no assumption), and unsafe ones do leave it",
        "stretching",
    ),
)

_ROAD = (
    Claim(
        10,
        "the switching policy satisfies Assumption 1 by design",
        "Section IV-D",
        None,
        "error rate on windows with q >= q_floor; its upper bound must be below alpha",
        "switch",
    ),
    Claim(
        11,
        "a conformal policy quickly leaves regimes in which its uncertainty is wrong",
        "Section VI",
        None,
        "99th percentile of the time until q >= s after a step shift; at most the theory's",
        "switch",
    ),
    Claim(
        12,
        "the quantile rises under distribution shift",
        "Figure 1",
        None,
        "paired difference of the quantile, out of distribution minus in; rule R",
        "trust",
    ),
    Claim(
        13,
        "other uncertainty estimates are over-confident",
        "Section I",
        None,
        "coverage of nominal 90 % sets out of distribution (HAU, dropout, ensemble); upper bound "
        "below 0.9 for each",
        "forecast",
    ),
    Claim(
        14,
        "alpha is one interpretable knob between greedy and conservative",
        "Section II",
        None,
        "rank correlation of alpha with speed and collisions over five values; both monotone",
        "switch",
    ),
    Claim(
        15,
        "four lanes, fifty cars, speed ranges 20-30, 20-40 and 20-50 m/s",
        "Section IV-A, IV-F",
        "up to 50 m/s",
        "highest speed in the widest range; the configuration must match and every range be "
        "reachable (in part: some are)",
        "road",
        (_INCONSISTENT,),
    ),
    Claim(
        16,
        "l_tilde = 2 / (1 + exp(0.1 l)) lies in [0, 1]",
        "Section IV-C",
        "[0, 1]",
        "least and greatest l_tilde; all in (0, 1] and strictly decreasing in distance",
        "drive",
    ),
    Claim(
        17,
        "DQN with two layers of 256, 200,000 steps and the stated rewards",
        "Section IV-B",
        "200,000 steps",
        "slope of the learning curve at the end, 10 seeds; the specification must match and the "
        "interval contain 0",
        "switch",
    ),
    Claim(
        18,
        "the predictor (64-128-64, 30,000 rollouts) is trained to convergence",
        "Section IV-C",
        "30,000 rollouts",
        "slope of the validation loss at the end; the number of parameters must match",
        "forecast",
    ),
    Claim(
        19,
        "evaluation mixes states in and out of distribution",
        "Section IV-F",
        None,
        "share of the switch's steps in [20, 40] that are faster than any in training; strictly "
        "between 5 and 95 %",
        "forecast",
    ),
    Claim(
        20,
        "the switch outperforms five uncertainty baselines",
        "Section IV-F, Figure 2",
        None,
        "least speed difference over the common collision levels; simultaneous band above 0 and "
        "hypervolume larger (Holm over five), by duration and by collisions per km",
        "switch",
    ),
    Claim(
        21,
        "it is always faster at the same collision frequency",
        "Figure 2",
        "always",
        "share of collision levels at which it is faster; one failure makes it hold in part",
        "switch",
    ),
    Claim(
        22,
        "its gain is larger for more stringent q_safe",
        "Section IV-F",
        None,
        "slope of the gain over q_safe; interval above 0",
        "switch",
    ),
    Claim(
        23,
        "it adds almost no computation",
        "Section IV-F",
        None,
        "time of the quantile's update as a share of the predictor's forward pass, both compiled, "
        "and its operations; below 1 % each",
        "forecast",
    ),
    Claim(
        24,
        "ensembles cost five times the computation",
        "Section IV-F",
        "5",
        "ratio of time and of operations, ensemble to single predictor; between 4.5 and 5.5",
        "forecast",
    ),
    Claim(
        25,
        "it needs no change of the model and is the simplest method but one",
        "abstract, Section IV-F",
        None,
        "number of weights that differ; 0 (simplicity: a table of lines and parameters, judged)",
        "forecast",
    ),
    Claim(
        26,
        "the safe policy alone is slow and safe (the star)",
        "Figure 2",
        None,
        "mean duration of the safe policy; longer and slower than the fast one in every range",
        "switch",
    ),
    Claim(
        27,
        "90 % coverage is verified empirically",
        "Section IV-F, Figure 3",
        "0.90",
        "pooled coverage over at least 1e5 steps; 0.90 +- 0.01 with q reset and with q carried on",
        "trust",
    ),
    Claim(
        28,
        "coverage in windows of 5 steps is above 0.9 most of the time",
        "Figure 3",
        "most of the time",
        "share of windows at or above 0.9, minus the 59 % of an exact independent 90 % process; "
        "rule R",
        "trust",
    ),
)

_LEARNING = (
    Claim(
        29,
        "the 42 cells of Table I",
        "Table I",
        "42 cells",
        "share of cells equivalent within 2 s and 1 m/s; at least 90 % must be",
        "table1",
    ),
    Claim(
        30,
        "the switch is the safest agent by a significant margin, in all three ranges",
        "Section IV-F, Table I",
        "4.3, 12.8, 14.6 s",
        "least paired difference of mean durations, Holm over six, 10 training seeds; rule R (the "
        "gain over an episode-level coin flip is reported beside it)",
        "table1",
    ),
    Claim(
        31,
        "pi_RL is the second best",
        "Section IV-F",
        "second in 3 of 3 ranges",
        "number of ranges in which it is second with probability above 0.95",
        "table1",
        (_INCONSISTENT,),
    ),
    Claim(
        32,
        "pi_RL survives 25 % longer at 20-40 than the other ablations",
        "Section IV-F",
        "1.25",
        "ratio of mean durations; interval against 1 and 1.25",
        "table1",
        (_INCONSISTENT,),
    ),
    Claim(
        33,
        "RL underperforms the switch out of distribution",
        "Section I, Section IV-F",
        None,
        "difference of mean durations, switch minus pi_RL; above 0 in both ranges",
        "table1",
    ),
    Claim(
        34,
        "no RL agent uses the quantile as well as the switch",
        "Section IV-F",
        None,
        "seconds that the switch lasts longer than the best coin of its speed between agents, "
        "pi_safe and a car that only slows down; interval above 0 in three ranges, at 0.3 and at "
        "the threshold chosen",
        "table1",
    ),
    Claim(
        35,
        "observing the quantile helps RL (pi_RL against pi_RL^nq)",
        "Section IV-F",
        None,
        "paired difference over training seeds; rule R in three ranges",
        "table1",
    ),
    Claim(
        36,
        "the penalty on q keeps pi_RL^1 in known states",
        "Section IV-F",
        None,
        "difference of the mean quantile, pi_RL minus pi_RL^1, and of the share of steps out of "
        "distribution; rule R",
        "table1",
    ),
    Claim(
        37,
        "pi_RL^2 is conservative only when the risk rises too",
        "Section IV-F",
        None,
        "deviance of its braking that q l_tilde explains beside q, on episodes that were not "
        "fitted; interval above 0",
        "ignored",
    ),
    Claim(
        38,
        "pi_speed and pi_RL^1 agree in all four numbers at 20-50",
        "Table I",
        "identical",
        "share of episodes in which both take the same actions throughout; a copied row is the "
        "other explanation",
        "table1",
        (_INCONSISTENT,),
    ),
    Claim(
        39,
        "RL fails because q is small during training",
        "Section IV-F",
        None,
        "mean duration gained by observing q, trained where q varies, minus the same in the "
        "paper's training; rule R at 20-40 and 20-50",
        "ignored",
    ),
    Claim(
        40,
        "RL policies satisfy the conditions of the guarantee in practice",
        "Section I",
        None,
        "greatest long-run error rate of an agent; at most alpha plus the bound's slack",
        "table1",
    ),
    Claim(
        41,
        "a hand-set threshold makes tuning hard",
        "Section I",
        None,
        "greatest change of duration when q_safe moves by 0.1; beyond the spread over training "
        "seeds in three ranges",
        "table1",
    ),
)

_ROBOT = (
    Claim(
        42,
        "on the robot the switch tracks better, in and out of distribution",
        "Section V-D, Figure 4",
        None,
        "difference of tracking errors; stratified exact permutation on logs",
        "run_it",
        (_HARDWARE,),
    ),
    Claim(
        43,
        "easy path: similar in distribution, a larger gap out of it",
        "Section V-D",
        None,
        "interaction of policy and distribution; its interval",
        "run_it",
        (_HARDWARE,),
    ),
    Claim(
        44,
        "hard path: the gain is mainly out of distribution",
        "Section V-D",
        None,
        "interaction of policy and distribution; its interval",
        "run_it",
        (_HARDWARE,),
    ),
    Claim(
        45,
        "medium path: better in distribution, because the predictor is poor there",
        "Section V-D",
        None,
        "AUC and Brier score of the predictor on each path",
        "run_it",
        (_HARDWARE,),
    ),
    Claim(
        46,
        "it takes longer on easy and medium paths and is faster on the hard one out of "
        "distribution, by catching false positives",
        "Section V-D, Figure 5",
        None,
        "signs of the differences in time, with the rate of false positives",
        "run_it",
        (_HARDWARE,),
    ),
    Claim(
        47,
        "coverage is above 0.8 in and out of distribution",
        "Section V-D, Figure 6",
        "> 0.8",
        "coverage with a block bootstrap; two 40-step runs are both above 0.8 by chance in 35 %",
        "run_it",
        (_HARDWARE,),
    ),
    Claim(
        48,
        "SLAM errors depend on path and speed",
        "Section V-A",
        None,
        "coefficients of a logistic fit, with intervals",
        "run_it",
        (_HARDWARE,),
    ),
    Claim(
        49,
        "trained on 43 paths with kp = 1.5 and weight 5; the false-positive rule helps",
        "Section V-B, V-C",
        "43 paths",
        "counterfactual effect of the rule on logs; the manifest of the data must match",
        "run_it",
        (_HARDWARE,),
    ),
    Claim(
        50,
        "gain rule, false-positive rule and stop rule as stated, at 10 Hz",
        "Section V-A, V-C, V-D",
        "10 Hz",
        "99th percentile of the loop's time on the emulator [ms], worst run; below 100 ms, and the "
        "rules as stated",
        "run_it",
    ),
)

CLAIMS: tuple[Claim, ...] = (*_THEORY, *_ROAD, *_LEARNING, *_ROBOT)
"""All claims, in order."""
