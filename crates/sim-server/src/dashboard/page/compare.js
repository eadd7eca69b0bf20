// Two runs beside each other, and their difference.
import { ask, make, plotly } from "/assets/common.js";
import { onTheme, palette, startTheme } from "/assets/theme.js";
import { KMH, signed } from "/assets/words.js";

const $ = (id) => document.getElementById(id);
const STEP_M = 20;
const QUANTITIES = [
  { key: "speed_m_s", title: "km/h", factor: KMH },
  { key: "engine_power_w", title: "kW", factor: 1e-3 },
  { key: "fuel_used_g", title: "fuel, kg", factor: 1e-3 },
  { key: "lateral_error_m", title: "lane error, cm", factor: 100 },
];
const FIGURES = [
  ["distance_m", "Distance, km", 1e-3, 3], ["duration_s", "Duration, s", 1, 1], ["mean_speed_m_s", "Mean speed, km/h", KMH, 2],
  ["fuel_g", "Fuel, kg", 1e-3, 3], ["brake_energy_j", "Brake energy, MJ", 1e-6, 3], ["saving_frac", "Saved against cruise control, %", 100, 2],
  ["lane_changes", "Lane changes", 1, 0], ["collisions", "Collisions", 1, 0], ["guard_activations", "Ticks under the guard", 1, 0],
  ["max_lateral_error_m", "Lateral error at most, m", 1, 3],
];
let drawn = null;

// The value of a column at stations, between its rows; none outside them.
function at(strip, key, stations) {
  const s = strip.s_m, y = strip[key];
  let i = 0;
  return stations.map((m) => {
    while (i + 1 < s.length && s[i + 1] < m) i += 1;
    if (s.length < 2 || m < s[0] || m > s[s.length - 1]) return null;
    const share = s[i + 1] > s[i] ? (m - s[i]) / (s[i + 1] - s[i]) : 0;
    return y[i] + share * (y[i + 1] - y[i]);
  });
}

const minus = (b, a) => b.map((v, i) => v === null || a[i] === null ? null : v - a[i]);
const mean = (values) => {
  const known = values.filter((v) => v !== null);
  return known.length === 0 ? null : known.reduce((sum, v) => sum + v, 0) / known.length;
};

function figures(a, b) {
  const shown = (v, factor, digits) => Number.isFinite(v) ? (v * factor).toFixed(digits).replace("-", "−") : "–";
  const rows = FIGURES.map(([key, title, factor, digits]) => {
    const [x, y] = [a?.[key], b?.[key]];
    const both = Number.isFinite(x) && Number.isFinite(y);
    const numbers = [shown(x, factor, digits), shown(y, factor, digits), both ? signed((y - x) * factor, digits) : "–"];
    return make("tr", {}, make("th", { scope: "row" }, title), ...numbers.map((text) => make("td", { class: "number" }, text)));
  });
  const word = (key, title) => make("tr", {}, make("th", { scope: "row" }, title), ...[a, b].map((s) => make("td", { class: "number" }, String(s?.[key] ?? "–"))), make("td", { class: "number" }, a?.[key] === b?.[key] ? "same" : "differs"));
  $("figures").replaceChildren(word("scenario", "Scenario"), word("seed", "Seed"), word("git_revision", "Revision"), word("state_hash", "State hash"), ...rows);
}

function verdict(c) {
  const same = c.ticks_different === 0 && c.more_ticks.a === 0 && c.more_ticks.b === 0;
  $("same").dataset.same = same ? "yes" : "no";
  const first = c.first_difference;
  const longer = c.more_ticks.a > 0 ? `A goes on for ${c.more_ticks.a} ticks. ` : c.more_ticks.b > 0 ? `B goes on for ${c.more_ticks.b} ticks. ` : "";
  const others = c.other_scene_s === null ? "" : ` The other vehicles are others from ${c.other_scene_s.toFixed(2)} s on.`;
  $("same").textContent = (first
    ? `First difference at tick ${first.tick}, ${first.time_s.toFixed(2)} s: ${first.field} is ${first.recorded} in A and ${first.replayed} in B; ${c.ticks_different} of ${c.ticks} ticks differ. ${longer}`
    : `The same bit for bit in all ${c.ticks} ticks. ${longer}`) + others;
}

