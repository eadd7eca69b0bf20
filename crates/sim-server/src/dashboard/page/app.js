// The dashboard: takes frames from /ws, fills the header and tiles, feeds view and strip plots.
import { BirdView } from "/assets/view.js";
import { Strips } from "/assets/strips.js";

const $ = (id) => document.getElementById(id);
const text = (id, value) => { const e = $(id); if (e.textContent !== value) e.textContent = value; };
const KMH = 3.6;
const DIESEL_G_PER_L = 832;

const road = await (await fetch("/api/v1/road")).json();
const view = new BirdView($("view"), $("map"), road);
const strips = new Strips($("strips"), road);
let frame = null;

// -- telemetry -----------------------------------------------------------------------------------
function connect() {
  const socket = new WebSocket(`ws://${location.host}/ws`);
  socket.onmessage = (event) => {
    const message = JSON.parse(event.data);
    if (message.kind === "frame") {
      frame = message;
      view.push(frame);
      strips.moveTo(frame.ego.s_m);
      show(frame);
    } else if (message.kind === "strip") {
      strips.append(message);
    }
  };
  socket.onclose = () => {
    enable(false);
    if (frame?.run.state === "finished") return;
    $("state").dataset.state = "offline";
    text("state", "offline");
    setTimeout(connect, 2000);
  };
}

// -- header and tiles ----------------------------------------------------------------------------
const clock = (s) => `${Math.floor(s / 60)}:${(s % 60).toFixed(1).padStart(4, "0")}`;
const words = (name) => name.replaceAll("_", " ");

function show(f) {
  const { ego, plan, run, road: here } = f;
  document.title = `${(ego.speed_m_s * KMH).toFixed(0)} km/h · ${run.scenario} · Tractrix`;
  text("scenario", run.scenario);
  $("state").dataset.state = run.state;
  text("state", run.state);
  enable(run.state !== "finished");
  for (const id of ["left", "right"]) $(id).hidden = !run.external_decider;
  text("play", run.state === "paused" ? "Play" : "Pause");
  if (document.activeElement !== $("pace")) selectPace(run.pace);
  text("time", clock(f.time_s));
  text("factor", run.state === "running" ? `${run.realtime_factor.toFixed(run.realtime_factor < 20 ? 1 : 0)}×` : "");

  text("speed", (ego.speed_m_s * KMH).toFixed(1));
  text("speed-sub", `target ${(plan.target_speed_m_s * KMH).toFixed(0)} · ref ${(plan.reference_speed_m_s * KMH).toFixed(0)} · limit ${(here.speed_limit_m_s * KMH).toFixed(0)}`);
  text("gear", ego.gear === 0 ? "N" : String(ego.gear));
  text("gear-sub", ego.shift_in_progress ? "shifting" : `${ego.engine_speed_rpm.toFixed(0)} rpm`);
  text("station", (ego.s_m / 1000).toFixed(2));
  text("station-sub", `of ${(road.length_m / 1000).toFixed(1)} · ${signed(here.grade_frac * 100, 1)} %`);
  $("station-bar").style.width = `${(100 * ego.s_m / road.length_m).toFixed(2)}%`;
  text("error", signed(plan.lateral_error_m * 100, 1));
  text("error-sub", `max ${(run.max_lateral_error_m * 100).toFixed(1)}`);
  text("hitch", signed(ego.articulation_rad * 180 / Math.PI, 2));
  text("hitch-sub", `steer ${signed(ego.steering_wheel_rad * 180 / Math.PI, 0)}°`);
  text("power", (ego.engine_power_w / 1000).toFixed(0));
  text("power-sub", braking(ego) || `pedal ${(plan.accelerator_pedal_frac * 100).toFixed(0)} % · ${ego.engine_torque_nm.toFixed(0)} Nm`);
  text("fuel", (ego.fuel_used_g / 1000).toFixed(2));
  const km = run.distance_m / 1000;
  text("fuel-sub", km > 0.2 ? `${(ego.fuel_used_g / DIESEL_G_PER_L / km * 100).toFixed(1)} l/100 km` : `${ego.fuel_rate_g_s.toFixed(1)} g/s`);
  const active = plan.guard.length > 0;
  $("guard-tile").classList.toggle("alert", active);
  text("guard", active ? "active" : "clear");
  text("guard-sub", active ? plan.guard.map(words).join(", ") : `${run.guard_activations} ticks so far`);
  text("maneuver", [words(plan.maneuver), plan.following !== null ? `following #${plan.following}` : "free", plan.refusal ? `refused: ${words(plan.refusal)}` : ""].filter(Boolean).join(" · "));
}

const signed = (value, digits) => {
  const shown = value.toFixed(digits);
  return Number(shown) === 0 ? (0).toFixed(digits) : value > 0 ? `+${shown}` : shown.replace("-", "−");
};

function braking(ego) {
  const parts = [];
  if (ego.retarder_force_n > 500) parts.push(`retarder ${(ego.retarder_force_n / 1000).toFixed(0)} kN`);
  if (ego.brake_force_n > 500) parts.push(`brakes ${(ego.brake_force_n / 1000).toFixed(0)} kN`);
  return parts.join(" · ");
}

// -- controls ------------------------------------------------------------------------------------
const send = (control) => fetch("/api/v1/control", { method: "POST", body: JSON.stringify(control) });
const enable = (on) => { for (const id of ["play", "step", "pace", "left", "right"]) $(id).disabled = !on; };

function selectPace(pace) {
  const select = $("pace");
  if (![...select.options].some((o) => o.value === pace)) select.add(new Option(`${pace}×`, pace));
  select.value = pace;
}

const toggle = () => send({ action: frame?.run.state === "paused" ? "play" : "pause" });
const step = () => send({ action: "step", ticks: 10 });
const change = (to) => send({ action: "lane_change", to });
$("play").onclick = toggle;
$("left").onclick = () => change("left");
$("right").onclick = () => change("right");
$("step").onclick = step;
$("pace").onchange = (e) => { send({ action: "pace", pace: e.target.value }); e.target.blur(); };
$("in").onclick = () => view.zoomBy(1.35);
$("out").onclick = () => view.zoomBy(1 / 1.35);
addEventListener("keydown", (e) => {
  if (e.target instanceof HTMLSelectElement || e.target instanceof HTMLButtonElement || $("play").disabled) return;
  if (e.key === " ") { e.preventDefault(); toggle(); }
  if (e.key === ".") step();
  if (e.key === "ArrowLeft" && frame?.run.external_decider) change("left");
  if (e.key === "ArrowRight" && frame?.run.external_decider) change("right");
});

enable(false);
connect();
