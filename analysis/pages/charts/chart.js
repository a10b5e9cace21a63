"use strict";
// What a reader does with a drawing of svg.py: read it under the cursor, zoom, hide lines by the legend, save it.
// By keyboard, with a drawing in focus: arrows move the cursor (up and down: to another line), + and - zoom, 0 shows all.

const UNITS = 10000;  // of an axis, as in svg.py
const charts = {};  // by the id of the element
const svgElement = (name, attributes = {}, parent = null) => {
  const element = document.createElementNS("http://www.w3.org/2000/svg", name);
  for (const [key, value] of Object.entries(attributes)) element.setAttribute(key, value);
  if (parent) parent.append(element);
  return element;
};
const clamped = (value, lo, hi) => Math.min(hi, Math.max(lo, value));
const numbers = text => (text || "").split(" ").map(Number);
const ink = color => `var(--c${color.slice(1).toLowerCase()})`;
const shown = (value, digits) => (value < 0 ? "−" : "") + Math.abs(value).toFixed(digits);

// The points of a path in units: [x, y, whether the line comes from the point before]. Differences follow the first.
function pathPoints(d) {
  const found = [];
  for (const piece of d.split("M").slice(1)) {
    const values = (piece.match(/-?\d+/g) || []).map(Number);
    for (let i = 0, x = 0, y = 0; i + 1 < values.length; i += 2) found.push([x += values[i], y += values[i + 1], i > 0]);
  }
  return found;
}

function roundValues(lo, hi, count) {
  const raw = (hi - lo) / count, power = 10 ** Math.floor(Math.log10(raw)), found = [];
  const step = [1, 2, 5, 10].map(nice => nice * power).find(nice => nice >= raw * (1 - 1e-9));
  for (let tick = Math.ceil(lo / step - 1e-9) * step; tick <= hi + 1e-9 * step; tick += step) found.push(Number(tick.toPrecision(10)));
  return found;
}

class Chart {
  constructor(plot) {
    this.plot = plot;
    this.svg = plot.querySelector("svg.chart");
    this.nearest = this.svg.dataset.cursor === "nearest";
    this.panels = [...this.svg.querySelectorAll(".panel")].map(element => ({
      element, x: numbers(element.dataset.x), y: numbers(element.dataset.y), digits: numbers(element.dataset.digits),
      logarithmic: element.dataset.log === "1", drawn: element.querySelector(".drawn"), placed: element.querySelector(".placed"),
      view: [0, 0, UNITS, UNITS], home: [0, 0, UNITS, UNITS], cursor: svgElement("svg", {class: "cursor"}, element),
      ticks: [...element.querySelectorAll(".tick")]}));
    this.readout = document.createElement("div");
    this.readout.className = "readout";
    this.readout.setAttribute("role", "status");
    this.readout.hidden = true;
    plot.append(this.readout);
    this.added = {};
    this.at = null;  // cursor: {panel, x, y} in units
    this.listen();
  }

  value(panel, y) { const at = panel.y[1] - y / UNITS * (panel.y[1] - panel.y[0]); return panel.logarithmic ? 10 ** at : at; }
  xValue(x) { const [lo, hi] = this.panels[0].x; return lo + x / UNITS * (hi - lo); }
  xUnits(value) { const [lo, hi] = this.panels[0].x; return UNITS * (value - lo) / (hi - lo); }
  yUnits(value, panel = this.panels[0]) { return UNITS * (panel.y[1] - (panel.logarithmic ? Math.log10(value) : value)) / (panel.y[1] - panel.y[0]); }
  // Pixels of the window from units, and back.
  matrix(panel) {
    const [x, y, width, height] = panel.view, box = panel.element.querySelector(".frame").getBoundingClientRect();
    return {toPx: (u, v) => [box.left + (u - x) / width * box.width, box.top + (v - y) / height * box.height],
            back: (px, py) => [x + (px - box.left) / box.width * width, y + (py - box.top) / box.height * height], box};
  }
  place(xValue, yValue, panel = this.panels[0]) { return this.matrix(panel).toPx(this.xUnits(xValue), this.yUnits(yValue, panel)); }
  timeAt(event) { return this.xValue(this.matrix(this.panels[0]).back(event.clientX, 0)[0]); }

