// The time bar of a run that is over.
const $ = (id) => document.getElementById(id);
const clock = (s) => `${Math.floor(s / 60)}:${(s % 60).toFixed(1).padStart(4, "0")}`;

export async function startTimeBar(recorded) {
  document.querySelector(".controls").hidden = true;
  await recorded.began;
  if (!recorded.span_s) return;
  const [first, last] = recorded.span_s;
  const at = $("at");
  Object.assign(at, { min: first, max: last });
  $("timebar").hidden = false;
  if (recorded.different > 0) $("differs").textContent = `${recorded.different} commands do not come out as recorded: another revision drove, or it goes on from a snapshot`;
  const show = () => {
    at.value = recorded.time_s;
    $("at-s").textContent = `${clock(recorded.time_s)} of ${clock(last)}`;
    $("play-back").textContent = recorded.plays ? "Stand" : "Play";
  };
  const toggle = () => {
    if (!recorded.plays && recorded.time_s >= last) recorded.goTo(first);
    recorded.plays = !recorded.plays;
    show();
  };
  $("play-back").onclick = toggle;
  $("play-pace").onchange = (e) => { recorded.pace = Number(e.target.value); };
  at.oninput = () => recorded.goTo(Number(at.value)).then(show);
  addEventListener("keydown", (e) => {
    if (e.key === " " && e.target === document.body) { e.preventDefault(); toggle(); }
  });
  setInterval(show, 100);
  show();
}
