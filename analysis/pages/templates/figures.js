"use strict";
// Draws the figures of the page: when they come into view, in the colors of the page, and anew for paper.
const figures = {};  // by the id of the element: data and layout
const drawn = new Map();  // by the same, the width, colors and marks that it was drawn with
const added = {};  // by the same: traces that the reader asked for, by what they are
const told = new Set();  // figures whose clicks are told
const marks = [];  // what changes figures before they are drawn: {key(), mark(data, layout)}
const NARROW_PX = 520;
const PAPER_HEIGHT = 0.7;  // of a figure's height on a screen
const asked = {};  // by the id of the element: how often the reader had all shown again
const root = document.documentElement;
const dark = window.matchMedia("(prefers-color-scheme: dark)");

function onPaper() { return root.classList.contains("paper"); }

function recolored(value) {
  if (typeof value === "string") {
    if (value in onDark) return onDark[value];
    const part = /^rgba\((\d+), (\d+), (\d+), ([\d.]+)\)$/.exec(value);
    if (!part) return value;
    const hex = "#" + part.slice(1, 4).map(n => Number(n).toString(16).padStart(2, "0")).join("");
    return hex in onDark ? onDark[hex] + Math.round(255 * part[4]).toString(16).padStart(2, "0") : value;
  }
  if (Array.isArray(value)) return value.length && typeof value[0] !== "number" ? value.map(recolored) : value;
  if (value === null || typeof value !== "object") return value;
  return Object.fromEntries(Object.entries(value).map(([name, item]) => [name, recolored(item)]));
}

// Type, margins and legend for a narrow element: the height grows with the lines of the legend.
function narrowed(layout, data) {
  const entries = data.filter(trace => trace.showlegend !== false && layout.showlegend !== false).length;
  const margin = {...layout.margin, l: 48, r: 8, b: Math.min(layout.margin.b, 56)};
  const size = onPaper() ? 12 : 13;
  layout = {...layout, margin, font: {...layout.font, size},
            legend: {...layout.legend, font: {size: size - 1}}, height: layout.height + 20 * Math.max(0, entries - 2)};
  for (const name of Object.keys(layout).filter(name => /^[xy]axis/.test(name)))
    layout[name] = {...layout[name], nticks: layout[name].dtick ? undefined : 6};
  return layout;
}

function draw(name) {
  const element = document.getElementById(name), width = element.clientWidth;
  if (!width) return;
  const inDark = dark.matches && !onPaper(), extra = Object.values(added[name] || {}).flat();
  const key = [width, inDark, onPaper(), extra.length, ...marks.map(mark => mark.key())].join();
  if (drawn.get(name) === key) return;
  drawn.set(name, key);
  let {data, layout} = structuredClone(figures[name]);
  data.push(...structuredClone(extra));
  if (extra.length && layout.yaxis.range) layout.yaxis.range[1] = 1.06 * highest(extra, layout.yaxis.range[1] / 1.06);
  for (const {mark} of marks) mark(data, layout);
  if (inDark) [data, layout] = [recolored(data), recolored(layout)];
  layout = {...layout, uirevision: asked[name] || 0, width, height: Math.round(layout.height * (onPaper() ? PAPER_HEIGHT : 1))};
  if (width < NARROW_PX) layout = narrowed(layout, data);
  else if (onPaper()) layout = {...layout, font: {...layout.font, size: 14}, legend: {...layout.legend, font: {size: 13}}};
  for (const name of Object.keys(layout).filter(name => /^[xy]axis/.test(name)))
    if (layout[name].title) Object.assign(layout[name].title, {font: {size: layout.font.size}, standoff: 10});
  element.style.height = `${layout.height}px`;
  const still = element.querySelector("svg.still");
  if (still) still.remove();
  Plotly.react(element, data, layout, {displayModeBar: false, scrollZoom: false});
  if (!told.has(name)) tellClicks(name, element), tellChanges(name, element);
}