  panelAt(event) {
    const boxes = this.panels.map(panel => panel.element.querySelector(".frame").getBoundingClientRect());
    const apart = boxes.map(box => Math.max(box.top - event.clientY, event.clientY - box.bottom));
    return this.panels[apart.indexOf(Math.min(...apart))];
  }

  // ---- reading

  marks(panel) {
    return [...panel.drawn.querySelectorAll("[data-value]:not(.off)")].map(element => {
      element.points = element.points || pathPoints(element.getAttribute("d"));
      return element;
    });
  }

  said(panel, element, x, y, z) {
    const of = {x: this.xValue(x), y: this.value(panel, y), z};
    return element.dataset.value.replace(/\{([xyz]):(\+?)\.(\d)([ef])\}/g, (_, name, sign, digits, form) =>
      (sign && of[name] > 0 ? "+" : "") + (form === "e" ? of[name].toExponential(digits) : shown(of[name], digits)));
  }

  // The values along a line of a panel.
  values(element, panel = this.panels[0]) {
    return {x: element.points.map(([x]) => this.xValue(x)), y: element.points.map(([, y]) => this.value(panel, y))};
  }

  xText(x) {
    const [name, unit] = this.panels[0].element.dataset.names.split("|");
    return `${name} ${shown(this.xValue(x), this.panels[0].digits[0])} ${unit}`.trim();
  }

  // What is read at the cursor: [{panel, element, x, y, text}].
  read(at) {
    if (this.nearest) { const found = this.closest(at, 60); return found ? [found] : []; }
    return this.panels.flatMap(panel => {
      const found = this.marks(panel).map(element => {
        const {points} = element;
        if (element.classList.contains("dots")) {
          const near = points.reduce((best, point, i) => Math.abs(point[0] - at.x) < Math.abs(points[best][0] - at.x) ? i : best, 0);
          if (!points.length || Math.abs(points[near][0] - at.x) > 0.012 * panel.view[2]) return null;
          return {panel, element, x: points[near][0], y: points[near][1], z: numbers(element.dataset.z)[near]};
        }
        const i = points.findIndex((point, k) => k && point[2] && points[k - 1][0] <= at.x && at.x <= point[0]);
        if (i < 0) return null;
        const [[x0, y0], [x1, y1]] = [points[i - 1], points[i]];
        return {panel, element, x: at.x, y: x1 > x0 ? y0 + (y1 - y0) * (at.x - x0) / (x1 - x0) : y1};
      }).filter(Boolean);
      const bars = [...panel.drawn.querySelectorAll("rect[data-say]:not(.off)")].filter(bar => {
        const left = Number(bar.getAttribute("x"));
        return left <= at.x && at.x <= left + Number(bar.getAttribute("width"));
      });
      return [...found.map(one => ({...one, text: this.named(one)})), ...bars.map(element => ({panel, element, text: element.dataset.say}))];
    });
  }

  named({panel, element, x, y, z}) {
    const name = element.dataset.label || element.dataset.name, said = this.said(panel, element, x, y, z);
    return name ? `${name}: ${said}` : said;
  }

  // The nearest point or bar within so many pixels.
  closest(at, px) {
    const {toPx, box} = this.matrix(at.panel), [cx, cy] = toPx(at.x, at.y);
    let best = null, least = px;
    for (const element of this.marks(at.panel))
      element.points.forEach(([x, y], i) => {
        const [a, b] = toPx(x, y), apart = Math.hypot(a - cx, b - cy);
        if (apart < least && a >= box.left - 1 && a <= box.right + 1) [least, best] = [apart, {panel: at.panel, element, x, y, z: numbers(element.dataset.z)[i], i}];
      });
    if (best) return {...best, text: this.named(best)};
    const bar = [...at.panel.drawn.querySelectorAll("rect[data-say]:not(.off)")].find(one => {
      const [x, y, width, height] = ["x", "y", "width", "height"].map(name => Number(one.getAttribute(name)));
      return x <= at.x && at.x <= x + width && y <= at.y && at.y <= y + height;
    });
    return bar ? {panel: at.panel, element: bar, text: bar.dataset.say} : null;
  }

