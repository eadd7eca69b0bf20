"use strict";
const D = DATA.diagnosis, R = DATA.report;
const LOSS = "#b3261e", BEFORE = "#d1495b", AFTER = "#0a7cc4", MEASURED = "#17202a", FLOOR = "#8a949e";
const byId = (id) => document.getElementById(id);
const clear = (id) => byId(id).remove();
const node = (tag, text, name) => {
  const e = document.createElement(tag);
  if (text !== undefined) e.textContent = text;
  if (name) e.className = name;
  return e;
};
const fixed = (x, digits = 3) => x === null || x === undefined ? "–" : Number(x.toPrecision(digits)).toString();
const percent = (x, digits = 0) => x === null || x === undefined ? "–" : `${(100 * x).toFixed(digits)} %`;
/** Column names carry their unit: "speed_m_s" is read as "speed, m/s". */
const UNITS = [["_m_s2", "m/s²"], ["_rad_s", "rad/s"], ["_m_s", "m/s"], ["_g_s", "g/s"], ["_kpa", "kPa"], ["_percent", "%"],
  ["_rpm", "rpm"], ["_frac", "1"], ["_degc", "°C"], ["_rad", "rad"], ["_pa", "Pa"], ["_1_m", "1/m"], ["_m", "m"]];
const split = (column) => {
  for (const [tail, unit] of UNITS) {
    if (column.endsWith(tail)) return [column.slice(0, -tail.length).replaceAll("_", " "), unit];
  }
  return [column.replaceAll("_", " "), column === "shift_in_process" ? "s" : ""];
};
const label = (column) => split(column).filter(Boolean).join(", ");
const words = (id) => id.replaceAll("_", " ");

function table(where, heads, rows) {
  const t = node("table"), head = t.createTHead().insertRow(), body = t.createTBody();
  for (const h of heads) head.append(node("th", h.name, h.number ? "n" : ""));
  for (const row of rows) {
    const line = body.insertRow();
    row.forEach((cell, i) => {
      const td = node("td", undefined, heads[i].number ? "n" : "");
      td.append(cell instanceof Node ? cell : document.createTextNode(cell));
      line.append(td);
    });
  }
  const scroll = node("div", undefined, "scroll");
  scroll.append(t);
  byId(where).append(scroll);
}
const plain = { displayModeBar: false, responsive: true };
const base = { margin: { l: 64, r: 16, t: 28, b: 44 }, plot_bgcolor: "#fff", paper_bgcolor: "#fff", font: { family: "system-ui, sans-serif", size: 13, color: "#17202a" },
  legend: { orientation: "h", y: 1.02, yanchor: "bottom", x: 0 } };
const axis = (title, more = {}) => ({ title: { text: title }, gridcolor: "#e9edf0", zerolinecolor: "#c3ccd4", automargin: true, ...more });

const VERDICTS = {
  explained: "The simulation is wrong on these drives, and the cause is known.",
  nothing_to_explain: "The drives fit the truck file within tolerances and noise: there is nothing to explain.",
  unknown: "The simulation is wrong on these drives, and no cause of the catalogue explains it.",
  ambiguous: "The simulation is wrong on these drives; they leave more than one cause.",
};

function heading() {
  document.title = `Diagnosis of ${D.truck}`;
  byId("title").textContent = `Diagnosis of the truck “${D.truck}” on ${DATA.drives}`;
  byId("verdict").textContent = VERDICTS[D.verdict] ?? D.verdict;
  const tiles = byId("tiles");
  const tile = (value, what) => {
    const t = node("div", undefined, "tile");
    t.append(node("b", value), node("span", what));
    tiles.append(t);
    return t;
  };
  tile(words(D.verdict), "verdict");
  if (D.causes.length) tile(D.causes.map((c) => words(c.id)).join(" + "), D.causes.length > 1 ? "causes, by evidence" : "cause");
  for (const g of R.gains.filter((g) => g.lost)) {
    tile(`+${percent(-g.fall_frac)}`, `WORSE: error of ${label(g.quantity)} on held-out drives, ${fixed(g.before)} to ${fixed(g.after)}, because of ${g.blamed.map(words).join(" and ")}`).classList.add("loss");
  }
  const best = R.gains.filter((g) => g.claimed).sort((a, b) => b.fall_frac - a.fall_frac)[0];
  if (best) tile(`−${percent(best.fall_frac)}`, `error of ${label(best.quantity)} on held-out drives (90 %: ${percent(best.fall_frac_interval[0])} to ${percent(best.fall_frac_interval[1])})`);
  else if (D.gain) tile("none claimed", "gain on held-out drives");
  const speed = D.wrong.find((w) => w.quantity === "speed_m_s");
  if (speed) tile(`${fixed(speed.rmse, 2)} m/s`, `speed error after ${speed.horizon_s} s of free run` + (speed.noise_floor ? `; drives in order: ${fixed(speed.noise_floor, 2)} m/s` : ""));
}

