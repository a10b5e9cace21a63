"use strict";
// The page of `flightpower open`: the flight, its runs and values, and the curve that follows from them.

const SVG = "http://www.w3.org/2000/svg", at = id => document.getElementById(id);
const HIDDEN = ["standing", "flying"];
const NOT_IN_CURVE = {standing: "not in the curve: at rest on the ground", flying: "not in the curve: from take-off to landing"};
const KEYS = {a: "acceleration", d: "deceleration", s: "steady"};
let flight = null;  // what the server says of the opened log
let runs = [], edited = false, selected = -1, changed = {}, propeller = "";
let last = null, first = null;  // the newest curve, and that of the flight as it was opened
let other = null;  // another log to compare with, and its curve
let polar = "";  // the file of a predicted polar
let method = "";  // another method than that of the report, by its name
let pointed = NaN, asked = 0;  // time under the pointer; number of the newest question

async function ask(path, body) {
  const options = body === undefined ? {} : {method: "POST", headers: {"Content-Type": "application/json"}, body: JSON.stringify(body)};
  const answer = await fetch(path, options);
  if (!answer.ok) throw new Error(await answer.text());
  return answer.json();
}

function say(text) { at("said").textContent = text; }
function complain(error) {
  at("wrong").textContent = error ? error.message : "";
  at("wrong").hidden = !error;
}

async function working(text, action) {
  document.body.classList.add("busy");
  say(text);
  complain(null);
  try { await action(); if (at("said").textContent === text) say(""); }
  catch (error) { say(""); complain(error); }
  finally { document.body.classList.remove("busy"); }
}

function put(parent, name, attributes = {}, text = "") {
  const element = parent instanceof SVGElement ? document.createElementNS(SVG, name) : document.createElement(name);
  for (const [key, value] of Object.entries(attributes)) element.setAttribute(key, value);
  element.textContent = text;
  parent.append(element);
  return element;
}

// ---- logs

async function list() {
  const {folder, logs, polars} = await ask("logs"), ul = at("logs").querySelector("ul");
  at("folder").textContent = folder;
  ul.replaceChildren();
  for (const log of logs) {
    const button = put(put(ul, "li"), "button", {type: "button", "aria-current": String(Boolean(flight && flight.file === log.name))},
                       `${log.name}, ${log.MB} MB${log.report ? ", has a report" : ""}`);
    button.addEventListener("click", () => open(log.name));
  }
  const choice = at("other"), others = logs.filter(log => flight && log.name !== flight.file);
  choice.replaceChildren();
  for (const name of ["", ...others.map(log => log.name)]) put(choice, "option", {value: name}, name || "no other flight");
  choice.value = other ? other.file : "";
  at("comparing").hidden = !others.length;
  at("predicted").replaceChildren();
  for (const name of ["", ...polars]) put(at("predicted"), "option", {value: name}, name || "none");
  at("predicted").value = polar;
  if (!logs.length) put(ul, "li", {}, "No log in this folder yet.");
  return logs;
}

function open(file) {
  return working(`reading ${file} …`, async () => {
    flight = await ask("open", {file});
    location.hash = file;
    [runs, edited, selected, changed, propeller, last, first, other, method, polar] = [flight.runs || [], false, -1, {}, "", null, null, null, "", ""];
    at("title").textContent = file;
    at("flight").hidden = flight.kind !== "drag";
    at("values").hidden = at("done").hidden = false;
    at("command").textContent = flight.command;
    at("curve").replaceChildren();
    at("track").replaceChildren();
    at("sources").replaceChildren();
    at("number").textContent = "";
    showForm();
    const listed = (await list()).find(log => log.name === file);
    showReport(listed && listed.report);
    if (flight.kind === "drag") { draw(); showRuns(); await compute(); }
  });
}

function showReport(there) {
  const frame = at("report");
  frame.hidden = at("apart").hidden = !there;
  if (there) at("apart").querySelector("a").href = frame.src = `report/${encodeURIComponent(flight.file)}?${Date.now()}`;
}

