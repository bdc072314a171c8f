// The time line of a recorded run: asks the server twice a second where it is, and moves it.

const REFRESH_MS = 500;

const bar = document.createElement("section");
bar.id = "timeline";
bar.setAttribute("aria-label", "Time line");
const button = (label, text) => {
  const made = document.createElement("button");
  made.type = "button";
  made.textContent = text;
  made.setAttribute("aria-label", label);
  bar.append(made);
  return made;
};
const back = button("step back", "Back");
const play = button("pause", "Pause");
const step = button("step", "Step");
const track = document.createElement("div");
track.className = "track";
const slider = document.createElement("input");
slider.type = "range";
slider.step = "0.01";
slider.setAttribute("aria-label", "time");
track.append(slider);
const shown = document.createElement("output");
bar.append(track, shown);
document.body.append(bar);

let dragging = false;
let marked = false;

function show(state) {
  slider.min = state.start;
  slider.max = state.end;
  if (!dragging) slider.value = state.now;
  shown.textContent = `${state.now.toFixed(1)} of ${state.end.toFixed(0)} s`;
  play.textContent = state.paused ? "Play" : "Pause";
  play.setAttribute("aria-label", state.paused ? "play" : "pause");
  if (!marked) {
    marked = true;
    document.title = state.title;
    for (const mark of state.marks) {
      const line = document.createElement("div");
      line.className = `mark ${mark.kind}`;
      line.title = `${mark.t.toFixed(1)} s: node ${mark.node} ${mark.kind}`;
      line.style.left = `${(100 * (mark.t - state.start)) / (state.end - state.start)}%`;
      track.append(line);
    }
  }
}

async function ask(order) {
  const request = order ? { method: "POST", body: JSON.stringify(order) } : {};
  try {
    const answer = await fetch("/timeline", request);
    if (answer.ok) show(await answer.json());
  } catch {
    shown.textContent = "the replay has ended";
  }
}

slider.addEventListener("pointerdown", () => {
  dragging = true;
});
slider.addEventListener("pointerup", () => {
  dragging = false;
});
slider.addEventListener("input", () => ask({ t: Number(slider.value) }));
back.addEventListener("click", () => ask({ step: -1 }));
step.addEventListener("click", () => ask({ step: 1 }));
play.addEventListener("click", () => {
  ask({ paused: play.getAttribute("aria-label") === "pause" });
});
ask();
setInterval(ask, REFRESH_MS);