function why() {
  const where = byId("causes");
  for (const c of D.causes) {
    const box = node("div", undefined, "cause");
    box.append(node("b", c.sentence));
    for (const e of R.effects.filter((e) => e.id === c.id)) box.append(node("em", `On these drives: ${e.sentence.charAt(0).toLowerCase()}${e.sentence.slice(1)}`));
    box.append(node("em", DATA.advice[c.id]));
    if (c.confused_with.length) {
      box.append(node("em", `These drives leave alternatives (probability of this one ${percent(c.probability)}):`));
      const list = node("ul");
      for (const o of c.confused_with) list.append(node("li", `${words(o.id)}, ${percent(o.probability)}. To decide: ${o.why}`));
      box.append(list);
    }
    const sizes = Object.entries(c.parameters).map(([k, p]) => `${words(k)} ${fixed(p.value, 4)} ± ${fixed(p.sigma, 2)}${p.unit === "1" ? "" : " " + p.unit}`);
    box.append(node("small", `${words(c.id)} (${words(c.kind)}): ${sizes.join("; ")}; probability ${percent(c.probability)}, evidence ${fixed(c.evidence, 3)} nats`));
    where.append(box);
  }
  if (D.unknown) {
    const box = node("div", undefined, "cause unknown");
    box.append(node("b", `Outside the catalogue: ${D.unknown.shape}.`));
    box.append(node("em", `It follows ${D.unknown.signals.map(label).join(", ")}. Look for something on the truck that acts with this signal and is not in the truck file.`));
    box.append(node("small", `A free function of ${label(D.unknown.signals[0] ?? "")} explains ${percent(D.unknown.explained_frac)} of what is left over the noise.`));
    where.append(box);
    found();
  }
  if (!D.causes.length && !D.unknown) where.append(node("p", "No cause adds evidence beyond the tolerances of trucks, loads, weather and instruments."));
  const rungs = D.causes.map((c) => ({ name: words(c.id), nats: c.evidence, color: AFTER }));
  if (D.unknown?.evidence) rungs.push({ name: `free function of ${split(D.unknown.signals[0] ?? "")[0]}`, nats: D.unknown.evidence, color: "#8a5fbf" });
  if (!rungs.length) { clear("ladder"); return; }
  byId("nats").textContent = "Evidence is the logarithm of how much more probable the measured data are with a cause than without it, in nats (natural logarithm): 3 nats are 20 to 1, 10 nats 22,000 to 1. It pays for the freedom of another size.";
  rungs.reverse();
  byId("ladder").style.height = `${110 + 34 * rungs.length}px`;
  Plotly.newPlot("ladder", [{ type: "bar", orientation: "h", x: rungs.map((r) => Math.max(r.nats, 1)), y: rungs.map((r) => r.name), marker: { color: rungs.map((r) => r.color) },
    text: rungs.map((r) => ` ${fixed(r.nats, 3)} `), textposition: "auto", hoverinfo: "none" }],
  { ...base, showlegend: false, title: { text: "Evidence that is lost without it", font: { size: 13 }, x: 0, xref: "container", xanchor: "left" },
    xaxis: axis("log evidence, nats (a cause needs 10)", { type: "log" }), yaxis: axis("", { showgrid: false }),
    shapes: [{ type: "line", x0: 10, x1: 10, y0: 0, y1: 1, yref: "paper", line: { color: FLOOR, dash: "dot" } }] }, plain);
}

/** The function that was found, at its knots. */
function found() {
  const { table: knots, signals, quantity, is_factor: factor, memory_s: memory } = D.unknown;
  if (!knots.length) return;
  const div = node("div", undefined, "plot");
  byId("causes").append(div);
  Plotly.newPlot(div, [{ type: "scatter", mode: "lines+markers", x: knots.map((k) => k[0]), y: knots.map((k) => factor ? 100 * k[1] : k[1]), line: { color: "#8a5fbf" } }],
    { ...base, showlegend: false, xaxis: axis(memory ? `${label(signals[0])}, over the last ${fixed(memory / 60, 2)} min` : label(signals[0])), yaxis: axis(factor ? "error of what it scales, %" : `error in the balance of ${split(quantity)[0]}`) }, plain);
}