  show(at) {
    this.at = at;
    const found = at ? this.read(at) : [];
    for (const panel of this.panels) {
      panel.cursor.replaceChildren();
      const share = (units, k) => `${(100 * (units - panel.view[k]) / panel.view[k + 2]).toFixed(2)}%`;
      if (at && !this.nearest) svgElement("line", {x1: share(at.x, 0), x2: share(at.x, 0), y2: "100%"}, panel.cursor);
      for (const one of found.filter(one => one.panel === panel && one.y !== undefined))
        svgElement("circle", {cx: share(one.x, 0), cy: share(one.y, 1), r: 5}, panel.cursor);
    }
    this.readout.hidden = !found.length;
    document.dispatchEvent(new CustomEvent("chart-cursor", {detail: {name: this.plot.id, x: at ? this.xValue(at.x) : NaN}}));
    if (!found.length) return;
    const head = this.nearest ? (found[0].x === undefined || found[0].element.dataset.value.includes("{x") ? [] : [this.xText(found[0].x)]) : [this.xText(at.x)];
    this.readout.replaceChildren(...[...new Set([...head, ...found.map(one => one.text)])].map(text => Object.assign(document.createElement("p"), {textContent: text})));
    const {toPx} = this.matrix(at.panel), [x, y] = toPx(at.x, at.y), plot = this.plot.getBoundingClientRect();
    const right = x - plot.left + 16 + this.readout.offsetWidth < plot.width;
    this.readout.style.left = `${Math.max(0, right ? x - plot.left + 16 : x - plot.left - 16 - this.readout.offsetWidth)}px`;
    this.readout.style.top = `${clamped(y - plot.top - this.readout.offsetHeight / 2, 0, Math.max(0, plot.height - this.readout.offsetHeight))}px`;
  }

  step(along, steps) {
    const panel = this.at ? this.at.panel : this.panels[0], [left, top, width, height] = panel.view;
    const at = this.at || {panel, x: left + width / 2, y: top + height / 2};
    if (!this.nearest) return this.show({...at, x: clamped(at.x + (along === "x" ? steps * width / 100 : 0), left, left + width)});
    const marks = this.marks(panel), found = this.closest(at, Infinity);
    if (!found || !found.element.points) return this.show(at);
    let {element, i} = found;
    if (along === "x") i = clamped(i + steps, 0, element.points.length - 1);
    else {
      element = marks[(marks.indexOf(element) - Math.sign(steps) + marks.length) % marks.length];
      i = element.points.reduce((best, point, k) => Math.abs(point[0] - found.x) < Math.abs(element.points[best][0] - found.x) ? k : best, 0);
    }
    this.show({panel, x: element.points[i][0], y: element.points[i][1]});
  }

  // ---- zooming

