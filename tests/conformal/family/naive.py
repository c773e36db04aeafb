"""The members' definitions written down plainly, from their docstrings, with no thought of speed.

Each is a generator: it yields a threshold and is sent the score and the threshold that it met.
"""

import math

from cpl.conformal.family import (
    ACI,
    COP,
    ECI,
    EWMA,
    KT,
    PID,
    SAOCP,
    SFOGD,
    UPOCP,
    CostAware,
    DecisionTheory,
    DtACI,
    Rolling,
    Split,
)


def quantile(scores, p, convention):
    """Read a p-quantile off a sample."""
    ordered, n = sorted(scores), len(scores)
    if not 0 <= p <= 1:
        return math.copysign(math.inf, p)
    match convention:
        case "linear":
            k = min(math.floor(p * (n - 1)), n - 1)
            return ordered[k] + (p * (n - 1) - k) * (ordered[min(k + 1, n - 1)] - ordered[k])
        case "higher":
            return ordered[math.ceil(p * (n - 1))]
        case "corrected":
            rank = math.ceil(p * (n + 1))
            return math.inf if rank > n else ordered[max(rank, 1) - 1]
    return ordered[max(math.ceil(p * n), 1) - 1]


def thresholds(rule, alpha, q0):
    """Return the generator of a member."""
    for kind, make in _NAIVE.items():
        if type(rule) is kind:
            return make(rule, alpha, q0)
    raise AssertionError(rule)


def _aci(rule, alpha, q0):
    level, past, q = alpha, [], q0
    while True:
        s, met = yield q
        level += rule.gamma * (alpha - (s > met))
        if rule.clip:
            level = min(max(level, 0.0), 1.0)
        past.append(s)
        q = quantile(past[-rule.window :], 1 - level, rule.quantile)


def _dtaci(rule, alpha, q0):
    K, past, q = len(rule.gammas), [], q0
    levels, weights = [alpha] * K, [1 / K] * K
    rate, mixed = rule.numbers(alpha)[3:5]
    while True:
        s, _ = yield q
        window = past[-rule.window :]
        if len(window) > max(rule.wait, 0):
            beta = sum(x >= s for x in window) / len(window)
            losses = [max(alpha * (beta - a), (alpha - 1) * (beta - a)) for a in levels]
            weights = [w * math.exp(-rate * loss) for w, loss in zip(weights, losses, strict=True)]
            total = sum(weights)
            weights = [(1 - mixed) * w / total + mixed / K for w in weights]
            weights = [w / sum(weights) for w in weights]
            levels = [
                a + g * (alpha - (a > beta)) for a, g in zip(levels, rule.gammas, strict=True)
            ]
            if rule.clip:
                levels = [min(max(a, 0.0), 1.0) for a in levels]
        past.append(s)
        level = sum(w * a for w, a in zip(weights, levels, strict=True))
        q = quantile(past[-rule.window :], 1 - level, rule.quantile)


def _sf_ogd(rule, alpha, q0):
    q, squares = q0, 0.0
    while True:
        s, met = yield q
        g = (s > met) - alpha
        squares += g * g
        q += rule.scale / math.sqrt(3) / math.sqrt(squares) * g
        q = max(q, 0.0) if rule.clip else q


def _saocp(rule, alpha, q0):
    experts, t, q = [], 0, q0

    def weight(e):
        return e["z"] / e["n"] * (1 + e["b"]) if e["n"] else 0.0

    def played():
        p = [e["prior"] * max(weight(e), 0.0) for e in experts]
        p = p if sum(p) > 0 else [e["prior"] for e in experts]
        return sum(w * e["q"] for w, e in zip(p, experts, strict=True)) / sum(p)

    def loss(s, q):
        return max((1 - alpha) * (s - q), alpha * (q - s))

    while True:
        s, _ = yield q
        t += 1
        experts = [e for e in experts if e["n"] <= e["life"]]
        life = rule.lifetime * (t & -t)
        prior = 1 / (t * t * (1 + math.floor(math.log2(t))))
        experts.append({"prior": prior, "life": life, "q": q, "g": 0, "z": 0, "b": 0, "n": 0})
        meta = loss(s, played())
        for e in experts:
            w = weight(e)
            won = min((meta - loss(s, e["q"])) / rule.scale / max(alpha, 1 - alpha), 1.0)
            won = 0.0 if abs(won) <= 1e-12 else max(won, -1.0 if w > 0 else 0.0)
            e["z"] += won
            e["b"] += won * w
            e["n"] += 1
            g = (s > e["q"]) - alpha
            e["g"] += g * g
            e["q"] += rule.scale / math.sqrt(3 * e["g"]) * g
            e["q"] = max(e["q"], 0.0) if rule.clip else e["q"]
        q = played()