function overlay() {
  byId("shown").textContent = "The speed runs free for 60 s from every new start, driven by measured torque, gear and brake pressure; the others are two minutes where the models differ most.";
  for (const drive of R.shown) {
    const role = { held_out: "not seen by the search", learned: "seen by the search: no drive was held out", baseline: "baseline" }[drive.role];
    byId("traces").append(node("h3", `${drive.name} (${role}): ${drive.why}`));
    overlays(drive.traces);
  }
}

function overlays(traces) {
  const same = (t) => JSON.stringify(t.before) === JSON.stringify(t.after);
  const changed = traces.filter((t) => !same(t));
  for (const t of changed.length ? changed : traces.slice(0, 1)) {
    const div = node("div", undefined, "plot trace");
    byId("traces").append(div);
    const [name, unit] = split(t.quantity);
    const line = (what, y, color, width) => ({ type: "scattergl", mode: "lines", name: what, legendgroup: what, x: t.time_s, y, line: { color, width } });
    const models = [[`truck file: rms error ${fixed(t.rms[0], 2)} ${unit}`, t.before, BEFORE]];
    if (changed.length) models.push([`extended truck: ${fixed(t.rms[1], 2)} ${unit}`, t.after, AFTER]);
    const off = (y) => y.map((v, i) => v === null ? null : v - t.measured[i]);
    const values = models.map(([what, y, color]) => line(what, y, color, 1.6));
    const errors = models.map(([what, y, color]) => ({ ...line(what, off(y), color, 1.4), yaxis: "y2", showlegend: false }));
    Plotly.newPlot(div, [line("measured", t.measured, MEASURED, 2.4), ...values, ...errors], { ...base, hovermode: "x unified", title: { text: t.title, font: { size: 14 }, x: 0, xref: "container", xanchor: "left", y: 0.98 },
      margin: { ...base.margin, t: 56 }, xaxis: axis("time, s", { anchor: "y2" }), yaxis: axis(unit ? `${name}, ${unit}` : name, { domain: [0.42, 1] }), yaxis2: axis(`error, ${unit}`, { domain: [0, 0.34] }) }, plain);
  }
}

function gain() {
  if (!D.gain || !R.gains.length) {
    byId("gain-text").textContent = D.causes.length ? "No drive was held out, so no gain is measured." : "Nothing was added to the truck, so there is no gain to measure.";
    clear("gain-plot");
    return;
  }
  const claimed = R.gains.filter((g) => g.claimed), lost = R.gains.filter((g) => g.lost);
  const names = D.gain.held_out.join(", ");
  byId("gain-text").textContent = claimed.length
    ? `On ${names} the extended truck is significantly better in ${claimed.map((g) => g.title.toLowerCase()).join("; ")}. Intervals are 90 %, from a bootstrap over windows of 60 s.`
    : `On ${names} no error falls significantly, so no gain is claimed. Intervals are 90 %, from a bootstrap over windows of 60 s.`;
  if (lost.length) byId("gain-text").prepend(node("strong", `Worse on ${names}: ${lost.map((g) => `${g.title.toLowerCase()} (${fixed(g.before)} to ${fixed(g.after)} ${split(g.quantity)[1]})`).join("; ")}. `, "loss"));
  const shown = R.gains.filter((g) => Math.abs(g.fall_frac) > 1e-6).sort((a, b) => a.fall_frac - b.fall_frac);
  if (shown.length) {
    byId("gain-plot").style.height = `${110 + 30 * shown.length}px`;
    Plotly.newPlot("gain-plot", [{ type: "scatter", mode: "markers", x: shown.map((g) => 100 * g.fall_frac), y: shown.map((g) => g.title), marker: { size: 11, color: shown.map((g) => g.lost ? LOSS : g.claimed ? "#2f8f5b" : FLOOR) },
      error_x: { type: "data", symmetric: false, array: shown.map((g) => 100 * (g.fall_frac_interval[1] - g.fall_frac)), arrayminus: shown.map((g) => 100 * (g.fall_frac - g.fall_frac_interval[0])), color: "#51606f" },
      hovertemplate: "%{y}: %{x:.1f} %<extra></extra>" }],
    { ...base, showlegend: false, xaxis: axis("fall of the rms error, % (green: claimed, red: worse)", { zeroline: true, zerolinewidth: 2 }), yaxis: axis("", { showgrid: false }) }, plain);
  } else clear("gain-plot");
  table("gain-table", [{ name: "Error" }, { name: "Before", number: true }, { name: "After", number: true }, { name: "Unit" }, { name: "Fall (90 %)", number: true }, { name: "Claimed" }],
    R.gains.map((g) => [g.horizon_s ? `${g.title}, ${g.horizon_s} s` : g.title, fixed(g.before), fixed(g.after), split(g.quantity)[1],
      `${percent(g.fall_frac)} (${percent(g.fall_frac_interval[0])} to ${percent(g.fall_frac_interval[1])})`, g.claimed ? node("span", "yes", "yes") : g.lost ? node("span", "worse", "loss") : "no"]));
}

