// A scenario with changes: seen as its text, shared by its address, started as a session.
import { ask, make, say } from "/assets/common.js";
import { startTheme } from "/assets/theme.js";

const $ = (id) => document.getElementById(id);
const CHOICES = ["road", "truck", "traffic", "mode", "decider", "speed_planner"];
const NUMBERS = ["payload_kg", "duration_s"];
const FIELDS = ["scenario", ...CHOICES, ...NUMBERS, "seed", "pace", "begin"];
let builtin = "";

async function choose(name) {
  const scenario = await ask(`/api/v1/scenarios/${encodeURIComponent(name)}`);
  if (!scenario) return;
  builtin = scenario.toml;
  $("description").textContent = scenario.description;
  $("toml").value = builtin;
  edited();
}

function edited() {
  $("back").disabled = $("toml").value === builtin;
}

// The address that brings all of this back.
function address() {
  const query = new URLSearchParams();
  for (const id of FIELDS) if ($(id).value !== "") query.set(id, $(id).value);
  const hash = $("toml").value === builtin ? "" : `#${encodeURIComponent($("toml").value)}`;
  return `${location.origin}/scenario?${query}${hash}`;
}

// A seed may be larger than a number of JavaScript is exact: it is put in as it was written.
function wanted() {
  const body = { state: $("begin").value, pace: $("pace").value };
  if ($("toml").value === builtin) body.scenario = $("scenario").value; else body.toml = $("toml").value;
  for (const id of CHOICES) if ($(id).value !== "") body[id] = $(id).value;
  for (const id of NUMBERS) if ($(id).value !== "") body[id] = $(id).valueAsNumber;
  const seed = $("seed").value.trim();
  const text = JSON.stringify(body);
  return seed === "" ? text : `${text.slice(0, -1)},"seed":${/^\d+$/.test(seed) ? seed : JSON.stringify(seed)}}`;
}

startTheme();
const [all, trucks] = await Promise.all([ask("/api/v1/scenarios"), ask("/api/v1/trucks")]);
$("scenario").append(...(all?.scenarios ?? []).map((s) => make("option", {}, s.name)));
$("truck").append(...(trucks?.trucks ?? []).map((name) => make("option", {}, name)));
const query = new URLSearchParams(location.search);
for (const id of FIELDS) if (query.has(id)) $(id).value = query.get(id);
await choose($("scenario").value);
if (location.hash.length > 1) { $("toml").value = decodeURIComponent(location.hash.slice(1)); edited(); }
$("scenario").onchange = () => choose($("scenario").value);
$("toml").oninput = edited;
$("back").onclick = () => { $("toml").value = builtin; edited(); };
$("share").onclick = async () => {
  history.replaceState(null, "", address());
  try { await navigator.clipboard.writeText(address()); say("The link is copied."); } catch { say("The link is in the address bar."); }
};
$("form").onsubmit = async (e) => {
  e.preventDefault();
  $("start").disabled = true;
  const session = await ask("/api/v1/sessions", { method: "POST", body: wanted() });
  $("start").disabled = false;
  if (session) location.assign(`/?session=${encodeURIComponent(session.id)}`);
};
