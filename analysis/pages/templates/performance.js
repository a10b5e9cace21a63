"use strict";
// Performance at any weight, in any air, with any battery: analysis/performance computed in the page, step by step as
// in power_train.py, level_flight.py, climb.py and analysis.py there, at the same sigma points of the parameters.
// Units: V in m/s, n in rev/s, thrust and drag in N, power in W, rho in kg/m^3. NaN where a quantity does not exist.

const BISECTIONS = 18, STEPS = 6;
const pointsOf = (model, compute) => model.points.map(compute);
const linspace = (first, last, n) => Array.from({length: n}, (_, i) => first + (last - first) * i / (n - 1));
const lastNotAbove = (knots, x) => { let i = 0; while (i < knots.length && knots[i] <= x) i++; return i; };

function interpolate(x, xs, ys) {
  if (x <= xs[0]) return ys[0];
  const i = lastNotAbove(xs, x);
  return i >= xs.length ? ys[ys.length - 1] : ys[i - 1] + (ys[i] - ys[i - 1]) * (x - xs[i - 1]) / (xs[i] - xs[i - 1]);
}

// {value, error} of a quantity computed at the sigma points: the estimate, then m points up and m down.
function withError(values) {
  const m = (values.length - 1) / 2;
  let sum = 0;
  for (let i = 1; i <= m; i++) sum += ((values[i] - values[m + i]) / 2) ** 2;
  return {value: values[0], error: Math.sqrt(sum)};
}

function curveWithErrors(rows) { return rows[0].map((_, k) => withError(rows.map(row => row[k]))); }

function thrustAndPower(propeller, V, n, rho) {
  const D = propeller.diameter_m, J = V / (n * D), rpm = 60 * n, {cT, cP} = propeller;
  const column = lastNotAbove(propeller.knots, J), from = J - propeller.below[column];
  const row = lastNotAbove(propeller.rpm.slice(1, -1), rpm), next = Math.min(row + 1, propeller.rpm.length - 1);
  const share = next === row ? 0
    : Math.min(1, Math.max(0, (rpm - propeller.rpm[row]) / (propeller.rpm[next] - propeller.rpm[row])));
  const at = table => (1 - share) * (table.value[row][column] + table.slope[row][column] * from)
    + share * (table.value[next][column] + table.slope[next][column] * from);
  let [thrust, power] = [at(cT), at(cP)];
  if (propeller.folds) [thrust, power] = [Math.max(thrust, -propeller.folded_drag_area / 2 * J ** 2), Math.max(power, 0)];
  return [thrust * rho * n ** 2 * D ** 4, power * rho * n ** 3 * D ** 5];
}

function covers(propeller, J, rpm) {
  const rows = propeller.rpm;
  return interpolate(rpm, rows, propeller.first_J) <= J && J <= interpolate(rpm, rows, propeller.last_J)
    && rows[0] <= rpm && rpm <= rows[rows.length - 1];
}

function correctedThrust(model, p, V, n, rho) {
  const J = V / (n * model.propeller.diameter_m);
  return thrustAndPower(model.propeller, V, n, rho)[0] * (1 + p.thrust_scale + p.thrust_slope * (J - model.J_reference));
}

// The zero of a rising function.
function zeroOf(excess, low, high) {
  if (!(excess(high) > 0)) return NaN;
  for (let i = 0; i < BISECTIONS; i++) {
    const middle = (low + high) / 2;
    if (excess(middle) > 0) high = middle; else low = middle;
  }
  const atLow = excess(low), rise = excess(high) - atLow;
  return rise !== 0 ? low - (high - low) * atLow / rise : high > low ? NaN : low;
}

function revpsForThrust(model, p, V, thrust, rho) {
  const slowest = V / (3 * model.propeller.diameter_m);
  return zeroOf(n => correctedThrust(model, p, V, n, rho) - thrust, slowest, 15 * slowest + 100);
}

function fullThrottleRevps(model, p, V, rho) {
  const excess = n =>
    n + p.revps_per_Nm * thrustAndPower(model.propeller, V, n, rho)[1] / (2 * Math.PI * n) - p.unloaded_revps;
  return zeroOf(excess, 1, 1.5 * p.unloaded_revps);
}

const speedAt = (CL, at) => Math.sqrt(2 * at.weight_N / (at.rho * CL * at.wing_area_m2));
const qS = (V, at) => at.rho * V ** 2 / 2 * at.wing_area_m2;
const drag = (p, V, CL, at) => qS(V, at) * (p.A0 + p.A1 * CL + p.A2 * CL ** 2);

function levelThrust(p, V, at) {
  let thrust = 0, carried = 0;
  for (let i = 0; i < STEPS; i++) {
    const CL = (at.weight_N - carried) / qS(V, at), alpha = p.alpha_0 + p.alpha_CL * CL;
    thrust = drag(p, V, CL, at) / Math.cos(alpha);
    carried = thrust * Math.sin(alpha);
  }
  return thrust;
}