function loop() {
  const e = DATA.example;
  if (!e) { clear("loop"); return; }
  const size = e.hidden.unit === "1" ? `${e.hidden.size > 0 ? "+" : ""}${(100 * e.hidden.size).toFixed(1)} %` : `${fixed(e.hidden.size)} ${e.hidden.unit}`;
  byId("loop-text").textContent = `Hidden in the measured truck was ${words(e.hidden.id)}, ${size}: ${e.hidden.meaning}. ${e.sentence}.`;
  const trips = [["true truck", e.loop.true_truck, MEASURED, 2.6], ["truck file", e.loop.truck_file, BEFORE, 1.6], ["extended truck", e.loop.extended_truck, AFTER, 1.6]];
  Plotly.newPlot("loop-plot", trips.map(([name, t, color, width]) => ({ type: "scattergl", mode: "lines", name: `${name}: ${fixed(t.fuel_g / 1000, 4)} kg fuel, ${t.trip_time_s.toFixed(0)} s`,
    x: t.s_m.map((s) => s / 1000), y: t.speed_m_s.map((v) => 3.6 * v), line: { color, width } })),
  { ...base, margin: { ...base.margin, t: 40 }, hovermode: "x unified", xaxis: axis("distance, km"), yaxis: axis("speed, km/h") }, plain);
}

function wrong() {
  if (!D.wrong.length) { byId("wrong-table").append(node("p", "Nothing beyond the noise.")); return; }
  table("wrong-table", [{ name: "Quantity" }, { name: "Free run", number: true }, { name: "rms error", number: true }, { name: "Bias", number: true }, { name: "Drives in order", number: true }, { name: "Accuracy", number: true }, { name: "Where" }],
    D.wrong.map((w) => [label(w.quantity), w.horizon_s ? `${w.horizon_s} s` : "one step", fixed(w.rmse), fixed(w.bias, 2), w.noise_floor ? fixed(w.noise_floor) : "–", w.accuracy_frac > -1 ? percent(w.accuracy_frac, 1) : "–", w.where]));
}

function maps() {
  const select = byId("quantity"), all = [...new Map(R.maps.map((m) => [m.quantity, m.title])).entries()];
  if (!all.length) { clear("maps"); return; }
  for (const [quantity, title] of all) {
    const option = node("option", `${title} (${label(quantity)})`);
    option.value = quantity;
    select.append(option);
  }
  const draw = () => {
    const chosen = R.maps.filter((m) => m.quantity === select.value), unit = split(select.value)[1];
    const traces = [], layout = { ...base, grid: { rows: Math.ceil(chosen.length / 4), columns: 4, pattern: "independent", ygap: 0.34, xgap: 0.16 }, hovermode: "x" };
    chosen.forEach((m, i) => {
      const n = i ? i + 1 : "", x = m.bins.map((b) => b.at), first = i === 0;
      const line = (name, pick, color, dash) => ({ type: "scatter", mode: "lines+markers", name, legendgroup: name, showlegend: first, x, y: m.bins.map(pick), xaxis: `x${n}`, yaxis: `y${n}`, line: { color, dash, width: 1.8 }, marker: { size: 4 } });
      traces.push(line("truck file", (b) => b.rms[0], BEFORE), line("extended truck", (b) => b.rms[1], AFTER));
      traces.push({ ...line("noise floor", () => m.noise_floor, FLOOR, "dot"), mode: "lines" });
      layout[`xaxis${n}`] = axis(m.axis);
      layout[`yaxis${n}`] = axis(i % 4 ? "" : `rms, ${unit}`, { rangemode: "tozero" });
    });
    Plotly.react("map-plot", traces, layout, plain);
  };
  select.onchange = draw;
  draw();
}

