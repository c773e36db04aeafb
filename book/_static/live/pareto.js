// What the switch's limit buys: published points, their intervals, and methods beside a rival at equal speed.
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
    duration: { words: "duration of a ride [s]", head: "duration [s]", digits: 1, fine: 2 },
    crashes: { words: "crashes per episode", head: "crashes per episode", digits: 3, fine: 3 },
    collisions: { words: "collisions per km", head: "collisions per km", digits: 3, fine: 3 },
  };

  // A curve read at a speed: straight lines between its points, null where it has none on one side.
  function read(points, speed, name) {
    const sorted = points.filter((p) => p[name]).map((p) => [p.speed[0], p[name][0]]).sort((a, b) => a[0] - b[0]);
    const last = sorted.length - 1;
    if (last < 0 || speed < sorted[0][0] || speed > sorted[last][0]) return null;
    const k = sorted.findIndex(([x]) => x >= speed);
    const [x1, y1] = sorted[k];
    if (x1 === speed) {
      const same = sorted.filter(([x]) => x === speed);
      return same.reduce((sum, [, y]) => sum + y, 0) / same.length;
    }
    const [x0, y0] = sorted[k - 1];
    return y0 + ((y1 - y0) / (x1 - x0)) * (speed - x0);
  }

  kit.mount("pareto", (stage) => {
    const data = self.cplLive.data.pareto;
    if (!data || !data.points.length) {
      const words = "No results on the limit q_safe are published yet. This figure fills itself when they are.";
      stage.append(h("p", { class: "live-empty" }, words));
      return () => {};
    }
    const looks = Object.fromEntries(data.methods.map(({ name }, k) => [name, LOOKS[k % LOOKS.length]]));
    const limits = [...new Set(data.points.map((point) => point.q_safe))].sort((a, b) => a - b);
    const state = { range: data.ranges[Math.floor(data.ranges.length / 2)], measure: "duration", limit: Math.floor(limits.length / 2), compare: "equal", rival: (data.methods.find(({ name }) => name === "none") || data.methods[0]).name, shown: new Set(data.methods.slice(0, 3).map(({ name }) => name)), width: 640 };

    const chart = s("svg", { class: "live-chart", role: "img", "aria-label": "" });
    const body = h("tbody");
    const change = (part) => {
      Object.assign(state, part);
      show();
    };
    const ranges = kit.select({ label: "speed range of the car", options: Object.fromEntries(data.ranges.map((r) => [r, r])), value: state.range, act: (range) => change({ range }) });
    const measure = kit.select({ label: "against speed", options: Object.fromEntries(Object.entries(MEASURES).map(([k, { head }]) => [k, head])), value: "duration", act: (name) => change({ measure: name }) });
    const limit = kit.slider({ label: "limit q_safe", min: 0, max: limits.length - 1, step: 1, value: state.limit, words: (k) => kit.number(limits[k]), act: (k) => change({ limit: k }) });
    const compare = kit.select({ label: "compare", options: { equal: "at equal speed", points: "point by point" }, value: state.compare, act: (way) => change({ compare: way }) });
    const rival = kit.select({ label: "rival", options: Object.fromEntries(data.methods.map(({ name, words }) => [name, words])), value: state.rival, act: (name) => change({ rival: name }) });
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
    const heads = h("tr");
    const table = h("div", { class: "live-scroll", tabindex: 0, role: "region", "aria-label": "The chosen points in numbers" }, h("table", {}, h("thead", {}, heads), body));
    stage.append(
      h("div", { class: "live-view" }, chart),
      h("div", { class: "live-controls" }, limit.root, ranges.root, measure.root, compare.root, rival.root),
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
      const equal = state.compare === "equal";
      rival.root.hidden = !equal;
      const inPlay = ({ name }) => curve(name).length && (state.shown.has(name) || (equal && name === state.rival));
      const methods = data.methods.filter(inPlay);
      const compared = methods.filter(({ name }) => !equal || name !== state.rival);
      drawChart(methods, equal);
      heads.replaceChildren(...headings(equal).map((w) => h("th", { scope: "col" }, w)));
      body.replaceChildren(...compared.map(({ name, words }) => (equal ? besideRow : row)(words, nearest(curve(name)))));
      if (!compared.length) body.append(h("tr", {}, h("td", { colspan: 5 }, "Choose a method beside the rival.")));
      stage.dataset.rows = compared.length;
      stage.dataset.limit = limits[state.limit];
    }

    function headings(equal) {
      if (!equal) return ["method", "q_safe", "speed [m/s]", MEASURES[state.measure].head];
      return ["method", "at speed [m/s]", MEASURES[state.measure].head, "the rival there", "differs by, 95 % interval"];
    }

    function row(words, point) {
      const { measure: name } = state;
      const cells = [interval(point.speed, 1), interval(point[name], MEASURES[name].digits)].map((parts) => h("td", {}, ...parts));
      return h("tr", {}, h("th", { scope: "row" }, words), h("td", {}, kit.number(point.q_safe)), ...cells);
    }

    // A point, the rival's curve at the point's own speed, and how far the point lies above it.
    function besideRow(words, point) {
      const { measure: name } = state;
      const { fine } = MEASURES[name];
      const there = read(curve(state.rival), point.speed[0], name);
      const gap = (point.beside[state.rival] || {})[name];
      const cells = [point.speed[0].toFixed(1), point[name] ? point[name][0].toFixed(fine) : "–", there === null ? "–" : there.toFixed(fine)];
      return h("tr", {}, h("th", { scope: "row" }, words), ...cells.map((text) => h("td", {}, text)), h("td", {}, ...difference(gap, fine)));
    }

    function difference(gap, digits) {
      if (!gap) return ["–"];
      const [v, low, high] = gap.map((x) => `${x < 0 ? "−" : "+"}${Math.abs(x).toFixed(digits)}`);
      return [v, h("span", { class: "live-ends" }, `${low} to ${high}`)];
    }

    function interval(values, digits) {
      if (!values) return ["–"];
      const [v, low, high] = values.map((x) => (x === null ? null : x.toFixed(digits)));
      return low === null || low === undefined ? [v] : [v, h("span", { class: "live-ends" }, `${low} to ${high}`)];
    }

    function drawChart(methods, equal) {
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
        if (equal && method.name === state.rival) continue; // its whole curve is the scale, no point of it
        const chosen = nearest(points);
        const there = equal ? read(curve(state.rival), chosen.speed[0], name) : null;
        if (there !== null) parts.push(s("line", { class: "cursor", x1: at(chosen)[0], x2: at(chosen)[0], y1: at(chosen)[1], y2: axes.Y(there) }));
        parts.push(...whiskers(axes, chosen, name, ink), mark(at(chosen), look, 6.5, "mark chosen"));
      }
      chart.replaceChildren(...parts);
      const spoken = methods.map((m) => {
        const p = nearest(curve(m.name));
        if (equal && m.name === state.rival) return `${m.words} is the rival`;
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

  self.cplLive.pareto = { read };

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
