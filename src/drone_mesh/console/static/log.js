// The log of events, newest first: one sentence for each, and one for all nodes of which the same is said.

import { arrowKeys } from "./arrows.js";
import { idLink, idLinks } from "./panel.js";

const ROWS_SHOWN = 300;
const SAME_WITHIN_S = 5; // simulated; events so close may share a sentence
const LOOKED_BACK = 8; // sentences, for one that an event can share
const NEIGHBOUR_KINDS = new Set(["neighbour found", "neighbour lost", "node missing"]);

// Kind -> its tone and its sentence. NODE: the node; PEERS: the other nodes. Of a|b, a is said of one node and b of several.
const SENTENCES = {
  started: ["", "NODE started"],
  connected: ["good", "NODE reached gateway PEERS"],
  disconnected: ["bad", "NODE lost gateway PEERS"],
  "gateway changed": ["", "NODE changed to gateway PEERS"],
  "neighbour found": ["", "NODE found PEERS"],
  "neighbour lost": ["", "NODE lost contact with PEERS"],
  "node missing": ["", "NODE has|have no route to PEERS any more"],
  "no route": ["bad", "NODE has no route to PEERS: the order was|orders were not delivered"],
  "power on": ["good", "NODE was|were switched on"],
  "power off": ["bad", "NODE was|were switched off"],
  emergency: ["bad", "NODE begins|begin a repair"],
  "negotiation started": ["", "NODE negotiates|negotiate who flies"],
  "negotiation ended": ["", "NODE learned that PEERS flies"],
  "flight decided": ["flight", "NODE flies|fly to the place of PEERS, to repair the mesh"],
  return: ["flight", "NODE returns to where it was"],
  "last flight": ["flight", "NODE leaves|leave the lost mesh"],
  "flight ordered": ["flight", "NODE flies|fly, ordered by PEERS"],
  landed: ["flight", "NODE landed"],
  crashed: ["bad", "NODE crashed"],
  "battery low": ["bad", "NODE has|have a low battery"],
  "battery empty": ["bad", "NODE has|have an empty battery"],
  "goal refused": ["bad", "NODE refused a goal"],
  "order sent": ["", "NODE sent an order|orders to PEERS"],
  "order accepted": ["", "PEERS accepted an order|orders of NODE"],
  "order refused": ["bad", "PEERS refused an order|orders of NODE"],
  "order arrived": ["good", "PEERS arrived, ordered by NODE"],
  "order given up": ["bad", "PEERS gave up an order|orders of NODE"],
  "order replaced": ["", "PEERS has|have a later order of NODE"],
  "order lost contact": ["bad", "PEERS is|are out of contact during an order|orders of NODE"],
  "outside the fence": ["bad", "NODE is|are where the fence does not allow it"],
  "took off": ["flight", "NODE took off"],
  "cannot fly": ["bad", "NODE cannot fly"],
  "can fly again": ["good", "NODE can fly again"],
};
const FORMS = /(an order|[a-z]+)\|([a-z]+)/g;

/** Whether it is more than neighbours that come and go. */
export function isNotable({ kind }) {
  return !NEIGHBOUR_KINDS.has(kind);
}

/** Whether it is about this node. */
export function isAbout(id, { node, peers }) {
  return node === id || peers.includes(id);
}

export class EventLog {
  #said = []; // the newest sentences: {kind, of, others, events: [{t, id, detail}], row, open}

  /** Shows in `list` the newest `rows` of the events for which `wanted(event)` is true. */
  constructor(mesh, list, wanted, rows = ROWS_SHOWN) {
    this.mesh = mesh;
    this.list = list;
    this.wanted = wanted;
    this.rows = rows;
    mesh.addEventListener("frame", (event) => {
      if (event.detail.full) this.rebuild();
      else this.#add(event.detail.events);
    });
    arrowKeys(list, "button");
  }

  /** Other events are wanted now. */
  rebuild() {
    this.list.replaceChildren();
    this.#said = [];
    this.#add(this.mesh.events);
  }