async function drop(file) {
  await working(`adding ${file.name} …`, async () => {
    const answer = await fetch(`file/${encodeURIComponent(file.name)}`, {method: "PUT", body: file});
    if (!answer.ok) throw new Error(await answer.text());
    if (!/\.(txt|csv|dat)$/i.test(file.name)) return open(file.name);
    polar = file.name;
    await list();
    if (flight && flight.kind === "drag") recompute();
  });
}

// ---- the curve

function values() {
  return {file: flight.file, runs: edited ? runs.map(({kind, start_s, end_s, keep, why}) => ({kind, start_s, end_s, keep, why})) : null,
          aircraft: changed, propeller, method, polar};
}

async function compute() {
  const question = ++asked;
  const found = await ask("curve", values());
  if (question !== asked) return;
  last = found;
  first = first || found.curve;
  at("command").textContent = found.command;
  if (!edited) runs = found.runs;
  else for (const run of runs) {
    const same = found.runs.find(one => Math.abs(one.start_s - run.start_s) < 0.06 && Math.abs(one.end_s - run.end_s) < 0.06 && one.keep === run.keep);
    run.why = same ? same.why : run.why;
  }
  if (other) await compare(other.file);
  showRuns();
  showMethods();
  drawCurve();
  drawTrack();
  const ul = at("notes").querySelector("ul");
  ul.replaceChildren();
  for (const note of found.notes) put(ul, "li", {}, note);
  at("notes").hidden = !found.notes.length;
}

// Another flight at the weight and air density of this one; asked again where these have changed.
async function compare(file) {
  const condition = [last.mass_kg, last.density_kgpm3];
  if (other && other.file === file && String(other.condition) === String(condition)) return;
  const found = await ask("curve", {file, at: condition});
  other = {file, condition, curve: found.curve};
}

function comparison() {
  const {speed_mps: V} = last.curve, {speed_mps: v} = other.curve;
  const from = Math.max(V[0], v[0]), to = Math.min(V[V.length - 1], v[v.length - 1]), middle = (from + to) / 2;
  if (from >= to) return "The flights have no speed in common.";
  const share = valueAt(other.curve, middle) / valueAt(last.curve, middle) - 1, reports = [flight.file, other.file].map(name => name.replace(/\.[^.]*$/, ".report"));
  return `Dotted: ${other.file} at the same weight and air density, ${percentText(share)} at ${middle.toFixed(1)} m/s. `
    + `Whether they differ: write both reports, then in their folder: analyze compare ${reports.join(" ")}`;
}

// ---- methods

function showMethods() {
  const choice = at("method");
  choice.replaceChildren();
  put(choice, "option", {value: ""}, `only that of the report: ${last.headline}`);
  for (const {name, title, missing} of last.methods)
    put(choice, "option", missing ? {value: name, disabled: ""} : {value: name}, title + (missing ? `: no ${missing} flown` : ""));
  choice.value = last.method ? last.method.name : "";
}

function byMethod() {
  const found = last.method;
  if (!found) return "";
  if (!found.curve.power_W.length) return `${found.title}: no curve. ${found.notes.join("; ")}`;
  const {speed_mps: v, power_W: p, power_lo_W: lo, power_hi_W: hi} = found.curve, k = Math.floor(v.length / 2), report = valueAt(last.curve, v[k]);
  const difference = report === null ? "" : `, ${percentText(p[k] / report - 1)} against the curve of the report`;
  return `Green: ${found.title}, ${p[k].toFixed(1)} W (95 % interval ${lo[k].toFixed(1)} to ${hi[k].toFixed(1)}) at ${v[k].toFixed(1)} m/s${difference}. `
    + [...found.notes, "The report has it under Comparison of methods."].join(" ");
}