// What the reader zoomed or hid stays when a figure is drawn anew, until all is to be shown again.
function tellChanges(name, element) {
  const button = element.parentElement.querySelector("[data-reset]"), show = () => { button.hidden = false; };
  for (const event of ["plotly_relayout", "plotly_restyle"]) element.on(event, show);
}
function reset(name) {
  asked[name] = (asked[name] || 0) + 1;
  document.getElementById(name).parentElement.querySelector("[data-reset]").hidden = true;
  drawn.delete(name);
  draw(name);
}

function highest(traces, least) {
  return traces.reduce((top, trace) => trace.y.reduce((most, value) => value > most ? value : most, top), least);
}

function translucent(color, opacity) {
  return `rgba(${[1, 3, 5].map(i => parseInt(color.slice(i, i + 2), 16)).join(", ")}, ${opacity})`;
}

// A curve over x with its interval, of one entry in the legend. half: half width of the interval.
function curveWithBand(name, {x, y, half}, line) {
  const trace = {type: "scatter", mode: "lines", name, legendgroup: name}, ends = sign => y.map((value, k) => value + sign * half[k]);
  return [
    {...trace, x: [...x, ...x.slice().reverse()], y: [...ends(1), ...ends(-1).reverse()], fill: "toself",
     fillcolor: translucent(line.color, 0.25), line: {width: 0}, hoverinfo: "skip", showlegend: false},
    {...trace, x, y, line, hovertemplate: "%{y:.1f} W"}];
}

// Traces in a figure beside its own, instead of those that were added by the same name before.
function add(name, what, traces) {
  if (!(name in figures)) return;
  added[name] = {...added[name], [what]: traces};
  drawn.delete(name);
  draw(name);
}

// A click in a figure is told to the page: the traces under the pointer, and x.
function tellClicks(name, element) {
  let traces = [];
  told.add(name);
  element.on("plotly_hover", event => { traces = event.points.map(point => point.data); });
  element.on("plotly_unhover", () => { traces = []; });
  // Plotly lays a sheet over the page while a button is down: the browser sees no click in the figure.
  element.addEventListener("pointerdown", down => addEventListener("pointerup", up => {
    if (Math.hypot(up.clientX - down.clientX, up.clientY - down.clientY) > 5) return;
    const {xaxis} = element._fullLayout, inside = up.clientX - element.getBoundingClientRect().left - xaxis._offset;
    const x = inside >= 0 && inside <= xaxis._length ? xaxis.p2d(inside) : NaN;
    document.dispatchEvent(new CustomEvent("figure-click", {detail: {name, traces, x}}));
  }, {once: true}), true);
}

function drawAll() { for (const name of Object.keys(figures)) draw(name); }
function drawAgain() { for (const name of [...drawn.keys()]) draw(name); }

function save(name) {
  const {layout} = document.getElementById(name);
  Plotly.downloadImage(name, {format: "svg", filename: name, width: layout.width, height: layout.height});
}

function openTarget() {
  const target = location.hash && document.getElementById(decodeURIComponent(location.hash.slice(1)));
  for (let element = target; element; element = element.parentElement)
    if (element.tagName === "DETAILS") element.open = true;
  if (target) target.scrollIntoView();
}

// What is folded stays off paper.
function toPaper() {
  root.classList.add("paper");
  drawAll();
}
function fromPaper() {
  root.classList.remove("paper");
  drawAgain();
}

function start() {
  const seen = new IntersectionObserver(
    entries => entries.filter(entry => entry.isIntersecting).forEach(entry => draw(entry.target.id)),
    {rootMargin: "400px"});
  for (const name of Object.keys(figures)) seen.observe(document.getElementById(name));
  let waiting = 0;
  addEventListener("resize", () => { clearTimeout(waiting); waiting = setTimeout(drawAgain, 150); });
  dark.addEventListener("change", drawAgain);
  addEventListener("beforeprint", toPaper);
  addEventListener("afterprint", fromPaper);
  addEventListener("hashchange", openTarget);
  openTarget();
}
