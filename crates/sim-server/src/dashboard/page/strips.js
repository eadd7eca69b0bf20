// Strip plots over distance: speed, grade, engine power, gear, fuel. Plotly draws them; it loads
// after the first picture.

const KMH = 3.6;
const REDRAW_MS = 500;
const ROWS = [
  { title: "speed<br>km/h", share: 1.5 },
  { title: "grade<br>%", share: 1 },
  { title: "power<br>kW", share: 1 },
  { title: "gear", share: 0.8 },
  { title: "fuel<br>kg", share: 0.9 },
];
const GAP = 0.028;

export class Strips {
  constructor(element, road) {
    this.element = element;
    this.columns = { s_km: [], speed: [], reference: [], power: [], gear: [], fuel: [] };
    this.road = road;
    this.s_km = 0;
    this.revision = 0;
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
    put(c.s_km, rows.s_m.map((s) => s / 1000));
    put(c.speed, rows.speed_m_s.map((v) => v * KMH));
    put(c.reference, rows.reference_speed_m_s.map((v) => v * KMH));
    put(c.power, rows.engine_power_w.map((p) => p / 1000));
    put(c.gear, rows.gear);
    put(c.fuel, rows.fuel_used_g.map((g) => g / 1000));
    this.stale = true;
  }

  moveTo(s_m) {
    this.stale ||= Math.abs(s_m / 1000 - this.s_km) > 1e-4;
    this.s_km = s_m / 1000;
  }

  redraw() {
    if (!this.plotly || (this.drawn && !this.stale) || document.hidden) return;
    this.stale = false;
    this.drawn = true;
    this.revision += 1;
    this.plotly.react(this.element, this.traces(), this.layout(), { displayModeBar: false, responsive: true });
  }

  traces() {
    const c = this.columns, profile = this.road.profile;
    const s = profile.s_m.map((v) => v / 1000);
    const line = (row, name, x, y, color, more = {}) => ({
      type: "scatter", mode: "lines", name, x, y, yaxis: row === 1 ? "y" : `y${row}`,
      hovertemplate: "%{y:.1f}", ...more, line: { color, width: 1.6, ...more.line },
    });
    return [
      line(1, "limit", s, profile.speed_limit_m_s.map((v) => v * KMH), "#ff5d6c", { line: { shape: "hv", width: 1.2, dash: "dot" } }),
      line(1, "reference", c.s_km, c.reference, "#7f8d9c", { line: { width: 1.3, dash: "dash" } }),
      line(1, "speed", c.s_km, c.speed, "#39c5ff", { line: { width: 2 } }),
      line(2, "grade", s, profile.grade_frac.map((g) => g * 100), "#3ddc97", { fill: "tozeroy", fillcolor: "rgba(61,220,151,.13)", line: { width: 1.3 } }),
      line(3, "power", c.s_km, c.power, "#ffb547", { fill: "tozeroy", fillcolor: "rgba(255,181,71,.10)" }),
      line(4, "gear", c.s_km, c.gear, "#c98bea", { hovertemplate: "%{y}", line: { shape: "hv" } }),
      line(5, "fuel", c.s_km, c.fuel, "#f2768e", { hovertemplate: "%{y:.2f}" }),
    ];
  }

  layout() {
    const total = ROWS.reduce((sum, row) => sum + row.share, 0);
    const unit = (1 - GAP * (ROWS.length - 1)) / total;
    const layout = {
      paper_bgcolor: "#11171f", plot_bgcolor: "#11171f",
      font: { color: "#8b99a8", size: 11, family: "Inter, Segoe UI, system-ui, DejaVu Sans, sans-serif" },
      margin: { l: 62, r: 18, t: 12, b: 36 },
      showlegend: false, hovermode: "x unified", hoverlabel: { bgcolor: "#1a232d", bordercolor: "#2a3642" },
      uirevision: "keep", datarevision: this.revision,
      xaxis: {
        range: [0, this.road.length_m / 1000], title: { text: "distance, km", standoff: 6 }, anchor: "free", position: 0,
        gridcolor: "#1c252f", zeroline: false, linecolor: "#2a3642", ticks: "outside", tickcolor: "#2a3642", hoverformat: ".2f",
      },
      shapes: [{ type: "line", xref: "x", yref: "paper", x0: this.s_km, x1: this.s_km, y0: 0, y1: 1, line: { color: "rgba(219,228,238,.45)", width: 1 } }],
    };
    let top = 1;
    ROWS.forEach((row, i) => {
      const bottom = Math.max(0, top - row.share * unit);
      layout[i === 0 ? "yaxis" : `yaxis${i + 1}`] = {
        domain: [bottom, top], title: { text: row.title, standoff: 8 }, gridcolor: "#1c252f",
        zerolinecolor: "#2f3b48", nticks: 4, fixedrange: true, rangemode: ["nonnegative", "normal", "tozero", "tozero", "tozero"][i],
        ...(row.title === "gear" ? { range: [0, 12.9], tickvals: [0, 4, 8, 12] } : {}),
      };
      top = bottom - GAP;
    });
    return layout;
  }
}
