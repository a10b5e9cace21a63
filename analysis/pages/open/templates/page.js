"use strict";
// The page of `flightpower open`: the flight, its runs and values, and the curve that follows from them.

const at = id => document.getElementById(id);
const NOT_IN_CURVE = {standing: "not in the curve: at rest on the ground", flying: "not in the curve: from take-off to landing"};
const ELECTRICAL = "electrical_power", BY_HAND = "left out by hand";
const KEYS = {a: "acceleration", d: "deceleration", s: "steady"};
let flight = null;  // what the server says of the opened log
let runs = [], edited = false, selected = -1, changed = {}, propeller = "";  // runs; of a whole flight the stretches left out
let airborne = [];  // stretches of a whole flight that are in the curve: [start, end]
let drawnChannels = [], typed = {};  // channels drawn besides the usual; the aircraft typed for another log
let last = null, first = null;  // the newest curve, and that of the flight as it was opened
let other = null;  // another log to compare with, and its curve
let polar = "";  // the file of a predicted polar
let method = "";  // another method than that of the report, by its name
let written = "";  // the edits with which the log was opened, or of which the report was written
let pointed = NaN, asked = 0;  // time under the pointer; number of the newest question

async function ask(path, body) {
  const options = body === undefined ? {} : {method: "POST", headers: {"Content-Type": "application/json"}, body: JSON.stringify(body)};
  const answer = await fetch(path, options);
  return answered(answer);
}

async function answered(answer) {
  if (answer.ok) return answer.json();
  throw Object.assign(new Error(await answer.text()), {field: decodeURIComponent(answer.headers.get("X-Field") || "")});
}

const whole = () => Boolean(flight) && flight.kind === ELECTRICAL;

function say(text) { at("said").textContent = text; }

