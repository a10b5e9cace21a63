"use strict";
// The controls of weight, air and battery: the asked curve beside that of the flight, and the answers in a table. They
// come from the grid of other_conditions.py, interpolated; V in m/s, power in W; NaN where a quantity does not exist.

const known = value => value ?? NaN;
const linear = (x, xs, ys) => {
  const i = clamped(xs.findIndex(one => one >= x), 1, xs.length - 1);
  return ys[i - 1] + (ys[i] - ys[i - 1]) * (x - xs[i - 1]) / (xs[i] - xs[i - 1]);
};

// Quantities at a weight and density: linear in the logarithms between the four nodes around it.
function interpolated(grid, at) {
  const place = ([first, step], value, last) => {
    const steps = clamped((Math.log(value) - first) / step, 0, last), i = Math.min(Math.floor(steps), last - 1);
    return [i, steps - i];
  };
  const [i, a] = place(grid.log_weight, at.weight_N, grid.nodes.length - 1);
  const [k, b] = place(grid.log_density, at.rho, grid.nodes[0].length - 1);
  const corners = [[i, k, (1 - a) * (1 - b)], [i + 1, k, a * (1 - b)], [i, k + 1, (1 - a) * b], [i + 1, k + 1, a * b]]
    .filter(([, , share]) => share > 1e-9).map(([row, column, share]) => [grid.nodes[row][column], share]);
  const sum = of => corners.reduce((total, [node, share]) => total + share * known(of(node)), 0);
  return {curve: name => (corners[0][0][name] || []).map((_, n) => sum(node => node[name][n])), number: name => sum(node => node[name]),
          airMean: rows => rows[k].map((value, n) => (1 - b) * known(value) + (b > 0 ? b * known(rows[k + 1][n]) : 0)),
          inside: n => corners.every(([node]) => node.inside[n] === "1")};
}

// Place and height of the maximum, by a parabola through the highest point and its neighbors.
function maximum(x, y) {
  let i = -1;
  y.forEach((value, k) => { if (!Number.isNaN(value) && (i < 0 || value > y[i])) i = k; });
  if (i < 0) return [NaN, NaN];
  if (i === 0 || i === x.length - 1 || !y.slice(i - 1, i + 2).every(Number.isFinite)) return [x[i], y[i]];
  const before = y[i - 1] - y[i], after = y[i + 1] - y[i];
  const shift = before + after < 0 ? (before - after) / (2 * (before + after)) : 0;
  return [x[i] + shift * (x[1] - x[0]), y[i] + (after - before) * shift / 4];
}

// Where y falls through zero for the last time.
function lastCrossing(x, y) {
  for (let i = x.length - 2; i >= 0; i--) if (y[i] > 0 && y[i + 1] <= 0) return x[i] + (x[i + 1] - x[i]) * y[i] / (y[i] - y[i + 1]);
  return NaN;
}

// at: weight_N, rho; flown: the same of the flight; energy_J: usable, of the battery.
function performanceAt(grid, flown, at, energy_J) {
  const heavier = at.weight_N / flown.weight_N, denser = at.rho / flown.rho, faster = Math.sqrt(heavier / denser);
  const scaled = (values, by) => values.map(value => by * known(value)), power = heavier * faster;
  const {curve, number, inside, airMean} = interpolated(grid, at), V = scaled(grid.V, faster);
  const required = scaled(grid.required, power), errors = scaled(grid.required_error, power), share = curve("battery_error");
  const battery = curve("efficiency").map((efficiency, k) => required[k] / efficiency);
  let full = null, sustained = V.map(() => true), possible = battery.some(Number.isFinite);
  if (grid.full) {
    const fullV = scaled(grid.full.V, faster), along = curve("along"), table = airMean(grid.full.thrust_over_density);
    const thrust = fullV.map((v, k) => at.rho * along[k] * linear(v, grid.full.thrust_V, table));
    const climb = curve("drag_over_weight").map((drag, k) => (thrust[k] / at.weight_N - drag) * fullV[k]);
    full = {V: fullV, power: thrust.map((newtons, k) => newtons * fullV[k]),
            maximumSpeed: {value: lastCrossing(fullV, climb), error: number("maximum_speed_error")},
            bestClimb: {value: maximum(fullV, climb)[1], error: number("best_climb_error")}};
    const held = V.map(v => !(linear(v, fullV, climb) < 0));
    possible = held.some((yes, k) => yes && Number.isFinite(battery[k]));
    if (possible) sustained = held;
  }
  const margin = 1.01 * (V[1] - V[0]), best = (objective, error) => {
    const [speed, value] = maximum(V, V.map((v, k) => sustained[k] ? objective(v, battery[k]) : NaN));
    const near = V.reduce((n, v, k) => Math.abs(v - speed) < Math.abs(V[n] - speed) ? k : n, 0);
    return {speed: {value: speed, error: number(error)}, best: {value, error: value * share[near]}, inside: inside(near),
            atSlowest: speed <= V[0] + margin, atFastest: speed >= V[V.length - 1] - margin};
  };
  return {flight: {V, required: required.map((value, k) => ({value, error: errors[k]})), battery}, full, possible,
          endurance: best((v, P) => energy_J / P, "endurance_speed_error"), range: best((v, P) => energy_J / P * v, "range_speed_error")};
}

