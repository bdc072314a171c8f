// The log of events, newest first.

import { arrowKeys } from "./arrows.js";
import { idLink } from "./panel.js";

const ROWS_SHOWN = 300;
const NEIGHBOUR_KINDS = new Set(["neighbour found", "neighbour lost", "node missing"]);
const TONE = {
  connected: "good",
  "power on": "good",
  disconnected: "bad",
  "power off": "bad",
  emergency: "bad",
  crashed: "bad",
  "battery low": "bad",
  "battery empty": "bad",
  "goal refused": "bad",
  "no route": "bad",
  "flight decided": "flight",
  "flight ordered": "flight",
  "took off": "flight",
  landed: "flight",
  "cannot fly": "bad",
  "can fly again": "good",
  "order refused": "bad",
  "order given up": "bad",
  "order arrived": "good",
};
const PEERS_SHOWN = 12;

export class EventLog {
  constructor(mesh, list, showNeighbours, onlySelected) {
    this.mesh = mesh;
    this.list = list;
    this.showNeighbours = showNeighbours;
    this.onlySelected = onlySelected;
    mesh.addEventListener("frame", (event) => {
      if (event.detail.full) this.#rebuild();
      else this.#add(event.detail.events);
    });
    mesh.addEventListener("select", () => this.onlySelected.checked && this.#rebuild());
    for (const box of [showNeighbours, onlySelected])
      box.addEventListener("change", () => this.#rebuild());
    arrowKeys(list, ".id-link");
  }

  #wanted(event) {
    if (!this.showNeighbours.checked && NEIGHBOUR_KINDS.has(event.kind)) return false;
    const selected = this.mesh.selected;
    return (
      !this.onlySelected.checked ||
      selected === null ||
      event.node === selected ||
      event.peers.includes(selected)
    );
  }

  #rebuild() {
    this.list.replaceChildren();
    this.#add(this.mesh.events);
  }

  #add(events) {
    const rows = events
      .filter((event) => this.#wanted(event))
      .slice(-ROWS_SHOWN)
      .reverse();
    if (!rows.length) return;
    this.list.prepend(...rows.map((event) => this.#row(event)));
    while (this.list.children.length > ROWS_SHOWN) this.list.lastElementChild.remove();
  }

  #row(event) {
    const row = document.createElement("li");
    const time = document.createElement("time");
    time.textContent = `${event.t.toFixed(1)} s`;
    const text = document.createElement("span");
    text.className = TONE[event.kind] ?? "";
    text.append(idLink(this.mesh, event.node, -1), ` ${event.kind}`);
    event.peers
      .slice(0, PEERS_SHOWN)
      .forEach((peer, index) => text.append(index ? ", " : " ", idLink(this.mesh, peer, -1)));
    if (event.peers.length > PEERS_SHOWN)
      text.append(` and ${event.peers.length - PEERS_SHOWN} more`);
    if (event.detail) text.append(` (${event.detail})`);
    row.append(time, text);
    return row;
  }
}
