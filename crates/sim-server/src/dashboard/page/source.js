// Where frames come from: a run under way over /ws, or one that is over, from its recording.
import { ask, base, run, session } from "/assets/common.js";

const CHUNK_S = 20;

// Frames and strip rows of a session; `lost` when nobody answers.
export function live({ frame, strip, lost }) {
  const socket = new WebSocket(`ws://${location.host}/ws?session=${encodeURIComponent(session)}`);
  socket.onmessage = (event) => {
    const message = JSON.parse(event.data);
    if (message.kind === "frame") frame(message);
    else if (message.kind === "strip") strip(message);
  };
  socket.onclose = () => {
    const again = lost();
    setTimeout(() => live({ frame, strip, lost }), again);
  };
}

// A run that is over: it plays at a pace, stands, and goes to any time.
export class Recorded {
  constructor({ frame, strip }) {
    this.frame = frame;
    this.pace = 1;
    this.plays = false;
    this.chunks = new Map();
    this.time_s = 0;
    this.shown = null;
    this.began = this.begin(strip);
  }

  async begin(strip) {
    const rows = await ask(`${base}/strip`);
    if (!rows) return;
    this.span_s = rows.span_s;
    this.different = rows.ticks_different;
    strip(rows);
    this.goTo(this.span_s[0]);
    let last = performance.now();
    const step = (now) => {
      if (this.plays) this.goTo(this.time_s + this.pace * (now - last) / 1000);
      last = now;
      requestAnimationFrame(step);
    };
    requestAnimationFrame(step);
  }

  // The frames of a stretch, asked for once.
  chunk(number) {
    if (!this.chunks.has(number)) {
      const [from, to] = [number * CHUNK_S, (number + 1) * CHUNK_S];
      const of = ask(`${base}/frames?from_s=${from}&to_s=${to - 0.001}`);
      this.chunks.set(number, of.then((answer) => answer?.frames ?? []));
    }
    return this.chunks.get(number);
  }

  async goTo(time_s) {
    const [first, last] = this.span_s;
    this.time_s = Math.min(last, Math.max(first, time_s));
    if (this.time_s >= last) this.plays = false;
    const wanted = this.time_s, number = Math.floor(wanted / CHUNK_S);
    const frames = await this.chunk(number);
    if (wanted + CHUNK_S / 2 > (number + 1) * CHUNK_S && (number + 1) * CHUNK_S < last) this.chunk(number + 1);
    if (wanted !== this.time_s) return;
    const past = frames.filter((f) => f.time_s <= wanted + 1e-6);
    const now = past[past.length - 1] ?? frames[0];
    if (now && (now !== this.shown)) { this.shown = now; this.frame(now); }
  }
}

export const isRecorded = run !== null;