function segments(stations, differences) {
  const rows = [];
  const last = stations[stations.length - 1] ?? 0;
  for (let km = Math.floor((stations[0] ?? 0) / 1000); km * 1000 <= last; km++) {
    const inside = stations.map((m, i) => [m, i]).filter(([m]) => m >= km * 1000 && m < (km + 1) * 1000).map(([, i]) => i);
    if (inside.length === 0) continue;
    const means = differences.map((d) => mean(inside.map((i) => d[i])));
    const [speed, power, , lane] = means.map((v, q) => v === null ? "–" : signed(v * QUANTITIES[q].factor, 2));
    const fuel = [inside[0], inside[inside.length - 1]].map((i) => differences[2][i]);
    const burnt = fuel.includes(null) ? "–" : signed(fuel[1] - fuel[0], 1);
    rows.push(make("tr", {}, make("th", { scope: "row" }, `${km} to ${km + 1}`), ...[speed, power, burnt, lane].map((text) => make("td", { class: "number" }, text))));
  }
  $("segments").replaceChildren(...rows);
}

async function draw() {
  if (!drawn) return;
  const { stations, a, b, names } = drawn;
  const k = palette(["panel", "text", "dim", "line", "grid", "speed", "limit", "plan"]);
  const x = stations.map((m) => m / 1000);
  const traces = [], layout = {
    paper_bgcolor: k.panel, plot_bgcolor: k.panel, font: { color: k.dim, size: 11 }, margin: { l: 62, r: 14, t: 8, b: 38 },
    hovermode: "x unified", hoverlabel: { bgcolor: k.panel, bordercolor: k.line, font: { color: k.text } },
    legend: { orientation: "h", y: 1.03, font: { color: k.text } }, uirevision: "same",
    xaxis: { title: { text: "distance, km", standoff: 6 }, gridcolor: k.grid, zeroline: false, anchor: "free", position: 0 },
  };
  const unit = 1 / QUANTITIES.length;
  QUANTITIES.forEach(({ title, factor }, i) => {
    const scaled = (values) => values.map((v) => v === null ? null : v * factor);
    const axes = [`y${2 * i + 1}`, `y${2 * i + 2}`].map((axis) => axis === "y1" ? "y" : axis);
    const line = (name, y, axis, color, dash, legend) => ({ type: "scatter", mode: "lines", x, y, name, yaxis: axis, showlegend: legend && i === 0, line: { color, width: 1.7, dash }, hovertemplate: "%{y:.2f}" });
    traces.push(line(`A ${names[0]}`, scaled(a[i]), axes[0], k.speed, "solid", true), line(`B ${names[1]}`, scaled(b[i]), axes[0], k.limit, "dash", true), line("B − A", scaled(minus(b[i], a[i])), axes[1], k.plan, "solid", true));
    const top = 1 - i * unit;
    const axis = (domain, text) => ({ domain, title: { text, font: { size: 10.5 } }, gridcolor: k.grid, zerolinecolor: k.line, nticks: 5 });
    layout[axes[0].replace("y", "yaxis")] = axis([top - unit * 0.58, top - 0.012], title);
    layout[axes[1].replace("y", "yaxis")] = axis([top - unit + 0.012, top - unit * 0.62], `B − A`);
  });
  (await plotly()).react($("plots"), traces, layout, { displayModeBar: false, responsive: true });
}

async function compare(names) {
  const path = (name) => `/api/v1/runs/${encodeURIComponent(name)}`;
  const [runs, strips, compared] = await Promise.all([
    Promise.all(names.map((name) => ask(path(name)))),
    Promise.all(names.map((name) => ask(`${path(name)}/strip`))),
    ask(`/api/v1/compare?a=${encodeURIComponent(names[0])}&b=${encodeURIComponent(names[1])}`),
  ]);
  if (runs.includes(null) || strips.includes(null) || compared === null) return;
  history.replaceState(null, "", `/compare?a=${encodeURIComponent(names[0])}&b=${encodeURIComponent(names[1])}`);
  verdict(compared);
  figures(runs[0].summary, runs[1].summary);
  const ends = strips.flatMap((s) => [s.s_m[0], s.s_m[s.s_m.length - 1]]);
  const first = Math.min(...ends), last = Math.max(...ends);
  const stations = Array.from({ length: Math.floor((last - first) / STEP_M) + 1 }, (_, i) => first + i * STEP_M);
  const [a, b] = strips.map((strip) => QUANTITIES.map(({ key }) => at(strip, key, stations)));
  segments(stations, a.map((values, i) => minus(b[i], values)));
  drawn = { stations, a, b, names };
  draw();
}

startTheme();
onTheme(draw);
const query = new URLSearchParams(location.search);
const all = (await ask("/api/v1/runs"))?.runs.filter((run) => !run.recording) ?? [];
for (const [id, fallback] of [["a", all[0]], ["b", all[1] ?? all[0]]]) {
  $(id).replaceChildren(...all.map((run) => make("option", {}, run.name)));
  const wanted = query.get(id) ?? fallback?.name;
  if (wanted !== undefined) $(id).value = wanted;
}
$("pair").onsubmit = (e) => { e.preventDefault(); compare([$("a").value, $("b").value]); };
if (query.has("a") && query.has("b")) compare([query.get("a"), query.get("b")]);
