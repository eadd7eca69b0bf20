// Strip plots over distance: speed, grade, engine power, gear, fuel. Plotly draws them; it loads
// after the first picture.
import { onTheme, palette } from "/assets/theme.js";
import { KMH } from "/assets/words.js";

const NAMES = ["panel", "text", "dim", "line", "grid", "cursor", "speed", "plan", "reference", "limit", "grade", "grade-fill", "power", "power-fill", "gear", "fuel"];
const REDRAW_MS = 500;
const ROWS = [
  { title: "km/h", share: 1.5, mode: "nonnegative" },
  { title: "grade %", share: 1, mode: "normal" },
  { title: "kW", share: 1, mode: "tozero" },
  { title: "gear", share: 0.8, mode: "tozero" },
  { title: "fuel kg", share: 0.9, mode: "tozero" },
];
const GAP = 0.035;

export class Strips {
  constructor(element, road) {
    this.element = element;
    this.columns = { time_s: [], s_km: [], speed: [], reference: [], power: [], gear: [], fuel: [] };
    this.road = road;
    this.s_km = 0;
    this.window_s = Infinity;
    this.over = "distance";
    this.revision = 0;
    onTheme(() => { this.colors = palette(NAMES); this.stale = true; });
    this.plan = { x: [], y: [] };
    this.plotly = null;
    const script = document.createElement("script");
    script.src = "/assets/plotly.js";
    script.onload = () => { this.plotly = window.Plotly; element.replaceChildren(); this.redraw(); };
    document.head.append(script);
    setInterval(() => this.redraw(), REDRAW_MS);
  }

  // Rows come in order; after a reconnection the server starts again at row 0.
  append(rows) {
    const c = this.columns;
    const put = (column, values) => { column.length = rows.first; column.push(...values); };
    put(c.time_s, rows.time_s);
    put(c.s_km, rows.s_m.map((s) => s / 1000));
    put(c.speed, rows.speed_m_s.map((v) => v * KMH));
    put(c.reference, rows.reference_speed_m_s.map((v) => v * KMH));
    put(c.power, rows.engine_power_w.map((p) => p / 1000));
    put(c.gear, rows.gear);
    put(c.fuel, rows.fuel_used_g.map((g) => g / 1000));
    this.stale = true;
  }

  moveTo({ ego, time_s, run, speed_ahead: ahead }) {
    const s_km = ego.s_m / 1000;
    this.stale ||= Math.abs(s_km - this.s_km) > 1e-4;
    Object.assign(this, { s_km, time_s, set_speed: run.set_speed_m_s * KMH });
    this.plan = { x: ahead.speed_m_s.map((_, i) => (ahead.from_m + i * ahead.step_m) / 1000), y: ahead.speed_m_s.map((v) => v * KMH) };
  }

  // Seconds back from now that the plots show, or "all".
  setWindow(choice) {
    this.window_s = choice === "all" ? Infinity : Number(choice);
    this.stale = true;
    this.redraw();
  }

  // What the plots are over: "distance" or "time".
  setOver(choice) {
    this.over = choice;
    this.stale = true;
    this.redraw();
  }

  // Stations shown, km: the whole road, or the window and a fifth of its length ahead.
  range() {
    if (this.over === "time") return [Math.max(0, this.time_s - this.window_s) || 0, Math.max(1, this.columns.time_s.at(-1) ?? 0, this.time_s ?? 0)];
    const length_km = this.road.length_m / 1000;
    if (this.window_s === Infinity) return [0, length_km];
    const { time_s, s_km } = this.columns;
    const first = time_s.findIndex((t) => t >= this.time_s - this.window_s);
    const from = first < 0 ? this.s_km : s_km[first];
    return [from, this.s_km + Math.max(0.1, 0.2 * (this.s_km - from))];
  }

  redraw() {
    if (!this.plotly || (this.drawn && !this.stale) || document.hidden) return;
    this.stale = false;
    this.drawn = true;
    this.revision += 1;
    this.plotly.react(this.element, this.traces(), this.layout(), { displayModeBar: false, responsive: true });
  }

  // The road's profile where the truck was, for plots over time.
  driven() {
    const { s_m, speed_limit_m_s, grade_frac } = this.road.profile;
    const step = s_m[1] - s_m[0];
    const at = this.columns.s_km.map((s) => Math.min(s_m.length - 1, Math.max(0, Math.floor(s * 1000 / step))));
    return { speed_limit_m_s: at.map((i) => speed_limit_m_s[i]), grade_frac: at.map((i) => grade_frac[i]) };
  }

