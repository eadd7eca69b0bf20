// Light and dark: what the system prefers, or the choice made here, which the browser keeps.
// Colours live in style.css; drawings read them from there, so that they change together.

const KEY = "tractrix.theme";
const CHOICES = ["auto", "light", "dark"];
const listeners = new Set();
const system = matchMedia("(prefers-color-scheme: light)");

const stored = () => {
  try { return CHOICES.includes(localStorage.getItem(KEY)) ? localStorage.getItem(KEY) : "auto"; } catch { return "auto"; }
};
let choice = stored();

function apply() {
  const light = choice === "light" || (choice === "auto" && system.matches);
  document.documentElement.dataset.theme = light ? "light" : "dark";
  for (const changed of listeners) changed();
}

export const theme = () => choice;

export function nextTheme() {
  choice = CHOICES[(CHOICES.indexOf(choice) + 1) % CHOICES.length];
  try { localStorage.setItem(KEY, choice); } catch { /* a browser that keeps nothing */ }
  apply();
}

export const onTheme = (changed) => { listeners.add(changed); changed(); };

// The button and the key of a page without a run.
export function startTheme() {
  const button = document.getElementById("theme");
  button.onclick = nextTheme;
  onTheme(() => { button.textContent = `Theme: ${theme()}`; });
  addEventListener("keydown", (e) => {
    const writes = e.target instanceof HTMLInputElement || e.target instanceof HTMLSelectElement || e.target instanceof HTMLTextAreaElement;
    if (e.key === "t" && !writes && !e.ctrlKey && !e.metaKey && !e.altKey) nextTheme();
  });
}

// Colours by name from the style sheet: --road-paint is color("road-paint").
export const color = (name) => getComputedStyle(document.documentElement).getPropertyValue(`--${name}`).trim();
export const palette = (names) => Object.fromEntries(names.map((name) => [name, color(name)]));

system.addEventListener("change", apply);
apply();
