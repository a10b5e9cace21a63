"use strict";
// The page of `flightpower open`: the flight, its runs and values, and the curve that follows from them.

const at = id => document.getElementById(id);
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
  if (parent instanceof SVGElement) return svgElement(name, attributes, parent);
  const element = document.createElement(name);
  for (const [key, value] of Object.entries(attributes)) element.setAttribute(key, value);
  element.textContent = text;
  parent.append(element);
  return element;
}

// A chart that the server has drawn, in place of the one that was there.
function draw(id, text) {
  at(id).innerHTML = text || "";
  startCharts(at(id));
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
    draw("over-speed", "");
    draw("from-above", "");
    at("sources").replaceChildren();
    at("number").textContent = "";
    showForm();
    const listed = (await list()).find(log => log.name === file);
    showReport(listed && listed.report);
    if (flight.kind === "drag") { draw("over-time", flight.strips); drawBands(); showRuns(); await compute(); }
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
  draw("from-above", found.figures.track);
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

function drawCurve() {
  const {speed_mps: V, power_W: P, power_lo_W: lo, power_hi_W: hi} = last.curve, {predicted} = last;
  const moved = String(first.power_W) !== String(P);
  draw("over-speed", last.figures.curve);
  const half = curve => curve.power_hi_W.map((value, k) => (value - curve.power_lo_W[k]) / 2);
  const beside = (name, curve, color, look) => curve && curve.power_W.length
    ? [{name, x: curve.speed_mps, y: curve.power_W, color, ...look, half: look.band ? half(curve) : null}] : [];
  charts.curve.add("beside", [
    ...beside("as opened", moved ? first : null, "#5b6b78", {dash: "9 6", width: 2}),
    ...beside(other && other.file, other && other.curve, "#d95f02", {dash: "3 4", band: true}),
    ...beside(last.method && last.method.title, last.method && last.method.curve, "#1b9e77", {dash: "12 6", band: true}),
    ...beside(predicted && `predicted by ${predicted.name}`, predicted, "#8a2f8f", {width: 2}),
  ]);
  at("by-polar").textContent = predicted ? `Thin: predicted by ${predicted.name}.` : "Drop a file of XFLR5, AVL or AeroSandbox on this page.";
  at("compared").textContent = other ? comparison() : "";
  at("by-method").textContent = byMethod();
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

const kindClass = run => `${run.kind.replace(/[^a-z]+/g, "-")}${run.keep ? "" : " left-out"}`;

// Where a time is, in px from the left of the strips.
const time = t => charts.strips.place(t, 0)[0] - at("strips").getBoundingClientRect().left;
const last_s = () => charts.strips.panels[0].x[1];

function drawBands() {
  if (!charts.strips) return;
  const {svg, panels: [{view: [left, , width]}]} = charts.strips, share = t => 100 * (charts.strips.xUnits(t) - left) / width;
  const focused = document.activeElement && document.activeElement.dataset && document.activeElement.dataset.end;
  const bands = svg.querySelector(".bands") || put(svg, "svg", {class: "bands"});
  bands.replaceChildren();
  runs.forEach((run, i) => {
    const chosen = i === selected, from = share(run.start_s), to = share(run.end_s);
    const band = put(bands, "rect", {class: `run ${kindClass(run)}${chosen ? " selected" : ""}`, x: `${from}%`, width: `${Math.max(0.1, to - from)}%`, height: "100%", "data-run": i});
    put(band, "title").textContent = `${run.kind}, ${run.start_s.toFixed(1)} to ${run.end_s.toFixed(1)} s${run.why ? ": " + run.why : ""}`;
    if (!chosen) return;
    for (const [end, place] of [["start_s", from], ["end_s", to]]) {
      const handle = put(bands, "svg", {x: `${place}%`});
      put(handle, "rect", {class: "end", x: -10, width: 20, height: "100%", tabindex: 0, role: "slider", "data-end": end, "aria-orientation": "horizontal",
                           "aria-label": `${end === "start_s" ? "start" : "end"} of the ${run.kind}`, "aria-valuemin": 0,
                           "aria-valuemax": Math.ceil(last_s()), "aria-valuenow": run[end].toFixed(2), "aria-valuetext": `${run[end].toFixed(2)} s`});
      put(handle, "line", {y2: "100%"});
    }
  });
  if (focused) { const again = bands.querySelector(`[data-end=${focused}]`); if (again) again.focus(); }
}

// The time under the pointer, and the place then.
function point(t) {
  if (Number.isNaN(t)) return;
  pointed = t;
  const track = last && last.track;
  if (!track || !charts.track) return;
  const i = Math.min(track.t_s.length - 1, Math.max(0, track.t_s.findIndex(one => one >= t)));
  charts.track.here(track.east_m[i], track.north_m[i]);
}

function listen() {
  const strips = at("over-time");
  let moving = "", pressed;
  document.addEventListener("chart-cursor", ({detail: {name, x}}) => { if (name === "strips") point(x); });
  document.addEventListener("chart-view", ({detail: {name}}) => { if (name === "strips") drawBands(); });
  document.addEventListener("chart-click", ({detail: {name}}) => { if (name === "strips" && pressed !== undefined) select(Number(pressed)); });
  strips.addEventListener("pointermove", event => {
    if (moving) move(moving, Math.min(last_s(), Math.max(0, charts.strips.timeAt(event))) - runs[selected][moving], false);
  });
  // Before the chart hears it, which would zoom.
  strips.addEventListener("pointerdown", event => {
    const {end} = event.target.dataset;
    pressed = event.target.dataset.run;
    if (end) { moving = end; event.target.focus(); strips.setPointerCapture(event.pointerId); event.preventDefault(); }
  }, true);
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