function otherConditions(embedded) {
  const {grid, flown, atmosphere: air, normal_95: z, color} = embedded;
  const section = document.getElementById("other-conditions"), fields = {};
  const pressureAt = height => air.sea_level_Pa
    * (1 - air.lapse_rate * height / air.sea_level_K) ** (air.gravity_mps2 / (air.gas_constant * air.lapse_rate));
  const relative = (height, kelvin) => pressureAt(height) / kelvin;
  const start = {mass: flown.weight_N / air.gravity_mps2, height: flown.pressure_altitude_m,
                 temperature: flown.temperature_K - 273.15, battery: embedded.battery_Wh, share: 100 * embedded.usable};

  function asked(values) {
    const density = relative(values.height, values.temperature + 273.15) / relative(start.height, flown.temperature_K);
    return {at: {weight_N: values.mass * air.gravity_mps2, rho: flown.rho * density},
            energy_J: 3600 * values.battery * values.share / 100};
  }

  const number = (value, digits) => Number.isFinite(value) ? value.toFixed(digits) : "–";
  const ends = ({value, error}, scale, digits, least = -Infinity) => Number.isFinite(error)
    ? ` (${number(Math.max(scale * (value - z * error), Math.min(least, scale * value)), digits)} to ${number(scale * (value + z * error), digits)})` : "";
  const quantity = (one, scale, digits, least) => number(scale * one.value, digits) + ends(one, scale, digits, least);
  const end = one => one.atSlowest ? ", the slowest flown" : one.atFastest ? ", the fastest flown" : "";
  const mark = one => one.inside ? "" : " *";

  function answers({flight, full, possible, endurance, range}) {
    const least = flight.required.reduce((best, one, k) => one.value < flight.required[best].value ? k : best, 0);
    const cannot = "level flight needs more than full throttle";
    return [
      ["least power required, W", `${quantity(flight.required[least], 1, 1)} at ${number(flight.V[least], 1)} m/s`],
      ["best endurance, min", possible ? `${quantity(endurance.best, 1 / 60, 0, 0)} at ${number(endurance.speed.value, 1)} m/s${end(endurance)}${mark(endurance)}` : cannot],
      ["best range, km", possible ? `${quantity(range.best, 1e-3, 1, 0)} at ${number(range.speed.value, 1)} m/s${end(range)}${mark(range)}` : cannot],
      ["full throttle, level, m/s", full ? quantity(full.maximumSpeed, 1, 1) : "not known"],
      ["best climb, m/s", full ? quantity(full.bestClimb, 1, 1) : "not known"],
      ["do not fly slower than, m/s", number(flight.V[0], 1)],
      ["fastest flown, m/s", number(flight.V[flight.V.length - 1], 1)],
    ];
  }

  function drawAsked(performance, name) {
    if (!performance) return charts.power.add("asked", []);
    const {flight: {V, required}, full} = performance;
    const curves = [{name, x: V, y: required.map(one => one.value), half: required.map(one => z * one.error), color, width: 5}];
    if (full) {
      const top = Math.max(V[V.length - 1], 1.03 * (full.maximumSpeed.value || 0)), x = full.V.filter(v => v <= top);
      curves.push({name, x, y: x.map((_, k) => full.power[k]), color, dash: "3 4", value: "{y:.1f} W available", unnamed: true});
    }
    charts.power.add("asked", curves);
  }

  function values() { return Object.fromEntries(Object.entries(fields).map(([name, field]) => [name, field.value()])); }

  function update() {
    const now = values(), changed = Object.values(fields).some(field => field.changed());
    const {at, energy_J} = asked(now);
    const performance = performanceAt(grid, flown, at, energy_J);
    answers(performance).forEach(([, text], k) => { section.querySelectorAll("tbody tr")[k].cells[2].textContent = changed ? text : "as flown"; });
    section.querySelector("output").textContent = `Air of ${at.rho.toFixed(3)} kg/m³. `
      + (changed ? "The lines in orange are computed, not flown: drag by the polar of this flight, thrust by the propeller table. " : "")
      + "* outside the propeller table: an extrapolation.";
    section.querySelector("button").disabled = !changed;
    drawAsked(changed ? performance : null, `${now.mass.toFixed(2)} kg, ${at.rho.toFixed(3)} kg/m³`);
    section.dataset.ready = "yes";
  }

  let waiting = 0;
  function soon() { cancelAnimationFrame(waiting); waiting = requestAnimationFrame(update); }

  for (const row of section.querySelectorAll("[data-field]")) {
    const name = row.dataset.field, [slider, box] = row.querySelectorAll("input"), digits = Number(box.dataset.digits);
    const begin = start[name];
    let value = begin;
    const limits = [Number(box.min), Number(box.max)];
    const show = () => { slider.value = value; box.value = value.toFixed(digits); };
    const take = from => () => {
      const given = Number(from.value);
      if (from.value === "" || !(given >= limits[0] && given <= limits[1])) return box.setCustomValidity(`between ${limits[0]} and ${limits[1]}`), box.reportValidity();
      box.setCustomValidity("");
      // The value of the flight has more digits than the box: it stays what it was where nothing was changed.
      value = from.value === begin.toFixed(digits) ? begin : given;
      if (from === box) slider.value = value; else box.value = value.toFixed(digits);
      soon();
    };
    fields[name] = {value: () => value, changed: () => value !== begin, reset: () => { value = begin; show(); }};
    slider.addEventListener("input", take(slider));
    box.addEventListener("input", take(box));
    show();
  }
  section.querySelector("button").addEventListener("click", () => { Object.values(fields).forEach(field => field.reset()); soon(); });
  const before = asked(start), body = section.querySelector("tbody");
  for (const [question, text] of answers(performanceAt(grid, flown, before.at, before.energy_J))) {
    const row = body.insertRow();
    for (const content of [question, text, ""]) row.insertCell().textContent = content;
  }
  [...body.rows].forEach(row => row.cells.length && ["", "as flown", "asked"].forEach((label, k) => { row.cells[k].dataset.label = label; }));
  section.hidden = false;
  update();
}
