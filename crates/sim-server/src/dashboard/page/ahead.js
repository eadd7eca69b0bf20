// The road ahead: grade as an area, over it speed limit, set speed and the planned speed.
import { onTheme, palette } from "/assets/theme.js";
import { KMH, signed } from "/assets/words.js";

const REACH_M = 4000;
const LEFT = 34, RIGHT = 34, TOP = 18, BOTTOM = 18;
const SPEED_SHARE = 0.58; // of the height; the grade lies below
const FONT = "11px system-ui, 'DejaVu Sans', sans-serif";

export class Ahead {
  constructor(canvas, road) {
    this.canvas = canvas;
    this.ctx = canvas.getContext("2d");
    this.profile = road.profile;
    this.frame = null;
    new ResizeObserver(() => this.draw()).observe(canvas);
    onTheme(() => {
      this.colors = palette(["text", "dim", "line", "speed", "plan", "limit", "reference", "grade", "grade-fill"]);
      this.draw();
    });
  }

  push(frame) {
    this.frame = frame;
    this.draw();
  }

  // Rows of the road's profile from the truck on: [m ahead, grade, limit].
  rows(s_m) {
    const { s_m: s, grade_frac, speed_limit_m_s } = this.profile;
    const rows = [];
    for (let i = Math.max(0, s.findIndex((v) => v > s_m) - 1); i < s.length && s[i] <= s_m + REACH_M; i++) {
      if (i >= 0) rows.push([Math.max(0, s[i] - s_m), grade_frac[i], speed_limit_m_s[i]]);
    }
    return rows;
  }

  draw() {
    const { canvas, ctx, frame } = this;
    const ratio = devicePixelRatio || 1, width = canvas.clientWidth, height = canvas.clientHeight;
    if (!frame || width === 0) return;
    if (canvas.width !== Math.round(width * ratio) || canvas.height !== Math.round(height * ratio)) {
      canvas.width = Math.round(width * ratio);
      canvas.height = Math.round(height * ratio);
    }
    ctx.setTransform(ratio, 0, 0, ratio, 0, 0);
    ctx.clearRect(0, 0, width, height);
    const { ego, run, speed_ahead } = frame, set_speed = run.set_speed_m_s * KMH;
    const rows = this.rows(ego.s_m);
    const planned = speed_ahead.speed_m_s.map((v, i) => [speed_ahead.from_m - ego.s_m + i * speed_ahead.step_m, v * KMH]).filter(([m]) => m >= 0 && m <= REACH_M);
    const speeds = [...rows.map((r) => r[2] * KMH), ...planned.map((p) => p[1]), ego.speed_m_s * KMH, set_speed].filter(Number.isFinite);
    const low = Math.max(0, Math.floor((Math.min(...speeds) - 3) / 10) * 10), high = Math.ceil((Math.max(...speeds) + 1) / 10) * 10;
    const steepest = Math.max(0.02, ...rows.map((r) => Math.abs(r[1]))) * 1.1;
    const bottom = height - BOTTOM;
    const split = TOP + SPEED_SHARE * (bottom - TOP), half = (bottom - split - 6) / 2;
    const box = {
      x: (m) => LEFT + (width - LEFT - RIGHT) * m / REACH_M,
      v: (kmh) => split - (split - TOP) * (kmh - low) / Math.max(10, high - low),
      g: (grade) => bottom - half - half * grade / steepest,
    };
    this.axes(box, low, high, steepest, width, bottom);
    this.grade(box, rows);
    const { colors } = this;
    this.line(steps(rows.map((r) => [r[0], r[2] * KMH])), box, colors.limit, 1.4, [2, 3]);
    this.line([[0, set_speed], [rows.length ? rows[rows.length - 1][0] : 0, set_speed]], box, colors.reference, 1.3, [7, 4]);
    this.line(planned, box, colors.plan, 2.2, []);
    ctx.fillStyle = colors.speed;
    ctx.beginPath();
    ctx.arc(box.x(0), box.v(ego.speed_m_s * KMH), 4, 0, 2 * Math.PI);
    ctx.fill();
  }

  axes(box, low, high, steepest, width, bottom) {
    const { ctx, colors } = this;
    ctx.font = FONT;
    ctx.lineWidth = 1;
    ctx.strokeStyle = colors.line;
    ctx.fillStyle = colors.dim;
    ctx.textBaseline = "middle";
    ctx.textAlign = "right";
    const step = Math.max(10, Math.ceil((high - low) / 10 / Math.max(1, Math.floor((box.v(low) - box.v(high)) / 18))) * 10);
    for (let v = low; v <= high; v += step) {
      ctx.beginPath(); ctx.moveTo(LEFT, box.v(v)); ctx.lineTo(width - RIGHT, box.v(v)); ctx.stroke();
      ctx.fillText(String(v), LEFT - 5, box.v(v));
    }
    ctx.textAlign = "left";
    ctx.fillStyle = colors.grade;
    const shown = Math.max(1, Math.floor(steepest * 100));
    for (const g of box.g(0) - box.g(0.01 * shown) > 11 ? [-shown, 0, shown] : [0]) ctx.fillText(`${signed(g, 0)}%`, width - RIGHT + 5, box.g(g / 100));
    ctx.fillStyle = colors.dim;
    ctx.textAlign = "center";
    for (let m = 0; m <= REACH_M; m += 1000) ctx.fillText(m === 0 ? "here" : `${m / 1000} km`, box.x(m), bottom + 11);
  }

  grade(box, rows) {
    const { ctx, colors } = this;
    if (rows.length < 2) return;
    ctx.beginPath();
    ctx.moveTo(box.x(rows[0][0]), box.g(0));
    for (const [m, g] of rows) ctx.lineTo(box.x(m), box.g(g));
    ctx.lineTo(box.x(rows[rows.length - 1][0]), box.g(0));
    ctx.closePath();
    ctx.fillStyle = colors["grade-fill"];
    ctx.fill();
    this.line(rows.map(([m, g]) => [m, g]), { x: box.x, v: box.g }, colors.grade, 1.2, []);
  }

  line(points, box, stroke, width, dash) {
    const { ctx } = this;
    ctx.strokeStyle = stroke;
    ctx.lineWidth = width;
    ctx.lineJoin = "round";
    ctx.setLineDash(dash);
    ctx.beginPath();
    let pen = false;
    for (const [m, v] of points) {
      if (!Number.isFinite(v)) { pen = false; continue; }
      if (pen) ctx.lineTo(box.x(m), box.v(v)); else ctx.moveTo(box.x(m), box.v(v));
      pen = true;
    }
    ctx.stroke();
    ctx.setLineDash([]);
  }
}

// A value that holds until the next point.
const steps = (points) => points.flatMap(([m, v], i) => i + 1 < points.length ? [[m, v], [points[i + 1][0], v]] : [[m, v]]);
