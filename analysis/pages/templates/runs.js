"use strict";
// One run shown in every figure, and the curve previewed without some of them.

// The solution of a symmetric positive definite system, by columns of the right side.
function solved(matrix, columns) {
  const n = matrix.length, rows = matrix.map((row, i) => [...row, ...columns.map(column => column[i])]);
  for (let i = 0; i < n; i++)
    for (let k = 0; k < n; k++) {
      if (k === i) continue;
      const factor = rows[k][i] / rows[i][i];
      for (let j = i; j < rows[k].length; j++) rows[k][j] -= factor * rows[i][j];
    }
  return columns.map((_, c) => rows.map((row, i) => row[n + c] / row[i]));
}

const unit = (n, i) => Array.from({length: n}, (_, k) => Number(k === i));

// The curve without some runs: {x, y, half}, the normal equations less their shares.
function curveWithout(shares, names) {
  const n = shares.information.length, gradient = new Array(n).fill(0);
  const information = shares.information.map(row => [...row]);
  for (const name of names) {
    const share = shares.by_run[name];
    share.gradient.forEach((value, i) => { gradient[i] += value; });
    share.information.forEach((row, i) => row.forEach((value, k) => { information[i][k] -= value; }));
  }
  const [step, ...after] = solved(information, [gradient, unit(n, 0), unit(n, 1), unit(n, 2)]);
  const before = solved(shares.information, [0, 1, 2].map(i => unit(n, i)));
  const A = shares.A.map((value, i) => value - step[i]);
  const covariance = shares.covariance.map((row, i) =>
    row.map((value, k) => value + shares.noise_factor * (after[i][k] - before[i][k])));
  const x = shares.speeds, y = [], half = [];
  for (const V of x) {
    const qSV = shares.rho * V ** 3 / 2 * shares.wing_area_m2, CL = shares.weight_N * V / qSV, row = [1, CL, CL ** 2];
    y.push(qSV * row.reduce((sum, value, i) => sum + value * A[i], 0));
    let variance = 0;
    row.forEach((one, i) => row.forEach((other, k) => { variance += one * other * covariance[i][k]; }));
    half.push(shares.normal_95 * qSV * Math.sqrt(Math.max(variance, 0)));
  }
  return {x, y, half};
}

function runsOfThePage({runs, file, shares, colors}) {
  const table = document.querySelector("#flight .table tbody"), shown = document.getElementById("run-shown");
  const preview = document.getElementById("preview"), left = new Set();
  const byName = new Map(runs.map(run => [run.name, run]));
  let selected = "";
  const canLeave = name => Boolean(shares && shares.by_run[name]) && Object.keys(shares.by_run).length - left.size > (left.has(name) ? 0 : 1);

  // Lines, points and stretches of the runs, in every figure.
  function mark() {
    for (const element of document.querySelectorAll(".chart [data-run]")) {
      const {run} = element.dataset;
      element.classList.toggle("selected", run === selected);
      element.classList.toggle("left-out", left.has(run));
      element.classList.toggle("dim", Boolean(selected) && run !== selected);
    }
  }

  function alone() {
    if (!charts.one_by_one) return;
    const curve = charts.one_by_one.marks(charts.one_by_one.panels[0]).find(element => selected && element.dataset.run === selected);
    charts.power.add("alone", curve ? [{...charts.one_by_one.values(curve), name: `${byName.get(selected).label}, alone`, color: colors.alone, dash: "9 6"}] : []);
  }

  function without() {
    preview.hidden = !left.size;
    if (!left.size) return charts.power.add("without", []);
    const curve = curveWithout(shares, left), all = curveWithout(shares, []), last = curve.x.length - 1;
    const numbers = runs.map((run, i) => left.has(run.name) ? i + 1 : 0).filter(Boolean);
    const name = `preview without run${numbers.length > 1 ? "s" : ""} ${numbers.join(", ")}`;
    charts.power.add("without", [{name, ...curve, color: colors.without, width: 4, dash: "9 4 3 4"}]);
    preview.curve = curve;
    const change = k => `${(100 * (curve.y[k] / all.y[k] - 1)).toFixed(1).replace("-0.0", "0.0")} % at ${curve.x[k].toFixed(1)} m/s`;
    preview.querySelector("span").textContent = `${name[0].toUpperCase()}${name.slice(1)}: power changes by ${[0, Math.floor(last / 2), last].map(change).join(", ")}. `
      + "Numbers and answers on this page are still those of all runs. To have them without: save the list, and run";
  }

  function update() {
    [...table.rows].forEach((row, i) => {
      const {name} = runs[i];
      row.classList.toggle("selected", name === selected);
      row.classList.toggle("left-out", left.has(name));
      row.setAttribute("aria-selected", String(name === selected));
    });
    shown.hidden = !selected;
    if (selected) {
      const {label, says} = byName.get(selected), leave = shown.querySelector("[data-do=leave]");
      shown.querySelector("b").textContent = label;
      shown.querySelector("span").textContent = says;
      leave.hidden = !shares || !shares.by_run[selected];
      leave.disabled = !canLeave(selected);
      leave.textContent = left.has(selected) ? "take it again" : "leave it out (preview)";
    }
    document.querySelectorAll("#fits figure[data-run]").forEach(figure =>
      figure.classList.toggle("faded", Boolean(selected) && figure.dataset.run !== selected));
    alone();
    without();
    mark();
  }

  function select(name) { selected = name === selected ? "" : name; update(); }
  function step(by) {
    const i = runs.findIndex(run => run.name === selected);
    select(runs[(i + by + runs.length) % runs.length].name);
  }

  [...table.rows].forEach((row, i) => {
    row.tabIndex = 0;
    row.addEventListener("click", () => select(runs[i].name));
    row.addEventListener("keydown", event => { if (event.key === "Enter" || event.key === " ") { event.preventDefault(); select(runs[i].name); } });
  });
  document.addEventListener("chart-click", ({detail: {run}}) => { if (byName.has(run)) select(run); });
  const actions = {
    leave: () => { if (left.has(selected)) left.delete(selected); else if (canLeave(selected)) left.add(selected); update(); },
    previous: () => step(-1), next: () => step(1), close: () => select(selected),
    all: () => { left.clear(); update(); },
    save: () => {
      const link = document.createElement("a");
      link.href = URL.createObjectURL(new Blob([editedRuns()], {type: "application/toml"}));
      link.download = "runs.toml";
      link.click();
    },
  };
  document.querySelectorAll("[data-do]").forEach(button => button.addEventListener("click", actions[button.dataset.do]));
  addEventListener("keydown", event => { if (event.key === "Escape" && selected) select(selected); });

  function editedRuns() {
    return file.head + file.blocks.map(block => left.has(block.run) ? block.left_out : block.kept).join("");
  }
  preview.editedRuns = editedRuns;
}
