// Bird's-eye view: the road from its lane borders, tractor and trailer with wheels, traffic, plan.
// The truck stays in place and drives to the right; map coordinates are metres, y to the left.
import { onTheme, palette } from "/assets/theme.js";
import { KMH } from "/assets/words.js";

const NAMES = [
  "view-ground", "view-dot", "verge", "asphalt", "ramp", "shoulder", "paint", "tractor", "cab", "trailer", "trailer-line",
  "edge", "wheel", "rim", "frame", "car", "van", "truck", "glass", "plan", "accent", "dim", "text", "label-ground", "ghost",
];
const FONT = "system-ui, 'DejaVu Sans', sans-serif";
const BEHIND = 0.34; // the truck's place across the canvas
const LONGEST_STEP_S = 20; // between two frames that follow each other, at the fastest pace
const LONGEST_STEP_MS = 1000;
const LABEL_SCALE = 4; // vehicles are named from so many pixels a metre on

export class BirdView {
  constructor(canvas, road) {
    this.canvas = canvas;
    this.ctx = canvas.getContext("2d");
    this.road = road;
    this.zoom = 1;
    this.frames = [];
    this.coloursBy = "class";
    this.chosen = null; // a vehicle that was clicked
    this.followed = null; // the view stays with it
    canvas.addEventListener("click", (e) => this.choose(e.offsetX, e.offsetY));
    onTheme(() => { this.colors = palette(NAMES); });
    canvas.addEventListener("wheel", (e) => { e.preventDefault(); this.zoomBy(Math.exp(-e.deltaY * 0.0015)); }, { passive: false });
    new ResizeObserver(() => this.resize()).observe(canvas);
    this.resize();
    const loop = () => { if (this.changed()) this.draw(); requestAnimationFrame(loop); };
    requestAnimationFrame(loop);
  }

  zoomBy(factor) { this.zoom = Math.min(6, Math.max(0.12, this.zoom * factor)); }

  // The vehicle under a place of the canvas, or none.
  choose(x, y) {
    if (this.frames.length === 0) return;
    const reach = Math.max(14, 3.5 * this.scale);
    const near = this.state().others.map((n) => [Math.hypot(...this.px(n.x_m, n.y_m).map((p, i) => p - [x, y][i])), n.id]);
    const [distance, id] = near.reduce((a, b) => b[0] < a[0] ? b : a, [Infinity, null]);
    this.chosen = distance < reach ? id : null;
    if (this.chosen === null) this.followed = null;
  }

  // Saves what is seen as a file.
  picture(name) {
    this.draw();
    this.canvas.toBlob((blob) => {
      const link = document.createElement("a");
      link.href = URL.createObjectURL(blob);
      link.download = name;
      link.click();
      URL.revokeObjectURL(link.href);
    });
  }

  resize() {
    const ratio = devicePixelRatio || 1;
    this.width = this.canvas.clientWidth;
    this.height = this.canvas.clientHeight;
    this.canvas.width = Math.round(this.width * ratio);
    this.canvas.height = Math.round(this.height * ratio);
    this.ratio = ratio;
    this.seen = null; // a canvas of another size is empty
  }

  push(frame) {
    frame.at = performance.now();
    // After a jump in time there is nothing between the two to be seen
    const last = this.frames.at(-1);
    const joins = last && Math.abs(frame.time_s - last.time_s) < LONGEST_STEP_S && frame.at - last.at < LONGEST_STEP_MS;
    this.frames = joins ? [last, frame] : [frame];
  }

  // How far the picture has come from the last frame but one to the last, 0 to 1.
  progress() {
    const [a, b] = this.frames;
    if (!b || a.time_s === b.time_s) return 1;
    return Math.min(1, (performance.now() - b.at) / Math.max(1, b.at - a.at));
  }