// A message stands in the status, which stays in view, and at its field, which gets a red border.
function complain(error) {
  at("wrong").textContent = error ? error.message : "";
  at("wrong").hidden = !error;
  for (const box of document.querySelectorAll("[aria-invalid]")) { box.removeAttribute("aria-invalid"); box.removeAttribute("aria-describedby"); }
  for (const text of document.querySelectorAll(".at-field")) text.remove();
  const boxes = error && error.field ? [...document.querySelectorAll("[data-field]")].filter(box => box.dataset.field === error.field) : [];
  if (!boxes.length) return;
  for (const box of boxes) { box.setAttribute("aria-invalid", "true"); box.setAttribute("aria-describedby", "at-field"); }
  const closed = boxes[0].closest("details");
  if (closed) closed.open = true;
  put(boxes[0].parentElement, "p", {class: "at-field", id: "at-field"}, error.message);
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

// A chart that the server has drawn, in place of the one that was there: zoomed as that was, the same lines hidden.
function draw(id, text, fresh = false) {
  const before = fresh ? null : [...at(id).querySelectorAll(".plot")].map(plot => charts[plot.id])[0];
  const kept = before && {
    name: before.plot.id, hidden: [...(before.hiddenByReader || [])],
    views: before.panels.filter(panel => String(panel.view) !== String(panel.home)).map(panel => {
      const [x, y, width, height] = panel.view;
      return {title: panelTitle(panel), x: [x, x + width].map(one => before.xValue(one)), y: [y, y + height].map(one => before.value(panel, one))};
    })};
  at(id).innerHTML = text || "";
  startCharts(at(id));
  const now = kept && text ? charts[kept.name] : null;
  if (!now) return;
  for (const name of kept.hidden) { now.toggle(name, false); (now.hiddenByReader = now.hiddenByReader || new Set()).add(name); }
  for (const {title, x, y} of kept.views) {
    const panel = now.panels.find(one => panelTitle(one) === title);
    if (!panel) continue;
    const [left, right] = x.map(one => now.xUnits(one)), [top, bottom] = y.map(one => now.yUnits(one, panel));
    now.look(panel, [left, top, right - left, bottom - top]);
  }
  if (kept.views.length || kept.hidden.length) now.told(true);
}

const panelTitle = panel => (panel.element.querySelector(".title") || {textContent: ""}).textContent;

// ---- logs

async function list() {
  const {folder, logs, polars} = await ask("logs"), body = at("logs").querySelector("tbody");
  at("folder").textContent = folder;
  body.replaceChildren();
  for (const log of logs) {
    const row = put(body, "tr");
    put(put(row, "td"), log.of_file ? "em" : "span", {}, log.date);
    const button = put(put(row, "td"), "button", {type: "button", "aria-current": String(Boolean(flight && flight.file === log.name))}, log.name);
    button.addEventListener("click", () => { if (mayLeave()) open(log.name); });
    for (const text of [log.length, `${log.kind}, ${log.size}`, log.report ? "yes" : ""]) put(row, "td", {}, text);
  }
  const choice = at("other"), others = logs.filter(log => flight && log.name !== flight.file);
  choice.replaceChildren();
  for (const name of ["", ...others.map(log => log.name)]) put(choice, "option", {value: name}, name || "no other flight");
  choice.value = other ? other.file : "";
  at("comparing").hidden = !others.length;
  at("predicted").replaceChildren();
  for (const name of ["", ...polars]) put(at("predicted"), "option", {value: name}, name || "none");
  at("predicted").value = polar;
  if (!logs.length) put(put(body, "tr"), "td", {colspan: 5}, "No log in this folder yet.");
  return logs;
}

function edits() {
  return JSON.stringify([edited && runs.map(({kind, start_s, end_s, keep}) => [kind, start_s, end_s, keep]), changed, propeller]);
}

const unwritten = () => Boolean(flight) && edits() !== written;
const mayLeave = () => !unwritten() || confirm(`The edits of ${flight.file} are not in a report. Discard them?`);

function open(file, note = "") {
  return working(`reading ${file} …`, async () => {
    try { await show(file); }
    catch (error) { if (note) error.message = `${error.message}. ${file}: ${note}`; throw error; }
    if (note) say(`${file}: ${note}`);
  });
}

async function show(file) {
  flight = await ask("open", {file});
  location.hash = encodeURIComponent(file);
  [runs, edited, selected, changed, propeller, last, first, other, method, polar] = [flight.runs || [], false, -1, {}, "", null, null, null, "", ""];
  [airborne, drawnChannels] = [[], []];
  if (flight.left_out && flight.left_out.length) {
    runs = flight.left_out.map(([start_s, end_s]) => ({kind: BY_HAND, start_s, end_s, keep: false, why: BY_HAND}));
    edited = true;
  }
  if (flight.edited_runs && flight.edited_runs.length) [runs, edited] = [flight.edited_runs, true];
  if (flight.remembered) changed = {...(Object.keys(flight.remembered).length ? flight.remembered : typed)};
  written = edits();
  at("title").textContent = file;
  for (const [name, on] of [["whole", whole()], ["by-runs", !whole()]]) at("flight").classList.toggle(name, on);
  at("runs-title").textContent = whole() ? "Stretches of the flight" : "Runs";
  at("add").textContent = whole() ? "leave out a stretch" : "new run";
  at("flight").hidden = at("done").hidden = false;
  at("command").textContent = flight.command;
  draw("over-speed", "");
  draw("from-above", "");
  for (const id of ["sources", "number"]) at(id).replaceChildren();
  at("guessed").hidden = at("notes").hidden = true;
  showForm();
  showEvents();
  showChannels();
  draw("over-time", flight.strips, true);
  drawBands();
  showRuns();
  const log = (await list()).find(one => one.name === file);
  showReport(log && log.report);
  await compute();
}

function showReport(there) {
  const frame = at("report");
  frame.hidden = at("apart").hidden = !there;
  if (there) at("apart").querySelector("a").href = frame.src = `report/${encodeURIComponent(flight.file)}?${Date.now()}`;
}

// Dropped files wait for each other. What was refused stays in the status until other files are dropped.
let adding = Promise.resolve(), pending = 0, refused = [];
function addFiles(files) {
  if (!pending) refused = [];
  for (const file of files) {
    pending += 1;
    adding = adding.then(() => addFile(file)).finally(() => { pending -= 1; });
  }
}

async function addFile(file) {
  const before = [...refused];
  await drop(file);
  if (!at("wrong").hidden) refused.push(at("wrong").textContent);
  if (before.length) complain(new Error(refused.join(" – ")));
}

async function drop(file) {
  await working(`adding ${file.name} …`, async () => {
    const {kind, note} = await answered(await fetch(`file/${encodeURIComponent(file.name)}`, {method: "PUT", body: file}));
    if ((kind === "log" || kind === "table") && mayLeave()) return open(file.name, note);
    if (kind === "polar") polar = file.name;
    await list();
    if (kind === "polar" && flight && !whole()) recompute();
    if (kind === "map") say(`${file.name} is the map of its table now; open the table`);
  });
}

// ---- modes, messages, channels

function showEvents() {
  const body = at("events").querySelector("tbody");
  body.replaceChildren();
  at("events").hidden = !flight.events.length;
  for (const {t_s, kind, text} of flight.events) {
    const row = put(body, "tr"), button = put(put(row, "td"), "button", {type: "button"}, (Math.round(10 * t_s) / 10 + 0).toFixed(1));
    put(row, "td", {}, kind === "mode" ? `mode ${text}` : text);
    button.addEventListener("click", () => {
      const panel = charts.strips.panels[0];
      charts.strips.show({panel, x: Math.min(UNITS, Math.max(0, charts.strips.xUnits(t_s))), y: UNITS / 2});
      at("strips").scrollIntoView({block: "nearest"});
    });
  }
}

async function nameChannels() {
  if (at("channel-names").children.length || !at("channels").open) return;
  await working("listing the channels …", async () => {
    const {names} = await ask("channels", {file: flight.file});
    at("channel-names").replaceChildren(...names.map(value => Object.assign(document.createElement("option"), {value})));
  });
}

function showChannels() {
  at("channel-names").replaceChildren();
  at("channel").value = "";
  nameChannels();
  chips();
}

function chips() {
  const ul = at("channels").querySelector("ul");
  ul.replaceChildren();
  for (const name of drawnChannels) {
    const button = put(put(ul, "li"), "button", {type: "button"}, `take away ${name}`);
    button.addEventListener("click", () => drawChannels(drawnChannels.filter(one => one !== name)));
  }
}

function drawChannels(wanted) {
  return working("drawing …", async () => {
    const {strips} = await ask("strips", {file: flight.file, channels: wanted});
    drawnChannels = wanted;
    draw("over-time", strips);
    drawBands();
    chips();
  });
}

// ---- the curve

function values() {
  const stretch = ({start_s, end_s}) => [start_s, end_s];
  return {file: flight.file, runs: edited && !whole() ? runs.map(({kind, start_s, end_s, keep, why}) => ({kind, start_s, end_s, keep, why})) : null,
          left_out: whole() ? runs.map(stretch) : [], aircraft: changed, propeller, method, polar};
}

async function compute() {
  const question = ++asked;
  const found = await ask("curve", values());
  if (question !== asked) return;
  last = found;
  first = first || found.curve;
  at("command").textContent = found.command;
  if (whole()) airborne = found.airborne;
  else if (!edited) runs = found.runs;
  else for (const run of runs) {
    const same = found.runs.find(one => Math.abs(one.start_s - run.start_s) < 0.06 && Math.abs(one.end_s - run.end_s) < 0.06 && one.keep === run.keep);
    run.why = same ? same.why : run.why;
  }
  if (other) await compare(other.file);
  showGuess();
  showRuns();
  if (!whole()) showMethods();
  drawBands();
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
  const aircraft = whole() ? Object.fromEntries(Object.entries(changed).filter(([key]) => key in flight.needed)) : {};
  const found = await ask("curve", {file, other_condition: condition, aircraft});
  if (found.kind !== last.kind) throw new Error(`${file} gives ${found.kind}, this flight ${last.kind}: they are not compared`.replaceAll("_", " "));
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
    ...beside("thrust times airspeed", last.required, "#00693e", {dash: "12 6", band: true}),
    ...beside(last.method && last.method.title, last.method && last.method.curve, "#1b9e77", {dash: "12 6", band: true}),
    ...beside(predicted && `predicted by ${predicted.name}`, predicted, "#8a2f8f", {width: 2}),
  ]);
  at("by-polar").textContent = predicted ? `Thin: predicted by ${predicted.name}.` : "Drop a file of XFLR5, AVL or AeroSandbox on this page.";
  at("compared").textContent = other ? comparison() : "";
  at("by-method").textContent = whole() ? "" : byMethod();
  const k = last.least_power === null ? 0 : V.reduce((best, v, i) => Math.abs(v - last.least_power) < Math.abs(V[best] - last.least_power) ? i : best, 0);
  const where = last.least_power === null ? "the slowest flown; power still decreases there" : "the speed of least power";
  at("number").textContent = `${last.kind === ELECTRICAL ? "Electrical power " : ""}${P[k].toFixed(1)} W (95 % interval ${lo[k].toFixed(1)} to ${hi[k].toFixed(1)}) at ${V[k].toFixed(1)} m/s, ${where}, `
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

