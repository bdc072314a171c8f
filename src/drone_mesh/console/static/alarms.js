// The lasting list of alarms: what needs attention, until somebody has seen it and it is over.

import { arrowKeys } from "./arrows.js";
import { idLinks } from "./panel.js";

const byId = (id) => document.getElementById(id);

export class Alarms {
  /** `acknowledge(text)` tells the console that somebody has seen these; `show()` brings the list into view. */
  constructor(mesh, acknowledge, show) {
    this.mesh = mesh;
    this.acknowledge = acknowledge;
    this.shown = "";
    mesh.addEventListener("frame", () => this.#update());
    byId("alarm-count").addEventListener("click", () => {
      show();
      byId("alarms").focus();
    });
    arrowKeys(byId("alarms"), ".id-link");
  }

  #update() {
    const { alarms } = this.mesh;
    const shown = JSON.stringify(alarms);
    if (shown === this.shown) return;
    this.shown = shown;
    const open = alarms.filter((alarm) => !alarm.acknowledged);
    const count = open.reduce((sum, { nodes }) => sum + Math.max(1, nodes.length), 0);
    const button = byId("alarm-count");
    button.hidden = !count;
    button.textContent = count === 1 ? "1 alarm" : `${count} alarms`;
    const list = byId("alarms");
    const focused = list.contains(document.activeElement);
    list.hidden = !alarms.length;
    list.replaceChildren(...alarms.map((alarm) => this.#row(alarm)));
    if (focused) (list.hidden ? byId("events") : list).focus();
  }

  #row({ text, nodes, since, over, acknowledged }) {
    const row = document.createElement("li");
    row.classList.toggle("over", over || acknowledged);
    const words = document.createElement("span");
    words.append(...(nodes.length ? idLinks(this.mesh, nodes) : ["The mesh:"]), ` ${text}`);
    const notes = [`since ${since.toFixed(0)} s`, over && "over", acknowledged && "acknowledged"];
    words.append(` (${notes.filter(Boolean).join(", ")})`);
    row.append(words);
    if (acknowledged) return row;
    const button = document.createElement("button");
    button.type = "button";
    button.className = "live";
    button.textContent = "Acknowledge";
    button.setAttribute("aria-label", `Acknowledge: ${nodes.length || "the mesh:"} ${text}`);
    button.addEventListener("click", () => this.acknowledge(text));
    row.append(button);
    return row;
  }
}