  // The state one frame period ago, between the last two frames: smooth at the screen's rate.
  state() {
    const [a, b] = this.frames.length > 1 ? this.frames : [this.frames[0], this.frames[0]];
    const t = this.progress();
    const mix = (p, q) => p + (q - p) * t;
    const before = new Map(a.neighbours.map((n) => [n.id, n]));
    const pose = (p, q) => ({ ...q, x_m: mix(p.x_m, q.x_m), y_m: mix(p.y_m, q.y_m), yaw_rad: mix(p.yaw_rad, q.yaw_rad) });
    const ego = pose(a.ego, b.ego);
    for (const key of ["s_m", "articulation_rad", "road_wheel_rad"]) ego[key] = mix(a.ego[key], b.ego[key]);
    const ghost = b.ghost && pose(a.ghost ?? b.ghost, b.ghost);
    return { ego, plan: b.plan, ghost, lead: b.lead?.id, others: b.neighbours.map((n) => pose(before.get(n.id) ?? n, n)) };
  }

  // Whether the picture is another than it was: one that stands still is not drawn again at the
  // screen's rate.
  changed() {
    const seen = [this.frames.at(-1), this.progress(), this.zoom, this.coloursBy, this.chosen, this.followed, this.colors];
    const same = this.seen?.every((was, i) => was === seen[i]);
    this.seen = seen;
    return !same;
  }

  draw() {
    const { ctx, ratio, width, height } = this;
    ctx.setTransform(ratio, 0, 0, ratio, 0, 0);
    ctx.fillStyle = this.colors["view-ground"];
    ctx.fillRect(0, 0, width, height);
    if (this.frames.length === 0 || width === 0) return;
    const { ego, plan, ghost, lead, others } = this.state();
    const scale = this.scale = Math.max(width, 500) / 110 * this.zoom;
    // screen from map: translate to the truck, turn by its heading, y up to y down
    const cos = Math.cos(ego.yaw_rad), sin = Math.sin(ego.yaw_rad);
    const at = others.find((n) => n.id === this.followed) ?? ego;
    this.px = (x, y) => {
      const dx = x - at.x_m, dy = y - at.y_m;
      return [width * BEHIND + scale * (dx * cos + dy * sin), height * 0.54 - scale * (dy * cos - dx * sin)];
    };
    this.heading = ego.yaw_rad;
    const s_m = ego.s_m + (at.x_m - ego.x_m) * cos + (at.y_m - ego.y_m) * sin;
    const window = [s_m - width * BEHIND / scale - 40, s_m + width * (1 - BEHIND) / scale + 40];
    this.drawDots(at);
    this.drawRoad(window);
    this.drawPath(plan, ego);
    for (const other of others) this.drawOther(other, other.id === lead);
    this.drawTruck(ego);
    if (ghost) this.drawGhost(ghost, ego);
    this.drawScale();
  }

  // Dots fixed to the map, so that motion is seen beside the road.
  drawDots(ego) {
    const { ctx, width, height, scale } = this;
    const step = scale > 5 ? 10 : scale > 1.5 ? 50 : 200;
    const reach = Math.hypot(width, height) / scale;
    ctx.fillStyle = this.colors["view-dot"];
    for (let x = Math.floor((ego.x_m - reach) / step) * step; x < ego.x_m + reach; x += step) {
      for (let y = Math.floor((ego.y_m - reach) / step) * step; y < ego.y_m + reach; y += step) {
        const [px, py] = this.px(x, y);
        if (px > 0 && px < width && py > 0 && py < height) ctx.fillRect(px - 1, py - 1, 2, 2);
      }
    }
  }