// Power of a curve at a speed; null outside its speeds.
function valueAt({speed_mps: v, power_W: p}, speed) {
  if (speed < v[0] || speed > v[v.length - 1]) return null;
  const k = Math.max(1, v.findIndex(one => one >= speed));
  return p[k - 1] + (p[k] - p[k - 1]) * (speed - v[k - 1]) / (v[k] - v[k - 1]);
}

const percentText = share => `${share < 0 ? "" : "+"}${(100 * share).toFixed(1)} %`;

let waiting = 0;
function recompute() {
  clearTimeout(waiting);
  waiting = setTimeout(() => working("computing the curve …", compute), 120);
}

function scale([lo, hi], [from, to]) {
  const scaled = value => from + (value - lo) / (hi - lo || 1) * (to - from);
  scaled.back = px => lo + (px - from) / (to - from) * (hi - lo);
  return scaled;
}

function ticks(lo, hi, count) {
  const raw = (hi - lo || 1) / count, power = 10 ** Math.floor(Math.log10(raw));
  const step = [1, 2, 5, 10].map(nice => nice * power).find(nice => nice >= raw);
  const found = [];
  for (let tick = Math.ceil(lo / step) * step; tick <= hi + 1e-9 * step; tick += step) found.push(Number(tick.toPrecision(10)));
  return found;
}

const extent = list => list.reduce(([lo, hi], value) => value === null || Number.isNaN(value) ? [lo, hi] : [Math.min(lo, value), Math.max(hi, value)], [Infinity, -Infinity]);
const path = (x, y, xs, ys) => xs.map((value, i) => ys[i] === null ? "" : `${i === 0 || ys[i - 1] === null ? "M" : "L"}${x(value).toFixed(1)} ${y(ys[i]).toFixed(1)}`).join("");

function axes(svg, x, y, [xRange, yRange], [left, right, top, bottom], [xTitle, yTitle]) {
  for (const tick of ticks(...xRange, Math.max(2, (right - left) / 90))) {
    put(svg, "path", {class: "grid", d: `M${x(tick)} ${top}V${bottom}`});
    if (xTitle) put(svg, "text", {x: x(tick), y: bottom + 17, "text-anchor": "middle"}, String(tick));
  }
  for (const tick of ticks(...yRange, Math.max(3, (bottom - top) / 40))) {
    put(svg, "path", {class: "grid", d: `M${left} ${y(tick)}H${right}`});
    put(svg, "text", {x: left - 6, y: y(tick) + 4, "text-anchor": "end"}, String(tick));
  }
  put(svg, "path", {class: "axis", d: `M${left} ${top}V${bottom}H${right}`});
  if (xTitle) put(svg, "text", {x: (left + right) / 2, y: bottom + 36, "text-anchor": "middle"}, xTitle);
  put(svg, "text", {transform: `translate(13 ${(top + bottom) / 2}) rotate(-90)`, "text-anchor": "middle"}, yTitle);
}

function emptied(id) {
  const svg = at(id);
  svg.replaceChildren();
  const {width, height} = svg.getBoundingClientRect();
  svg.setAttribute("viewBox", `0 0 ${width} ${height}`);
  return [svg, width, height];
}