def _pid(rule, alpha, q0):
    p, errors, level, trend, q = q0, [], None, 0.0, q0
    while True:
        s, met = yield q
        known = sum(errors) - alpha * len(errors)
        errors.append(s > met)
        p += rule.eta * (errors[-1] - alpha)
        t = len(errors)
        z = known * math.log(t) / (rule.C_sat * t)
        lift = rule.K_I and (
            math.copysign(math.inf, z) if abs(z) >= math.pi / 2 else rule.K_I * math.tan(z)
        )
        if level is None:
            level = s
        else:
            before = level
            level = rule.level * s + (1 - rule.level) * (level + trend)
            trend = rule.trend * (level - before) + (1 - rule.trend) * trend
        q = p + lift + level + trend


def _eci(rule, alpha, q0):
    p, q, past, terms = q0, q0, [], []
    while True:
        s, met = yield q
        window = past[-rule.window :] if rule.window else []
        spread = max(window) - min(window) if window else math.inf
        step = rule.eta * spread if window else rule.eta
        x = s - met
        sigmoid = 1 / (1 + math.exp(min(-rule.slope * x, 700.0)))
        term = x * rule.slope * sigmoid * (1 - sigmoid) if math.isfinite(x) else 0.0
        if rule.cutoff and abs(x) < spread:
            term = 0.0
        terms.append(term)
        if rule.decay:
            old = terms[:-1]
            weights = [rule.decay ** (len(old) - 1 - k) for k in range(len(old))]
            term = sum(w * e for w, e in zip(weights, old, strict=True)) / (sum(weights) or 1.0)
        p += step * ((s > met) - alpha)
        q = p + step * term
        if rule.form == "accumulated":
            p = q
        past.append(s)


def _kt(rule, alpha, q0):
    wealth, gs = rule.wealth, []
    bet, q = 0.0, q0
    while True:
        s, met = yield q
        gs.append((s > met) - alpha)
        wealth *= 1 + bet * gs[-1]
        bet = sum(gs) / (len(gs) + 1)
        q = q0 + bet * wealth


def _up_ocp(rule, alpha, q0):
    wealth, misses, events, q = rule.wealth, 0, 0, q0
    while True:
        s, met = yield q
        b = (misses + 0.5) / (events + 1)
        bet = b / alpha - (1 - b) / (1 - alpha)
        wealth *= 1 + bet * ((s > met) - alpha)
        misses, events = misses + (s > met), events + 1
        b = (misses + 0.5) / (events + 1)
        q = q0 + (b / alpha - (1 - b) / (1 - alpha)) * wealth


def _cop(rule, alpha, q0):
    p, past, q = q0, [], q0
    while True:
        s, met = yield q
        p += rule.eta * ((s > met) - alpha)
        past.append(s)
        window = past[-rule.window :]
        q = p + rule.eta * (1 - sum(x <= p for x in window) / len(window) - alpha)


def _cost_aware(rule, alpha, q0):
    q = q0
    while True:
        s, met = yield q
        cost = 1 + rule.cost * min((s - met) / rule.reach, 1.0)
        q += rule.eta * ((cost if s > met else 0.0) - alpha)


def _decision(rule, alpha, q0):
    q = q0
    while True:
        s, met = yield q
        q += rule.eta * (min(max((s - met) / rule.reach, 0.0), 1.0) - alpha)


def _ewma(rule, alpha, q0):
    q, mean, var = q0, None, 0.0
    rho = 1 / rule.memory
    while True:
        s, _ = yield q
        if mean is None:
            mean = s
        else:
            off = s - mean
            mean, var = mean + rho * off, (1 - rho) * (var + rho * off * off)
        q = mean + rule.deviations * math.sqrt(var)


def _rolling(rule, alpha, q0):
    past, q = [], q0
    while True:
        s, _ = yield q
        past.append(s)
        q = quantile(past[-rule.window :], 1 - alpha, rule.quantile)


def _split(rule, alpha, q0):
    past, q = [], q0
    while True:
        s, _ = yield q
        past.append(s)
        if len(past) == rule.calibration:
            q = quantile(past, 1 - alpha, "corrected")


_NAIVE = {
    ACI: _aci,
    COP: _cop,
    CostAware: _cost_aware,
    DecisionTheory: _decision,
    DtACI: _dtaci,
    ECI: _eci,
    EWMA: _ewma,
    KT: _kt,
    PID: _pid,
    Rolling: _rolling,
    SAOCP: _saocp,
    SFOGD: _sf_ogd,
    Split: _split,
    UPOCP: _up_ocp,
}
