// A tracker to play with: choose its settings and the world, or be the adversary and draw the scores.
(function () {
  "use strict";

  const { kit, tracker } = self.cplLive;
  const { h, s } = kit;
  const STEPS = 200;
  const B = 1;

  const RULES = {
    fixed: { words: "fixed: η", rule: (size) => ({ kind: "fixed", eta: size }) },
    "running-max": {
      words: "share of the largest score so far",
      rule: (size) => ({ kind: "running-max", c: size }),
    },
    "trailing-max": {
      words: "share of the largest of the last 20 scores",
      rule: (size) => ({ kind: "trailing-max", c: size, window: 20 }),
    },
    "trailing-range": {
      words: "share of the range of the last 20 scores",
      rule: (size) => ({ kind: "trailing-range", lr: size, window: 20 }),
    },
    decaying: {
      words: "shrinking with time: η t^−0.6",
      rule: (size) => ({ kind: "decaying", c: size, power: 0.6 }),
    },
    pi: {
      words: "PI: fixed η and the sum of the errors",
      rule: (size) => ({ kind: "pi", rule: { kind: "fixed", eta: size }, K_I: 0.5, C_sat: 5, lag: 1 }),
    },
    aci: {
      words: "ACI: a level with step η/5, quantile of the last 100",
      rule: (size) => ({ kind: "aci", gamma: size / 5, window: 100, quantile: "inverted_cdf", clip: false }),
    },
    dtaci: {
      words: "DtACI: five such levels",
      rule: () => ({
        kind: "dtaci", gammas: [0.001, 0.004, 0.016, 0.064, 0.128], window: 100, interval: 100,
        quantile: "inverted_cdf", clip: false, wait: 0,
      }),
    },
    sf_ogd: { words: "SF-OGD, scale 10 η", rule: (size) => ({ kind: "sf_ogd", scale: 10 * size, clip: false }) },
    saocp: {
      words: "SAOCP, scale 10 η",
      rule: (size) => ({ kind: "saocp", scale: 10 * size, lifetime: 8, clip: false }),
    },
    pid: {
      words: "PID with a scorecaster: η",
      rule: (size) => ({ kind: "pid", eta: size, K_I: 0.5, C_sat: 5, level: 0.1, trend: 0 }),
    },
    eci: {
      words: "ECI: η times the range of the last 100",
      rule: (size) => ({ kind: "eci", eta: size, window: 100, slope: 1, form: "shown", cutoff: false, decay: 0 }),
    },
    kt: { words: "betting, wealth 10 η", rule: (size) => ({ kind: "kt", wealth: 10 * size }) },
    up_ocp: { words: "UP-OCP, wealth 10 η", rule: (size) => ({ kind: "up_ocp", wealth: 10 * size }) },
    cop: { words: "COP: η", rule: (size) => ({ kind: "cop", eta: size, window: 100 }) },
    cost_aware: {
      words: "cost-aware: η",
      rule: (size) => ({ kind: "cost_aware", eta: size, cost: 2, reach: 1 }),
    },
    decision: { words: "decision theory: η", rule: (size) => ({ kind: "decision", eta: size, reach: 0.5 }) },
    ewma: { words: "moving average and 1.3 deviations", rule: () => ({ kind: "ewma", memory: 20, deviations: 1.3 }) },
    rolling: {
      words: "quantile of the last 100 scores",
      rule: () => ({ kind: "rolling", window: 100, quantile: "inverted_cdf" }),
    },
    split: { words: "split conformal: of the first 50", rule: () => ({ kind: "split", calibration: 50 }) },
  };

  const WORLDS = {
    jump: "a jump half-way",
    none: "no shift",
    drift: "a slow drift",
    bursts: "bursts",
    waves: "waves",
    worst: "the optimal adversary",
    own: "your own scores",
  };

  const SCALES = {
    none: () => 0.45,
    jump: (t) => (t < STEPS / 2 ? 0.3 : 1),
    drift: (t) => 0.2 + (0.8 * t) / STEPS,
    bursts: (t) => (t % 50 >= 35 ? 1 : 0.25),
    waves: (t) => 0.6 + 0.4 * Math.sin((2 * Math.PI * t) / 50),
  };

  function world(kind, { alpha, eta, W, delay }, seed) {
    if (kind === "worst") {
      const worst = tracker.worstScores(alpha, eta, B, W, delay);
      return Array.from({ length: STEPS }, (_, t) => (t < worst.length ? worst[t] : 0));
    }
    const random = kit.randomly(seed);
    return Array.from({ length: STEPS }, (_, t) => round(SCALES[kind](t) * Math.max(random(), random())));
  }

  function round(score) {
    return Math.round(Math.min(Math.max(score, 0), B) * 100) / 100;
  }

  // Errors in the W steps that end with each step, and what the theory allows there.
  function windows({ err, eta }, settings) {
    const { alpha, W, delay, rule } = settings;
    const rows = [];
    let errors = 0;
    for (let t = 0; t < STEPS; t += 1) {
      errors += Number(err[t]) - (t >= W ? Number(err[t - W]) : 0);
      if (t >= W - 1) rows.push({ t, errors });
    }
    if (rule === "fixed") {
      const most = tracker.maxErrors(alpha, settings.eta, B, W, delay);
      const least = tracker.minErrors(alpha, settings.eta, B, W, delay);
      for (const row of rows) Object.assign(row, { most, least });
    } else if (delay === 1 && eta && rule !== "pi") {
      let largest = 0;
      let seen = 0;
      for (const row of rows) {
        for (; seen <= row.t; seen += 1) largest = Math.max(largest, eta[seen]);
        const deviation = tracker.variableStepBound(eta.slice(row.t - W + 1, row.t + 1), B, largest);
        row.most = Math.min(W, Math.floor(alpha * W + deviation + 1e-9));
        row.least = Math.max(0, Math.ceil(alpha * W - deviation - 1e-9));
      }
    }
    return rows;
  }

  kit.mount("tracker", (stage) => {
    const state = { alpha: 0.1, eta: 0.1, delay: 1, W: 40, rule: "fixed", world: "jump", seed: 1, at: 0, width: 640 };
    let scores = world("jump", state, state.seed);

    const above = s("svg", { class: "live-chart", role: "img", "aria-label": "" });
    const below = s("svg", { class: "live-chart", role: "img", "aria-label": "" });
    const pad = h("div", { class: "live-pad" }, above);
    const numbers = kit.readouts({
      errors: "errors in all",
      now: "q at the end",
      window: "fullest window",
      worst: "worst case, exact",
      theorem: "Theorem 1 promises",
    });
    const speech = kit.speaker();
    const hint = h("p", { class: "live-hint", id: kit.fresh("hint") });

    const change = (part) => {
      Object.assign(state, part);
      if (state.world !== "own") scores = world(state.world, state, state.seed);
      show();
    };
    const place = (score, advance) => {
      scores[state.at] = round(score);
      if (advance) state.at = Math.min(state.at + 1, STEPS - 1);
      show();
    };

    const two = (v) => v.toFixed(2);
    const controls = {
      alpha: kit.slider({ label: "α, share of errors aimed at", min: 0.01, max: 0.5, step: 0.01, value: 0.1, words: two, act: (alpha) => change({ alpha }) }),
      eta: kit.slider({ label: "η, step size", min: 0.01, max: 1, step: 0.01, value: 0.1, words: two, act: (eta) => change({ eta }) }),
      delay: kit.slider({ label: "delay of the feedback", min: 1, max: 12, step: 1, value: 1, words: (v) => (v === 1 ? "1 step" : `${v} steps`), act: (delay) => change({ delay }) }),
      W: kit.slider({ label: "W, window", min: 1, max: STEPS, step: 1, value: 40, words: (v) => (v === 1 ? "1 step" : `${v} steps`), act: (W) => change({ W }) }),
      rule: kit.select({
        label: "rule",
        options: Object.fromEntries(Object.entries(RULES).map(([name, { words }]) => [name, words])),
        value: "fixed",
        act: (rule) => change({ rule }),
      }),
      world: kit.select({ label: "the world", options: WORLDS, value: "jump", act: (name) => change({ world: name }) }),
    };
    const again = kit.button("New draw", () => change({ seed: state.seed + 1 }));
    const attack = kit.button("Be the adversary", () => {
      scores = new Array(STEPS).fill(0);
      controls.world.set("own");
      change({ world: "own", at: 0 });
      pad.focus({ preventScroll: true });
    });
    const missing = kit.button("Play 1 (B)", () => place(B, true));
    const covering = kit.button("Play 0", () => place(0, true));
    const back = kit.button("Step back", () => change({ at: Math.max(state.at - 1, 0) }));
    const play = h("div", { class: "live-buttons", hidden: true, role: "group", "aria-label": "The adversary's moves" }, missing, covering, back);

    stage.append(
      h("div", { class: "live-view" }, pad, below),
      numbers.root,
      speech.root,
      h("div", { class: "live-controls" }, ...Object.values(controls).map((c) => c.root)),
      h("div", { class: "live-buttons" }, again, attack),
      play,
      hint,
    );

    // The chart is a slider over the steps while the scores are the reader's own.
    function playable(own) {
      play.hidden = !own;
      again.hidden = own || state.world === "worst";
      hint.textContent = own
        ? "Draw with the mouse or a finger. Keys: ← → choose a step, ↑ ↓ change its score, b plays 1 and 0 plays 0, and both go on to the next step."
        : "";
      pad.classList.toggle("live-drawing", own);
      if (own) {
        const attributes = { tabindex: 0, role: "slider", "aria-label": "Scores of your own, step by step", "aria-describedby": hint.id, "aria-valuemin": 1, "aria-valuemax": STEPS };
        for (const [name, value] of Object.entries(attributes)) pad.setAttribute(name, value);
      } else {
        for (const name of ["tabindex", "role", "aria-label", "aria-describedby", "aria-valuemin", "aria-valuemax", "aria-valuenow", "aria-valuetext"]) pad.removeAttribute(name);
      }
    }

    const keys = {
      ArrowLeft: () => change({ at: Math.max(state.at - 1, 0) }),
      ArrowRight: () => change({ at: Math.min(state.at + 1, STEPS - 1) }),
      ArrowUp: () => place(scores[state.at] + 0.05, false),
      ArrowDown: () => place(scores[state.at] - 0.05, false),
      Home: () => change({ at: 0 }),
      End: () => change({ at: STEPS - 1 }),
      b: () => place(B, true),
      0: () => place(0, true),
    };
    pad.addEventListener("keydown", (event) => {
      const key = Object.hasOwn(keys, event.key) && keys[event.key];
      if (!key || state.world !== "own" || event.ctrlKey || event.metaKey || event.altKey) return;
      event.preventDefault();
      key();
    });

    let scale = null;
    let drawn = null; // the step that was drawn last
    const draw = (event) => {
      const box = above.getBoundingClientRect();
      const t = Math.round(inverse(scale.X, event.clientX - box.left, 1, STEPS)) - 1;
      const at = Math.min(Math.max(t, 0), STEPS - 1);
      const score = inverse(scale.Y, event.clientY - box.top, 0, B);
      const from = drawn === null ? at : drawn;
      const old = drawn === null ? score : scores[from];
      for (let k = Math.min(from, at); k <= Math.max(from, at); k += 1) {
        scores[k] = round(from === at ? score : old + ((score - old) * (k - from)) / (at - from));
      }
      drawn = at;
      change({ at });
    };
    pad.addEventListener("pointerdown", (event) => {
      if (state.world !== "own") return;
      pad.setPointerCapture(event.pointerId);
      drawn = null;
      draw(event);
    });
    pad.addEventListener("pointermove", (event) => {
      if (state.world === "own" && pad.hasPointerCapture(event.pointerId)) draw(event);
    });

    function show() {
      const way = { alpha: state.alpha, delay: state.delay };
      const rule = RULES[state.rule].rule(state.eta);
      const exact = state.rule === "fixed";
      const run = exact ? tracker.trackExact(scores, { ...way, eta: state.eta }) : tracker.track(scores, rule, way);
      const rows = windows(run, state);
      const own = state.world === "own";
      playable(own);
      scale = drawScores(above, run, scores, state, own);
      drawWindows(below, rows, state);
      const fullest = rows.reduce((best, row) => (row.errors > best.errors ? row : best));
      const errors = run.err.filter(Boolean).length;
      numbers.set("errors", `${errors} of ${STEPS}, ${percent(errors / STEPS)}`);
      numbers.set("now", run.q[STEPS - 1].toFixed(3));
      numbers.set("window", `${fullest.errors} of ${state.W} (steps ${fullest.t - state.W + 2}–${fullest.t + 1})`);
      numbers.set("worst", exact ? `${fullest.most} of ${state.W}` : "known for a fixed step only");
      numbers.set("theorem", theorem(state));
      const verdict = judgement(fullest, state, exact);
      speech.say(verdict);
      if (own) {
        const outcome = run.err[state.at] ? "a miss" : "covered";
        pad.setAttribute("aria-valuenow", state.at + 1);
        pad.setAttribute("aria-valuetext", `step ${state.at + 1}: score ${two(scores[state.at])} meets q ${two(run.q[state.at])}, ${outcome}`);
      }
      above.setAttribute("aria-label", `Scores and threshold over ${STEPS} steps: ${errors} errors; q ends at ${run.q[STEPS - 1].toFixed(2)}.`);
      below.setAttribute("aria-label", `Errors in the last ${state.W} steps: at most ${fullest.errors}. ${verdict}`);
      stage.dataset.errors = errors;
      stage.dataset.fullest = fullest.errors;
      stage.dataset.worst = fullest.most ?? "";
      stage.dataset.q = run.q[STEPS - 1];
    }

    return (width) => {
      state.width = width;
      show();
    };
  });

  function theorem({ rule, alpha, eta, W, delay }) {
    if (rule !== "fixed") return "nothing for this rule";
    const rate = tracker.errorRateBound(alpha, eta, B, W, delay);
    return rate >= 1 ? "nothing: a window this short may be all errors" : `less than ${percent(rate)} in any ${W}`;
  }

  function judgement(fullest, { W, rule, delay }, exact) {
    if (fullest.most === undefined) return "For this rule, or feedback that comes late, no bound of a window is computed here.";
    if (fullest.most >= W) {
      return fullest.errors === W
        ? `All ${W} steps of a window are errors, and nothing forbids it.`
        : `A window of ${W} steps may be all errors: there is no promise to break.`;
    }
    const short = fullest.most - fullest.errors;
    if (!exact) return `The fullest window is ${short} below what a bound for its steps allows (${fullest.most}).`;
    if (short < 0) throw new Error(`${fullest.errors} errors in ${W} steps break the bound of ${fullest.most}`);
    if (short === 0) return `The fullest window has ${fullest.errors} errors: the worst case, and no sequence has more.`;
    return `The fullest window is ${short} ${short === 1 ? "error" : "errors"} short of the worst case${delay > 1 ? " (a bound that need not be attained)" : ""}.`;
  }

  function percent(share) {
    return `${(100 * share).toFixed(1)} %`;
  }

  function inverse(scale, pixel, low, high) {
    return low + ((pixel - scale(low)) / (scale(high) - scale(low))) * (high - low);
  }

  function drawScores(svg, { q, err }, scores, { alpha, eta, delay, rule, width, at }, own) {
    const walls = tracker.quantileRange(alpha, eta, B, delay);
    const fixed = rule === "fixed";
    const finite = q.filter(Number.isFinite);
    const low = Math.min(-0.05, ...finite, fixed ? walls.low : 0) - 0.04;
    const high = Math.max(1, ...finite, fixed ? walls.high : 0) + 0.09;
    const axes = kit.axes(svg, { width, height: width < 500 ? 210 : 250, x: [1, STEPS], y: [low, high], xLabel: "step", yLabel: "score" });
    const { X, Y } = axes;
    const parts = [axes.frame];
    if (fixed) {
      for (const wall of [walls.low, walls.high]) parts.push(s("line", { class: "wall", x1: axes.left, x2: axes.right, y1: Y(wall), y2: Y(wall) }));
      parts.push(kit.note(axes.left + 4, Y(walls.high) - 4, width < 500 ? "q stays between the dashed walls" : "q never leaves the space between the dashed walls", "ink"));
    }
    const covered = scores.map((v, t) => (err[t] ? "" : `M${(X(t + 1) - 1.6).toFixed(1)} ${Y(v).toFixed(1)}a1.6 1.6 0 1 0 3.2 0a1.6 1.6 0 1 0 -3.2 0`));
    const missed = scores.map((v, t) => (err[t] ? `M${X(t + 1).toFixed(1)} ${(Y(v) - 4.2).toFixed(1)}l3.8 7h-7.6z` : ""));
    parts.push(s("path", { class: "covered", d: covered.join("") }), s("path", { class: "missed", d: missed.join("") }));
    const line = [];
    const shown = q.map((v) => Math.min(Math.max(v, low), high)); // an infinite one lies on the edge
    shown.forEach((v, t) => line.push([X(t + 0.5), Y(v)], [X(t + 1.5), Y(v)]));
    parts.push(s("path", { class: "quantile", d: kit.path(line) }));
    parts.push(kit.note(axes.right - 4, Y(shown[STEPS - 1]) - 7, "q", "blue", "end"));
    if (own) parts.push(s("line", { class: "cursor", x1: X(at + 1), x2: X(at + 1), y1: axes.top, y2: axes.bottom }));
    const under = axes.bottom + 30; // the line of the axis title
    parts.push(s("path", { class: "missed", d: `M${axes.left + 5} ${under - 9}l3.8 7h-7.6z` }), kit.note(axes.left + 13, under, "error", "red"));
    parts.push(s("circle", { class: "covered", cx: axes.left + 56, cy: under - 4, r: 2.2 }), kit.note(axes.left + 63, under, "covered", "grey"));
    svg.replaceChildren(...parts);
    return axes;
  }

  function drawWindows(svg, rows, { alpha, W, width }) {
    const top = Math.max(alpha * W, ...rows.map((row) => Math.max(row.errors, row.most ?? 0)));
    const yTicks = top <= 4 ? [0, 1, 2, 3, 4].filter((v) => v <= top + 1) : undefined;
    const axes = kit.axes(svg, { width, height: width < 500 ? 125 : 150, x: [1, STEPS], y: [0, top * 1.18 + 0.3], xLabel: `last step of the window of ${W}`, yLabel: "errors", yTicks });
    const { X, Y } = axes;
    const line = (name) => rows.map((row) => [X(row.t + 1), Y(row[name])]);
    const parts = [axes.frame];
    if (rows[0].most !== undefined) {
      const area = [...line("most"), ...line("least").reverse()];
      parts.push(s("path", { class: "allowed", d: `${kit.path(area)}Z` }));
      parts.push(s("path", { class: "bound", d: kit.path(line("most")) }));
      const { most } = rows[rows.length - 1];
      parts.push(kit.note(axes.right - 4, Y(most) - 5, `allowed: ${most}`, "ink", "end"));
    }
    parts.push(s("line", { class: "aim", x1: axes.left, x2: axes.right, y1: Y(alpha * W), y2: Y(alpha * W) }));
    parts.push(s("path", { class: "errors", d: kit.path(line("errors")) }));
    if (rows.length === 1) parts.push(s("circle", { class: "missed", cx: X(STEPS), cy: Y(rows[0].errors), r: 3 }));
    parts.push(kit.note(axes.left + 4, Y(alpha * W) - 4, `aim αW = ${kit.number(alpha * W)}`, "green"));
    svg.replaceChildren(...parts);
  }
})();