function drawCurve() {
  const [svg, width, height] = emptied("curve"), {speed_mps: V, power_W: P, power_lo_W: lo, power_hi_W: hi} = last.curve;
  const beside = [[other && other.curve, "other"], [last.method && last.method.curve, "method"]].filter(([curve]) => curve && curve.power_W.length), predicted = last.predicted;
  const xRange = extent([...V, ...first.speed_mps, ...(predicted ? predicted.speed_mps : []), ...beside.flatMap(([curve]) => curve.speed_mps)]);
  const yRange = [0, 1.08 * extent([...hi, ...first.power_W, ...(predicted ? predicted.power_W : []), ...beside.flatMap(([curve]) => curve.power_hi_W)])[1]];
  const box = [56, width - 8, 10, height - 44], x = scale(xRange, box.slice(0, 2)), y = scale(yRange, [box[3], box[2]]);
  axes(svg, x, y, [xRange, yRange], box, ["true airspeed, m/s", "power required, W"]);
  const band = (speeds, upper, lower) => path(x, y, speeds, upper) + path(x, y, [...speeds].reverse(), [...lower].reverse()).replace("M", "L") + "Z";
  put(svg, "path", {class: "area", d: band(V, hi, lo)});
  for (const [{speed_mps, power_W, power_lo_W, power_hi_W}, name] of beside) {
    put(svg, "path", {class: `area ${name}`, d: band(speed_mps, power_hi_W, power_lo_W)});
    put(svg, "path", {class: `line ${name}`, d: path(x, y, speed_mps, power_W)});
  }
  if (predicted) put(svg, "path", {class: "line predicted", d: path(x, y, predicted.speed_mps, predicted.power_W)});
  at("by-polar").textContent = predicted ? `Thin: predicted by ${predicted.name}.` : "Drop a file of XFLR5, AVL or AeroSandbox on this page.";
  at("compared").textContent = other ? comparison() : "";
  at("by-method").textContent = byMethod();
  const moved = String(first.power_W) !== String(P);
  if (moved) put(svg, "path", {class: "line before", d: path(x, y, first.speed_mps, first.power_W)});
  put(svg, "path", {class: "line now", d: path(x, y, V, P)});
  const k = last.least_power === null ? 0 : V.reduce((best, v, i) => Math.abs(v - last.least_power) < Math.abs(V[best] - last.least_power) ? i : best, 0);
  const where = last.least_power === null ? "the slowest flown; power still decreases there" : "the speed of least power";
  at("number").textContent = `${P[k].toFixed(1)} W (95 % interval ${lo[k].toFixed(1)} to ${hi[k].toFixed(1)}) at ${V[k].toFixed(1)} m/s, ${where}, `
    + `for ${last.mass_kg.toFixed(2)} kg in air of ${last.density_kgpm3.toFixed(3)} kg/m³. ` + (moved ? "Dashed: as opened. " : "")
    + "The verdict is in the report.";
  const sources = at("sources");
  sources.replaceChildren();
  for (const [name, share] of last.sources) {
    if (share < 0.005) continue;
    const row = put(sources, "div");
    put(row, "span", {}, name);
    put(row, "meter", {min: 0, max: 1, value: share, "aria-label": name});
    put(row, "span", {}, `${(100 * share).toFixed(0)} %`);
  }
  put(sources, "p", {}, `Shares of the variance at ${last.sources_at_mps.toFixed(1)} m/s.`);
}

// ---- the flight over time and from above

let time = null;  // scale of the time axis
function draw() {
  const strips = Object.entries(flight.strips), n = strips.length;
  at("strips").style.height = `calc(${n} * 5.6rem + 40px)`;
  const [svg, width, height] = emptied("strips");
  const tRange = extent(strips.flatMap(([, {t_s}]) => [t_s[0], t_s[t_s.length - 1]]));
  const left = 56, right = width - 8, bottom = height - 40, each = bottom / n;
  time = scale(tRange, [left, right]);
  strips.forEach(([title, {t_s, value}], i) => {
    const box = [left, right, i * each + 8, (i + 1) * each - 6], range = extent(value), y = scale(range, [box[3], box[2]]);
    axes(svg, time, y, [tRange, range], box, [i === n - 1 ? "time since the start of the log, s" : "", ""]);
    put(svg, "path", {class: "line", d: path(time, y, t_s, value)});
    put(svg, "text", {class: "over-line", x: left + 6, y: box[2] + 10}, title);
  });
  put(svg, "g", {id: "bands"});
  put(svg, "path", {class: "cursor", id: "line"});
  drawBands();
}

const kindClass = run => `${run.kind.replace(/[^a-z]+/g, "-")}${run.keep ? "" : " left-out"}`;

