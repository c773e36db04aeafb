// The quantile tracker of cpl.conformal, for pages: the same rules, the same numbers.
//
//   q[t+1] = q[t] + eta[t] (err[t] - alpha),   err[t] = scores[t] > q[t]
//
// `track` rounds as cpl.conformal.track does, operation for operation; `trackExact` counts, as
// cpl.conformal.reference.follow does, so that a tie is a tie. Bounds are computed with fractions.
// The vectors of vectors.js, made by the Python package, are run in a browser and in Node.
(function (root) {
  "use strict";

  const inNode = typeof module === "object" && module.exports;
  const family = inNode ? require("./family.js") : root.cplLive.family;

  // ---------------------------------------------------------------- steps, one for each score

  const rules = {
    fixed: (scores, rule) => scores.map(() => rule.eta),
    "running-max": (scores, rule) => scaled(rolling(scores, Math.abs, Infinity), rule.c),
    "trailing-max": (scores, rule) => scaled(rolling(scores, Math.abs, rule.window), rule.c),
    "trailing-range": (scores, rule) => {
      const above = rolling(scores, (s) => s, rule.window);
      const below = rolling(scores, (s) => -s, rule.window);
      return scores.map((_, t) => (t === 0 ? rule.lr : (above[t - 1] + below[t - 1]) * rule.lr));
    },
    decaying: (scores, rule) => scores.map((_, t) => rule.c * Math.pow(t + 1, -rule.power)),
    pi: (scores, rule) => steps(scores, rule.rule),
  };

  function steps(scores, rule) {
    if (!Object.hasOwn(rules, rule.kind)) throw new RangeError(`no rule is called ${rule.kind}`);
    return rules[rule.kind](Array.from(scores), rule);
  }

  // A few hundred scores: the plain way is fast enough.
  function rolling(scores, size, window) {
    return scores.map((_, t) => {
      let best = -Infinity;
      for (let i = Math.max(t - window + 1, 0); i <= t; i += 1) best = Math.max(best, size(scores[i]));
      return best;
    });
  }

  function scaled(values, factor) {
    return values.map((value) => factor * value);
  }

  // ---------------------------------------------------------------- trackers

  function track(scores, rule, { alpha, delay = 1, q0 = 0 }) {
    if (family.has(rule.kind)) return family.follow(scores, rule, { alpha, delay, q0 });
    const eta = steps(scores, rule);
    const q = new Array(scores.length);
    const err = new Array(scores.length);
    const beta = 1 - alpha;
    let p = q0;
    let shown = q0;
    let misses = 0;
    let events = 0;
    for (let t = 0; t < scores.length; t += 1) {
      q[t] = shown;
      err[t] = scores[t] > shown;
      const i = t - delay + 1;
      if (i < 0) continue;
      const missed = scores[i] > q[i];
      p = missed ? p + eta[i] * beta : p - eta[i] * alpha;
      if (rule.kind === "pi") {
        const known = misses;
        misses += missed ? 1 : 0;
        events += 1;
        shown = p + integral(rule, rule.lag === 0 ? misses : known, events, alpha);
      } else {
        shown = p;
      }
    }
    return { q, err, eta };
  }

  function integral(rule, known, events, alpha) {
    if (rule.K_I === 0) return 0;
    const x = known - (events - rule.lag) * alpha;
    const z = (x * Math.log(events)) / (rule.C_sat * events);
    if (z >= 0.5 * Math.PI) return Infinity;
    if (z <= -0.5 * Math.PI) return -Infinity;
    return rule.K_I * Math.tan(z);
  }

  // Fixed step, decimal numbers: everything is a whole number of one small unit.
  function trackExact(scores, { alpha, eta, delay = 1 }) {
    const { unit, a, one, e } = grid(alpha, eta, scores);
    const level = scores.map((s) => whole(s, unit));
    const counted = new Array(scores.length);
    const err = new Array(scores.length);
    let p = 0;
    for (let t = 0; t < scores.length; t += 1) {
      counted[t] = p;
      err[t] = level[t] > p;
      const i = t - delay + 1;
      if (i >= 0) p += e * ((err[i] ? one : 0) - a);
    }
    return { q: counted.map((n) => n / unit), err, eta: scores.map(() => eta) };
  }

  function grid(alpha, eta, scores) {
    const one = 10 ** places(alpha);
    const fine = 10 ** places(eta);
    const finest = scores.reduce((most, s) => Math.max(most, places(s)), 0);
    const unit = Math.max(one * fine, 10 ** finest);
    return { unit, one, a: whole(alpha, one), e: Math.round(whole(eta, unit) / one) };
  }

  function whole(value, unit) {
    return Math.round(value * unit);
  }

  function places(value) {
    const [digits, power] = String(value).split("e");
    return Math.max((digits.split(".")[1] || "").length - Number(power || 0), 0);
  }

  // ---------------------------------------------------------------- bounds, with fractions

  function fraction(value) {
    const k = places(value);
    return { n: BigInt(Number(value).toFixed(k).replace(".", "")), d: 10n ** BigInt(k) };
  }

  const times = (x, y) => ({ n: x.n * y.n, d: x.d * y.d });
  const over = (x, y) => ({ n: x.n * y.d, d: x.d * y.n });
  const plus = (x, y) => ({ n: x.n * y.d + y.n * x.d, d: x.d * y.d });
  const minus = (x, y) => plus(x, { n: -y.n, d: y.d });
  const real = (x) => Number(x.n) / Number(x.d);

  function floor({ n, d }) {
    const q = n / d;
    return Number(n % d < 0n ? q - 1n : q);
  }

  function ceil(x) {
    return -floor({ n: -x.n, d: x.d });
  }

  // The most and the fewest errors in any W steps, q[0] = 0: Theorem 1, corrected and exact.
  function maxErrors(alpha, eta, B, W, delay = 1) {
    const sum = plus(times(fraction(alpha), fraction(W)), over(fraction(B), fraction(eta)));
    return Math.min(W, ceil(sum) + delay - 1);
  }

  function minErrors(alpha, eta, B, W, delay = 1) {
    const sum = minus(times(fraction(alpha), fraction(W)), over(fraction(B), fraction(eta)));
    return Math.max(0, floor(sum) - delay + 1);
  }

  // Theorem 1's own bound on the share of errors.
  function errorRateBound(alpha, eta, B, W, delay = 1) {
    const deviation = plus(over(fraction(B), fraction(eta)), fraction(delay));
    return real(plus(fraction(alpha), over(deviation, fraction(W))));
  }

  function smallestInformativeWindow(alpha, eta, B, delay = 1) {
    const deviation = plus(over(fraction(B), fraction(eta)), fraction(delay));
    return ceil(over(deviation, minus(fraction(1), fraction(alpha))));
  }

  // Where q lives: low <= q < high.
  function quantileRange(alpha, eta, B, delay = 1) {
    const reach = times(fraction(delay), fraction(eta));
    const rest = minus(fraction(1), fraction(alpha));
    return {
      low: -real(times(reach, fraction(alpha))),
      high: real(plus(fraction(B), times(reach, rest))),
    };
  }

  // Any steps, prompt feedback: |errors - alpha W| <= (B + H) V; Infinity if a step is zero.
  function variableStepBound(eta, B, largest) {
    let variation = 1 / eta[0];
    for (let t = 1; t < eta.length; t += 1) variation += Math.max(1 / eta[t] - 1 / eta[t - 1], 0);
    return Number.isFinite(variation) ? (B + largest) * variation : Infinity;
  }

  // The sequence that attains maxErrors in its last W steps (cpl.conformal.adversary).
  function worstScores(alpha, eta, B, W, delay = 1) {
    const { a, one, e, unit } = grid(alpha, eta, [B]);
    const top = whole(B, unit);
    const scores = [];
    const p = [0];
    const play = (score) => {
      const q = p[Math.max(p.length - delay, 0)];
      scores.push(score / unit);
      p.push(p[p.length - 1] + e * ((score > q ? one : 0) - a));
    };
    for (let t = 0; t < delay; t += 1) play(0);
    for (let t = 0; t < W - delay; t += 1) play(p[p.length - 1] + e * (one - a) < top ? top : 0);
    for (let t = 0; t < Math.min(delay, W); t += 1) play(top);
    return scores;
  }

  // ---------------------------------------------------------------- the Python package's vectors

  // Return what differs from the numbers of cpl.conformal, as sentences.
  function compare(vectors) {
    const differing = [];
    const say = (what, number, ours, theirs) =>
      differing.push(`${what} ${number}: ${JSON.stringify(ours)} is not ${JSON.stringify(theirs)}`);
    vectors.tracks.forEach((v, number) => {
      const { q, err } = track(v.scores, v.rule, v);
      const near = q.every((x, t) => same(x, v.q[t], v.tolerance));
      if (!near) say("track", number, q, v.q);
      if (!err.every((e, t) => e === Boolean(v.err[t]))) say("errors", number, err, v.err);
    });
    vectors.exact.forEach((v, number) => {
      const { q, err } = trackExact(v.scores, v);
      if (!q.every((x, t) => x === v.q[t])) say("exact track", number, q, v.q);
      if (!err.every((e, t) => e === Boolean(v.err[t]))) say("exact errors", number, err, v.err);
    });
    vectors.bounds.forEach((v, number) => {
      const where = [v.alpha, v.eta, v.B, v.W, v.delay];
      const { low, high } = quantileRange(v.alpha, v.eta, v.B, v.delay);
      const ours = [maxErrors(...where), minErrors(...where), errorRateBound(...where), low, high];
      ours.push(smallestInformativeWindow(v.alpha, v.eta, v.B, v.delay));
      const theirs = [v.most, v.fewest, v.rate, v.low, v.high, v.informative];
      if (!ours.every((x, i) => same(x, theirs[i], 1e-15))) say("bounds", number, ours, theirs);
    });
    vectors.varying.forEach((v, number) => {
      const ours = variableStepBound(v.etas, v.B, v.largest);
      if (!same(ours, v.deviation, 1e-12)) say("varying bound", number, ours, v.deviation);
    });
    vectors.adversaries.forEach((v, number) => {
      const ours = worstScores(v.alpha, v.eta, v.B, v.W, v.delay);
      if (String(ours) !== String(v.scores)) say("adversary", number, ours, v.scores);
    });
    return differing;
  }

  // Infinite thresholds are written as text, since JSON has no infinity.
  function same(ours, theirs, tolerance) {
    if (typeof theirs === "string") return ours === Number(theirs);
    return ours === theirs || Math.abs(ours - theirs) <= tolerance * Math.max(1, Math.abs(theirs));
  }

  const tracker = {
    compare,
    errorRateBound,
    maxErrors,
    minErrors,
    quantileRange,
    smallestInformativeWindow,
    steps,
    track,
    trackExact,
    variableStepBound,
    worstScores,
  };
  if (inNode) module.exports = tracker;
  else root.cplLive = Object.assign(root.cplLive || {}, { tracker });
})(typeof self === "undefined" ? this : self);