  // -- road ----------------------------------------------------------------------------------------
  drawRoad([from, to]) {
    const { ctx, road } = this;
    const step = road.border_step_m;
    const range = (lane) => {
      const count = lane.left_xy_m.length / 2;
      return [Math.max(0, Math.floor((from - lane.s_start_m) / step)), Math.min(count - 1, Math.ceil((to - lane.s_start_m) / step))];
    };
    const outline = (lane, [first, last]) => {
      ctx.beginPath();
      for (let i = first; i <= last; i++) ctx.lineTo(...this.border(lane.left_xy_m, i));
      for (let i = last; i >= first; i--) ctx.lineTo(...this.border(lane.right_xy_m, i));
      ctx.closePath();
    };
    const seen = road.lanes.map((lane) => [lane, range(lane)]).filter(([, [first, last]]) => last > first);
    ctx.strokeStyle = this.colors.verge;
    ctx.lineWidth = 11 * this.scale;
    ctx.lineJoin = "round";
    for (const [lane, span] of seen) { outline(lane, span); ctx.stroke(); }
    for (const [lane, span] of seen) {
      ctx.fillStyle = lane.kind === "driving" ? this.colors.asphalt : lane.kind === "shoulder" ? this.colors.shoulder : this.colors.ramp;
      ctx.strokeStyle = ctx.fillStyle;
      ctx.lineWidth = 1;
      outline(lane, span);
      ctx.fill();
      ctx.stroke();
    }
    ctx.strokeStyle = this.colors.paint;
    ctx.lineWidth = Math.max(1, 0.16 * this.scale);
    for (const [lane, [first, last]] of seen) {
      for (const marking of lane.markings) {
        const a = Math.max(first, marking.first), b = Math.min(last, marking.last);
        if (b <= a) continue;
        const xy = marking.side === "left" ? lane.left_xy_m : lane.right_xy_m;
        // dashes of 6 m every 15 m, fixed to the road
        ctx.setLineDash(marking.line === "dashed" ? [6 * this.scale, 9 * this.scale] : []);
        ctx.lineDashOffset = ((lane.s_start_m + a * step) % 15) * this.scale;
        ctx.globalAlpha = marking.line === "dashed" ? 0.75 : 0.9;
        ctx.beginPath();
        for (let i = a; i <= b; i++) ctx.lineTo(...this.border(xy, i));
        ctx.stroke();
      }
    }
    ctx.setLineDash([]);
    ctx.globalAlpha = 1;
    this.drawPosts(from, to);
  }

  border(xy, i) { return this.px(xy[2 * i], xy[2 * i + 1]); }

  // Kilometre posts beside the rightmost border.
  drawPosts(from, to) {
    const { ctx, road } = this;
    const step = this.scale > 2.5 ? 50 : this.scale > 0.8 ? 100 : 500;
    ctx.fillStyle = this.colors.dim;
    ctx.font = `11px ${FONT}`;
    ctx.textAlign = "center";
    for (let s = Math.ceil(Math.max(0, from) / step) * step; s <= Math.min(to, road.length_m); s += step) {
      let low = null;
      for (const lane of road.lanes) {
        const i = Math.round((s - lane.s_start_m) / road.border_step_m);
        if (i < 0 || i >= lane.right_xy_m.length / 2) continue;
        const p = this.border(lane.right_xy_m, i);
        if (low === null || p[1] > low[1]) low = p;
      }
      if (low === null) continue;
      ctx.fillRect(low[0] - 0.5, low[1] + 5, 1, 6);
      ctx.fillText((s / 1000).toFixed(step < 100 ? 2 : 1), low[0], low[1] + 23);
    }
  }

  drawPath(plan, ego) {
    const { ctx } = this;
    const xy = plan.path_xy_m;
    if (xy.length < 4) return;
    const points = [];
    for (let i = 0; i < xy.length; i += 2) points.push(this.px(xy[i], xy[i + 1]));
    const reach = this.road.truck.tractor_front_m;
    const nose = this.px(ego.x_m + reach * Math.cos(ego.yaw_rad), ego.y_m + reach * Math.sin(ego.yaw_rad));
    const front = nose[0];
    const visible = [nose, ...points.filter((p) => p[0] > front + 2)];
    if (visible.length < 3) return;
    const end = visible[visible.length - 1];
    const fade = ctx.createLinearGradient(front, 0, Math.max(front + 1, end[0]), 0);
    fade.addColorStop(0, this.colors.plan);
    fade.addColorStop(1, `color-mix(in srgb, ${this.colors.plan} 20%, transparent)`);
    ctx.strokeStyle = fade;
    ctx.lineCap = ctx.lineJoin = "round";
    for (const [width, alpha] of [[2.4 * this.scale, 0.13], [Math.max(1.6, 0.22 * this.scale), 0.95]]) {
      ctx.lineWidth = width;
      ctx.globalAlpha = alpha;
      ctx.beginPath();
      for (const p of visible) ctx.lineTo(...p);
      ctx.stroke();
    }
    ctx.globalAlpha = 1;
    ctx.lineCap = "butt";
  }

