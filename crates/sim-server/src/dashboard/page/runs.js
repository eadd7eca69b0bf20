// Sessions, runs and jobs of the server.
import { ask, make, post, say } from "/assets/common.js";
import { startTheme } from "/assets/theme.js";
import { KMH, signed } from "/assets/words.js";

const $ = (id) => document.getElementById(id);
const LOOK_MS = 2000;
const marked = new Set();
let found = [];

const cell = (...content) => make("td", {}, ...content);
const number = (value, digits) => make("td", { class: "number" }, Number.isFinite(value) ? value.toFixed(digits) : "–");
const actions = (...all) => make("td", { class: "actions" }, ...all);
const button = (label, onclick, more = {}) => make("button", { type: "button", onclick, ...more }, label);
const of = (kind, name) => `/api/v1/${kind}/${encodeURIComponent(name)}`;

async function sure(words) {
  $("sure-text").textContent = words;
  $("sure").showModal();
  return new Promise((resolve) => { $("sure").onclose = () => resolve($("sure").returnValue === "yes"); });
}

async function remove(kind, name, words) {
  if (!await sure(words)) return;
  if (await ask(of(kind, name), { method: "DELETE" })) { marked.delete(name); refresh(); }
}

function session(s) {
  const end = s.id === "default" ? "End it, and the program" : "End it";
  return make("tr", {},
    cell(make("a", { href: `/?session=${encodeURIComponent(s.id)}` }, s.id)), cell(s.scenario), cell(String(s.seed)),
    cell(s.state), cell(s.run ?? "–"),
    actions(button(end, () => remove("sessions", s.id, `End session ${s.id}? Its run is kept.`))));
}

function mark(name, on) {
  if (on) marked.add(name); else marked.delete(name);
  const [a, b] = marked;
  const link = $("compare"), ready = marked.size === 2;
  link.setAttribute("aria-disabled", String(!ready));
  if (ready) link.href = `/compare?a=${encodeURIComponent(a)}&b=${encodeURIComponent(b)}`; else link.removeAttribute("href");
}

async function diagnose(name) {
  const truck = found.find((r) => r.name === name)?.truck ?? "longhaul";
  if (await post("/api/v1/diagnose", { truck, run: name })) refresh();
}

function run(r) {
  const s = r.summary ?? {}, over = !r.recording;
  const check = make("input", { type: "checkbox", "aria-label": `Mark ${r.name}`, onchange: (e) => mark(r.name, e.target.checked) });
  check.checked = marked.has(r.name);
  const all = over
    ? [make("a", { href: `/?run=${encodeURIComponent(r.name)}` }, "Play"), make("a", { href: `${of("runs", r.name)}/report`, target: "_blank", rel: "noopener" }, "Report")]
    : [];
  all.push(make("a", { href: `${of("runs", r.name)}/recording`, download: `${r.name}.mcap` }, over ? "Download" : "Download what is finished"));
  if (over) all.push(button("Diagnose", () => diagnose(r.name), { title: "What the simulation gets wrong on this run, with the truck longhaul: a job" }), button("Delete", () => remove("runs", r.name, `Delete run ${r.name}, its recording and its summary? They cannot be brought back.`), { class: "bad" }));
  return make("tr", {},
    cell(check), cell(r.name), cell(s.scenario ?? "–"), cell(s.seed === undefined ? "–" : String(s.seed)),
    number(s.distance_m / 1000, 2), number(s.mean_speed_m_s * KMH, 1), number(s.fuel_g / 1000, 2),
    make("td", { class: "number" }, Number.isFinite(s.saving_frac) ? signed(s.saving_frac * 100, 1) : "–"),
    number(s.collisions, 0), cell(r.recording ? "being recorded" : s.end_reason?.replaceAll("_", " ") ?? "broke off"),
    cell(new Date(r.written_unix_s * 1000).toLocaleString()), number(r.recording_bytes / 1e6, 1), actions(...all));
}

function job(j) {
  const asked = Object.entries(j.asked).map(([key, value]) => `${key} ${value}`).join(", ");
  const status = j.status === "running" ? `running ${j.said ?? ""}` : j.status === "failed" ? `failed: ${j.why}` : j.status.replaceAll("_", " ");
  const files = j.files.flatMap((file) => [make("a", { href: `${of("jobs", j.id)}/files/${encodeURIComponent(file)}`, target: "_blank", rel: "noopener" }, file), " "]);
  return make("tr", {}, cell(`${j.kind} ${j.id}`), cell(asked), cell(status), cell(...files),
    actions(button(j.status === "running" || j.status === "queued" ? "Cancel" : "Remove", () => remove("jobs", j.id, `Remove job ${j.id} and its files?`))));
}

// Rows are put in place of the old ones only where something has changed: a focus stays.
const shown = new Map();
function fill(id, items, row) {
  const text = JSON.stringify(items);
  if (shown.get(id) === text) return;
  shown.set(id, text);
  $(id).replaceChildren(...items.map(row));
}

function showRuns() {
  const words = $("find").value.trim().toLowerCase();
  const fits = (r) => `${r.name} ${r.summary?.scenario ?? ""}`.toLowerCase().includes(words);
  fill("runs", found.filter(fits), run);
}

async function refresh() {
  if (document.hidden) return;
  const [sessions, runs, jobs] = await Promise.all(["sessions", "runs", "jobs"].map((kind) => ask(`/api/v1/${kind}`)));
  if (!sessions || !runs || !jobs) return;
  fill("sessions", sessions.sessions, session);
  $("no-sessions").hidden = sessions.sessions.length > 0;
  found = runs.runs;
  showRuns();
  $("no-runs").hidden = found.length > 0;
  $("jobs-panel").hidden = jobs.jobs.length === 0;
  fill("jobs", jobs.jobs, job);
}

$("find").oninput = showRuns;
startTheme();
say("");
refresh();
setInterval(refresh, LOOK_MS);
