// What all pages share: where the session's answers are, asking the server, saying what it refuses.
const $ = (id) => document.getElementById(id);
const SHOWN_MS = 8000;
const query = new URLSearchParams(location.search);
let hide = null;

// The session that this page shows, and the run that it plays back.
export const session = query.get("session") ?? "default";
export const run = query.get("run");
export const base = run === null
  ? `/api/v1/sessions/${encodeURIComponent(session)}`
  : `/api/v1/runs/${encodeURIComponent(run)}`;

// What was refused is said in the server's words.
export function say(words) {
  clearTimeout(hide);
  $("answer").textContent = words;
  $("answer").hidden = words === "";
  if (words !== "") hide = setTimeout(() => say(""), SHOWN_MS);
}

// The answer, or null when it is a refusal, which is said.
export async function ask(path, { method = "GET", body } = {}) {
  const headers = body === undefined ? {} : { "Content-Type": "application/json" };
  try {
    const answer = await fetch(path, { method, headers, body });
    if (answer.ok) { say(""); return answer.status === 204 ? {} : await answer.json(); }
    say((await answer.json()).detail);
  } catch {
    say("the program does not answer");
  }
  return null;
}

export const post = (path, value) => ask(path, { method: "POST", body: JSON.stringify(value) });

// An element with attributes, listeners (on...) and children.
export function make(tag, more = {}, ...children) {
  const element = document.createElement(tag);
  for (const [key, value] of Object.entries(more)) {
    if (key.startsWith("on")) element[key] = value;
    else if (value !== null && value !== undefined && value !== false) element.setAttribute(key, value === true ? "" : value);
  }
  element.append(...children);
  return element;
}

// Plotly, once it is there.
export const plotly = () => new Promise((resolve) => {
  if (window.Plotly) return resolve(window.Plotly);
  const script = make("script", { src: "/assets/plotly.js" });
  script.onload = () => resolve(window.Plotly);
  document.head.append(script);
});
