// The time line: drag to any moment of what the console remembers, play, step, return to the present.
// While a page shows the past or a recording, all controls that give orders are hidden.

const byId = (id) => document.getElementById(id);

export class TimeLine {
  /** `ask(request)` sends a request that is not answered. */
  constructor(mesh, ask) {
    this.mesh = mesh;
    this.ask = ask;
    this.dragging = false;
    this.slider = byId("time");
    mesh.addEventListener("timeline", () => this.#show());
    mesh.addEventListener("marks", () => this.#mark());
    mesh.addEventListener("layouts", () => this.#recording());
    this.slider.addEventListener("pointerdown", () => (this.dragging = true));
    for (const what of ["pointerup", "pointercancel", "change"])
      this.slider.addEventListener(what, () => (this.dragging = false));
    this.slider.addEventListener("input", () => ask({ t: Number(this.slider.value) }));
    byId("time-back").addEventListener("click", () => ask({ step: -1 }));
    byId("time-step").addEventListener("click", () => ask({ step: 1 }));
    byId("time-play").addEventListener("click", () => ask({ paused: !this.mesh.timeline.paused }));
    byId("time-factor").addEventListener("change", (event) =>
      ask({ factor: Number(event.target.value) }),
    );
    byId("time-live").addEventListener("click", () => ask({ live: true }));
  }

  #recording() {
    const { recording } = this.mesh;
    document.body.toggleAttribute("data-recording", Boolean(recording));
    byId("badge").hidden = !recording;
    if (!recording) return;
    document.title = `${recording}: recording`;
    byId("time-live").textContent = "As played";
    byId("time-live").title = "Return to where the recording is being played";
  }

  #show() {
    const { start, end, now, live, paused, factor } = this.mesh.timeline;
    byId("timeline").classList.toggle("empty", end - start < 1);
    document.body.toggleAttribute("data-past", !live);
    this.slider.min = start;
    this.slider.max = end;
    if (!this.dragging) this.slider.value = now;
    this.slider.setAttribute("aria-valuetext", `${now.toFixed(1)} s`);
    const isNow = live && !this.mesh.recording;
    byId("time-now").textContent = isNow ? "now" : `${now.toFixed(1)} of ${end.toFixed(0)} s`;
    const play = byId("time-play");
    play.textContent = paused ? "Play" : "Pause";
    play.setAttribute("aria-label", paused ? "play" : "pause");
    byId("time-live").hidden = !this.mesh.hasPresent;
    byId("time-live").disabled = live;
    const speed = byId("time-factor");
    if (document.activeElement !== speed) speed.value = String(factor);
    this.#place();
  }

  #mark() {
    const marks = this.mesh.marks.map(({ t, kind, node }) => {
      const line = document.createElement("i");
      line.className = `mark ${kind}`;
      line.title = `${t.toFixed(1)} s: node ${node} ${kind}`;
      line.dataset.t = t;
      return line;
    });
    byId("marks").replaceChildren(...marks);
    this.#place();
  }

  /** The left end of the time line moves on, and with it the marks. */
  #place() {
    const { start, end } = this.mesh.timeline;
    for (const line of byId("marks").children) {
      const share = (Number(line.dataset.t) - start) / (end - start || 1);
      line.style.left = `${100 * Math.min(1, Math.max(0, share))}%`;
    }
  }
}