function drawBands() {
  const bands = document.getElementById("bands");
  if (!bands) return;
  const focused = document.activeElement && document.activeElement.dataset && document.activeElement.dataset.end;
  const bottom = at("strips").getBoundingClientRect().height - 40;
  bands.replaceChildren();
  runs.forEach((run, i) => {
    const from = time(run.start_s), to = time(run.end_s), chosen = i === selected;
    const band = put(bands, "rect", {class: `run ${kindClass(run)}${chosen ? " selected" : ""}`, x: from, y: 4, width: Math.max(1, to - from), height: bottom - 4, "data-run": i});
    put(band, "title", {}, `${run.kind}, ${run.start_s.toFixed(1)} to ${run.end_s.toFixed(1)} s${run.why ? ": " + run.why : ""}`);
    if (!chosen) return;
    for (const end of ["start_s", "end_s"]) {
      const x = time(run[end]);
      put(bands, "rect", {class: "end", x: x - 10, y: 4, width: 20, height: bottom - 4, tabindex: 0, role: "slider", "data-end": end, "aria-orientation": "horizontal",
                          "aria-label": `${end === "start_s" ? "start" : "end"} of the ${run.kind}`, "aria-valuemin": 0,
                          "aria-valuemax": Math.ceil(last_s()), "aria-valuenow": run[end].toFixed(2), "aria-valuetext": `${run[end].toFixed(2)} s`});
      put(bands, "path", {d: `M${x} 4V${bottom}`});
    }
  });
  if (focused) { const again = bands.querySelector(`[data-end=${focused}]`); if (again) again.focus(); }
}

function last_s() { return Math.max(...Object.values(flight.strips).map(({t_s}) => t_s[t_s.length - 1])); }

function drawTrack() {
  const track = last && last.track, [svg, width, height] = emptied("track");
  if (!track || !track.t_s) return;
  const [e, n] = [extent(track.east_m), extent(track.north_m)], span = Math.max((e[1] - e[0]) / (width - 30), (n[1] - n[0]) / (height - 30)) || 1;
  const x = value => width / 2 + (value - (e[0] + e[1]) / 2) / span, y = value => height / 2 - (value - (n[0] + n[1]) / 2) / span;
  put(svg, "path", {class: "line", d: path(x, y, track.east_m, track.north_m)});
  runs.forEach(run => {
    if (!run.keep || HIDDEN.includes(run.kind)) return;
    const inside = track.t_s.map((t, i) => i).filter(i => track.t_s[i] >= run.start_s && track.t_s[i] <= run.end_s);
    put(svg, "path", {class: `over ${kindClass(run)}`, d: path(x, y, inside.map(i => track.east_m[i]), inside.map(i => track.north_m[i]))});
  });
  put(svg, "text", {x: 4, y: 14}, "north ↑");
  const dot = put(svg, "circle", {class: "dot", id: "here", r: 6, cx: -20, cy: -20});
  svg.place = t => {
    const i = Math.min(track.t_s.length - 1, Math.max(0, track.t_s.findIndex(one => one >= t)));
    dot.setAttribute("cx", x(track.east_m[i]));
    dot.setAttribute("cy", y(track.north_m[i]));
  };
}

function point(t) {
  pointed = t;
  const bottom = at("strips").getBoundingClientRect().height - 40;
  at("line").setAttribute("d", `M${time(t)} 4V${bottom}`);
  const said = Object.entries(flight.strips).map(([title, {t_s, value}]) => {
    const i = t_s.findIndex(one => one >= t), number = value[i];
    const [name, unit] = title.split(", ");
    return number === undefined || number === null ? "" : `${name} ${number.toFixed(unit === "rpm" ? 0 : 1)} ${unit}`;
  });
  at("cursor").textContent = `${t.toFixed(1)} s: ${said.filter(Boolean).join(", ")}`;
  if (at("track").place) at("track").place(t);
}