  look(panel, view) {
    panel.view = view;
    panel.drawn.setAttribute("viewBox", view.join(" "));
    const moved = (element, k) => {
      const key = k ? "y" : "x", share = element.home = element.home || {};
      if (share[key] === undefined) share[key] = parseFloat(element.getAttribute(key)) / 100;
      const now = (UNITS * share[key] - view[k]) / view[k + 2];
      element.setAttribute(key, `${(100 * now).toFixed(2)}%`);
      return now >= -0.001 && now <= 1.001;
    };
    for (const element of panel.placed.children) element.toggleAttribute("data-outside", !(moved(element, 0) & moved(element, 1)));
    for (const [k, axis] of ["x", "y"].entries()) {
      const ticks = panel.ticks.filter(tick => tick.classList.contains(axis));
      if (!ticks.length) continue;
      if (ticks[0].classList.contains("given")) { for (const tick of ticks) tick.toggleAttribute("data-outside", !moved(tick, k)); continue; }
      const [lo, hi] = panel[axis], share = k ? 1 - (view[1] + view[3]) / UNITS : view[0] / UNITS, ends = lo + share * (hi - lo);
      const values = roundValues(ends, ends + view[k + 2] / UNITS * (hi - lo), k ? 6 : 9);
      const fresh = values.map(value => {
        const tick = ticks[0].cloneNode(true), units = k ? this.yUnits(panel.logarithmic ? 10 ** value : value, panel) : this.xUnits(value);
        tick.setAttribute(axis, `${(100 * (units - view[k]) / view[k + 2]).toFixed(2)}%`);
        const text = tick.querySelector("text");
        if (text) text.textContent = k && panel.logarithmic ? Number((10 ** value).toPrecision(2)) : String(value).replace("-", "−");
        return tick;
      });
      ticks[0].before(...fresh);
      ticks.forEach(tick => tick.remove());
      panel.ticks = panel.ticks.filter(tick => !ticks.includes(tick)).concat(fresh);
    }
    document.dispatchEvent(new CustomEvent("chart-view", {detail: {name: this.plot.id}}));
  }

  // x: units of all panels; y: of one, or null.
  zoom([x0, x1], panel, y) {
    if (x1 - x0 < 2) return;
    if (this.svg.classList.contains("equal")) {
      const share = Math.max((x1 - x0) / UNITS, y ? (y[1] - y[0]) / UNITS : 0), middle = [(x0 + x1) / 2, y ? (y[0] + y[1]) / 2 : UNITS / 2];
      [[x0, x1], y] = middle.map(at => [at - share * UNITS / 2, at + share * UNITS / 2]);
    }
    for (const one of this.panels) {
      const [, top, , height] = one.view, [from, to] = one === panel && y ? y : [top, top + height];
      this.look(one, [x0, from, x1 - x0, to - from]);
    }
    this.told(true);
  }
  zoomBy(factor) {
    const [left, , width] = this.panels[0].view, middle = this.at ? this.at.x : left + width / 2, {home} = this.panels[0];
    const from = Math.max(home[0], middle - factor * (middle - left)), to = Math.min(home[0] + home[2], middle + factor * (left + width - middle));
    this.zoom([from, to], null, null);
    if (this.at) this.show(this.at);
  }
  reset() {
    for (const panel of this.panels) this.look(panel, panel.home);
    for (const name of this.hiddenByReader || []) this.toggle(name, true);
    this.hiddenByReader = null;
    this.told(false);
  }
  told(changed) {
    const button = this.plot.parentElement.querySelector("[data-reset]");
    if (button) button.hidden = !changed;
  }

  toggle(name, on) {
    for (const element of this.svg.querySelectorAll("[data-name]")) if (element.dataset.name === name) element.classList.toggle("off", !on);
    for (const button of this.plot.querySelectorAll("[data-entry]")) if (button.dataset.entry === name) button.setAttribute("aria-pressed", String(on));
  }

  // ---- lines that the page adds