// sin(gamma), and thrust along the flight path.
function climbAngle(p, thrust, V, at) {
  let carried = 0, sine = 0, along = 0;
  for (let i = 0; i < STEPS; i++) {
    const CL = (at.weight_N * Math.sqrt(1 - sine ** 2) - carried) / qS(V, at), alpha = p.alpha_0 + p.alpha_CL * CL;
    along = thrust * Math.cos(alpha);
    carried = thrust * Math.sin(alpha);
    sine = Math.min(0.99, Math.max(-0.99, (along - drag(p, V, CL, at)) / at.weight_N));
  }
  return [sine, along];
}

function levelFlight(model, at) {
  const [smallest, largest] = model.flown_CL;
  const V = linspace(speedAt(largest, at), speedAt(smallest, at), model.speeds);
  const required = pointsOf(model, p => V.map(v => drag(p, v, at.weight_N / qS(v, at), at) * v));
  const n = pointsOf(model, p => V.map(v => revpsForThrust(model, p, v, levelThrust(p, v, at), at.rho)));
  const battery = model.points.map((p, i) => V.map((v, k) => {
    const shaft = thrustAndPower(model.propeller, v, n[i][k], at.rho)[1];
    const torque = shaft / (2 * Math.PI * n[i][k]) + model.no_load_torque_Nm;
    return (p.shaft_scale * shaft + p.friction * n[i][k] + p.copper * torque ** 2) / (1 + p.meter_scale);
  }));
  const inside = V.map((v, k) => covers(model.propeller, v / (n[0][k] * model.propeller.diameter_m), 60 * n[0][k]));
  return {V, required: curveWithErrors(required), battery, inside};
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

// The best speed; objective: of a battery power and a speed.
function optimum(flight, sustained, objective) {
  const {V} = flight, maxima = flight.battery.map(powers =>
    maximum(V, powers.map((power, k) => sustained[k] ? objective(power, V[k]) : NaN)));
  const speed = withError(maxima.map(one => one[0])), best = withError(maxima.map(one => one[1]));
  const margin = 1.01 * (V[1] - V[0]), slowest = V[0], fastest = V[V.length - 1];
  const nearest = V.reduce((k, v, i) => Math.abs(v - speed.value) < Math.abs(V[k] - speed.value) ? i : k, 0);
  return {speed, best, atSlowest: speed.value <= slowest + margin, atFastest: speed.value >= fastest - margin,
          inside: flight.inside[nearest]};
}

// Where y falls through zero for the last time.
function lastCrossing(x, y) {
  for (let i = x.length - 2; i >= 0; i--)
    if (y[i] > 0 && y[i + 1] <= 0) return x[i] + (x[i + 1] - x[i]) * y[i] / (y[i] - y[i + 1]);
  return NaN;
}

// Of each sigma point; where one does not cross, the estimate's crossing shifted by the difference over the slope.
function lastCrossings(x, rows) {
  const crossings = rows.map(row => lastCrossing(x, row)), here = crossings[0];
  if (!Number.isFinite(here)) return crossings;
  const at = x.findIndex(value => value >= here), i = Math.min(at < 0 ? x.length : at, x.length - 1);
  const slope = (rows[0][i] - rows[0][i - 1]) / (x[i] - x[i - 1]);
  return crossings.map((value, k) => Number.isFinite(value) ? value : here - interpolate(here, x, rows[k]) / slope);
}

function fullThrottle(model, at) {
  const [smallest, largest] = model.flown_CL;
  const V = linspace(speedAt(largest, at), model.fastest_sought * speedAt(smallest, at), model.speeds);
  const power = [], climb = [];
  for (const p of model.points) {
    const rows = V.map(v => {
      const n = fullThrottleRevps(model, p, v, at.rho);
      const [sine, along] = climbAngle(p, correctedThrust(model, p, v, n, at.rho), v, at);
      return [along * v, v * sine];
    });
    power.push(rows.map(row => row[0]));
    climb.push(rows.map(row => row[1]));
  }
  const highest = row => row.reduce((best, value) => Number.isNaN(value) || best >= value ? best : value, NaN);
  return {V, power: curveWithErrors(power), climb: curveWithErrors(climb),
          maximumSpeed: withError(lastCrossings(V, climb)), bestClimb: withError(climb.map(highest))};
}

// at: weight_N, rho, wing_area_m2. energy_J: usable, of the battery.
function performanceAt(model, at, energy_J) {
  const flight = levelFlight(model, at), full = model.full_throttle ? fullThrottle(model, at) : null;
  const climbs = full && full.climb.map(climb => climb.value);
  let sustained = flight.V.map(v => !full || !(interpolate(v, full.V, climbs) < 0));
  const possible = sustained.some((yes, k) => yes && Number.isFinite(flight.battery[0][k]));
  if (!possible) sustained = sustained.map(() => true);
  return {flight, full, possible, endurance: optimum(flight, sustained, power => energy_J / power),
          range: optimum(flight, sustained, (power, V) => energy_J / power * V)};
}
