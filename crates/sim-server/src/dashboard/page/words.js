// What the stack decided, in words.

export const KMH = 3.6;

export const signed = (value, digits) => {
  const shown = value.toFixed(digits);
  return Number(shown) === 0 ? (0).toFixed(digits) : value > 0 ? `+${shown}` : shown.replace("-", "−");
};

const plain = (name) => name.replaceAll("_", " ");
const from = (table) => (name) => table[name] ?? plain(name);

export const maneuver = from({
  keep_lane: "Keeps its lane",
  change_left: "Changes to the left lane",
  change_right: "Changes to the right lane",
  abort_change: "Breaks the lane change off",
  minimal_risk: "Brakes within its lane: minimal risk",
});

export const reason = from({
  lane_ends: "its lane ends",
  slower_ahead: "the vehicle ahead is slower",
  keep_right: "the right lane serves as well",
  policy: "the learned policy chose it",
  requested: "asked for from outside",
});

export const refusal = from({
  no_target_lane: "there is no lane on that side",
  unsafe_front: "the gap ahead in the target lane is too small",
  unsafe_rear: "the gap behind in the target lane is too small",
  unsafe_own_lane: "the gap to the vehicle ahead would close during the change",
  occupied: "a vehicle is alongside",
  no_feasible_path: "no path keeps the limits of the loaded truck",
  busy: "a change is under way, or the last one was just now",
});

export const guard = from({
  range: "a command was outside its range",
  rate: "a command changed too fast",
  stale: "an input is too old",
  non_finite: "an input is not a number",
  frozen: "an input does not change",
  jump: "an input jumped",
  headway: "the vehicle ahead is closer than the safe gap",
  no_plan: "there is no plan",
  bus: "the truck or its bus is not in order",
  intruder: "somebody on the bus pretends to be somebody else",
  driver: "the driver has taken over",
});

const speedSource = from({
  cruise: "cruise control",
  solved: "predictive plan",
  almost_solved: "predictive plan, solver stopped early",
  last_profile: "last valid predictive plan",
  fallback: "cruise control, no predictive plan here",
});

// What sets the speed now: traffic or the plan.
export function speedBy(plan) {
  const source = speedSource(plan.speed_status);
  if (!plan.held_up) return `Free: ${source}`;
  return `${plan.following === null ? "Held up by traffic" : `Held up by #${plan.following}`} (${source})`;
}
