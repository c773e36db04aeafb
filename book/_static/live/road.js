// Recorded rides side by side: the same traffic, other policies. Nothing is simulated here.
(function () {
  "use strict";

  const { kit } = self.cplLive;
  const { h, s } = kit;
  const HERE = document.currentScript.src;
  const LANES = 4;
  const LANE_M = 4;
  const LANE_PX = 15;
  const CAR = { length: 5, width: 2 };

  // ---------------------------------------------------------------- data

  function running(differences) {
    let sum = 0;
    return differences.map((d) => (sum += d) / 10);
  }

  function unpacked(ride) {
    const cars = ride.cars.map(([first, x, y, crashed]) => ({ first, x: running(x), y: running(y), crashed }));
    return { ...ride, cars, x: running(ride.ego.x), y: running(ride.ego.y), v: ride.ego.v.map((v) => v / 10) };
  }

  // A scene is a script of its own; pages from disk may load scripts, and nothing else.
  const loading = new Map();
  function scene(key) {
    const name = `ride-${key}`;
    const known = () => ({ ...self.cplLive.data[name], rides: self.cplLive.data[name].rides.map(unpacked) });
    if (self.cplLive.data[name]) return Promise.resolve(known());
    if (!loading.has(name)) {
      loading.set(
        name,
        new Promise((resolve, reject) => {
          const script = h("script", { src: new URL(`data/${name}.js`, HERE).href });
          script.onload = () => resolve(known());
          script.onerror = () => reject(new Error(`${name}.js cannot be loaded`));
          document.head.append(script);
        }),
      );
    }
    return loading.get(name);
  }

  function between(values, f) {
    const k = Math.min(Math.max(Math.floor(f), 0), values.length - 1);
    const next = Math.min(k + 1, values.length - 1);
    return values[k] + (values[next] - values[k]) * Math.min(Math.max(f - k, 0), 1);
  }

  // ---------------------------------------------------------------- one ride

  function rideView(ride, scene, rate, withStrip) {
    const now = h("span", { class: "live-now" });
    const outcome = ride.crashed
      ? `crashes after ${kit.number(ride.duration_s)} s`
      : `${kit.number(ride.duration_s)} s without a crash`;
    const average = `${ride.speed_mps.toFixed(0)} m/s on average`;
    const words = `${ride.words}: ${outcome}, ${average}`;
    const road = s("svg", { class: "live-chart live-road", role: "img", "aria-label": words });
    const strip = withStrip ? s("svg", { class: "live-chart", role: "img", "aria-label": stripWords(ride, scene) }) : undefined;
    const head = h("p", { class: "live-ride-head" }, h("strong", {}, ride.words), h("span", { class: ride.crashed ? "live-bad" : "live-good" }, `${ride.crashed ? "✕" : "✓"} ${outcome}, ${average}`), now);
    const root = h("div", { class: "live-ride" }, head, road, strip, strip && key(scene));
    let paint = null;
    let cursor = null;
    return {
      root,
      resize(width, end) {
        paint = roadPainter(road, ride, width);
        cursor = strip ? drawStrip(strip, ride, scene, width, end) : null;
      },
      show(t) {
        const f = Math.min(t * rate, ride.frames - 1);
        paint(f);
        if (cursor) cursor(Math.min(t, ride.duration_s));
        const over = t >= ride.duration_s;
        const careful = ride.safe[Math.min(Math.floor(t), ride.safe.length - 1)];
        const who = ride.policy === "switch" || ride.policy === "gate" ? (careful ? ", careful" : ", fast") : "";
        now.textContent = over && ride.crashed ? "crashed" : `${between(ride.v, f).toFixed(0)} m/s${who}`;
        root.classList.toggle("live-over", over && ride.crashed);
      },
    };
  }

  // What the lines of the strip are.
  function key({ q_safe }) {
    const sample = (kind, words) => h("span", {}, s("svg", { class: "live-chart live-sample", width: 20, height: 10, "aria-hidden": "true" }, s("line", { class: kind, x1: 0, x2: 20, y1: 5, y2: 5 })), ` ${words}`);
    const bar = h("span", {}, s("svg", { class: "live-chart live-sample", width: 20, height: 10, "aria-hidden": "true" }, s("rect", { class: "careful", y: 1, width: 20, height: 8 })), " the careful policy drives");
    return h("p", { class: "live-key" }, sample("forecast", "forecast"), sample("quantile", "forecast + q"), sample("bound", `limit ${q_safe}`), bar);
  }

  function stripWords(ride, { q_safe }) {
    const sums = ride.q.map((q, k) => (q === null ? null : q + ride.l_hat[k])).filter((v) => v !== null);
    const above = sums.filter((v) => v >= q_safe).length;
    return `Forecast plus q over time: at or above the limit ${q_safe} in ${above} of ${sums.length} decisions.`;
  }

  // Cars are drawn once and moved; a road has at most as many as were ever in sight.
  function roadPainter(svg, ride, width) {
    const height = LANES * LANE_PX;
    const [behind, ahead] = width < 500 ? [22, 90] : [40, 125];
    const px = width / (behind + ahead);
    const y = (m) => (m / LANE_M + 0.5) * LANE_PX;
    svg.setAttribute("viewBox", `0 0 ${width} ${height}`);
    svg.setAttribute("width", width);
    svg.setAttribute("height", height);
    const lines = [];
    for (let k = 1; k < LANES; k += 1) {
      lines.push(s("line", { class: "lane", x1: 0, x2: width, y1: k * LANE_PX, y2: k * LANE_PX, "stroke-dasharray": `${3 * px} ${9 * px}` }));
    }
    const box = { width: CAR.length * px, height: CAR.width * (LANE_PX / LANE_M), rx: 2 };
    const shape = (kind) => s("rect", { class: kind, x: -box.width / 2, y: -box.height / 2, ...box });
    const others = ride.cars.map(() => shape("car"));
    const ego = s("g", {}, shape("car ego"));
    const cross = s("path", { class: "crash", d: "M-7 -7L7 7M-7 7L7 -7", visibility: "hidden" });
    ego.append(cross);
    svg.replaceChildren(s("rect", { class: "asphalt", width, height }), ...lines, ...others, ego);
    return (f) => {
      const x = between(ride.x, f);
      for (const line of lines) line.setAttribute("stroke-dashoffset", (x * px) % (12 * px));
      ride.cars.forEach((car, k) => {
        const g = f - car.first;
        const seen = g >= 0 && g <= car.x.length - 1;
        others[k].setAttribute("visibility", seen ? "visible" : "hidden");
        if (!seen) return;
        others[k].setAttribute("transform", `translate(${((between(car.x, g) - x + behind) * px).toFixed(1)} ${y(between(car.y, g)).toFixed(1)})`);
        others[k].classList.toggle("wrecked", car.crashed >= 0 && f >= car.crashed);
      });
      ego.setAttribute("transform", `translate(${(behind * px).toFixed(1)} ${y(between(ride.y, f)).toFixed(1)})`);
      cross.setAttribute("visibility", ride.crashed && f >= ride.frames - 1 ? "visible" : "hidden");
    };
  }

  // Forecast and what the tracker adds to it, the limit (the agent knows none), and where the
  // careful policy drives.
  function drawStrip(svg, ride, { q_safe }, width, end) {
    const finite = ride.q.map((q, k) => (q === null ? 0 : q + ride.l_hat[k]));
    const top = Math.max(1, ...finite) * 1.05;
    const axes = kit.axes(svg, { width, height: 112, x: [0, end], y: [-0.16, top], xLabel: "time [s]", yLabel: "proximity", yTicks: [0, 0.5, 1] });
    const { X, Y } = axes;
    const known = ride.q.map((q, k) => [k, ride.l_hat[k], q]).filter(([, , q]) => q !== null);
    const stairs = (value) => known.flatMap(([k, l, q]) => [[X(k), Y(value(l, q))], [X(k + 1), Y(value(l, q))]]);
    const lower = stairs((l) => l);
    const upper = stairs((l, q) => l + q);
    const parts = [axes.frame];
    if (known.length) {
      parts.push(s("path", { class: "allowed", d: `${kit.path([...upper, ...lower.slice().reverse()])}Z` }));
      parts.push(s("path", { class: "forecast", d: kit.path(lower) }), s("path", { class: "quantile", d: kit.path(upper) }));
    }
    if (ride.policy !== "agent") parts.push(s("line", { class: "bound", x1: axes.left, x2: axes.right, y1: Y(q_safe), y2: Y(q_safe) }));
    ride.safe.forEach((safe, k) => {
      if (safe) parts.push(s("rect", { class: "careful", x: X(k), y: Y(-0.03), width: X(k + 1) - X(k) + 0.5, height: Y(-0.13) - Y(-0.03) }));
    });
    const cursor = s("line", { class: "cursor", x1: 0, x2: 0, y1: axes.top, y2: axes.bottom });
    svg.replaceChildren(...parts, cursor);
    return (t) => cursor.setAttribute("transform", `translate(${X(t).toFixed(1)} 0)`);
  }

  // ---------------------------------------------------------------- the viewer

  kit.mount("road", (stage, { scene: where }) => {
    const front = where === "front";
    const index = self.cplLive.data.rides;
    if (!index) {
      stage.append(h("p", {}, "No rides are published yet; the picture in the text stands for them."));
      return () => {};
    }
    const reduced = self.matchMedia("(prefers-reduced-motion: reduce)");
    const state = { key: index.opening, t: 0, end: 1, speed: 2, playing: false, width: 0, clock: 0 };
    let views = [];

    const roads = h("div", { class: "live-rides" });
    const time = kit.slider({ label: "time", min: 0, max: 1, step: 0.1, value: 0, words: (v) => `${v.toFixed(1)} s`, act: (t) => seek(t) });
    const play = kit.button("Play", () => (state.playing ? pause() : start()), { class: "live-button live-play" });
    const speed = kit.select({ label: "pace", options: { 1: "real time", 2: "2 × faster", 5: "5 × faster" }, value: "2", act: (v) => (state.speed = Number(v)) });
    const byTop = Object.groupBy ? Object.groupBy(index.scenes, (one) => one.top) : grouped(index.scenes);
    const ranges = kit.select({
      label: "speed range of the car",
      options: Object.fromEntries(Object.entries(byTop).map(([top, all]) => [top, `${all[0].low} to ${top} m/s`])),
      value: String(chosen().top),
      act: (top) => choose(byTop[top].find((one) => one.seed === chosen().seed) || byTop[top][0]),
    });
    const seeds = kit.select({ label: "traffic (seed)", options: seedOptions(), value: String(chosen().seed), act: (seed) => choose(byTop[chosen().top].find((one) => String(one.seed) === seed)) });
    const speech = kit.speaker();
    const choices = front ? undefined : h("div", { class: "live-controls" }, ranges.root, seeds.root, speed.root);
    speech.root.classList.add("live-unseen"); // eyes have the headings of the rides
    stage.append(...[choices, roads, h("div", { class: "live-transport" }, play, time.root), speech.root, h("p", { class: "live-hint" }, index.note)].filter(Boolean));

    function grouped(scenes) {
      const found = {};
      for (const one of scenes) (found[one.top] ??= []).push(one);
      return found;
    }

    function chosen() {
      return index.scenes.find((one) => one.key === state.key);
    }

    function seedOptions() {
      const words = (one) => one.rides.filter((ride) => ride.crashed).length;
      return Object.fromEntries(byTop[chosen().top].map((one) => [one.seed, `${one.seed}: ${words(one)} of ${one.rides.length} crash`]));
    }

    function choose(next) {
      pause();
      state.key = next.key;
      seeds.input.replaceChildren(...Object.entries(seedOptions()).map(([value, words]) => h("option", { value }, words)));
      seeds.set(String(next.seed));
      open();
    }

    function open() {
      const { key } = state;
      stage.dataset.state = "loading";
      scene(key).then((full) => {
        if (key !== state.key) return; // another one was chosen meanwhile
        const shown = front ? full.rides.filter((ride) => ["speed", "switch"].includes(ride.policy)) : full.rides;
        views = shown.map((ride) => rideView(ride, full, index.rate, !front || ride.policy === "switch"));
        roads.replaceChildren(...views.map((view) => view.root));
        state.end = Math.max(...shown.map((ride) => ride.duration_s));
        time.set(0, state.end);
        resize();
        // A still picture should tell the story: the first crash, if there is one.
        const crashes = shown.filter((ride) => ride.crashed).map((ride) => ride.duration_s);
        seek(crashes.length ? Math.min(...crashes) : 0);
        stage.dataset.state = "ready";
        speech.say(shown.map((ride) => `${ride.words}: ${ride.crashed ? "crash" : "no crash"}`).join("; "));
      });
    }

    function resize() {
      if (!state.width) return;
      for (const view of views) view.resize(state.width, state.end);
      paint();
    }

    function seek(t) {
      state.t = t;
      time.set(t.toFixed(1));
      paint();
    }

    function paint() {
      if (state.width) for (const view of views) view.show(state.t);
      stage.dataset.t = state.t.toFixed(2);
    }

    function start() {
      if (state.t >= state.end) state.t = 0;
      state.playing = true;
      state.clock = 0;
      play.textContent = "Pause";
      requestAnimationFrame(tick);
    }

    function pause() {
      state.playing = false;
      play.textContent = "Play";
    }

    function tick(clock) {
      if (!state.playing) return;
      const passed = state.clock ? Math.min(clock - state.clock, 100) / 1000 : 0;
      state.clock = clock;
      seek(Math.min(state.t + passed * state.speed, state.end));
      if (state.t >= state.end) pause();
      else requestAnimationFrame(tick);
    }

    open();
    if (front && !reduced.matches) {
      const once = new IntersectionObserver(([entry]) => {
        if (!entry.isIntersecting || stage.dataset.state !== "ready") return;
        once.disconnect();
        seek(0);
        start();
      }, { threshold: 0.5 });
      once.observe(stage);
    }
    return (width) => {
      state.width = width;
      resize();
    };
  });
})();
