"use strict";
// The controls of weight, air and battery: the asked curve beside that of the flight, and the answers in a table.

function otherConditions(embedded) {
  const {model, flown, atmosphere: air, normal_95: z, color} = embedded;
  const section = document.getElementById("other-conditions"), fields = {};
  const pressureAt = height => air.sea_level_Pa
    * (1 - air.lapse_rate * height / air.sea_level_K) ** (air.gravity_mps2 / (air.gas_constant * air.lapse_rate));
  const relative = (height, kelvin) => pressureAt(height) / kelvin;
  const start = {mass: flown.weight_N / air.gravity_mps2, height: flown.pressure_altitude_m,
                 temperature: flown.temperature_K - 273.15, battery: embedded.battery_Wh, share: 100 * embedded.usable};

  function asked(values) {
    const density = relative(values.height, values.temperature + 273.15) / relative(start.height, flown.temperature_K);
    return {at: {weight_N: values.mass * air.gravity_mps2, rho: flown.rho * density, wing_area_m2: flown.wing_area_m2},
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
      ["longest endurance, min", possible ? `${quantity(endurance.best, 1 / 60, 0, 0)} at ${number(endurance.speed.value, 1)} m/s${end(endurance)}${mark(endurance)}` : cannot],
      ["longest range, km", possible ? `${quantity(range.best, 1e-3, 1, 0)} at ${number(range.speed.value, 1)} m/s${end(range)}${mark(range)}` : cannot],
      ["full throttle, level, m/s", full ? quantity(full.maximumSpeed, 1, 1) : "not known"],
      ["best climb, m/s", full ? quantity(full.bestClimb, 1, 1) : "not known"],
      ["do not fly slower than, m/s", number(flight.V[0], 1)],
      ["fastest flown, m/s", number(flight.V[flight.V.length - 1], 1)],
    ];
  }

  function drawAsked(performance, name) {
    if (!performance) return add("power", "asked", []);
    const {flight: {V, required}, full} = performance;
    const curve = {x: V, y: required.map(one => one.value), half: required.map(one => z * one.error)};
    const traces = curveWithBand(name, curve, {color, width: 5});
    if (full) {
      const top = Math.max(V[V.length - 1], 1.03 * (full.maximumSpeed.value || 0)), x = full.V.filter(v => v <= top);
      traces.push({...traces[1], x, y: x.map((_, k) => full.power[k].value), showlegend: false,
                   line: {color, width: 3, dash: "dot"}, hovertemplate: "%{y:.1f} W available"});
    }
    add("power", "asked", traces);
  }

  function values() { return Object.fromEntries(Object.entries(fields).map(([name, field]) => [name, field.value()])); }

  function update() {
    const now = values(), changed = Object.values(fields).some(field => field.changed());
    const {at, energy_J} = asked(now);
    const performance = performanceAt(model, at, energy_J);
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
  for (const [question, text] of answers(performanceAt(model, before.at, before.energy_J))) {
    const row = body.insertRow();
    for (const content of [question, text, ""]) row.insertCell().textContent = content;
  }
  [...body.rows].forEach(row => row.cells.length && ["", "as flown", "asked"].forEach((label, k) => { row.cells[k].dataset.label = label; }));
  section.hidden = false;
  update();
}
