// Buttons, fields and keys: what they ask of the run, and what it refuses.
import { ask as request, base } from "/assets/common.js";
import { nextTheme, onTheme, theme } from "/assets/theme.js";

const $ = (id) => document.getElementById(id);
const KMH = 3.6;

const ask = async (body) => await request(`${base}/control`, { method: "POST", body }) !== null;

const send = (command) => ask(JSON.stringify(command));

// What can be asked of a run in this state; null: there is none.
export function enable(state) {
  const drives = state === "running" || state === "paused";
  for (const id of ["play", "step", "pace", "left", "right", "set-speed", "until", "decider", "speed-planner", "break", "release"]) $(id).disabled = !drives;
  $("again").disabled = state === null;
}

function select(id, value, name) {
  const list = $(id);
  if (document.activeElement === list) return;
  if (![...list.options].some((o) => o.value === value)) list.add(new Option(name, value));
  list.value = value;
}

// How the run is set; a list that is open is left alone.
export function showSettings(run) {
  select("pace", run.pace, `${run.pace}×`);
  select("decider", run.decider, run.decider);
  select("speed-planner", run.speed_planner, run.speed_planner);
  const isOn = run.faults.includes($("fault").value);
  $("break").textContent = isOn ? "Mend" : "Break";
  $("break").setAttribute("aria-pressed", isOn);
  $("release").hidden = !run.driven_from_outside;
}

export function startControls(view, frame) {
  const paused = async () => frame()?.run.state === "paused" || send({ action: "pause" });
  const toggle = () => send({ action: frame()?.run.state === "paused" ? "play" : "pause" });
  const step = async () => await paused() && send({ action: "step", ticks: 10 });
  const change = (to) => send({ action: "lane_change", to });
  $("play").onclick = toggle;
  $("left").onclick = () => change("left");
  $("right").onclick = () => change("right");
  $("step").onclick = step;
  $("pace").onchange = (e) => { send({ action: "pace", pace: e.target.value }); e.target.blur(); };
  const chosen = (id, command) => { $(id).onchange = (e) => { send(command(e.target.value)); e.target.blur(); }; };
  chosen("decider", (decider) => ({ action: "set_decider", decider }));
  chosen("speed-planner", (speed_planner) => ({ action: "set_speed_planner", speed_planner }));
  $("release").onclick = () => send({ action: "release" });
  $("theme").onclick = nextTheme;
  onTheme(() => { $("theme").textContent = `Theme: ${theme()}`; });
  $("in").onclick = () => view.zoomBy(1.35);
  $("out").onclick = () => view.zoomBy(1 / 1.35);

  $("picture").onclick = () => view.picture(`tractrix-${(frame()?.time_s ?? 0).toFixed(1)}-s.png`);
  $("colours").onchange = (e) => { view.coloursBy = e.target.value; };

  const onSubmit = (form, act) => { $(form).onsubmit = (e) => { e.preventDefault(); act(); }; };
  onSubmit("set-speed-form", () => send({ action: "set_speed", speed_m_s: $("set-speed-kmh").valueAsNumber / KMH }));
  onSubmit("fault-form", () => {
    const fault = $("fault").value;
    return send({ action: "fault", fault, on: !frame()?.run.faults.includes(fault) });
  });
  onSubmit("until-form", async () => {
    const time_s = $("until-s").valueAsNumber;
    return await paused() && send({ action: "step_until", time_s });
  });
  // A seed may be larger than a number of JavaScript is exact
  onSubmit("again-form", () => {
    const seed = $("seed").value.trim();
    return ask(seed === "" ? '{"action":"reset"}' : `{"action":"reset","seed":${/^\d+$/.test(seed) ? seed : JSON.stringify(seed)}}`);
  });

  addEventListener("keydown", (e) => {
    if (e.target instanceof HTMLSelectElement || e.target instanceof HTMLInputElement || e.ctrlKey || e.metaKey || e.altKey) return;
    if (e.key === "t") nextTheme();
    if (e.key === "+") view.zoomBy(1.35);
    if (e.key === "-") view.zoomBy(1 / 1.35);
    const isControl = e.target instanceof HTMLButtonElement || e.target instanceof HTMLElement && e.target.tagName === "SUMMARY";
    if (isControl || $("play").disabled) return;
    if (e.key === " ") { e.preventDefault(); toggle(); }
    if (e.key === ".") step();
    if (e.key === "ArrowLeft" && frame()?.run.external_decider) change("left");
    if (e.key === "ArrowRight" && frame()?.run.external_decider) change("right");
  });
}