  #add(events) {
    const changed = new Set();
    for (const event of events) if (this.wanted(event)) changed.add(this.#take(event));
    const rows = [];
    for (const said of changed) {
      this.#write(said);
      if (!said.row.isConnected) rows.unshift(said.row);
    }
    if (rows.length) this.list.prepend(...rows.slice(0, this.rows));
    while (this.list.children.length > this.rows) this.list.lastElementChild.remove();
  }

  /** Adds the event to a recent sentence that says the same of others, or begins a new one. */
  #take({ t, node, kind, peers, detail }) {
    const ofPeers = peers.length > 0 && (kind.startsWith("order ") || kind === "no route");
    const [ids, others] = ofPeers ? [peers, [node]] : [[node], peers];
    const at = this.#said.findIndex(
      (said) =>
        said.kind === kind &&
        t - said.events[0].t <= SAME_WITHIN_S &&
        String(said.others) === String(others),
    );
    const events = ids.map((id) => ({ t, id, detail }));
    // What happened to a node keeps its order: nothing joins a sentence before what was said of that node since.
    const since = this.#said.slice(0, at + 1).flatMap((said) => said.events);
    if (at >= 0 && !since.some(({ id }) => ids.includes(id))) {
      this.#said[at].events.push(...events);
      return this.#said[at];
    }
    const said = { kind, ofPeers, others, events, row: document.createElement("li"), open: false };
    this.#said = [said, ...this.#said].slice(0, LOOKED_BACK);
    return said;
  }

  #write(said) {
    const { kind, ofPeers, others, events, row } = said;
    const [tone, sentence] = SENTENCES[deed(said)] ?? ["", `NODE ${kind} PEERS`];
    const ids = sorted(events.map(({ id }) => id));
    const [nodes, peers] = ofPeers ? [others, ids] : [ids, sorted(others)];
    const text = document.createElement("span");
    text.className = tone;
    const number = ids.length > 1 ? "$2" : "$1";
    for (const part of sentence.replace(FORMS, number).split(/(NODE|PEERS)/)) {
      if (part === "NODE") text.append(...idLinks(this.mesh, nodes));
      else if (part === "PEERS")
        text.append(...(peers.length ? idLinks(this.mesh, peers) : ["nobody"]));
      else text.append(part);
    }
    const details = new Set(events.map(({ detail }) => detail));
    const [detail] = details;
    if (details.size === 1 && detail) text.append(` (${detail})`);
    row.replaceChildren(this.#time(said), text);
    if (said.open) row.append(this.#each(events));
  }

  /** When it happened; of several nodes a button, which shows it of each. */
  #time(said) {
    const { events } = said;
    const times = events.map(({ t }) => t);
    const [first, last] = [Math.min(...times), Math.max(...times)].map((t) => t.toFixed(1));
    const time = document.createElement("time");
    time.textContent = first === last ? `${first} s` : `${first} to ${last} s`;
    if (events.length === 1) return time;
    const button = document.createElement("button");
    button.type = "button";
    button.className = "when";
    button.tabIndex = -1;
    button.title = "When each";
    button.setAttribute("aria-expanded", said.open);
    button.append(time);
    button.addEventListener("click", () => {
      said.open = !said.open;
      this.#write(said);
      said.row.querySelector(".when").focus();
    });
    return button;
  }

  #each(events) {
    const each = document.createElement("p");
    for (const { t, id, detail } of [...events].sort((a, b) => a.t - b.t || a.id - b.id)) {
      const one = document.createElement("span");
      one.append(idLink(this.mesh, id, -1), ` ${t.toFixed(1)} s${detail && ` (${detail})`}`);
      each.append(one);
    }
    return each;
  }
}

/** Its kind; of a flight that the node decided on itself, whether that repairs the mesh. */
function deed({ kind, others, events }) {
  if (kind !== "flight decided") return kind;
  if (!others.length) return "last flight";
  return String(others) === String(events[0].id) ? "return" : kind;
}

function sorted(ids) {
  return [...ids].sort((a, b) => a - b);
}