const kindClass = run => run.kind === BY_HAND ? "left-out-by-hand" : `${run.kind.replace(/[^a-z]+/g, "-")}${run.keep ? "" : " left-out"}`;

// Where a time is, in px from the left of the strips.
const time = t => charts.strips.place(t, 0)[0] - at("strips").getBoundingClientRect().left;
const last_s = () => at("strips") ? charts.strips.panels[0].x[1] : flight.end_s || 0;

function drawBands() {
  if (!at("strips")) return;
  const {svg, panels: [{view: [left, , width]}]} = charts.strips, share = t => 100 * (charts.strips.xUnits(t) - left) / width;
  const focused = document.activeElement && document.activeElement.dataset && document.activeElement.dataset.end;
  const bands = svg.querySelector(".bands") || put(svg, "svg", {class: "bands"});
  bands.replaceChildren();
  for (const [start, end] of airborne) put(bands, "rect", {class: "run airborne", x: `${share(start)}%`, width: `${share(end) - share(start)}%`, height: "100%"});
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
    if (key === "n" && flight) add();
    if (selected < 0) return;
    if (whole() && (key === "x" || key === "delete")) takeAgain(selected);
    else if (whole() && key !== "escape") return;
    else if (key in KEYS) { runs[selected].kind = KEYS[key]; changedRuns(); }
    else if (key === "x" || key === "delete") { runs[selected].keep = !runs[selected].keep; changedRuns(); }
    else if (key === "escape") select(-1);
  });
  at("method").addEventListener("change", () => { method = at("method").value; recompute(); });
  at("predicted").addEventListener("change", () => { polar = at("predicted").value; recompute(); });
  at("other").addEventListener("change", () => working("reading the other flight …", async () => {
    const file = at("other").value;
    try { if (file) await compare(file); else other = null; }
    catch (error) { other = null; at("other").value = ""; throw error; }
    finally { drawCurve(); }
  }));
  at("channels").addEventListener("toggle", nameChannels);
  const wanted = () => {
    const name = at("channel").value.trim();
    if (!name || drawnChannels.includes(name)) return;
    at("channel").value = "";
    drawChannels([...drawnChannels, name]);
  };
  at("draw").addEventListener("click", wanted);
  at("channel").addEventListener("keydown", event => { if (event.key === "Enter") wanted(); });
  at("add").addEventListener("click", add);
  at("as-found").addEventListener("click", () => { edited = false; selected = -1; runs = flight.runs || []; changedRuns(false); });
  at("as-recorded").addEventListener("click", () => { changed = {}; propeller = ""; showForm(); recompute(); });
  at("write").addEventListener("click", () => working("analyzing the log and writing the report …", async () => {
    const {said, kept, command} = await ask("write", values());
    say([...said, ...kept.map(name => `the previous list is now ${name}`)].join("; "));
    at("command").textContent = command;
    written = edits();
    showReport(true);
    await list();
  }));
  at("logs").querySelector("input").addEventListener("change", event => { addFiles([...event.target.files]); event.target.value = ""; });
  addEventListener("beforeunload", event => { if (unwritten()) event.preventDefault(); });
  addEventListener("dragover", event => { event.preventDefault(); document.body.classList.add("dropping"); });
  addEventListener("dragleave", () => document.body.classList.remove("dropping"));
  addEventListener("drop", event => {
    event.preventDefault();
    document.body.classList.remove("dropping");
    addFiles([...event.dataTransfer.files]);
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
  const start_s = Math.round(10 * (Number.isNaN(pointed) ? middleOfFlight() : Math.max(0, pointed))) / 10;
  if (whole()) return leaveOut(Math.min(start_s, last_s() - 1), Math.min(last_s(), start_s + 30));
  runs.push({kind: "deceleration", start_s, end_s: Math.min(last_s(), start_s + 10), keep: true, why: ""});
  selected = runs.length - 1;
  changedRuns();
}

// The middle of the longest stretch that is in the curve, or of the log.
function middleOfFlight() {
  if (!airborne.length) return last_s() / 2;
  const [start, end] = airborne.reduce((longest, one) => one[1] - one[0] > longest[1] - longest[0] ? one : longest);
  return (start + end) / 2;
}

function leaveOut(start_s, end_s) {
  runs.push({kind: BY_HAND, start_s, end_s, keep: false, why: BY_HAND});
  selected = runs.length - 1;
  changedRuns();
}

function takeAgain(i) {
  runs.splice(i, 1);
  selected = -1;
  changedRuns(runs.length > 0);
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
  if (whole()) airborne.forEach(([start, end], i) => {
    const row = put(body, "tr"), keep = put(put(row, "td"), "input", {type: "checkbox", "aria-label": `use stretch ${i + 1}`, "data-place": `a${i}`});
    keep.checked = true;
    keep.addEventListener("change", () => leaveOut(start, end));
    for (const text of ["in the air", start.toFixed(1), end.toFixed(1), ""]) put(row, "td", {}, text);
  });
  runs.forEach((run, i) => {
    const row = put(body, "tr", i === selected ? {class: "selected"} : {}), cells = Array.from({length: 5}, () => put(row, "td"));
    const keep = put(cells[0], "input", {type: "checkbox", "aria-label": `use run ${i + 1}`, "data-place": `${i} keep`});
    keep.checked = run.keep;
    keep.addEventListener("change", () => { if (whole()) return takeAgain(i); run.keep = keep.checked; changedRuns(); });
    if (whole()) cells[1].textContent = run.kind;
    const kind = whole() ? document.createElement("select") : put(cells[1], "select", {"aria-label": `kind of run ${i + 1}`, "data-place": `${i} kind`});
    for (const name of flight.kinds || []) put(kind, "option", name === run.kind ? {selected: ""} : {}, name);
    kind.addEventListener("change", () => { run.kind = kind.value; changedRuns(); });
    for (const [cell, end, name] of [[2, "start_s", "start"], [3, "end_s", "end"]]) {
      const box = put(cells[cell], "input", {type: "number", step: 0.1, min: 0, "aria-label": `${name} of run ${i + 1}, s`, value: run[end].toFixed(2), "data-place": `${i} ${end}`, "data-field": `run ${i}`});
      box.addEventListener("change", () => { if (Number.isFinite(box.valueAsNumber)) { run[end] = box.valueAsNumber; changedRuns(); } });
    }
    if (!whole()) cells[4].textContent = run.why || NOT_IN_CURVE[run.kind] || "";
    row.addEventListener("click", event => { if (event.target.tagName === "TD") select(i); });
    row.addEventListener("focusin", () => { if (selected !== i) { selected = i; drawBands(); [...body.rows].forEach((one, k) => one.classList.toggle("selected", k === i)); } });
  });
  if (place) { const again = body.querySelector(`[data-place="${place}"]`); if (again) again.focus(); }
}

// ---- values

function showForm() {
  const [group, ...more] = flight.form, rest = at("form").querySelector("div");
  at("first-title").textContent = group.title;
  showFields(at("first"), group.fields);
  rest.replaceChildren();
  for (const {title, fields} of more) { put(rest, "h3", {}, title); showFields(put(rest, "div", {class: "fields"}), fields); }
  at("values").hidden = !more.length;
  recorded();
}

function recorded() { at("as-recorded").disabled = !Object.keys(changed).length && !propeller; }

function showFields(div, fields) {
  div.replaceChildren();
  for (const {key, label: words, value, meaning, example} of fields) {
    const label = put(div, "label", {title: meaning});
    put(label, "span", {}, words);
    const box = key === "propeller" ? choiceOfPropeller(label) : put(label, "input", {"data-key": key, "data-field": key, placeholder: example, autocomplete: "off"});
    box.addEventListener("focus", () => { at("meaning").textContent = meaning ? `${words}: ${meaning}` : ""; });
    if (key === "propeller") continue;
    box.value = key in changed ? changed[key] : value;
    box.classList.toggle("changed", key in changed);
    box.addEventListener("change", () => {
      if (box.value === value) delete changed[key]; else changed[key] = box.value;
      if (flight.needed && key in flight.needed) typed[key] = box.value;
      box.classList.toggle("changed", box.value !== value);
      recorded();
      recompute();
    });
  }
}

function choiceOfPropeller(label) {
  const choice = put(label, "select", {"data-key": "propeller", "data-field": "propeller"});
  put(choice, "option", {value: ""}, flight.propeller ? `${flight.propeller} (as in the log)` : "not known");
  for (const name of flight.propellers) put(choice, "option", {value: name}, name);
  choice.value = propeller;
  choice.addEventListener("change", () => { propeller = choice.value; recorded(); recompute(); });
  return choice;
}

// What was guessed stands in its field in gray, until it is typed.
function showGuess() {
  const guessed = Object.entries(last.guessed || {});
  for (const box of at("first").querySelectorAll("input")) box.classList.remove("guessed");
  for (const [key, text] of guessed) {
    const box = at("first").querySelector(`[data-key="${key}"]`);
    box.placeholder = `guessed: ${text}`;
    box.classList.add("guessed");
  }
  const words = guessed.map(([key]) => flight.needed[key]);
  at("missing").textContent = words.length ? `It lacks ${words.join(", ")}, which are only guessed: type them first.` : "";
  at("guessed").hidden = !guessed.length;
  at("guessed").textContent = guessed.length ? "Drawn with a guessed aircraft, by speed and power of this flight: type mass, wing area and span." : "";
}

listen();
working("", async () => {
  const logs = await list(), wanted = decodeURIComponent(location.hash.slice(1));
  const name = wanted || (logs.length === 1 ? logs[0].name : "");
  if (name) await open(name);
});