  // Curves with their bands in the first panel, in place of those that were added by the same key: name, x, y, color,
  // half (width of the interval), width, dash, value, unnamed (no entry of its own). What lies outside widens the view.
  add(key, curves) {
    const {drawn} = this.panels[0], {legend} = this;
    for (const element of this.added[key] || []) element.remove();
    const made = this.added[key] = [];
    for (const {name, x, y, half, color, width = 3, dash = "", value = "{y:.1f} W", unnamed = false} of curves) {
      const line = ys => x.map((one, k) => [Math.round(this.xUnits(one)), Math.round(this.yUnits(ys[k]))]).filter(point => point.every(Number.isFinite));
      const path = points => "M" + points.map(([a, b], k) => k ? `${a - points[k - 1][0]} ${b - points[k - 1][1]}` : `${a} ${b}l`).join(" ");
      if (half) {
        const ends = [1, -1].map(sign => line(y.map((one, k) => one + sign * half[k])));
        made.push(svgElement("path", {"data-name": name, d: path([...ends[0], ...ends[1].reverse()]) + "Z", fill: ink(color), "fill-opacity": 0.25}, drawn));
      }
      made.push(svgElement("path", {"data-name": name, "data-value": value, d: path(line(y)), stroke: ink(color), "stroke-width": width, "stroke-dasharray": dash}, drawn));
      if (unnamed || !legend) continue;
      const button = Object.assign(document.createElement("button"), {type: "button", textContent: name});
      button.dataset.entry = name;
      button.setAttribute("aria-pressed", "true");
      const swatch = svgElement("svg", {class: "swatch", width: 28, height: 14, "aria-hidden": "true"});
      svgElement("path", {d: "M1 7H27", stroke: ink(color), "stroke-width": Math.min(width, 5), "stroke-dasharray": dash}, swatch);
      button.prepend(swatch);
      legend.append(button);
      made.push(button);
    }
    const seen = Object.values(this.added).flat().filter(element => element.tagName === "path").flatMap(element => pathPoints(element.getAttribute("d")));
    const [left, top, right] = seen.reduce(([a, b, c], [x, y]) => [Math.min(a, x), Math.min(b, y - 200), Math.max(c, x)], [0, 0, UNITS]);
    const zoomed = String(this.panels[0].view) !== String(this.panels[0].home);
    for (const panel of this.panels) panel.home = panel === this.panels[0] ? [left, top, right - left, UNITS - top] : [left, 0, right - left, UNITS];
    if (!zoomed) for (const panel of this.panels) this.look(panel, panel.home);
  }
  // A dot that stays where it is put, until it is put elsewhere.
  here(x, y) {
    const {element, view} = this.panels[0], dot = element.querySelector(".here") || svgElement("circle", {class: "here", r: 6}, element);
    dot.setAttribute("cx", `${100 * (this.xUnits(x) - view[0]) / view[2]}%`);
    dot.setAttribute("cy", `${100 * (this.yUnits(y) - view[1]) / view[3]}%`);
  }
  get legend() { return this.plot.querySelector(".legend"); }
  entries() { return [...this.plot.querySelectorAll("[data-entry]")].map(button => button.dataset.entry); }

  // ---- gestures

  listen() {
    const {svg, plot} = this;
    let down = null, box = null;
    const atEvent = event => {
      const panel = this.panelAt(event), [x, y] = this.matrix(panel).back(event.clientX, event.clientY), [left, , width] = panel.view;
      return {panel, x: clamped(x, left, left + width), y};
    };
    plot.addEventListener("click", event => {
      const button = event.target.closest("[data-entry]");
      if (!button) return;
      const on = button.getAttribute("aria-pressed") === "false", name = button.dataset.entry;
      (this.hiddenByReader = this.hiddenByReader || new Set())[on ? "delete" : "add"](name);
      this.toggle(name, on);
      this.told(true);
    });
    svg.addEventListener("pointerdown", event => {
      if (event.defaultPrevented || event.button) return;
      down = {event, at: atEvent(event)};
      if (event.pointerType !== "touch") svg.setPointerCapture(event.pointerId);
    });
    svg.addEventListener("pointermove", event => {
      const at = atEvent(event);
      if (down && event.pointerType !== "touch" && Math.hypot(event.clientX - down.event.clientX, event.clientY - down.event.clientY) > 5) {
        const {panel} = down.at, y = clamped(this.matrix(panel).back(0, event.clientY)[1], panel.view[1], panel.view[1] + panel.view[3]);
        const wide = Math.abs(event.clientX - down.event.clientX) > 12, high = Math.abs(event.clientY - down.event.clientY) > 24;
        const sorted = (a, b) => [Math.min(a, b), Math.max(a, b)], [left, top, width, height] = panel.view;
        down.x = wide ? sorted(down.at.x, at.x) : [left, left + width];
        down.y = high ? sorted(down.at.y, y) : [top, top + height];
        box = box || svgElement("rect", {class: "zooming"});
        panel.drawn.append(box);
        for (const [key, value] of Object.entries({x: down.x[0], y: down.y[0], width: down.x[1] - down.x[0], height: down.y[1] - down.y[0]})) box.setAttribute(key, value);
        down.zooms = wide || high;
      }
      this.show(at);
    });
    svg.addEventListener("pointerup", event => {
      if (box) box.remove();
      box = null;
      const {zooms, x, y, at} = down || {};
      if (zooms) this.zoom(x, at.panel, y);
      else if (at) this.clicked(at);
      down = null;
    });
    svg.addEventListener("pointercancel", () => { if (box) box.remove(); down = box = null; });
    svg.addEventListener("pointerleave", () => { if (!down) this.show(null); });
    svg.addEventListener("dblclick", () => this.reset());
    svg.addEventListener("blur", () => this.show(null));
    svg.addEventListener("keydown", event => {
      if (event.target !== svg || event.ctrlKey || event.metaKey || event.altKey) return;
      const steps = event.shiftKey && event.key.startsWith("Arrow") ? 10 : 1;
      const action = {ArrowLeft: () => this.step("x", -steps), ArrowRight: () => this.step("x", steps), ArrowUp: () => this.step("y", 1),
                      ArrowDown: () => this.step("y", -1), "+": () => this.zoomBy(0.5), "=": () => this.zoomBy(0.5), "-": () => this.zoomBy(2),
                      0: () => this.reset(), Enter: () => { if (this.at) this.clicked(this.at); }}[event.key];
      if (!action) return;
      event.preventDefault();
      action();
    });
  }