  traces() {
    const isTime = this.over === "time";
    const profile = isTime ? this.driven() : this.road.profile, k = this.colors;
    const c = isTime ? { ...this.columns, s_km: this.columns.time_s } : this.columns;
    const s = isTime ? c.s_km : profile.s_m.map((v) => v / 1000);
    const whole = isTime ? [0, Math.max(...this.range())] : [0, this.road.length_m / 1000];
    // What was planned and what is planned now join at the truck, or lie over each other in a run that is over.
    const joins = (this.plan.x[0] ?? Infinity) >= (c.s_km.at(-1) ?? 0) - 0.1;
    const plan = isTime ? { x: [], y: [] } : joins ? this.plan : { x: [null, ...this.plan.x], y: [null, ...this.plan.y] };
    const line = (row, name, x, y, color, more = {}) => ({
      type: "scatter", mode: "lines", name, x, y, yaxis: row === 1 ? "y" : `y${row}`,
      hovertemplate: "%{y:.1f}", ...more, line: { color, width: 1.6, ...more.line },
    });
    return [
      line(1, "limit", s, profile.speed_limit_m_s.map((v) => v * KMH), k.limit, { line: { shape: "hv", width: 1.4, dash: "dot" } }),
      line(1, "set speed", whole, [this.set_speed, this.set_speed], k.reference, { line: { width: 1.3, dash: "dash" } }),
      line(1, "plan", [...c.s_km, ...plan.x], [...c.reference, ...plan.y], k.plan, { line: { width: 1.5 } }),
      line(1, "speed", c.s_km, c.speed, k.speed, { line: { width: 2.2 } }),
      line(2, "grade", s, profile.grade_frac.map((g) => g * 100), k.grade, { fill: "tozeroy", fillcolor: k["grade-fill"], line: { width: 1.3 } }),
      line(3, "power", c.s_km, c.power, k.power, { fill: "tozeroy", fillcolor: k["power-fill"] }),
      line(4, "gear", c.s_km, c.gear, k.gear, { hovertemplate: "%{y}", line: { shape: "hv" } }),
      line(5, "fuel", c.s_km, c.fuel, k.fuel, { hovertemplate: "%{y:.2f}" }),
    ];
  }

  cursor() { return this.over === "time" ? this.time_s : this.s_km; }

  layout() {
    const total = ROWS.reduce((sum, row) => sum + row.share, 0);
    const unit = (1 - GAP * (ROWS.length - 1)) / total;
    const k = this.colors;
    const layout = {
      paper_bgcolor: k.panel, plot_bgcolor: k.panel,
      font: { color: k.dim, size: 11, family: "Inter, Segoe UI, system-ui, DejaVu Sans, sans-serif" },
      margin: { l: 52, r: 16, t: 6, b: 34 },
      showlegend: false, hovermode: "x unified", hoverlabel: { bgcolor: k.panel, bordercolor: k.line, font: { color: k.text } },
      uirevision: `${this.over} ${this.window_s}`, datarevision: this.revision,
      xaxis: {
        range: this.range(), title: { text: this.over === "time" ? "time, s" : "distance, km", standoff: 6 }, anchor: "free", position: 0,
        gridcolor: k.grid, zeroline: false, linecolor: k.line, ticks: "outside", tickcolor: k.line, hoverformat: ".2f",
      },
      shapes: [{ type: "line", xref: "x", yref: "paper", x0: this.cursor(), x1: this.cursor(), y0: 0, y1: 1, line: { color: k.cursor, width: 1 } }],
    };
    let top = 1;
    ROWS.forEach((row, i) => {
      const bottom = Math.max(0, top - row.share * unit);
      const ticks = row.share * unit * this.element.clientHeight > 55 ? 4 : 3;
      layout[i === 0 ? "yaxis" : `yaxis${i + 1}`] = {
        domain: [bottom, top], title: { text: row.title, standoff: 8, font: { size: 10.5 } }, gridcolor: k.grid,
        zerolinecolor: k.line, nticks: ticks, fixedrange: true, rangemode: row.mode,
        ...(row.title === "gear" ? { range: [0, 12.9], tickvals: ticks > 3 ? [0, 4, 8, 12] : [0, 12] } : {}),
      };
      top = bottom - GAP;
    });
    return layout;
  }
}