  // -- bodies --------------------------------------------------------------------------------------
  // Runs `paint` in metres with x along the body and y to its left, origin at a map point.
  onBody(x, y, yaw, paint) {
    const { ctx } = this;
    ctx.save();
    ctx.translate(...this.px(x, y));
    ctx.rotate(this.heading - yaw);
    ctx.scale(this.scale, -this.scale);
    paint(ctx);
    ctx.restore();
  }

  box(ctx, rear, front, width, radius, fill) {
    ctx.fillStyle = fill;
    ctx.strokeStyle = this.colors.edge;
    ctx.lineWidth = 0.08;
    ctx.beginPath();
    ctx.roundRect(rear, -width / 2, front - rear, width, radius);
    ctx.fill();
    ctx.stroke();
  }

  axle(ctx, x, width, twin, angle = 0) {
    const tyre = twin ? 0.56 : 0.34;
    ctx.fillStyle = this.colors.wheel;
    ctx.strokeStyle = this.colors.rim;
    ctx.lineWidth = 0.07;
    for (const side of [-1, 1]) {
      ctx.save();
      ctx.translate(x, side * (width / 2 - tyre / 2 + 0.04));
      ctx.rotate(angle);
      ctx.beginPath();
      ctx.roundRect(-0.5, -tyre / 2, 1.0, tyre, 0.12);
      ctx.fill();
      ctx.stroke();
      ctx.restore();
    }
  }

  drawTruck(ego) {
    const t = this.road.truck;
    const hx = ego.x_m + t.hitch_m * Math.cos(ego.yaw_rad), hy = ego.y_m + t.hitch_m * Math.sin(ego.yaw_rad);
    const cabLength = 2.3;
    this.onBody(ego.x_m, ego.y_m, ego.yaw_rad, (ctx) => {
      this.box(ctx, t.tractor_rear_m, t.tractor_front_m - 0.3, 0.9, 0.1, this.colors.frame);
      for (const x of t.drive_axles_m) this.axle(ctx, x, t.width_m, true);
      this.axle(ctx, t.steer_axle_m, t.width_m, false, ego.road_wheel_rad);
    });
    this.onBody(hx, hy, ego.yaw_rad + ego.articulation_rad, (ctx) => {
      for (const x of t.trailer_axles_m) this.axle(ctx, x, t.width_m + 0.1, true);
      ctx.globalAlpha = 0.72;
      this.box(ctx, t.trailer_rear_m, t.trailer_front_m, t.width_m, 0.12, this.colors.trailer);
      ctx.globalAlpha = 1;
      ctx.strokeStyle = this.colors["trailer-line"];
      ctx.lineWidth = 0.05;
      ctx.beginPath();
      for (let x = t.trailer_rear_m + 1.6; x < t.trailer_front_m - 0.5; x += 1.6) { ctx.moveTo(x, -t.width_m / 2 + 0.1); ctx.lineTo(x, t.width_m / 2 - 0.1); }
      ctx.stroke();
      ctx.fillStyle = this.colors.edge;
      ctx.beginPath();
      ctx.arc(0, 0, 0.2, 0, 2 * Math.PI);
      ctx.fill();
    });
    this.onBody(ego.x_m, ego.y_m, ego.yaw_rad, (ctx) => {
      const front = t.tractor_front_m;
      this.box(ctx, front - cabLength, front, t.width_m, 0.35, this.colors.tractor);
      ctx.fillStyle = this.colors.cab;
      ctx.beginPath();
      ctx.roundRect(front - 0.75, -t.width_m / 2 + 0.2, 0.5, t.width_m - 0.4, 0.15);
      ctx.fill();
    });
  }

  // By class, or from slow (orange) over the truck's speed (grey) to fast (blue).
  colourOf(n) {
    if (this.coloursBy === "class") return this.colors[n.class] ?? this.colors.car;
    const faster = (n.speed_m_s - this.frames[this.frames.length - 1].ego.speed_m_s) / 5;
    const share = Math.round(100 * Math.min(1, Math.abs(faster)));
    return `color-mix(in oklab, ${faster < 0 ? this.colors.car : this.colors.tractor} ${share}%, ${this.colors.truck})`;
  }