  // A click is told to the page, with the run under the pointer: that of a line near it, or of a shade.
  clicked(at) {
    const near = this.closest(at, 14), shade = [...at.panel.drawn.querySelectorAll(".shade[data-run]")].find(one => {
      const left = Number(one.getAttribute("x"));
      return left <= at.x && at.x <= left + Number(one.getAttribute("width"));
    });
    const run = (near && near.element.dataset.run) || (shade && shade.dataset.run) || "";
    document.dispatchEvent(new CustomEvent("chart-click", {detail: {name: this.plot.id, run, x: this.xValue(at.x)}}));
  }

  // The drawing as a file of its own, with its legend, heading and style.
  text() {
    const plot = this.plot.getBoundingClientRect(), frame = this.panels.map(panel => this.matrix(panel).box);
    const out = svgElement("svg", {width: plot.width, height: plot.height, viewBox: `0 0 ${plot.width} ${plot.height}`});
    svgElement("style", {}, out).textContent = document.getElementById("chart-style").textContent;
    svgElement("rect", {width: "100%", height: "100%", style: "fill:var(--paper)"}, out);
    const group = svgElement("g", {class: "chart"}, out), top = frame[0].top - plot.top;
    const inner = svgElement("svg", {x: frame[0].left - plot.left, y: top, width: frame[0].width, height: frame[frame.length - 1].bottom - frame[0].top, overflow: "visible"}, group);
    inner.append(...[...this.svg.children].map(child => child.cloneNode(true)));
    inner.querySelectorAll(".cursor").forEach(one => one.remove());
    for (const button of this.plot.querySelectorAll("[data-entry][aria-pressed=true]")) {
      const box = button.getBoundingClientRect(), entry = svgElement("g", {transform: `translate(${box.left - plot.left} ${box.top - plot.top + box.height / 2 - 7})`}, group);
      entry.append(button.querySelector("svg").cloneNode(true));
      svgElement("text", {x: 34, y: 12}, entry).textContent = button.dataset.entry;
    }
    return new XMLSerializer().serializeToString(out);
  }

  save() {
    const link = document.createElement("a");
    link.href = URL.createObjectURL(new Blob([this.text()], {type: "image/svg+xml"}));
    link.download = `${this.plot.id}.svg`;
    link.click();
  }
}

function startCharts(root = document) {
  for (const plot of root.querySelectorAll(".plot")) charts[plot.id] = new Chart(plot);
}
