// All values of the truck, and those of the vehicle that was clicked.
import { make } from "/assets/common.js";
import { KMH, signed } from "/assets/words.js";

// Units as the ends of names, the longest first.
const UNITS = [
  ["_m_s2", "m/s²"], ["_rad_s", "rad/s"], ["_m_s", "m/s"], ["_g_s", "g/s"], ["_rpm", "rpm"], ["_rad", "rad"], ["_nm", "N m"],
  ["_m", "m"], ["_w", "W"], ["_n", "N"], ["_g", "g"], ["_ratio", ""],
];

const named = (key) => {
  const [end, unit] = UNITS.find(([end]) => key.endsWith(end)) ?? ["", ""];
  return [key.slice(0, key.length - end.length).replaceAll("_", " "), unit];
};
const shown = (value) => typeof value === "number" ? String(Math.round(value * 1e4) / 1e4).replace("-", "−") : value ? "yes" : "no";

export class Values {
  constructor(list, vehicle, view) {
    Object.assign(this, { list, vehicle, view, cells: null, id: null, frame: null });
    // A run that stands still brings no frame after the list is opened.
    list.parentElement.addEventListener("toggle", () => { if (this.frame) this.show(this.frame); });
  }

  show(frame) {
    this.frame = frame;
    if (this.list.parentElement.open) this.showTruck(frame.ego);
    this.showVehicle(frame);
  }

  showTruck(ego) {
    if (!this.cells) {
      this.cells = new Map(Object.keys(ego).map((key) => [key, make("dd")]));
      this.list.replaceChildren(...Object.keys(ego).map((key) => make("div", {}, make("dt", {}, named(key)[0]), this.cells.get(key))));
    }
    for (const [key, cell] of this.cells) cell.textContent = `${shown(ego[key])} ${named(key)[1]}`.trim();
  }

  showVehicle({ ego, neighbours }) {
    const { view, vehicle } = this;
    const chosen = neighbours.find((n) => n.id === view.chosen);
    vehicle.hidden = !chosen;
    if (!chosen) { view.followed = null; this.id = null; return; }
    if (this.id !== chosen.id) {
      this.id = chosen.id;
      this.lines = make("div");
      const follow = make("button", { type: "button", onclick: () => { view.followed = view.followed === null ? chosen.id : null; } });
      this.follow = follow;
      vehicle.replaceChildren(this.lines, follow);
    }
    const ahead = (chosen.x_m - ego.x_m) * Math.cos(ego.yaw_rad) + (chosen.y_m - ego.y_m) * Math.sin(ego.yaw_rad);
    const words = [
      `#${chosen.id}, ${chosen.class}, ${chosen.length_m.toFixed(1)} m`,
      `${(chosen.speed_m_s * KMH).toFixed(1)} km/h (${signed((chosen.speed_m_s - ego.speed_m_s) * KMH, 1)} against the truck)`,
      `${Math.abs(ahead).toFixed(0)} m ${ahead > 0 ? "ahead" : "behind"}`,
    ];
    this.lines.replaceChildren(...words.map((line) => make("p", {}, line)));
    this.follow.textContent = view.followed === null ? "Follow it" : "Follow the truck";
  }
}
