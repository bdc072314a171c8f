// The selected node: its facts, its power switch, and where to send it.

import { Mesh, orDash } from "./mesh.js";
import { words } from "./table.js";

const SEVERITY = { gateway: 0, connected: 0, flying: 1, off: 1, lost: 2, stale: 3 };

export class NodePanel {
  /** `power(id, on)` and `fly(id, x, y, z)` carry out what the buttons say. */
  constructor(mesh, power, fly) {
    this.mesh = mesh;
    this.power = power;
    this.fly = fly;
    for (const what of ["frame", "select", "detail"]) mesh.addEventListener(what, () => this.#show());
    mesh.addEventListener("select", () => this.#fillPlace());
    byId("power").addEventListener("click", () => this.switchPower());
    byId("node-close").addEventListener("click", () => mesh.select(null));
    byId("fly-form").addEventListener("submit", (event) => this.#send(event));
  }

  switchPower() {
    const node = this.mesh.nodes.get(this.mesh.selected);
    if (node) this.power(node.id, !node.on);
  }

  focusPlace() {
    if (this.mesh.selected !== null) byId("fly-x").select();
  }

  #show() {
    const node = this.mesh.nodes.get(this.mesh.selected);
    byId("node-none").hidden = Boolean(node);
    byId("node-details").hidden = !node;
    if (!node) return;
    const state = Mesh.stateOf(node);
    setText(byId("node-name"), `${node.role === 1 ? "Gateway" : "Router"} ${node.id}`);
    setText(byId("node-state"), node.trouble || words(node));
    byId("node-state").dataset.severity = SEVERITY[state];
    setText(byId("power"), node.on ? "Switch off" : "Switch on");
    this.#facts(node);
  }

  #facts(node) {
    const facts = [
      ["Gateway", orDash(node.gateway)],
      ["Hops", orDash(node.hops)],
      ["Would fly to the place of", node.place === 255 ? "–" : [node.place]],
      ["Known nodes", String(node.known)],
      ["Messages sent", String(node.sent)],
      ["Position", node.at ? node.at.map((m) => m.toFixed(2)).join(", ") : "–"],
      ["Route", node.route.length ? node.route : "–", " › ", true],
      ["Neighbours, seconds since last heard", this.#neighbours(node), ", ", true],
    ];
    const list = byId("node-facts");
    const shown = JSON.stringify(facts);
    if (list.dataset.shown === shown) return;
    list.dataset.shown = shown;
    list.replaceChildren(...facts.map(([name, value, glue, wide]) => this.#fact(name, value, glue, wide)));
  }

  #neighbours(node) {
    if (!node.ids.length) return "–";
    const ages = new Map(this.mesh.detail?.node === node.id ? this.mesh.detail.neighbours : []);
    return node.ids.map((id) => (ages.has(id) ? [id, ages.get(id)] : id));
  }

  /** A value is a text, or a list of ids, or of [id, age]: ids become links. */
  #fact(name, value, glue, wide) {
    const box = document.createElement("div");
    if (wide) box.className = "wide";
    const dt = document.createElement("dt");
    dt.textContent = name;
    const dd = document.createElement("dd");
    if (typeof value === "string") dd.textContent = value;
    else {
      value.forEach((item, index) => {
        const [id, age] = [item].flat();
        if (index) dd.append(glue);
        dd.append(idLink(this.mesh, id));
        if (age !== undefined) dd.append(` (${age === 255 ? "255+" : age})`);
      });
    }
    box.append(dt, dd);
    return box;
  }

  #fillPlace() {
    const node = this.mesh.nodes.get(this.mesh.selected);
    const place = node?.path.length ? node.path.slice(-3) : node?.at;
    ["x", "y", "z"].forEach((axis, index) => {
      byId(`fly-${axis}`).value = place ? String(index < 2 ? Number(place[index].toFixed(1)) : Math.round(place[index])) : "";
    });
  }

  #send(event) {
    event.preventDefault();
    const place = ["x", "y", "z"].map((axis) => Number(byId(`fly-${axis}`).value.trim().replace(",", ".") || NaN));
    this.fly(this.mesh.selected, ...place);
  }
}

/** A button that chooses this node. */
export function idLink(mesh, id) {
  const link = document.createElement("button");
  link.type = "button";
  link.className = "id-link";
  link.textContent = id;
  link.addEventListener("click", () => mesh.select(id));
  return link;
}

function byId(id) {
  return document.getElementById(id);
}

function setText(element, text) {
  if (element.textContent !== text) element.textContent = text;
}
