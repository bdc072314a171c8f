// The demonstration of a repair or a relief: its sentences, and how long the mesh still waits at the last one.

import { agreed } from "./confirm.js";

const byId = (id) => document.getElementById(id);

export class Story {
  /**
   * `demonstrate(on)` begins a demonstration, or ends it and closes its story; `plan()` resolves
   * with what it would do, or with nothing if it cannot begin.
   */
  constructor(mesh, demonstrate, plan) {
    this.mesh = mesh;
    for (const what of ["story", "layouts"]) mesh.addEventListener(what, () => this.#show());
    byId("demonstrate").addEventListener("click", async () => {
      if (this.running) return demonstrate(false);
      const text = await plan();
      if (text && (await agreed(text, "Show it"))) demonstrate(true);
    });
    byId("story-close").addEventListener("click", () => demonstrate(false));
  }

  get running() {
    return Boolean(this.mesh.story.running);
  }

  #show() {
    const { steps = [], wait = {}, running = false } = this.mesh.story;
    byId("story-card").hidden = !steps.length;
    document.body.toggleAttribute("data-story", Boolean(steps.length));
    byId("demonstrate").textContent = running ? "End" : `Show a ${this.mesh.demo}`;
    byId("demonstrate").setAttribute("aria-pressed", running);
    this.#list(steps);
    byId("story-wait").hidden = wait.left === undefined;
    if (wait.left === undefined) return;
    byId("story-left").max = wait.of;
    byId("story-left").value = wait.of - wait.left;
    byId("story-wait").lastElementChild.textContent = `${wait.left} s`;
  }

  /** Rewrites only what changed: a screen reader announces each change. */
  #list(steps) {
    const list = byId("story");
    while (list.children.length > steps.length) list.lastElementChild.remove();
    let changed = false;
    steps.forEach(({ t, text }, index) => {
      const row = list.children[index] ?? list.appendChild(this.#row());
      const [time, words] = row.children;
      const at = `${t.toFixed(0)} s`;
      if (words.textContent === text && time.textContent === at) return;
      time.textContent = at;
      if (words.textContent !== text) words.textContent = text;
      changed = true;
    });
    for (const row of list.children) {
      if (row === list.lastElementChild) row.setAttribute("aria-current", "step");
      else row.removeAttribute("aria-current");
    }
    if (changed) list.scrollTop = list.scrollHeight;
  }

  #row() {
    const row = document.createElement("li");
    row.append(document.createElement("time"), document.createElement("span"));
    return row;
  }
}
