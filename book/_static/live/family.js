// The family of trackers of cpl.conformal.family, for pages: rules that keep a state of their own.
//
// A member is made from its settings, alpha and the first threshold; it is a function that takes a
// score and the threshold that the score met, and returns the next threshold. The vectors of the
// Python package are run through all of them, in Node and in a browser.
(function (root) {
  "use strict";

  const CONVENTIONS = {
    "inverted_cdf": (n, p) => Math.ceil(p * n),
    corrected: (n, p) => Math.ceil(p * (n + 1)),
    higher: (n, p) => Math.ceil(p * (n - 1)) + 1,
  };

  function quantile(scores, p, convention) {
    if (p > 1) return Infinity;
    if (p < 0) return -Infinity;
    const sorted = Float64Array.from(scores).sort();
    const n = sorted.length;
    if (convention === "linear") {
      const k = Math.min(Math.floor(p * (n - 1)), n - 1);
      return sorted[k] + (p * (n - 1) - k) * (sorted[Math.min(k + 1, n - 1)] - sorted[k]);
    }
    const rank = CONVENTIONS[convention](n, p);
    if (convention === "corrected" && rank > n) return Infinity;
    return sorted[Math.min(Math.max(rank, 1), n) - 1];
  }

  function remember(past, score, window) {
    past.push(score);
    if (past.length > window) past.shift();
  }

  const between = (x, low, high) => Math.min(Math.max(x, low), high);
  const pinball = (alpha, x) => Math.max((1 - alpha) * x, -alpha * x);

  const members = {
    aci: ({ gamma, window, quantile: convention, clip }, alpha) => {
      let level = alpha;
      const past = [];
      return (score, met) => {
        level += gamma * (alpha - (score > met ? 1 : 0));
        if (clip) level = between(level, 0, 1);
        remember(past, score, window);
        return quantile(past, 1 - level, convention);
      };
    },

    dtaci: ({ gammas, window, interval, quantile: convention, clip, wait }, alpha) => {
      const count = gammas.length;
      const mean = ((1 - alpha) ** 2 * alpha ** 3 + alpha ** 2 * (1 - alpha) ** 3) / 3;
      const rate = Math.sqrt(3 / interval) * Math.sqrt((Math.log(interval * count) + 2) / mean);
      const mixed = 1 / (2 * interval);
      let weights = gammas.map(() => 1 / count);
      let levels = gammas.map(() => alpha);
      const past = [];
      return (score) => {
        if (past.length > wait) {
          const beta = past.filter((s) => s >= score).length / past.length;
          const kept = weights.map((w, k) => {
            const off = beta - levels[k];
            return w * Math.exp(-rate * Math.max(alpha * off, (alpha - 1) * off));
          });
          const total = kept.reduce((a, b) => a + b, 0);
          const shared = kept.map((w) => ((1 - mixed) * w) / total + mixed / count);
          const sum = shared.reduce((a, b) => a + b, 0);
          weights = shared.map((w) => w / sum);
          levels = levels.map((a, k) => {
            const level = a + gammas[k] * (alpha - (a > beta ? 1 : 0));
            return clip ? between(level, 0, 1) : level;
          });
        }
        remember(past, score, window);
        const played = weights.reduce((a, w, k) => a + w * levels[k], 0);
        return quantile(past, 1 - played, convention);
      };
    },

    sf_ogd: ({ scale, clip }, alpha, q0) => {
      let q = q0;
      let squares = 0;
      return (score, met) => {
        const gradient = (score > met ? 1 : 0) - alpha;
        squares += gradient * gradient;
        q += (scale / Math.sqrt(3) / Math.sqrt(squares)) * gradient;
        if (clip) q = Math.max(q, 0);
        return q;
      };
    },

    saocp: ({ scale, lifetime, clip }, alpha, q0) => {
      let experts = [];
      let time = 0;
      let shown = q0;
      const weight = (e) => (e.age ? (e.won / e.age) * (1 + e.bet) : 0);
      const played = () => {
        const paid = experts.map((e) => e.prior * Math.max(weight(e), 0));
        const total = paid.reduce((a, b) => a + b, 0);
        const shares = total > 0 ? paid : experts.map((e) => e.prior);
        const sum = shares.reduce((a, b) => a + b, 0);
        return shares.reduce((a, share, k) => a + share * experts[k].q, 0) / sum;
      };
      return (score) => {
        time += 1;
        experts = experts.filter((e) => e.age <= e.lives);
        let lives = lifetime;
        for (let part = time; part % 2 === 0; part /= 2) lives *= 2;
        const prior = 1 / (time * time * (1 + Math.floor(Math.log2(time))));
        experts.push({ prior, lives, q: shown, squares: 0, won: 0, bet: 0, age: 0 });
        const meta = pinball(alpha, score - played());
        for (const e of experts) {
          const w = weight(e);
          let won = Math.min((meta - pinball(alpha, score - e.q)) / scale / Math.max(alpha, 1 - alpha), 1);
          won = Math.abs(won) > 1e-12 ? Math.max(won, w > 0 ? -1 : 0) : 0;
          e.won += won;
          e.bet += won * w;
          e.age += 1;
          const gradient = (score > e.q ? 1 : 0) - alpha;
          e.squares += gradient * gradient;
          e.q += (scale / Math.sqrt(3 * e.squares)) * gradient;
          if (clip) e.q = Math.max(e.q, 0);
        }
        shown = played();
        return shown;
      };
    },

    pid: ({ eta, K_I, C_sat, level: smooth, trend: tilt }, alpha, q0) => {
      let p = q0;
      let misses = 0;
      let events = 0;
      let level = 0;
      let trend = 0;
      return (score, met) => {
        const missed = score > met ? 1 : 0;
        p += eta * (missed - alpha);
        const known = misses;
        misses += missed;
        events += 1;
        let lift = 0;
        if (K_I > 0) {
          const z = ((known - (events - 1) * alpha) * Math.log(events)) / (C_sat * events);
          lift = Math.abs(z) >= 0.5 * Math.PI ? Math.sign(z) * Infinity : K_I * Math.tan(z);
        }
        if (events === 1) level = score;
        else {
          const before = level;
          level = smooth * score + (1 - smooth) * (level + trend);
          trend = tilt * (level - before) + (1 - tilt) * trend;
        }
        return p + lift + level + trend;
      };
    },

    eci: ({ eta, window, slope, form, cutoff, decay }, alpha, q0) => {
      let p = q0;
      let sum = 0;
      let weight = 0;
      const past = [];
      return (score, met) => {
        const spread = past.length ? Math.max(...past) - Math.min(...past) : Infinity;
        const step = past.length ? eta * spread : eta;
        const off = score - met;
        const bend = Number.isFinite(off) ? Math.exp(-slope * Math.abs(off)) : 0;
        let term = bend > 0 ? (off * slope * bend) / ((1 + bend) * (1 + bend)) : 0;
        if (cutoff && Math.abs(off) < spread) term = 0;
        if (decay > 0) {
          const shown = weight > 0 ? sum / weight : 0;
          sum = decay * sum + term;
          weight = decay * weight + 1;
          term = shown;
        }
        p += step * ((score > met ? 1 : 0) - alpha);
        const q = p + step * term;
        if (form === "accumulated") p = q;
        if (window > 0) remember(past, score, window);
        return q;
      };
    },

    kt: ({ wealth: first }, alpha, q0) => {
      let wealth = first;
      let sum = 0;
      let events = 0;
      return (score, met) => {
        const gradient = (score > met ? 1 : 0) - alpha;
        wealth += gradient * ((sum / (events + 1)) * wealth);
        sum += gradient;
        events += 1;
        return q0 + (sum / (events + 1)) * wealth;
      };
    },

    up_ocp: ({ wealth: first }, alpha, q0) => {
      let wealth = first;
      let misses = 0;
      let events = 0;
      return (score, met) => {
        const share = (misses + 0.5) / (events + 1);
        if (score > met) {
          wealth *= share / alpha;
          misses += 1;
        } else wealth *= (1 - share) / (1 - alpha);
        events += 1;
        return q0 + (((misses + 0.5) / (events + 1) - alpha) / (alpha * (1 - alpha))) * wealth;
      };
    },

    cop: ({ eta, window }, alpha, q0) => {
      let p = q0;
      const past = [];
      return (score, met) => {
        p += eta * ((score > met ? 1 : 0) - alpha);
        remember(past, score, window);
        return p + eta * (1 - alpha - past.filter((s) => s <= p).length / past.length);
      };
    },

    cost_aware: ({ eta, cost, reach }, alpha, q0) => {
      let q = q0;
      return (score, met) => {
        q += eta * ((score > met ? 1 + cost * Math.min((score - met) / reach, 1) : 0) - alpha);
        return q;
      };
    },

    decision: ({ eta, reach }, alpha, q0) => {
      let q = q0;
      return (score, met) => {
        q += eta * (between((score - met) / reach, 0, 1) - alpha);
        return q;
      };
    },

    ewma: ({ memory, deviations }) => {
      const rate = 1 / memory;
      let mean = null;
      let spread = 0;
      return (score) => {
        if (mean === null) mean = score;
        else {
          const off = score - mean;
          mean += rate * off;
          spread = (1 - rate) * (spread + rate * off * off);
        }
        return mean + deviations * Math.sqrt(spread);
      };
    },

    rolling: ({ window, quantile: convention }, alpha) => {
      const past = [];
      return (score) => {
        remember(past, score, window);
        return quantile(past, 1 - alpha, convention);
      };
    },

    split: ({ calibration }, alpha, q0) => {
      const past = [];
      let q = q0;
      return (score) => {
        if (past.length < calibration) {
          past.push(score);
          if (past.length === calibration) q = quantile(past, 1 - alpha, "corrected");
        }
        return q;
      };
    },
  };

  // Follow a whole sequence, as cpl.conformal.track does: feedback comes `delay` steps later.
  function follow(scores, rule, { alpha, delay = 1, q0 = 0 }) {
    const take = members[rule.kind](rule, alpha, q0);
    const q = new Array(scores.length);
    let shown = q0;
    for (let t = 0; t < scores.length; t += 1) {
      q[t] = shown;
      const i = t - delay + 1;
      if (i >= 0) shown = take(scores[i], q[i]);
    }
    return { q, err: q.map((x, t) => scores[t] > x), eta: null };
  }

  const family = { follow, has: (kind) => Object.hasOwn(members, kind), members: Object.keys(members) };
  if (typeof module === "object" && module.exports) module.exports = family;
  else root.cplLive = Object.assign(root.cplLive || {}, { family });
})(typeof self === "undefined" ? this : self);