  drawOther(n, isLead) {
    const { ctx, colors, scale } = this;
    this.onBody(n.x_m, n.y_m, n.yaw_rad, (ctx) => {
      const half = n.length_m / 2;
      const round = n.class === "car" ? 0.55 : 0.25;
      this.box(ctx, -half, half, n.width_m, round, this.colourOf(n));
      ctx.fillStyle = colors.glass;
      const glass = n.class === "car" ? [half * 0.28, half * 0.3] : [half - 0.95, 0.6];
      ctx.fillRect(glass[0], -n.width_m / 2 + 0.18, glass[1], n.width_m - 0.36);
      if (n.class === "car") ctx.fillRect(-half * 0.72, -n.width_m / 2 + 0.22, half * 0.25, n.width_m - 0.44);
      if (!isLead && n.id !== this.chosen) return;
      ctx.strokeStyle = n.id === this.chosen ? colors.text : colors.accent;
      ctx.lineWidth = Math.max(0.25, 2 / scale);
      ctx.beginPath();
      ctx.roundRect(-half - 0.3, -n.width_m / 2 - 0.3, n.length_m + 0.6, n.width_m + 0.6, round);
      ctx.stroke();
    });
    if (scale < LABEL_SCALE && !isLead) return;
    const [x, y] = this.px(n.x_m, n.y_m);
    if (x < -40 || x > this.width + 40) return;
    ctx.font = `${isLead ? "600 " : ""}11px ${FONT}`;
    ctx.textAlign = "center";
    ctx.lineJoin = "round";
    ctx.lineWidth = 3;
    ctx.strokeStyle = colors["label-ground"];
    ctx.fillStyle = isLead ? colors.text : colors.dim;
    const label = `#${n.id} ${(n.speed_m_s * KMH).toFixed(0)}`, at = y - n.width_m / 2 * scale - 5;
    ctx.strokeText(label, x, at);
    ctx.fillText(label, x, at);
  }

  // The same truck under cruise control: an outline, or where it is when it is out of sight.
  drawGhost(ghost, ego) {
    const { ctx, colors, width, scale } = this;
    const t = this.road.truck, rear = t.hitch_m + t.trailer_rear_m;
    const [x, y] = this.px(ghost.x_m, ghost.y_m);
    const apart = ghost.s_m - ego.s_m, seen = x + t.tractor_front_m * scale > 0 && x + rear * scale < width;
    const label = `cruise control ${(ghost.speed_m_s * KMH).toFixed(0)}`;
    ctx.strokeStyle = ctx.fillStyle = colors.ghost;
    ctx.font = `11px ${FONT}`;
    if (!seen) {
      const text = `${label}: ${Math.abs(apart).toFixed(0)} m ${apart > 0 ? "ahead ▸" : "behind"}`;
      ctx.textAlign = apart > 0 ? "right" : "left";
      ctx.fillText(apart > 0 ? text : `◂ ${text}`, apart > 0 ? width - 10 : 10, 18);
      return;
    }
    this.onBody(ghost.x_m, ghost.y_m, ghost.yaw_rad, (ctx) => {
      ctx.lineWidth = 1.6 / scale;
      ctx.setLineDash([0.9, 0.6]);
      ctx.beginPath();
      ctx.roundRect(t.tractor_front_m - 2.3, -t.width_m / 2, 2.3, t.width_m, 0.3);
      ctx.roundRect(rear, -t.width_m / 2, t.trailer_front_m - t.trailer_rear_m, t.width_m, 0.12);
      ctx.stroke();
    });
    ctx.setLineDash([]);
    ctx.textAlign = "center";
    ctx.fillText(label, x, y + t.width_m / 2 * scale + 14);
  }

  drawScale() {
    const { ctx, height } = this;
    const length = [5, 10, 20, 50, 100, 200, 500, 1000].find((m) => m * this.scale > 70) ?? 1000;
    const w = length * this.scale, x = 14, y = height - 16;
    ctx.strokeStyle = ctx.fillStyle = this.colors.dim;
    ctx.lineWidth = 1.5;
    ctx.beginPath();
    ctx.moveTo(x, y - 5); ctx.lineTo(x, y); ctx.lineTo(x + w, y); ctx.lineTo(x + w, y - 5);
    ctx.stroke();
    ctx.font = `11px ${FONT}`;
    ctx.textAlign = "left";
    ctx.fillText(`${length} m`, x + w + 7, y + 1);
  }
}
