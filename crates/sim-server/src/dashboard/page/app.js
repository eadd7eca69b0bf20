// The dashboard: takes frames from /ws, fills the header and tiles, feeds views and strip plots.
import { Ahead } from "/assets/ahead.js";
import { ask, base, run as playedRun, session } from "/assets/common.js";
import { enable, showSettings, startControls } from "/assets/controls.js";
import { MiniMap } from "/assets/minimap.js";
import { live, Recorded } from "/assets/source.js";
import { Strips } from "/assets/strips.js";
import { startTimeBar } from "/assets/timebar.js";
import { Values } from "/assets/values.js";
import { BirdView } from "/assets/view.js";
import * as words from "/assets/words.js";

const $ = (id) => document.getElementById(id);
const text = (id, value) => { const e = $(id); if (e.textContent !== value) e.textContent = value; };
const { KMH, signed } = words;
const DIESEL_G_PER_L = 832;
const REFUSAL_SHOWN_S = 10;

// A server without this session has its sessions and runs to show.
if (playedRun === null) {
  const all = await ask("/api/v1/sessions");
  if (all && !all.sessions.some((s) => s.id === session)) {
    location.replace("/runs");
    await new Promise(() => {});
  }
} else {
  const [here, runs] = ["/", "/runs"].map((path) => document.querySelector(`nav a[href="${path}"]`));
  here.removeAttribute("aria-current");
  runs.setAttribute("aria-current", "page");
}
const road = await ask(`${base}/road`);
if (!road) throw new Error("nothing to show");
const view = new BirdView($("view"), road);
const ahead = new Ahead($("ahead"), road);
const map = new MiniMap($("map"), road);
const strips = new Strips($("strips"), road);
const values = new Values($("values"), $("vehicle"), view);
let frame = null, leaving = false;
startControls(view, () => frame);

// -- telemetry -----------------------------------------------------------------------------------
function take(now) {
  // Another run has taken the port: its road, limits and plots are other ones.
  // Once: a second reload would break off the first.
  if (leaving) return;
  if (frame && frame.run_id !== now.run_id) {
    leaving = true;
    return location.reload();
  }
  frame = now;
  view.push(frame);
  ahead.push(frame);
  map.draw(frame.ego);
  strips.moveTo(frame);
  values.show(frame);
  show(frame);
}

function lost() {
  enable(null);
  if (frame?.run.state === "finished") return 5000;
  $("state").dataset.state = "offline";
  text("state", "offline");
  return 2000;
}

const strip = (rows) => strips.append(rows);
if (playedRun === null) live({ frame: take, strip, lost });
else startTimeBar(new Recorded({ frame: take, strip }));

// -- header and tiles ----------------------------------------------------------------------------
const limit = (v) => v * KMH < 999 ? (v * KMH).toFixed(0) : "none";
const clock = (s) => `${Math.floor(s / 60)}:${(s % 60).toFixed(1).padStart(4, "0")}`;

function show(f) {
  const { ego, plan, run, road: here } = f;
  document.title = `${(ego.speed_m_s * KMH).toFixed(0)} km/h · ${run.scenario} · Tractrix`;
  text("scenario", run.scenario);
  $("state").dataset.state = run.state;
  text("state", run.state);
  if (playedRun === null) enable(run.state);
  for (const id of ["left", "right"]) $(id).hidden = !run.external_decider;
  text("play", run.state === "paused" ? "Play" : "Pause");
  if (playedRun === null) showSettings(run);
  text("time", clock(f.time_s));
  text("factor", run.state === "running" ? `${run.realtime_factor.toFixed(run.realtime_factor < 20 ? 1 : 0)}×` : "");

  text("speed", (ego.speed_m_s * KMH).toFixed(1));
  text("speed-sub", `plan ${(plan.target_speed_m_s * KMH).toFixed(0)} · limit ${limit(here.speed_limit_m_s)}`);
  text("gear", ego.gear === 0 ? "N" : String(ego.gear));
  text("gear-sub", ego.shift_in_progress ? "shifting" : `${ego.engine_speed_rpm.toFixed(0)} rpm`);
  text("station", (ego.s_m / 1000).toFixed(2));
  text("station-sub", `of ${(road.length_m / 1000).toFixed(1)} · ${signed(here.grade_frac * 100, 1)} %`);
  $("station-bar").style.width = `${(100 * ego.s_m / road.length_m).toFixed(2)}%`;
  text("error", signed(plan.lateral_error_m * 100, 1));
  text("error-sub", `hitch ${signed(ego.articulation_rad * 180 / Math.PI, 1)}°`);
  text("power", (ego.engine_power_w / 1000).toFixed(0));
  text("power-sub", braking(ego) || `pedal ${(plan.accelerator_pedal_frac * 100).toFixed(0)} %`);
  text("fuel", (ego.fuel_used_g / 1000).toFixed(2));
  const km = run.distance_m / 1000;
  text("fuel-sub", km > 0.2 ? `${(ego.fuel_used_g / DIESEL_G_PER_L / km * 100).toFixed(1)} l/100 km` : `${ego.fuel_rate_g_s.toFixed(1)} g/s`);
  const active = plan.guard.length > 0;
  $("guard-tile").classList.toggle("alert", active);
  text("guard", active ? "active" : "clear");
  text("guard-sub", active ? plan.guard.map(words.guard).join(", ") : run.guard_activations === undefined ? "" : `${run.guard_activations} ticks`);
  decision(f);
  traffic(f);
  against(f.ghost);
  banner(run);
}

