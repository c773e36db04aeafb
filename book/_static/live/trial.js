// An experiment on the compiled road: hundreds of paired episodes in workers, with intervals.
(function () {
  "use strict";

  const { kit, host } = self.cplLive;
  const { h } = kit;
  const FIRST_SEED = 20000000; // the book's test seeds
  const STREAMS = 10; // that a carried threshold's episodes are dealt to
  const RESAMPLES = 1000;
  const LEVELS = [0.1, 0.15, 0.2, 0.25, 0.3, 0.35, 0.4, 0.5, 0.65, 0.9]; // of a rival with a limit
  const RIVALS = {
    coin: "coin: fast or careful",
    "no quantile": "forecast without q",
  };
  const WORDS = { switch: "switch", speed: "fast policy", safe: "careful policy", "no quantile": "forecast without q" };
  const MEASURES = [
    { name: "survived", words: "rides without a crash [%]", digits: 0, of: (t) => 100 * (1 - t.crashes / t.episodes), share: true },
    { name: "crashes", words: "crashes per ride", digits: 2, of: (t) => t.crashes / t.episodes },
    { name: "per_km", words: "crashes per km", digits: 3, of: (t) => t.crashes / t.km },
    { name: "duration", words: "duration [s]", digits: 1, of: (t) => t.steps / t.episodes },
    { name: "speed", words: "mean speed [m/s]", digits: 2, of: (t) => t.speed / t.episodes },
    { name: "coverage", words: "coverage of q [%]", digits: 1, of: (t) => 100 * (1 - t.missed / t.scored) },
  ];

  // ---------------------------------------------------------------- statistics

  function tally(rows) {
    return rows.map((r) => ({ episodes: 1, crashes: r.crashed, km: r.distance_m / 1000, steps: r.steps, speed: r.speed_sum / r.steps, missed: r.missed, scored: r.scored }));
  }

  function sums(each, chosen) {
    const total = { episodes: 0, crashes: 0, km: 0, steps: 0, speed: 0, missed: 0, scored: 0 };
    for (const k of chosen) for (const name in total) total[name] += each[k][name];
    return total;
  }

  // Wilson's interval of a share, in per cent.
  function wilson(hits, n) {
    const z = 1.959963984540054;
    const p = hits / n;
    const middle = (p + (z * z) / (2 * n)) / (1 + (z * z) / n);
    const half = (z / (1 + (z * z) / n)) * Math.sqrt((p * (1 - p)) / n + (z * z) / (4 * n * n));
    return [100 * Math.max(0, middle - half), 100 * Math.min(1, middle + half)];
  }

  function quantile(sorted, p) {
    const at = p * (sorted.length - 1);
    const low = Math.floor(at);
    return sorted[low] + (at - low) * ((sorted[low + 1] ?? sorted[low]) - sorted[low]);
  }

  function interval(values) {
    const good = values.filter(Number.isFinite).sort((a, b) => a - b);
    return good.length < 0.9 * values.length ? null : [quantile(good, 0.025), quantile(good, 0.975)];
  }

  // Resamples of the seeds, the same for all arms: episodes are paired.
  function resamples(n) {
    const random = kit.randomly(1);
    return Array.from({ length: RESAMPLES }, () => Array.from({ length: n }, () => Math.floor(random() * n)));
  }

  // The rival's sums at a speed: rides of two neighbouring arms, mixed so that they are as fast.
  function atSpeed(totals, speed) {
    const sorted = [...totals].sort((a, b) => a.speed / a.episodes - b.speed / b.episodes);
    for (let k = 0; k + 1 < sorted.length; k += 1) {
      const [a, b] = [sorted[k], sorted[k + 1]];
      const [v, w] = [a.speed / a.episodes, b.speed / b.episodes];
      if (v <= speed && speed <= w) {
        const share = w > v ? (speed - v) / (w - v) : 0;
        return Object.fromEntries(Object.keys(a).map((name) => [name, a[name] + share * (b[name] - a[name])]));
      }
    }
    return null;
  }

  // Every measure of an arm, and of the switch less its rival at the switch's speed.
  function compare(own, rivals) {
    const everything = own.map((_, k) => k);
    const drawn = resamples(own.length);
    const describe = (each) => {
      const total = sums(each, everything);
      const many = drawn.map((chosen) => sums(each, chosen));
      return Object.fromEntries(MEASURES.map(({ name, of, share }) => [name, { value: of(total), ends: share ? wilson(total.episodes - total.crashes, total.episodes) : interval(many.map(of)) }]));
    };
    const difference = (of, chosen) => {
      const mine = sums(own, chosen);
      const theirs = atSpeed(rivals.map((each) => sums(each, chosen)), mine.speed / mine.episodes);
      return theirs ? of(mine) - of(theirs) : NaN;
    };
    const equal = Object.fromEntries(MEASURES.filter(({ name }) => name !== "speed" && name !== "coverage").map(({ name, of }) => {
      const value = difference(of, everything);
      return [name, { value, ends: Number.isFinite(value) ? interval(drawn.map((chosen) => difference(of, chosen))) : null }];
    }));
    return { own: describe(own), rivals: rivals.map(describe), equal };
  }

  // ---------------------------------------------------------------- the figure

  kit.mount("trial", (stage) => {
    const state = { pair: 0, top: 40, density: 1, noise: 0, alpha: 0.1, step: 0.1, delay: 3, q_safe: 0.3, carry: false, rival: "coin", episodes: 100 };
    const set = (name) => (value) => {
      state[name] = value;
    };
    const slider = (label, name, min, max, step, words) => kit.slider({ label, min, max, step, value: state[name], words, act: set(name) }).root;
    const two = (v) => v.toFixed(2);
    const controls = h("div", { class: "live-controls" },
      kit.select({ label: "pair of policies", options: { 0: "first", 1: "second", 2: "third" }, value: "0", act: (k) => set("pair")(Number(k)) }).root,
      kit.select({ label: "speeds of the car", options: { 30: "20 to 30 m/s", 40: "20 to 40 m/s", 50: "20 to 50 m/s" }, value: "40", act: (k) => set("top")(Number(k)) }).root,
      slider("density of the other cars", "density", 0.5, 2, 0.25, two),
      slider("noise of the observation", "noise", 0, 0.1, 0.01, two),
      slider("α, miscoverage", "alpha", 0.05, 0.5, 0.05, two),
      slider("step, share of the largest score", "step", 0.02, 0.5, 0.02, two),
      slider("delay of the feedback [s]", "delay", 3, 10, 1, String),
      slider("limit q_safe", "q_safe", 0.05, 1, 0.05, two),
      kit.select({ label: "threshold q", options: { reset: "reset for each ride", carry: "carried over" }, value: "reset", act: (k) => set("carry")(k === "carry") }).root,
      kit.select({ label: "rival", options: RIVALS, value: state.rival, act: set("rival") }).root,
      slider("rides of each driver", "episodes", 50, 500, 50, String));
    const speech = kit.speaker();
    const bar = h("progress", { class: "live-progress", max: 1, value: 0, "aria-label": "Rides driven", hidden: true });
    const run = kit.button("Run", () => (state.crew ? cancel() : begin()), { class: "live-button live-play" });
    const save = kit.button("Download CSV", download, { disabled: true });
    const body = h("tbody");
    const head = h("tr");
    const table = h("div", { class: "live-scroll", tabindex: 0, role: "region", "aria-label": "Results with intervals", hidden: true }, h("table", {}, h("thead", {}, head), body));
    const told = h("p", { class: "live-hint" }, "");
    stage.append(controls, h("div", { class: "live-buttons" }, run, save), bar, speech.root, table, told);
    stage.dataset.state = "waiting";

    function arms(now) {
      const rival = now.rival === "coin" ? [["speed", now.q_safe], ["safe", now.q_safe]] : [...new Set([now.q_safe, ...LEVELS])].map((q) => ["no quantile", q]);
      return [["switch", now.q_safe], ...rival].map(([driver, q_safe]) => ({ driver, q_safe, rows: [] }));
    }

    function jobsOf(arm, now) {
      const { low = 20, top, density, noise, alpha, step } = now;
      const settings = { driver: arm.driver, low, top, density, noise, alpha, step, running: true, delay: arm.driver === "no quantile" ? 3 : now.delay, q_safe: arm.q_safe };
      const carry = now.carry && arm.driver !== "no quantile";
      const seeds = Array.from({ length: now.episodes }, (_, k) => FIRST_SEED + k);
      const parts = carry ? Array.from({ length: STREAMS }, (_, k) => seeds.filter((_s, e) => e % STREAMS === k)) : chunks(seeds, 10);
      return parts.map((part) => ({ settings, seeds: part, carry, arm }));
    }

    async function begin() {
      const now = { ...state };
      stage.dataset.state = "loading";
      speech.say("Loading the road …");
      try {
        const [tab, data] = await Promise.all([host.tab(), host.pair(now.pair)]);
        const size = Math.max(1, Math.min(4, navigator.hardwareConcurrency || 2));
        const made = arms(now);
        const jobs = made.flatMap((arm) => jobsOf(arm, now));
        const all = made.length * now.episodes;
        state.crew = host.crew(size, tab, now.pair, data);
        stage.dataset.state = "running";
        run.textContent = "Cancel";
        bar.hidden = false;
        let done = 0;
        let steps = 0;
        const begun = performance.now();
        await state.crew.run(jobs.map(({ settings, seeds, carry }) => ({ settings, seeds, carry })), (job, rows) => {
          jobs.find((j) => j.settings === job.settings && j.seeds === job.seeds).arm.rows.push(...rows);
          done += rows.length;
          steps += rows.reduce((total, row) => total + row.steps, 0);
          bar.value = done / all;
          speech.say(`${done} of ${all} rides driven.`);
        });
        const seconds = (performance.now() - begun) / 1000;
        for (const arm of made) arm.rows.sort((a, b) => a.seed - b.seed);
        finish();
        state.result = { now, made, tab };
        Object.assign(stage.dataset, { state: "done", seconds: seconds.toFixed(2), rides: all, steps });
        save.disabled = false;
        render(now, made, seconds, steps, size);
      } catch (error) {
        finish();
        stage.dataset.state = "failed";
        speech.say(`The experiment cannot be run: ${error.message}.`);
      }
    }

    function cancel() {
      finish();
      stage.dataset.state = "cancelled";
      speech.say("Cancelled.");
    }

    function finish() {
      if (state.crew) state.crew.stop();
      state.crew = null;
      run.textContent = "Run";
      bar.hidden = true;
      bar.value = 0;
    }

    function render(now, made, seconds, steps, workers) {
      const [own, ...others] = made;
      const found = compare(tally(own.rows), others.map(({ rows }) => tally(rows)));
      const shown = now.rival === "coin" ? [0, 1] : [0]; // of the rival's arms, those with a column
      const names = ["switch", ...shown.map((k) => WORDS[others[k].driver]), "switch less rival, at equal speed"];
      head.replaceChildren(h("th", { scope: "col" }, "95 % intervals"), ...names.map((w) => h("th", { scope: "col" }, w)));
      body.replaceChildren(...MEASURES.map(({ name, words, digits }) => {
        const cells = [found.own[name], ...shown.map((k) => (name === "coverage" && others[k].driver === "no quantile" ? undefined : found.rivals[k][name])), found.equal[name]];
        return h("tr", { "data-measure": name }, h("th", { scope: "row" }, words), ...cells.map((cell, k) => h("td", {}, spoken(cell, digits, k === cells.length - 1))));
      }));
      table.hidden = false;
      const { per_km: lead } = found.equal;
      const rival = now.rival === "coin" ? "a coin that drives as fast" : "the forecast without q, as fast";
      const verdict = !Number.isFinite(lead.value) ? "No rival drives at the switch's speed here" : !lead.ends ? `Too few rides to say how the switch stands beside ${rival}` : lead.ends[1] < 0 ? `At equal speed the switch crashes less per kilometre than ${rival}` : lead.ends[0] > 0 ? `At equal speed the switch crashes more per kilometre than ${rival}` : `At equal speed the switch and ${rival} cannot be told apart`;
      speech.say(`${verdict}. ${made.length * now.episodes} rides in ${seconds.toFixed(1)} s.`);
      told.textContent = `${made.length} drivers, ${now.episodes} rides each on the same environment seeds ${FIRST_SEED} to ${FIRST_SEED + now.episodes - 1}; ${steps.toLocaleString("en")} decisions by ${workers} workers in ${seconds.toFixed(1)} s. Intervals: Wilson's for the share, else ${RESAMPLES} resamples of the seeds, drawn together for all drivers; they speak of this pair of policies and of no other. Rivals are mixed from ${now.rival === "coin" ? "rides of the fast and the careful policy" : "rides at the two neighbouring limits"} until they are as fast.`;
    }

    function download() {
      const { now, made, tab } = state.result;
      const text = csv(now, made, tab);
      const url = URL.createObjectURL(new Blob([text], { type: "text/csv" }));
      const anchor = h("a", { href: url, download: `road-pair-${now.pair}-top-${now.top}-${now.episodes}.csv` });
      document.body.append(anchor);
      anchor.click();
      anchor.remove();
      URL.revokeObjectURL(url);
    }

    return () => {};
  });

  // Rows as `cpl compute anywhere` gives them, below what is needed to compute them again.
  function csv(now, made, tab) {
    const shared = `pair=${now.pair} top_speed_mps=${now.top} vehicles_density=${now.density} observation_noise=${now.noise} alpha=${now.alpha} step=${now.step} delay=${now.delay} carry=${now.carry} episodes=${now.episodes} first_seed=${FIRST_SEED}`;
    const lines = [
      "# simulated; the road of cpl.highway as WebAssembly, arithmetic \"own\"",
      `# module sha256 ${tab.sha256}`,
      `# made ${new Date().toISOString()}`,
      ...made.map((arm) => `# cpl compute anywhere --set "drivers=${arm.driver}" q_safe=${arm.q_safe} ${shared}`),
      ["driver", "q_safe", ...host.COLUMNS].join(","),
    ];
    for (const { driver, q_safe, rows } of made) {
      for (const row of rows) {
        const cells = host.COLUMNS.map((name) => (name === "crashed" ? (row[name] ? "True" : "False") : row[name]));
        lines.push([driver, q_safe, ...cells].join(","));
      }
    }
    return `${lines.join("\n")}\n`;
  }

  function chunks(values, size) {
    const found = [];
    for (let k = 0; k < values.length; k += size) found.push(values.slice(k, k + size));
    return found;
  }

  function spoken(cell, digits, signed) {
    if (!cell || !Number.isFinite(cell.value)) return "–";
    const form = (v) => `${signed && v > 0 ? "+" : ""}${v.toFixed(digits).replace("-", "−")}`;
    if (!cell.ends) return form(cell.value);
    const [value, ends] = [`${form(cell.value)} `, `(${form(cell.ends[0])} to ${form(cell.ends[1])})`];
    return h("span", {}, value, h("span", { class: "live-ends" }, ends));
  }

  self.cplLive.trial = { atSpeed, compare, csv, interval, sums, tally, wilson };
})();
