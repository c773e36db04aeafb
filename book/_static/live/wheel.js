// The road to drive: the compiled road in this tab, with four other drivers on the same seed.
(function () {
  "use strict";

  const { kit, host } = self.cplLive;
  const { h, s } = kit;
  const LANES = 4;
  const LANE_M = 4;
  const CAR = { length: 5, width: 2 };
  const SPAN = { behind: 40, ahead: 110 }; // [m] of road in view
  const [LEFT, STAY, RIGHT, FASTER, SLOWER] = [0, 1, 2, 3, 4];
  const KEYS = { ArrowUp: LEFT, ArrowDown: RIGHT, ArrowRight: FASTER, ArrowLeft: SLOWER, Enter: STAY };
  const WORDS = ["left lane", "stay", "right lane", "faster", "slower"];
  const ICONS = ["↑", "·", "↓", "→", "←"];
  const SEED = 20000004;
  const GHOSTS = [
    { driver: "speed", letter: "F", words: "fast policy" },
    { driver: "safe", letter: "C", words: "careful policy" },
    { driver: "switch", letter: "S", words: "switch" },
    { driver: "gate", letter: "G", words: "gate" },
  ];
  const PACES = { real: "real time", half: "half speed", step: "step by step" };
  const RATE = { real: 1, half: 0.5 };

  kit.mount("wheel", (stage) => {
    const reduced = window.matchMedia("(prefers-reduced-motion: reduce)").matches;
    const state = {
      seed: SEED, top: 40, pair: 0, limit: 0.3, pace: reduced ? "step" : "real", // what a link carries
      width: 640, playing: false, wanted: STAY, frame: 0, clock: 0, all: null, trail: [], over: true,
    };
    read(location.hash);

    const road = s("svg", { class: "live-chart live-road", role: "img" });
    const strip = s("svg", { class: "live-chart", role: "img" });
    const speech = kit.speaker();
    const pad = h("div", { class: "live-pad live-wheel", tabindex: 0, role: "group", "aria-label": "The road. Arrow keys: up and down change the lane, right is faster, left is slower, Enter stays. Space starts and pauses." }, road, strip);
    const score = h("tbody");
    const heads = ["driver", "time [s]", "mean speed [m/s]", "distance [m]", "scores missed", "end"].map((w) => h("th", { scope: "col" }, w));
    const table = h("div", { class: "live-scroll", tabindex: 0, role: "region", "aria-label": "Score of every driver" }, h("table", {}, h("thead", {}, h("tr", {}, ...heads)), score));
    const play = kit.button("Drive", () => (state.playing ? pause() : start()), { class: "live-button live-play" });
    const actions = ICONS.map((icon, action) => kit.button(`${icon} ${WORDS[action]}`, () => choose(action), { class: "live-button live-action", "data-action": action }));
    const seed = h("input", { type: "number", id: kit.fresh("seed"), min: 0, max: 4294967295, step: 1, value: state.seed, inputmode: "numeric" });
    seed.addEventListener("change", () => again({ seed: Math.max(0, Math.min(4294967295, Math.round(Number(seed.value)) || 0)) }));
    const range = kit.select({ label: "speeds of your car", options: { 30: "20 to 30 m/s", 40: "20 to 40 m/s", 50: "20 to 50 m/s" }, value: String(state.top), act: (top) => again({ top: Number(top) }) });
    const pair = kit.select({ label: "pair of policies", options: { 0: "first", 1: "second", 2: "third" }, value: String(state.pair), act: (k) => again({ pair: Number(k) }) });
    const limit = kit.slider({ label: "limit q_safe of the switch", min: 0.05, max: 1, step: 0.05, value: state.limit, words: (v) => v.toFixed(2), act: (v) => again({ limit: v }) });
    const pace = kit.select({ label: "pace", options: PACES, value: state.pace, act: (name) => { pause(); state.pace = name; show(); } });
    const link = kit.button("Link to this seed", share);
    const told = h("p", { class: "live-hint" }, "");
    stage.append(
      h("div", { class: "live-view" }, pad, h("div", { class: "live-buttons live-actions" }, play, ...actions)),
      speech.root, table,
      h("div", { class: "live-controls" },
        h("div", { class: "live-control" }, h("label", { for: seed.id }, "environment seed"), seed),
        range.root, pair.root, limit.root, pace.root),
      h("div", { class: "live-buttons" }, kit.button("Next seed", () => again({ seed: state.seed + 1 })), kit.button("Begin again", () => again({})), link),
      told,
    );

    // ---------------------------------------------------------------- links

    function read(hash) {
      const found = new URLSearchParams(hash.replace(/^#/, ""));
      const take = (name, low, high) => {
        const value = Number(found.get(name));
        if (found.has(name) && value >= low && value <= high) state[name] = value;
      };
      take("seed", 0, 4294967295);
      state.seed = Math.round(state.seed);
      if (["30", "40", "50"].includes(found.get("top"))) take("top", 30, 50);
      if (["0", "1", "2"].includes(found.get("pair"))) take("pair", 0, 2);
      take("limit", 0, 2);
      if (found.get("only") === "wheel") document.documentElement.dataset.only = "wheel"; // a slide's frame
    }

    function share() {
      const hash = `#seed=${state.seed}&top=${state.top}&pair=${state.pair}&limit=${kit.number(state.limit)}`;
      history.replaceState(null, "", hash);
      const done = () => speech.say("The address of this page now leads to this seed, and is copied.");
      const not = () => speech.say("The address of this page now leads to this seed.");
      if (navigator.clipboard && window.isSecureContext) navigator.clipboard.writeText(location.href).then(done, not);
      else not();
    }

    // ---------------------------------------------------------------- the rides

    async function load() {
      stage.dataset.state = "loading";
      speech.say("Loading the road …");
      const [tab, data] = await Promise.all([host.tab(), host.pair(state.pair)]);
      state.machine = state.machine || (await host.Machine.load(tab));
      const { rows, discrete, floats } = tab.agreement;
      told.textContent = `This is the native engine's code, compiled to WebAssembly; it drives the same episodes as cpl compute anywhere, bit for bit. Against highway-env, in ${rows.toLocaleString("en")} recorded rows: ${discrete} differ in anything discrete, ${floats.toLocaleString("en")} in the last bits of a position, speed or timer, because the C library that highway-env asks rounds some sines and powers the other way. Cars are drawn frame by frame; you decide once a second.`;
      return [tab, data];
    }

    function settings(driver) {
      return { driver, low: 20, top: state.top, density: 1, noise: 0, running: true, delay: 3, alpha: 0.1, step: 0.1, q_safe: state.limit };
    }

    async function prepare() {
      const [tab, data] = await load();
      const { machine } = state;
      const networks = machine.pair(state.pair, data);
      const drivers = [{ driver: "reader", letter: "", words: "you" }, ...GHOSTS.filter(({ driver }) => tab.drivers.includes(driver))];
      const key = `${state.pair}`;
      state.kept = state.kept || new Map(); // rides of a pair, begun again rather than made anew
      if (!state.kept.has(key)) {
        const made = drivers.map((who) => ({ ...who, ride: new host.Ride(machine, networks, settings(who.driver)), slow: new host.Road(machine) }));
        for (const { slow } of made) slow.slowly(1);
        state.kept.set(key, made);
      }
      state.all = state.kept.get(key);
      for (const car of state.all) {
        car.ride.road.set(settings(car.driver));
        car.ride.set("q_safe", state.limit);
        car.ride.begin(state.seed);
        car.slow.copyFrom(car.ride.road);
        car.ended = false;
      }
      state.trail = [];
      Object.assign(state, { frame: 0, wanted: STAY, over: false, fresh: true });
      resize();
      show();
      stage.dataset.state = "ready";
    }

    function again(part) {
      pause();
      Object.assign(state, part);
      seed.value = state.seed;
      stage.dataset.seed = state.seed;
      if (state.all) return prepare().then(() => speech.say(`Seed ${state.seed}, at the start.`), failed);
      return undefined;
    }

    function failed(error) {
      stage.dataset.state = "failed";
      speech.say(`The road cannot be loaded: ${error.message}.`);
    }

    // One decision of everybody who still drives; the pictures follow frame by frame.
    function decide() {
      state.fresh = false;
      for (const car of state.all) {
        if (car.ended) continue;
        car.ride.decide();
        if (car.driver === "reader") car.ride.set("action", state.wanted);
        car.slow.copyFrom(car.ride.road);
        car.action = car.ride.get("action");
        car.ride.act();
      }
      const me = state.all[0];
      if (!me.ended) state.trail.push({ l_tilde: me.ride.get("l_tilde"), l_hat: me.ride.get("ready") ? me.ride.get("l_hat") : NaN, u: me.ride.get("u"), err: me.ride.get("err") });
      state.wanted = STAY;
      mark();
    }

    function advance() {
      if (state.frame === 0) decide();
      for (const car of state.all) {
        if (!car.ended) car.slow.step(state.frame === 0 ? car.action : STAY);
      }
      state.frame += 1;
      if (state.frame < state.machine.tab.frames) return;
      state.frame = 0;
      for (const car of state.all) {
        if (!car.ended && car.ride.get("ended")) car.ended = true;
      }
      const me = state.all[0];
      if (me.ended && !state.over) {
        state.over = true;
        const crashed = me.ride.get("crashed") === 1;
        speech.say(`${crashed ? "You have crashed" : "Arrived without a crash"} after ${me.ride.get("steps")} seconds, at ${(me.ride.get("speed_sum") / me.ride.get("steps")).toFixed(1)} metres a second on average.`);
      }
      if (state.all.every((car) => car.ended)) pause();
    }

    // ---------------------------------------------------------------- controls

    function choose(action) {
      if (!state.all) return start();
      state.wanted = action;
      mark();
      if (state.pace === "step" && !state.over) whole();
      else if (!state.playing) start();
      return undefined;
    }

    function whole() {
      do advance();
      while (state.frame !== 0);
      show();
      const me = state.all[0].ride;
      if (!state.over) speech.say(`${me.get("steps")} s, ${me.get("last_speed").toFixed(0)} m/s, forecast plus q ${(me.get("l_hat") + me.get("u")).toFixed(2)}.`);
    }

    function mark() {
      for (const button of actions) button.setAttribute("aria-pressed", String(Number(button.dataset.action) === state.wanted));
      stage.dataset.wanted = state.wanted;
    }

    function start() {
      const go = () => {
        if (state.all.every((car) => car.ended)) return prepare().then(go, failed);
        if (state.pace === "step") return whole();
        state.playing = true;
        state.clock = 0;
        play.textContent = "Pause";
        requestAnimationFrame(tick);
        return undefined;
      };
      const asked = performance.now();
      if (state.all) return go();
      return prepare().then(() => {
        go();
        stage.dataset.first = Math.round(performance.now() - asked);
      }, failed);
    }

    function pause() {
      state.playing = false;
      play.textContent = state.pace === "step" && state.all ? "Next second" : "Drive";
    }

    function tick(clock) {
      if (!state.playing) return;
      const each = 1000 / state.machine.tab.frames / RATE[state.pace];
      if (!state.clock) state.clock = clock - each;
      let most = 4; // a tab that slept does not catch up
      while (clock - state.clock >= each && state.playing && most > 0) {
        state.clock += each;
        most -= 1;
        advance();
      }
      if (most === 0) state.clock = clock;
      show();
      if (state.playing) requestAnimationFrame(tick);
    }

    pad.addEventListener("keydown", (event) => {
      if (event.ctrlKey || event.metaKey || event.altKey) return;
      if (event.key in KEYS) choose(KEYS[event.key]);
      else if (event.key === " ") play.click();
      else return;
      event.preventDefault();
    });
    document.addEventListener("visibilitychange", () => document.hidden && state.playing && pause());
    window.addEventListener("hashchange", () => {
      read(location.hash);
      for (const [control, name] of [[range, "top"], [pair, "pair"], [limit, "limit"]]) control.set(String(state[name]));
      again({});
    });

    // ---------------------------------------------------------------- pictures

    let painter = null;

    function resize() {
      painter = painterOf(road, state.width);
      show();
    }

    function show() {
      if (!state.playing) play.textContent = state.pace === "step" && state.all ? "Next second" : "Drive";
      stage.dataset.step = state.all ? state.all[0].ride.get("steps") : 0;
      if (!painter) return;
      if (!state.all) {
        painter.empty();
        strip.replaceChildren();
        strip.setAttribute("height", 0);
        return;
      }
      const me = state.all[0];
      const cars = me.slow.cars();
      painter.paint(cars, state.all);
      const speed = cars.speed[0].toFixed(0);
      road.setAttribute("aria-label", `Your car at ${speed} metres a second in lane ${Math.round(cars.y[0] / LANE_M) + 1} of ${LANES}, after ${me.ride.get("steps")} seconds.`);
      drawStrip(strip, state);
      score.replaceChildren(...state.all.map(scoreRow));
    }

    function scoreRow(car) {
      const get = (name) => car.ride.get(name);
      const steps = get("steps");
      const end = !car.ended ? "drives" : get("crashed") ? "✕ crash" : "✓ no crash";
      const cells = [steps, steps ? (get("speed_sum") / steps).toFixed(1) : "–", steps ? get("distance_m").toFixed(0) : 0, `${get("missed")} of ${get("scored")}`, end];
      const name = car.letter ? `${car.letter} · ${car.words}` : car.words;
      return h("tr", { "data-driver": car.driver }, h("th", { scope: "row" }, name), ...cells.map((c) => h("td", {}, String(c))));
    }

    play.textContent = "Drive";
    stage.dataset.state = "waiting";
    stage.dataset.seed = state.seed;
    return (width) => {
      state.width = width;
      resize();
    };
  });

  // The road from above, the reader's car at a fixed place; ghosts are outlines with a letter.
  function painterOf(svg, width) {
    const scale = width / (SPAN.behind + SPAN.ahead);
    const lane = Math.max(18, Math.min(30, scale * LANE_M * 1.3));
    const height = LANES * lane + 18;
    for (const [name, value] of Object.entries({ viewBox: `0 0 ${width} ${height}`, width, height })) svg.setAttribute(name, value);
    const Y = (y) => (y / LANE_M + 0.5) * lane;
    const asphalt = s("rect", { class: "asphalt", x: 0, y: 0, width, height: LANES * lane });
    const lines = Array.from({ length: LANES - 1 }, (_, k) => s("line", { class: "lane", x1: 0, x2: width, y1: (k + 1) * lane, y2: (k + 1) * lane, "stroke-dasharray": `${3 * scale} ${6 * scale}` }));
    const marks = s("g", { class: "live-axes" });
    const others = s("g");
    const ghosts = s("g");
    svg.replaceChildren(asphalt, ...lines, marks, others, ghosts);
    const long = CAR.length * scale;
    const wide = Math.max(8, (CAR.width / LANE_M) * lane);
    const shape = (x, y, turn, kind) => s("rect", { class: kind, x: -long / 2, y: -wide / 2, width: long, height: wide, rx: 2, transform: `translate(${x.toFixed(1)} ${y.toFixed(1)}) rotate(${((turn * 180) / Math.PI).toFixed(1)})` });

    function paint(cars, all) {
      const origin = cars.x[0] - SPAN.behind;
      const X = (x) => (x - origin) * scale;
      const seen = (x) => x > -long && x < width + long;
      const offset = origin % 9;
      for (const line of lines) line.setAttribute("stroke-dashoffset", (offset * scale).toFixed(1));
      const drawn = [];
      for (let k = cars.x.length - 1; k >= 0; k -= 1) {
        const x = X(cars.x[k]);
        if (!seen(x)) continue;
        const wrecked = cars.crashed[k] !== 0n;
        drawn.push(shape(x, Y(cars.y[k]), cars.heading[k], `car${k === 0 ? " ego" : ""}${wrecked && k > 0 ? " wrecked" : ""}`));
        if (wrecked && k === 0) drawn.push(s("path", { class: "crash", d: `M${x - 8} ${Y(cars.y[0]) - 8}l16 16m0 -16l-16 16` }));
      }
      others.replaceChildren(...drawn);
      const shades = [];
      for (const car of all.slice(1)) {
        const { x, y, heading } = car.slow.cars();
        const at = X(x[0]);
        const inside = Math.max(18, Math.min(width - 18, at));
        if (seen(at)) shades.push(shape(at, Y(y[0]), heading[0], `car ghost ${car.driver}`));
        const arrow = at < 0 ? "‹" : at > width ? "›" : "";
        const letter = arrow === "‹" ? `‹${car.letter}` : `${car.letter}${arrow}`;
        shades.push(s("text", { class: "live-letter", x: inside, y: Y(y[0]) + 4, "text-anchor": "middle" }, car.ended && car.ride.get("crashed") ? `${letter}✕` : letter));
      }
      ghosts.replaceChildren(...shades);
      const metres = [];
      for (let x = Math.ceil(origin / 50) * 50; X(x) < width; x += 50) metres.push(s("text", { x: X(x), y: height - 3, "text-anchor": "middle" }, `${x} m`));
      marks.replaceChildren(...metres);
    }

    return { paint, empty: () => others.replaceChildren(s("text", { class: "live-note", x: width / 2, y: 2 * lane + 4, "text-anchor": "middle" }, "Press Drive: the road is loaded and starts.")) };
  }

  // Forecast, forecast plus q, the limit, and what was missed, second by second.
  function drawStrip(svg, { trail, limit, width }) {
    const axes = kit.axes(svg, { width, height: 130, x: [0, 40], y: [0, 1.2], xLabel: "time [s]", yLabel: "closeness", yTicks: [0, 0.5, 1] });
    const line = (values, kind) => s("path", { class: kind, d: kit.path(values.map((v, k) => [axes.X(k), axes.Y(Math.min(v, 1.2))]).filter((p) => Number.isFinite(p[1]))) });
    const parts = [axes.frame, s("line", { class: "wall", x1: axes.left, x2: axes.right, y1: axes.Y(Math.min(limit, 1.2)), y2: axes.Y(Math.min(limit, 1.2)) }), kit.note(axes.right, axes.Y(Math.min(limit, 1.2)) - 4, "limit q_safe", "grey", "end")];
    if (trail.length > 1) {
      parts.push(line(trail.map((t) => t.l_hat), "forecast"), line(trail.map((t) => t.l_hat + t.u), "quantile"), line(trail.map((t) => (Number.isNaN(t.l_hat) ? NaN : t.u)), "errors"));
      trail.forEach((t, k) => t.err && parts.push(s("circle", { class: "missed", cx: axes.X(k), cy: axes.Y(0.04), r: 3.5 })));
      const last = trail.length - 1;
      if (!Number.isNaN(trail[last].l_hat)) {
        const x = axes.X(last) + 4;
        const anchor = last > 30 ? "end" : "start";
        const { l_hat, u } = trail[last];
        const names = [[l_hat + u, "forecast + q", "blue"], [l_hat, "forecast", "grey"], [u, "q", "red"]].sort(([a], [b]) => a - b);
        let lowest = axes.bottom - 4; // one name above the other, none on the axis
        for (const [value, words, color] of names) {
          const y = Math.min(axes.Y(Math.min(value, 1.1)) + 4, lowest);
          parts.push(kit.note(x, y, words, color, anchor));
          lowest = y - 14;
        }
      }
    }
    svg.replaceChildren(...parts);
    const now = trail[trail.length - 1];
    svg.setAttribute("aria-label", now && !Number.isNaN(now.l_hat) ? `Forecast ${now.l_hat.toFixed(2)}, quantile ${now.u.toFixed(2)}, limit ${limit.toFixed(2)}.` : "No forecast yet.");
  }
})();
