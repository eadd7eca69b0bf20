// The whole road with the truck's place on it.
import { onTheme, palette } from "/assets/theme.js";

const MARGIN = 6;

export class MiniMap {
  constructor(canvas, road) {
    this.canvas = canvas;
    this.x = road.profile.x_m;
    this.y = road.profile.y_m;
    const range = (v) => [v.reduce((a, b) => Math.min(a, b)), v.reduce((a, b) => Math.max(a, b))];
    this.box = [...range(this.x), ...range(this.y)];
    onTheme(() => { this.colors = palette(["dim", "accent", "panel"]); });
  }

  draw(ego) {
    const { canvas, x, y, box: [x0, x1, y0, y1], colors } = this;
    const ratio = devicePixelRatio || 1, width = canvas.clientWidth, height = canvas.clientHeight;
    if (canvas.width !== Math.round(width * ratio)) {
      canvas.width = Math.round(width * ratio);
      canvas.height = Math.round(height * ratio);
    }
    const ctx = canvas.getContext("2d");
    ctx.setTransform(ratio, 0, 0, ratio, 0, 0);
    ctx.clearRect(0, 0, width, height);
    const scale = Math.min((width - 2 * MARGIN) / Math.max(1, x1 - x0), (height - 2 * MARGIN) / Math.max(1, y1 - y0));
    const px = (mx, my) => [width / 2 + scale * (mx - (x0 + x1) / 2), height / 2 - scale * (my - (y0 + y1) / 2)];
    ctx.strokeStyle = colors.dim;
    ctx.lineWidth = 1.6;
    ctx.lineJoin = "round";
    ctx.beginPath();
    for (let i = 0; i < x.length; i++) ctx.lineTo(...px(x[i], y[i]));
    ctx.stroke();
    ctx.fillStyle = colors.accent;
    ctx.strokeStyle = colors.panel;
    ctx.beginPath();
    ctx.arc(...px(ego.x_m, ego.y_m), 4, 0, 2 * Math.PI);
    ctx.fill();
    ctx.stroke();
  }
}