const timeAt = event => time.back(event.clientX - at("strips").getBoundingClientRect().left);

function listen() {
  const strips = at("strips");
  let moving = "";
  strips.addEventListener("pointermove", event => {
    if (!time) return;
    const t = Math.min(last_s(), Math.max(0, timeAt(event)));
    point(t);
    if (moving) { move(moving, t - runs[selected][moving], false); }
  });
  strips.addEventListener("pointerdown", event => {
    const {end, run} = event.target.dataset;
    if (end) { moving = end; event.target.focus(); strips.setPointerCapture(event.pointerId); event.preventDefault(); }
    else if (run !== undefined) select(Number(run));
  });
  const dropped = () => { if (moving) { moving = ""; changedRuns(); } };
  strips.addEventListener("pointerup", dropped);
  strips.addEventListener("pointercancel", dropped);
  strips.addEventListener("keydown", event => {
    const {end} = event.target.dataset, step = {ArrowLeft: -1, ArrowDown: -1, ArrowRight: 1, ArrowUp: 1}[event.key];
    if (!end || !step) return;
    event.preventDefault();
    move(end, step * (event.shiftKey ? 1 : 0.1), true);
  });
  document.addEventListener("keydown", event => {
    if (event.ctrlKey || event.metaKey || event.altKey || event.target.matches("input, select, textarea")) return;
    const key = event.key.toLowerCase();
    if (key === "n" && flight && flight.kind === "drag") add();
    if (selected < 0) return;
    if (key in KEYS) { runs[selected].kind = KEYS[key]; changedRuns(); }
    else if (key === "x" || key === "delete") { runs[selected].keep = !runs[selected].keep; changedRuns(); }
    else if (key === "escape") select(-1);
  });
  at("method").addEventListener("change", () => { method = at("method").value; recompute(); });
  at("predicted").addEventListener("change", () => { polar = at("predicted").value; recompute(); });
  at("other").addEventListener("change", () => working("reading the other flight …", async () => {
    const file = at("other").value;
    if (file) await compare(file); else other = null;
    drawCurve();
  }));
  at("add").addEventListener("click", add);
  at("as-found").addEventListener("click", () => { edited = false; selected = -1; runs = flight.runs; changedRuns(false); });
  at("as-recorded").addEventListener("click", () => { changed = {}; propeller = ""; showForm(); recompute(); });
  at("write").addEventListener("click", () => working("analyzing the log and writing the report …", async () => {
    const {said, kept, command} = await ask("write", values());
    say([...said, ...kept.map(name => `the previous list is now ${name}`)].join("; "));
    at("command").textContent = command;
    showReport(true);
    await list();
  }));
  at("logs").querySelector("input").addEventListener("change", event => { if (event.target.files[0]) drop(event.target.files[0]); });
  addEventListener("dragover", event => { event.preventDefault(); document.body.classList.add("dropping"); });
  addEventListener("dragleave", () => document.body.classList.remove("dropping"));
  addEventListener("drop", event => {
    event.preventDefault();
    document.body.classList.remove("dropping");
    if (event.dataTransfer.files[0]) drop(event.dataTransfer.files[0]);
  });
  let resizing = 0;
  addEventListener("resize", () => { clearTimeout(resizing); resizing = setTimeout(() => { if (flight && flight.kind === "drag") { draw(); if (last) { drawCurve(); drawTrack(); } } }, 150); });
}

// ---- runs

function move(end, by, atOnce) {
  const run = runs[selected], other = end === "start_s" ? run.end_s - 0.2 : run.start_s + 0.2, moved = Math.round(100 * (run[end] + by)) / 100;
  run[end] = end === "start_s" ? Math.max(0, Math.min(moved, other)) : Math.min(last_s(), Math.max(moved, other));
  edited = true;
  drawBands();
  if (atOnce) changedRuns();
}

