// What live figures share: elements, labelled controls, charts with a readable size, quiet speech.
(function () {
  "use strict";

  const SVG = "http://www.w3.org/2000/svg";

  function h(tag, attributes = {}, ...children) {
    return filled(document.createElement(tag), attributes, children);
  }

  function s(tag, attributes = {}, ...children) {
    return filled(document.createElementNS(SVG, tag), attributes, children);
  }

  function filled(element, attributes, children) {
    for (const [name, value] of Object.entries(attributes)) {
      if (name.startsWith("on")) element.addEventListener(name.slice(2), value);
      else if (value === true) element.setAttribute(name, "");
      else if (value !== false && value !== undefined) element.setAttribute(name, value);
    }
    element.append(...children.filter((child) => child !== undefined));
    return element;
  }

  let last = 0;
  function fresh(prefix) {
    last += 1;
    return `live-${prefix}-${last}`;
  }

  // A range input with its label, and its value in words beside it.
  function slider({ label, min, max, step, value, words = String, act }) {
    const id = fresh("slider");
    const shown = h("span", { class: "live-value", "aria-hidden": "true" }, words(value));
    const input = h("input", { type: "range", id, min, max, step, value });
    const speak = () => {
      shown.textContent = words(Number(input.value));
      input.setAttribute("aria-valuetext", shown.textContent);
    };
    input.addEventListener("input", () => {
      speak();
      act(Number(input.value));
    });
    speak();
    const root = h("div", { class: "live-control" }, h("label", { for: id }, label), shown, input);
    const set = (next, limit) => {
      if (limit !== undefined) input.max = limit;
      input.value = next;
      speak();
    };
    return { root, input, set };
  }

  function select({ label, options, value, act }) {
    const id = fresh("select");
    const input = h("select", { id, onchange: () => act(input.value) });
    for (const [name, words] of Object.entries(options)) {
      input.append(h("option", { value: name, selected: name === value }, words));
    }
    const root = h("div", { class: "live-control" }, h("label", { for: id }, label), input);
    return { root, input, set: (next) => (input.value = next) };
  }

  function button(words, act, attributes = {}) {
    return h("button", { type: "button", class: "live-button", onclick: act, ...attributes }, words);
  }

  // Named numbers; `set(name, text)` changes one. Screen readers find them, and are not interrupted.
  function readouts(names) {
    const cells = {};
    const root = h("dl", { class: "live-readouts" });
    for (const [name, words] of Object.entries(names)) {
      cells[name] = h("dd", {}, "");
      root.append(h("div", {}, h("dt", {}, words), cells[name]));
    }
    return { root, set: (name, text) => (cells[name].textContent = text) };
  }

  // A line that is read aloud when it changes, but not more often than somebody can listen.
  function speaker() {
    const root = h("p", { class: "live-said", role: "status" });
    let waiting = 0;
    const say = (text) => {
      window.clearTimeout(waiting);
      waiting = window.setTimeout(() => {
        if (root.textContent !== text) root.textContent = text;
      }, 250);
    };
    return { root, say };
  }

  // ---------------------------------------------------------------- charts

  // Scales and axes of one chart, drawn in CSS pixels so that text never shrinks with the page.
  function axes(svg, { width, height, x, y, xLabel, yLabel, left = 44, bottom = 34, top = 8, right = 14, xTicks, yTicks }) {
    svg.setAttribute("viewBox", `0 0 ${width} ${height}`);
    svg.setAttribute("width", width);
    svg.setAttribute("height", height);
    const X = (v) => left + ((v - x[0]) / (x[1] - x[0])) * (width - left - right);
    const Y = (v) => height - bottom - ((v - y[0]) / (y[1] - y[0])) * (height - bottom - top);
    const frame = s("g", { class: "live-axes" });
    for (const v of yTicks || ticks(y, 4)) {
      frame.append(s("line", { class: "grid", x1: left, x2: width - right, y1: Y(v), y2: Y(v) }));
      frame.append(s("text", { x: left - 6, y: Y(v) + 4, "text-anchor": "end" }, number(v)));
    }
    for (const v of xTicks || ticks(x, Math.max(2, Math.floor(width / 110)))) {
      frame.append(s("line", { x1: X(v), x2: X(v), y1: height - bottom, y2: height - bottom + 4 }));
      frame.append(s("text", { x: X(v), y: height - bottom + 16, "text-anchor": "middle" }, number(v)));
    }
    frame.append(s("line", { x1: left, x2: width - right, y1: height - bottom, y2: height - bottom }));
    const middle = (top + height - bottom) / 2;
    frame.append(
      s("text", { x: (left + width - right) / 2, y: height - 4, "text-anchor": "middle" }, xLabel),
      s("text", { x: 12, y: middle, "text-anchor": "middle", transform: `rotate(-90 12 ${middle})` }, yLabel),
    );
    return { X, Y, frame, left, right: width - right, top, bottom: height - bottom };
  }

  function ticks([low, high], about) {
    const rough = (high - low) / about;
    const power = 10 ** Math.floor(Math.log10(rough));
    const step = [1, 2, 5, 10].map((m) => m * power).find((m) => m >= rough);
    const found = [];
    for (let k = Math.ceil(low / step - 1e-9); k * step <= high + 1e-9 * step; k += 1) found.push(k * step);
    return found;
  }

  function number(v) {
    return String(Number(v.toPrecision(6)));
  }

  function path(points) {
    return points.map(([x, y], i) => `${i ? "L" : "M"}${x.toFixed(1)} ${y.toFixed(1)}`).join("");
  }

  // Text that keeps clear of what is drawn behind it.
  function note(x, y, text, kind, anchor = "start") {
    return s("text", { class: `live-note ${kind}`, x, y, "text-anchor": anchor }, text);
  }

  // ---------------------------------------------------------------- placing figures

  // Build every figure of a name on this page. The fallback stays until the figure stands.
  function mount(name, build) {
    const start = () => {
      for (const figure of document.querySelectorAll(`.live[data-live="${name}"]`)) {
        const stage = figure.querySelector(".live-stage");
        const redraw = build(stage, figure.dataset);
        stage.hidden = false;
        figure.classList.add("live-on");
        let width = 0;
        new ResizeObserver(() => {
          const next = inner(stage);
          if (next > 0 && next !== width) {
            width = next;
            redraw(width);
          }
        }).observe(stage);
        if (inner(stage) > 0) redraw((width = inner(stage)));
        figure.dataset.ready = "yes";
      }
    };
    if (document.readyState === "loading") document.addEventListener("DOMContentLoaded", start);
    else start();
  }

  function inner(stage) {
    const style = getComputedStyle(stage);
    return Math.floor(stage.clientWidth - parseFloat(style.paddingLeft) - parseFloat(style.paddingRight));
  }

  // Numbers that are random and the same in every browser (mulberry32).
  function randomly(seed) {
    let state = seed >>> 0;
    return () => {
      state = (state + 0x6d2b79f5) >>> 0;
      let z = state;
      z = Math.imul(z ^ (z >>> 15), z | 1);
      z ^= z + Math.imul(z ^ (z >>> 7), z | 61);
      return ((z ^ (z >>> 14)) >>> 0) / 4294967296;
    };
  }

  const kit = { axes, button, fresh, h, mount, note, number, path, randomly, readouts, s, select, slider, speaker };
  self.cplLive = Object.assign(self.cplLive || {}, { kit });
})();
