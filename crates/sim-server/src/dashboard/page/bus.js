// The bus between stack and truck: messages, addresses, what is not in order.
import { ask, make, session } from "/assets/common.js";
import { nextTheme, onTheme, theme } from "/assets/theme.js";

const $ = (id) => document.getElementById(id);
const PERIOD_MS = 500;
// A message this many of its periods old is late
const LATE = 5;

$("theme").onclick = nextTheme;
onTheme(() => { $("theme").textContent = `Theme: ${theme()}`; });
addEventListener("keydown", (e) => {
  if (e.key === "t" && !(e.target instanceof HTMLInputElement) && !e.ctrlKey && !e.metaKey && !e.altKey) nextTheme();
});

const hex = (address) => address === null ? "all" : address.toString(16).toUpperCase().padStart(2, "0");
const shown = ({ value, unit, state }) => value === null ? state.replaceAll("_", " ")
  : `${typeof value === "number" ? Number(value.toPrecision(5)) : value}${unit ? ` ${unit}` : ""}`;
const percent = (frac) => `${(frac * 100).toFixed(1)} %`;

let latest = null;

function row(m) {
  const wanted = $("find").value.trim().toLowerCase();
  const all = [m.name ?? "", m.id, String(m.pgn), hex(m.source), ...m.signals.map((s) => s.name)];
  if (wanted !== "" && !all.some((text) => text.toLowerCase().includes(wanted))) return [];
  const isLate = m.rate_hz !== null && m.age_s * m.rate_hz > LATE;
  const signals = m.wrong ? m.wrong : make("details", {},
    make("summary", {}, `${m.signals.length}`),
    make("dl", { class: "signals" }, ...m.signals.map((s) => make("div", {}, make("dt", {}, s.name), make("dd", {}, shown(s))))));
  const cells = [
    make("th", { scope: "row" }, `${m.name ?? "unknown"}${m.sent_by_the_stack ? " ↑" : ""}`),
    make("td", { class: "number" }, String(m.pgn)),
    make("td", {}, hex(m.source)),
    make("td", {}, hex(m.destination)),
    make("td", { class: "number" }, m.rate_hz === null ? "–" : m.rate_hz.toFixed(1)),
    make("td", { class: isLate ? "number late" : "number" }, m.age_s.toFixed(2)),
    make("td", { class: "number" }, String(m.count)),
    make("td", {}, make("code", {}, m.bytes.match(/.{1,16}/g)?.join(" ") ?? "")),
    make("td", {}, m.signals.length > 0 || m.wrong ? signals : "–"),
  ];
  return [make("tr", { "data-key": `${m.sent_by_the_stack}${m.id}` }, ...cells)];
}

function show(bus) {
  const direct = bus.vehicle === "direct";
  $("direct").hidden = !direct;
  for (const id of ["messages-panel", "claims-panel", "figures"]) $(id).hidden = direct;
  $("vehicle").textContent = direct ? "" : bus.vehicle;
  const f = bus.figures;
  $("figures").textContent = f === null ? "" : `Load ${percent(f.mean_load_frac)} on average, ${percent(f.peak_load_frac)} at most; `
    + `${f.refused} demands refused, ${f.unsent} frames without room, ${bus.errors} errors.`;
  $("faults").textContent = bus.faults.length === 0 ? (direct ? "" : "All in order.")
    : bus.faults.map(({ fault, since_s }) => `${fault.replaceAll("_", " ")} since ${since_s.toFixed(1)} s`).join(" · ");
  $("faults").hidden = $("faults").textContent === "";
  $("faults").dataset.same = bus.faults.length > 0 ? "no" : "yes";
  const open = new Set([...document.querySelectorAll("#messages tr:has(details[open])")].map((tr) => tr.dataset.key));
  $("messages").replaceChildren(...bus.messages.flatMap(row));
  for (const tr of $("messages").children) if (open.has(tr.dataset.key)) tr.querySelector("details")?.setAttribute("open", "");
  $("left-out").textContent = bus.left_out > 0 ? `${bus.left_out} messages found no place here.` : "";
  $("claims").replaceChildren(...bus.claims.map((c) => make("tr", {},
    make("th", { scope: "row" }, hex(c.address)), make("td", {}, make("code", {}, c.name)),
    make("td", { class: "number" }, String(c.function)), make("td", { class: "number" }, String(c.manufacturer)),
    make("td", { class: "number" }, String(c.identity)), make("td", {}, c.can_choose ? "yes" : "no"))));
}

// The session that is shown: the one that the address names, or one of those that there are.
async function begin() {
  const sessions = (await ask("/api/v1/sessions"))?.sessions ?? [];
  const one = sessions.find((s) => s.id === session) ?? sessions[0];
  $("no-session").hidden = one !== undefined;
  for (const id of ["messages-panel", "claims-panel"]) $(id).hidden = one === undefined;
  if (one === undefined) return;
  $("others").hidden = sessions.length < 2;
  $("others").replaceChildren(...sessions.length < 2 ? [] : sessions.flatMap((s) =>
    [make("a", { href: `/bus?session=${encodeURIComponent(s.id)}`, "aria-current": s === one ? "page" : null }, s.id), " "]));
  look(`/api/v1/sessions/${encodeURIComponent(one.id)}/bus`);
}

async function look(path) {
  if (!$("hold").checked && !document.hidden) {
    const bus = await ask(path);
    if (bus === null) return;
    show(latest = bus);
  }
  setTimeout(look, PERIOD_MS, path);
}

$("find").oninput = () => { if (latest !== null) show(latest); };
begin();