function add() {
  const start_s = Math.round(10 * (Number.isNaN(pointed) ? last_s() / 2 : pointed)) / 10;
  runs.push({kind: "deceleration", start_s, end_s: Math.min(last_s(), start_s + 10), keep: true, why: ""});
  selected = runs.length - 1;
  changedRuns();
}

function changedRuns(byHand = true) {
  edited = byHand;
  drawBands();
  drawTrack();
  showRuns();
  recompute();
}

function select(i) {
  selected = i === selected ? -1 : i;
  drawBands();
  showRuns();
}

function showRuns() {
  const body = at("runs").tBodies[0], active = document.activeElement, place = active && active.dataset && active.dataset.place;
  body.replaceChildren();
  at("as-found").disabled = !edited;
  runs.forEach((run, i) => {
    const row = put(body, "tr", i === selected ? {class: "selected"} : {}), cells = Array.from({length: 5}, () => put(row, "td"));
    const keep = put(cells[0], "input", {type: "checkbox", "aria-label": `use run ${i + 1}`, "data-place": `${i} keep`});
    keep.checked = run.keep;
    keep.addEventListener("change", () => { run.keep = keep.checked; changedRuns(); });
    const kind = put(cells[1], "select", {"aria-label": `kind of run ${i + 1}`, "data-place": `${i} kind`});
    for (const name of flight.kinds) put(kind, "option", name === run.kind ? {selected: ""} : {}, name);
    kind.addEventListener("change", () => { run.kind = kind.value; changedRuns(); });
    for (const [cell, end, name] of [[2, "start_s", "start"], [3, "end_s", "end"]]) {
      const box = put(cells[cell], "input", {type: "number", step: 0.1, min: 0, "aria-label": `${name} of run ${i + 1}, s`, value: run[end].toFixed(2), "data-place": `${i} ${end}`});
      box.addEventListener("change", () => { if (Number.isFinite(box.valueAsNumber)) { run[end] = box.valueAsNumber; changedRuns(); } });
    }
    cells[4].textContent = run.why || NOT_IN_CURVE[run.kind] || "";
    row.addEventListener("click", event => { if (event.target.tagName === "TD") select(i); });
    row.addEventListener("focusin", () => { if (selected !== i) { selected = i; drawBands(); [...body.rows].forEach((one, k) => one.classList.toggle("selected", k === i)); } });
  });
  if (place) { const again = body.querySelector(`[data-place="${place}"]`); if (again) again.focus(); }
}

// ---- values

function showForm() {
  const div = at("form").querySelector("div");
  div.replaceChildren();
  const recorded = () => { at("as-recorded").disabled = !Object.keys(changed).length && !propeller; };
  if (flight.propellers) {
    const label = put(div, "label");
    put(label, "span", {}, "propeller flown");
    const choice = put(label, "select", {"data-key": "propeller"});
    put(choice, "option", {value: ""}, `${flight.propeller} (as in the log)`);
    for (const name of flight.propellers) put(choice, "option", {value: name}, name);
    choice.addEventListener("change", () => { propeller = choice.value; recorded(); recompute(); });
  }
  for (const {key, value, meaning} of flight.form) {
    const label = put(div, "label", {title: meaning});
    put(label, "span", {}, key);
    const box = put(label, "input", {"data-key": key});
    box.value = value;
    box.addEventListener("focus", () => { at("meaning").textContent = meaning ? `${key}: ${meaning}` : ""; });
    box.addEventListener("change", () => {
      if (box.value === value) delete changed[key]; else changed[key] = box.value;
      box.classList.toggle("changed", box.value !== value);
      recorded();
      if (flight.kind === "drag") recompute();
    });
  }
  recorded();
}

listen();
working("", async () => {
  const logs = await list(), wanted = decodeURIComponent(location.hash.slice(1));
  const name = wanted || (logs.length === 1 ? logs[0].name : "");
  if (name) await open(name);
});
