// What the switch's limit buys: published points, each the mean over many rides, and their intervals.
(function () {
  "use strict";

  const { kit } = self.cplLive;
  const { h, s } = kit;

  const LOOKS = [
    { color: "blue", dash: "", mark: "circle" },
    { color: "red", dash: "7 3", mark: "square" },
    { color: "green", dash: "2 3", mark: "triangle" },
    { color: "purple", dash: "9 3 2 3", mark: "diamond" },
    { color: "grey", dash: "4 4", mark: "circle" },
    { color: "ink", dash: "1 4", mark: "square" },
    { color: "blue", dash: "12 4", mark: "triangle" },
    { color: "red", dash: "3 6", mark: "diamond" },
  ];
  const MARKS = {
    circle: (r) => `M${-r} 0a${r} ${r} 0 1 0 ${2 * r} 0a${r} ${r} 0 1 0 ${-2 * r} 0`,
    square: (r) => `M${-r} ${-r}h${2 * r}v${2 * r}h${-2 * r}z`,
    triangle: (r) => `M0 ${-1.2 * r}l${1.2 * r} ${2.1 * r}h${-2.4 * r}z`,
    diamond: (r) => `M0 ${-1.4 * r}l${1.4 * r} ${1.4 * r}l${-1.4 * r} ${1.4 * r}l${-1.4 * r} ${-1.4 * r}z`,
  };
  const MEASURES = {
    duration: { words: "duration of a ride [s]", digits: 1 },
    collisions: { words: "collisions per km", digits: 3 },
  };

  kit.mount("pareto", (stage) => {
    const data = self.cplLive.data.pareto;
    if (!data || !data.points.length) {
      const words = "No results on the limit q_safe are published yet. This figure fills itself when they are.";
      stage.append(h("p", { class: "live-empty" }, words));
      return () => {};
    }
    const looks = Object.fromEntries(data.methods.map(({ name }, k) => [name, LOOKS[k % LOOKS.length]]));
    const limits = [...new Set(data.points.map((point) => point.q_safe))].sort((a, b) => a - b);
    const state = { range: data.ranges[data.ranges.length - 1], measure: "duration", limit: Math.floor(limits.length / 2), shown: new Set(data.methods.slice(0, 3).map(({ name }) => name)), width: 640 };

    const chart = s("svg", { class: "live-chart", role: "img", "aria-label": "" });
    const body = h("tbody");
    const change = (part) => {
      Object.assign(state, part);
      show();
    };
    const ranges = kit.select({ label: "speed range of the car", options: Object.fromEntries(data.ranges.map((r) => [r, r])), value: state.range, act: (range) => change({ range }) });
    const measure = kit.select({ label: "against speed", options: Object.fromEntries(Object.entries(MEASURES).map(([k, { words }]) => [k, words])), value: "duration", act: (name) => change({ measure: name }) });
    const limit = kit.slider({ label: "limit q_safe", min: 0, max: limits.length - 1, step: 1, value: state.limit, words: (k) => kit.number(limits[k]), act: (k) => change({ limit: k }) });
    const boxes = data.methods.map(({ name, words }) => {
      const box = h("input", {
        type: "checkbox",
        checked: state.shown.has(name),
        onchange: () => {
          state.shown[box.checked ? "add" : "delete"](name);
          show();
        },
      });
      return h("label", {}, box, sample(looks[name]), words);
    });
    const heads = ["method", "q_safe", "speed [m/s]", "duration [s]", "collisions/km"].map((w) => h("th", { scope: "col" }, w));
    const table = h("div", { class: "live-scroll", tabindex: 0, role: "region", "aria-label": "The chosen points in numbers" }, h("table", {}, h("thead", {}, h("tr", {}, ...heads)), body));
    stage.append(
      h("div", { class: "live-view" }, chart),
      h("div", { class: "live-controls" }, limit.root, ranges.root, measure.root),
      h("fieldset", { class: "live-choices" }, h("legend", {}, "methods"), ...boxes),
      table,
      h("p", { class: "live-hint" }, data.note),
    );

    // The curve of a method in the chosen range, by its limit.
    function curve(name) {
      return data.points.filter((p) => p.method === name && p.range === state.range).sort((a, b) => a.q_safe - b.q_safe);
    }

    function nearest(points) {
      const want = limits[state.limit];
      return points.reduce((best, p) => (Math.abs(p.q_safe - want) < Math.abs(best.q_safe - want) ? p : best));
    }

    function show() {
      const methods = data.methods.filter(({ name }) => state.shown.has(name) && curve(name).length);
      drawChart(methods);
      body.replaceChildren(...methods.map(({ name, words }) => row(words, nearest(curve(name)))));
      stage.dataset.rows = methods.length;
      stage.dataset.limit = limits[state.limit];
    }

    function row(words, point) {
      const cell = (name, digits) => h("td", {}, interval(point[name], digits));
      return h("tr", {}, h("th", { scope: "row" }, words), h("td", {}, kit.number(point.q_safe)), cell("speed", 1), cell("duration", 1), cell("collisions", 3));
    }

    function interval(values, digits) {
      if (!values) return "–";
      const [v, low, high] = values.map((x) => (x === null ? null : x.toFixed(digits)));
      return low === null || low === undefined ? v : `${v} (${low} to ${high})`;
    }

    function drawChart(methods) {
      const { measure: name, width } = state;
      const all = data.points.filter((p) => p.range === state.range && p[name]);
      const x = around(all.map((p) => p.speed[0]));
      const y = around(all.map((p) => p[name][0]));
      const axes = kit.axes(chart, { width, height: width < 500 ? 260 : 330, x, y, xLabel: "mean speed [m/s]", yLabel: MEASURES[name].words, left: 54 });
      const parts = [axes.frame];
      for (const method of methods) {
        const look = looks[method.name];
        const ink = `stroke: var(--live-${look.color})`;
        const points = curve(method.name).filter((p) => p[name]);
        if (!points.length) continue;
        const at = (p) => [axes.X(p.speed[0]), axes.Y(p[name][0])];
        parts.push(s("path", { class: "curve", style: ink, "stroke-dasharray": look.dash, d: kit.path(points.map(at)) }));
        for (const p of points) parts.push(mark(at(p), look, 3.2, "mark"));
        const chosen = nearest(points);
        parts.push(...whiskers(axes, chosen, name, ink), mark(at(chosen), look, 6.5, "mark chosen"));
      }
      chart.replaceChildren(...parts);
      const spoken = methods.map((m) => {
        const p = nearest(curve(m.name));
        return `${m.words}: ${p.speed[0].toFixed(1)} m/s, ${MEASURES[name].words} ${p[name] ? p[name][0].toFixed(MEASURES[name].digits) : "unknown"}`;
      });
      chart.setAttribute("aria-label", `Curves over the limit, at q_safe ${kit.number(limits[state.limit])}: ${spoken.join("; ")}.`);
    }

    function whiskers(axes, point, name, ink) {
      const lines = [];
      const [x, y] = [axes.X(point.speed[0]), axes.Y(point[name][0])];
      const [, low, high] = point[name];
      const [, slow, fast] = point.speed;
      if (typeof low === "number") lines.push(s("line", { class: "interval", style: ink, x1: x, x2: x, y1: axes.Y(low), y2: axes.Y(high) }));
      if (typeof slow === "number") lines.push(s("line", { class: "interval", style: ink, x1: axes.X(slow), x2: axes.X(fast), y1: y, y2: y }));
      return lines;
    }

    return (width) => change({ width });
  });

  function mark([x, y], { color, mark: shape }, size, kind) {
    return s("path", { class: kind, style: `fill: var(--live-${color})`, transform: `translate(${x.toFixed(1)} ${y.toFixed(1)})`, d: MARKS[shape](size) });
  }

  // How a method is drawn, beside its name: dash and marker, so that colour is never alone.
  function sample(look) {
    const line = s("line", { class: "curve", style: `stroke: var(--live-${look.color})`, "stroke-dasharray": look.dash, x1: 0, x2: 34, y1: 8, y2: 8 });
    return s("svg", { class: "live-sample", width: 34, height: 16, "aria-hidden": "true" }, line, mark([17, 8], look, 4, "mark"));
  }

  function around(values) {
    const [low, high] = [Math.min(...values), Math.max(...values)];
    const rim = (high - low || 1) * 0.08;
    return [low - rim, high + rim];
  }
})();