// What the truck does and why.
function decision({ plan, run, time_s }) {
  text("maneuver", words.maneuver(plan.maneuver) + (plan.reason && plan.maneuver !== "keep_lane" ? `: ${words.reason(plan.reason)}` : ""));
  text("speed-by", words.speedBy(plan));
  const refused = run.last_refusal, ago = refused ? time_s - refused.time_s : Infinity;
  $("refusal").hidden = ago > REFUSAL_SHOWN_S;
  if (ago > REFUSAL_SHOWN_S) return;
  const wish = refused.reason ? ` (${words.reason(refused.reason)})` : "";
  text("refusal", `Lane change${wish} refused ${ago < 1 ? "now" : `${ago.toFixed(0)} s ago`}: ${words.refusal(refused.refusal)}`);
}

function traffic({ lead }) {
  text("lead", lead ? `#${lead.id}, ${(lead.speed_m_s * KMH).toFixed(0)} km/h` : "none");
  text("gap", lead ? `${lead.gap_m.toFixed(0)} m` : "–");
  text("time-gap", lead?.time_gap_s != null ? `${lead.time_gap_s.toFixed(1)} s` : "–");
  text("ttc", lead?.time_to_collision_s == null ? "–" : lead.time_to_collision_s > 99 ? "> 99 s" : `${lead.time_to_collision_s.toFixed(0)} s`);
}

// The same truck under cruise control without traffic, both at the truck's place.
function against(ghost) {
  $("ghost-tile").hidden = !ghost;
  if (!ghost) return;
  const percent = (frac) => frac == null ? "–" : signed(frac * 100, 1);
  const kg = (g) => (g / 1000).toFixed(2);
  text("saving", percent(ghost.saving_frac));
  text("saving-free", ghost.held_up_s > 0 ? `free road ${percent(ghost.free_saving_frac)} %` : "");
  text("saving-sub", `${kg(ghost.ego_fuel_g)} / ${kg(ghost.fuel_g)} kg · ${signed(ghost.ego_time_s - ghost.time_s, 0)} s · traffic ${ghost.held_up_s.toFixed(0)} s`);
  $("ghost-tile").title = "Fuel saved at equal trip time and speed against the same truck under cruise control (up to 5 km/h "
    + "faster downhill) on an empty road. Time lost behind others counts against the truck; \"free road\" leaves out the "
    + `stretches on which traffic held it up (${ghost.held_up_s.toFixed(0)} s, ${(ghost.held_up_m / 1000).toFixed(1)} km).`;
}

// What must not happen, for as long as the run lasts.
function banner(run) {
  const said = [];
  if (run.off_road) said.push("A wheel is off the road.");
  else if (run.off_road_events > 0) said.push(`Off the road ${times(run.off_road_events)}, ${run.off_road_time_s.toFixed(1)} s.`);
  if (run.collisions > 0) said.push(`Collided ${times(run.collisions)}.`);
  if (run.driven_from_outside) said.push("Driven from outside.");
  if (run.faults?.length > 0) said.push(`Broken: ${run.faults.map((fault) => fault.replaceAll("_", " ")).join(", ")}.`);
  $("banner").hidden = said.length === 0;
  text("banner", said.join(" "));
}

const times = (count) => count === 1 ? "once" : `${count} times`;

function braking(ego) {
  const parts = [];
  if (ego.retarder_force_n > 500) parts.push(`retarder ${(ego.retarder_force_n / 1000).toFixed(0)} kN`);
  if (ego.brake_force_n > 500) parts.push(`brakes ${(ego.brake_force_n / 1000).toFixed(0)} kN`);
  return parts.join(" · ");
}

for (const choice of document.getElementsByName("window")) choice.onchange = () => strips.setWindow(choice.value);
for (const choice of document.getElementsByName("over")) choice.onchange = () => strips.setOver(choice.value);
if (frame === null) enable(null);