const ROLES = { learned: "search", held_out: "held out", baseline: "baseline" };

/** Every drive with its part, and the sizes that it alone would choose. */
function drives() {
  const sizes = D.causes.flatMap((c) => Object.keys(c.parameters).filter((k) => D.drives.some((d) => d.alone.some((a) => a.id === c.id && a.parameter === k))).map((k) => [c.id, k]));
  const cell = (d, [id, k]) => {
    const a = d.alone.find((a) => a.id === id && a.parameter === k);
    return a ? `${fixed(a.value)} ± ${fixed(a.sigma, 2)}` : "–";
  };
  table("drives-table", [{ name: "Drive" }, { name: "Used for" }, { name: "Minutes", number: true }, { name: "km", number: true }, { name: "Mass, t", number: true }, { name: "Air, °C", number: true },
    { name: "Speed error, m/s", number: true }, { name: "with causes", number: true }, ...sizes.map(([id, k]) => ({ name: `${words(id)} (${words(k)})`, number: true }))],
  D.drives.map((d) => [d.name, ROLES[d.role], (d.duration_s / 60).toFixed(1), (d.distance_m / 1000).toFixed(1), (d.mass_kg / 1000).toFixed(1), fixed(d.air_mean_degc, 2), fixed(d.speed_rmse_before_m_s), fixed(d.speed_rmse_after_m_s), ...sizes.map((s) => cell(d, s))]));
  if (sizes.length) byId("drives-table").append(node("p", "A size is what this drive alone would choose, the other sizes as found; ± is one standard deviation."));
}

function rest() {
  const confused = D.causes.flatMap((c) => c.confused_with.map((o) => [words(c.id), words(o.id), percent(o.probability), o.why]));
  if (confused.length) table("confused-table", [{ name: "Named" }, { name: "Could be" }, { name: "Probability", number: true }, { name: "Why, and what separates them" }], confused);
  else byId("confused-table").append(node("p", D.causes.length ? "No other cause comes within five nats of those named." : "No cause was named."));
  const unseen = D.not_observable.map((n) => [words(n.id), n.why]);
  if (unseen.length) table("unseen-table", [{ name: "Cause" }, { name: "Why" }], unseen);
  else byId("unseen-table").append(node("p", "These drives excite every cause of the catalogue."));
  if (D.detectable.length) {
    byId("unseen-table").append(node("p", "Silence about a cause means that it is smaller than this:"));
    table("unseen-table", [{ name: "Cause" }, { name: "Size" }, { name: "Smallest that shows", number: true }, { name: "Unit" }],
      D.detectable.map((d) => [words(d.id), words(d.parameter), fixed(d.smallest, 2), d.unit === "1" ? "" : d.unit]));
  }
  drives();
  const shown = new Set(["drive", "channel", "time_s", "kind", "action"]);
  const found = D.findings.map((f) => [f.drive, f.channel ?? "", f.time_s === null ? "" : fixed(f.time_s, 5), words(f.kind),
    Object.entries(f).filter(([k]) => !shown.has(k)).map(([k, v]) => `${words(k)} ${v}`).join(", "), words(f.action)]);
  if (found.length) table("data-table", [{ name: "Drive" }, { name: "Channel" }, { name: "Time, s", number: true }, { name: "Defect" }, { name: "Figures" }, { name: "Done" }], found);
  else byId("data-table").append(node("p", "None: no gap, stuck sensor, wrong unit or implausible value."));
  if (DATA.overlay) {
    byId("extended-text").textContent = `${D.extended_truck} runs in the simulator, the planner and the server like any truck file: sim-server run --truck ${D.extended_truck}`;
    byId("toml").textContent = DATA.overlay;
  } else clear("extended");
  for (const n of D.not_carried) byId("extended")?.append(node("p", `Not in it: ${words(n.id)} (${n.why}).`));
  byId("footer").textContent = `Tractrix ${D.version}, revision ${D.git_revision.slice(0, 12)}, seed ${D.seed}. Tolerances ${D.tolerances_from_baseline ? "learned from baseline drives" : "are defaults: no baseline was given"}. ${D.side_force?.sentence ?? ""}`;
}

heading(); why(); overlay(); gain(); loop(); wrong(); maps(); rest();
