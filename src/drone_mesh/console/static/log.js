// The log of events, newest first: one sentence for each, and one for all nodes of which the same is said.

import { arrowKeys } from "./arrows.js";
import { idLinks } from "./panel.js";

const ROWS_SHOWN = 300;
const SAME_WITHIN_S = 5; // simulated; events so close may share a sentence
const LOOKED_BACK = 8; // sentences, for one that an event can share
const NEIGHBOUR_KINDS = new Set(["neighbour found", "neighbour lost", "node missing"]);

// Kind -> its tone and its sentence. NODE: the node; PEERS: the other nodes; DETAIL: in brackets.
const SENTENCES = {
  started: ["", "NODE started"],
  connected: ["good", "NODE reached gateway PEERS"],
  disconnected: ["bad", "NODE lost gateway PEERS"],
  "gateway changed": ["", "NODE changed to gateway PEERS"],
  "neighbour found": ["", "NODE found PEERS"],
  "neighbour lost": ["", "NODE lost its neighbours PEERS"],
  "node missing": ["", "NODE has no route to PEERS any more"],
  "no route": ["bad", "NODE has no route to PEERS: the order was not delivered"],
  "power on": ["good", "NODE was switched on"],
  "power off": ["bad", "NODE was switched off"],
  emergency: ["bad", "NODE begins a repair"],
  "negotiation started": ["", "NODE negotiates who flies"],
  "negotiation ended": ["", "NODE learned that PEERS flies"],
  "flight decided": ["flight", "NODE flies to the place of PEERS, to repair the mesh"],
  "flight ordered": ["flight", "NODE flies, ordered by PEERS"],
  landed: ["flight", "NODE landed"],
  crashed: ["bad", "NODE crashed"],
  "battery low": ["bad", "NODE has a low battery"],
  "battery empty": ["bad", "NODE has an empty battery"],
  "goal refused": ["bad", "NODE refused a goal"],
  "order sent": ["", "NODE sent an order to PEERS"],
  "order accepted": ["", "PEERS accepted an order of NODE"],
  "order refused": ["bad", "PEERS refused an order of NODE"],
  "order arrived": ["good", "PEERS arrived, ordered by NODE"],
  "order given up": ["bad", "PEERS gave up an order of NODE"],
  "order replaced": ["", "PEERS has a later order of NODE"],
  "order lost contact": ["bad", "PEERS is out of contact during an order of NODE"],
  "took off": ["flight", "NODE took off"],
  "cannot fly": ["bad", "NODE cannot fly"],
  "can fly again": ["good", "NODE can fly again"],
};

export class EventLog {
  #said = []; // the newest sentences: {kind, t, nodes, peers, details, row}

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
    this.#said = [];
    this.#add(this.mesh.events);
  }

  #add(events) {
    const changed = new Set();
    for (const event of events) if (this.#wanted(event)) changed.add(this.#take(event));
    const rows = [];
    for (const said of changed) {
      this.#write(said);
      if (!said.row.isConnected) rows.unshift(said.row);
    }
    if (rows.length) this.list.prepend(...rows.slice(0, ROWS_SHOWN));
    while (this.list.children.length > ROWS_SHOWN) this.list.lastElementChild.remove();
  }

  /** Adds the event to a recent sentence that says the same of others, or begins a new one. */
  #take({ t, node, kind, peers, detail }) {
    const ofPeers = kind.startsWith("order ") || kind === "no route";
    const same = this.#said.find(
      (said) =>
        said.kind === kind &&
        t - said.t <= SAME_WITHIN_S &&
        String(ofPeers ? said.nodes : said.peers) === String(ofPeers ? [node] : peers),
    );
    if (same) {
      for (const id of ofPeers ? peers : [node])
        if (!same[ofPeers ? "peers" : "nodes"].includes(id))
          same[ofPeers ? "peers" : "nodes"].push(id);
      same.details.add(detail);
      return same;
    }
    const row = document.createElement("li");
    const said = { t, kind, nodes: [node], peers: [...peers], details: new Set([detail]), row };
    this.#said = [said, ...this.#said].slice(0, LOOKED_BACK);
    return said;
  }

  #write({ t, kind, nodes, peers, details, row }) {
    const [tone, sentence] = SENTENCES[kind] ?? ["", `NODE ${kind} PEERS`];
    const time = document.createElement("time");
    time.textContent = `${t.toFixed(1)} s`;
    const text = document.createElement("span");
    text.className = tone;
    for (const part of sentence.split(/(NODE|PEERS)/)) {
      if (part === "NODE") text.append(...idLinks(this.mesh, sorted(nodes)));
      else if (part === "PEERS") text.append(...idLinks(this.mesh, sorted(peers)));
      else text.append(part);
    }
    const [detail] = details;
    if (details.size === 1 && detail) text.append(` (${detail})`);
    row.replaceChildren(time, text);
  }
}

function sorted(ids) {
  return [...ids].sort((a, b) => a - b);
}
