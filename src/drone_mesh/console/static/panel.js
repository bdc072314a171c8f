// The selected node: its facts, its power switch, and where to send its drone.

import { arrowKeys } from "./arrows.js";
import { inDegrees, toEarth, toFrame } from "./earth.js";
import { batteryOf, goalOf, orDash, UNKNOWN } from "./mesh.js";
import { typedNumber } from "./numbers.js";

export class NodePanel {
  /** `power(id, on)` and `fly(id, x, y, z)` carry out the orders of the buttons. */
  constructor(mesh, power, fly) {
    this.mesh = mesh;
    this.power = power;
    this.fly = fly;
    this.typed = new Set(); // fields of the goal that the user filled in
    this.sentFrom = null; // the place in the other fields when the goal was sent
    for (const what of ["frame", "select", "detail"])
      mesh.addEventListener(what, () => this.#show());
    mesh.addEventListener("select", () => this.#emptyGoal());
    mesh.addEventListener("frame", () => this.#fillGoal());
    byId("power").addEventListener("click", () => this.switchPower());
    byId("node-close").addEventListener("click", () => mesh.select(null));
    byId("fly-form").addEventListener("submit", (event) => this.#send(event));
    byId("fly-form").addEventListener("input", (event) => this.typed.add(event.target));
    byId("degrees").addEventListener("change", () => {
      this.#show();
      this.#emptyGoal();
    });
  }

  /** The origin, if the user wants degrees and there is one. */
  get #origin() {
    return byId("degrees").checked ? this.mesh.origin : null;
  }

  switchPower() {
    const node = this.mesh.nodes.get(this.mesh.selected);
    if (node) this.power(node.id, !node.on);
  }

  focusGoal() {
    if (this.mesh.selected !== null) byId("fly-x").select();
  }

  #show() {
    const node = this.mesh.nodes.get(this.mesh.selected);
    byId("node-none").hidden = Boolean(node);
    byId("node-details").hidden = !node;
    if (!node) return;
    setText(byId("node-name"), `${node.role === 1 ? "Gateway" : "Router"} ${node.id}`);
    setText(byId("node-condition"), node.trouble || node.condition);
    byId("node-condition").title = node.trouble || node.condition;
    byId("node-condition").dataset.colour = node.colour;
    byId("node-condition").dataset.severity = node.trouble ? node.severity : "";
    setText(byId("power"), node.on ? "Switch off" : "Switch on");
    this.#facts(node);
  }

  #facts(node) {
    const neighbours = this.#neighbours(node);
    const earth = this.#earth(node);
    const coming = [...this.mesh.nodes.values()].find(({ relieves }) => relieves === node.id);
    const facts = [
      ...(node.repair ? [["Repair", node.repair, { wide: true }]] : []),
      ...(node.mission ? [["Mission", node.mission, { wide: true }]] : []),
      ...(node.order ? [["Latest order", node.order, { wide: true }]] : []),
      ...(node.since ? [["Since then", node.since, { wide: true }]] : []),
      [node.condition === "connected" ? "Gateway" : "Last gateway", orDash(node.gateway)],
      ["Hops", orDash(node.hops)],
      [
        "Fallback position",
        node.fallback === UNKNOWN ? "–" : [node.fallback],
        { before: "node ", after: `’s${this.#fallbackAge(node)}` },
      ],
      ...(batteryOf(node) ? [["Battery, minutes left", batteryOf(node)]] : []),
      ...(node.home?.length ? [["Pad", placeOf(node.home, node.pad), { wide: true }]] : []),
      ...((node.relieves ?? null) === null ? [] : [["Relieves", [node.relieves]]]),
      ...(coming
        ? [["Relieved by", [coming.id], { after: coming.path.length ? ", on its way" : "" }]]
        : []),
      ...(node.why_not_fly ? [["Cannot fly", node.why_not_fly]] : []),
      ["Known nodes", String(node.known_nodes ?? "–")],
      ["Messages sent", String(node.total_messages ?? "–")],
      ["Position", node.position ? node.position.map((m) => m.toFixed(2)).join(", ") : "–"],
      ...(node.channel ? [["Radio channel", node.channel, { wide: true }]] : []),
      ...(node.data ? [["Users’ data", node.data, { wide: true }]] : []),
      ...(earth ? [["Latitude, longitude, altitude", earth, { wide: true }]] : []),
      ...(node.drone ? [["Drone", node.drone, { wide: true }]] : []),
      ["Route", node.route.length ? node.route : "–", { glue: " › ", wide: true }],
      [
        Number(neighbours) ? "Neighbours" : "Neighbours, seconds since last heard",
        neighbours,
        { glue: ", ", wide: true },
      ],
    ];
    const list = byId("node-facts");
    const shown = JSON.stringify(facts);
    if (list.dataset.shown === shown) return;
    list.dataset.shown = shown;
    const [row, id] = this.#focused(list);
    list.replaceChildren(
      ...facts.map(([name, value, options]) => this.#fact(name, value, options)),
    );
    if (row >= 0) this.#linkIn(list.children[row], id)?.focus();
  }

  /** [row, id] of the link in the list that has the focus, so that a new list can restore it. */
  #focused(list) {
    const link = document.activeElement;
    return [[...list.children].findIndex((box) => box.contains(link)), link?.textContent];
  }

  #linkIn(box, id) {
    const links = [...box.querySelectorAll(".id-link")];
    return links.find((link) => link.textContent === id) ?? links[0];
  }

  #neighbours(node) {
    if (!node.neighbours) return "–";
    if (this.mesh.detail?.node !== node.id) return "…";
    const known = this.mesh.detail.neighbours;
    return known.length ? known : String(node.neighbours); // a real node reports their number
  }

  #fallbackAge(node) {
    const { node: id, fallback_age: age } = this.mesh.detail ?? {};
    return id === node.id && (age ?? null) !== null ? `, reported ${age} s ago` : "";
  }

  #earth({ earth, position }) {
    if (!earth) return position && this.#origin ? inDegrees(this.#origin, position) : "";
    const [latitude, longitude, altitude] = earth; // as its autopilot says
    return `${latitude.toFixed(6)}°, ${longitude.toFixed(6)}°, ${altitude.toFixed(1)} m`;
  }

  /** `value` is a text, a list of ids, or a list of [id, age]; ids become buttons that select the node. */
  #fact(name, value, { glue = "", before = "", after = "", wide = false } = {}) {
    const box = document.createElement("div");
    if (wide) box.className = "wide";
    const dt = document.createElement("dt");
    dt.textContent = name;
    const dd = document.createElement("dd");
    if (typeof value === "string") dd.textContent = value;
    else {
      dd.append(before);
      value.forEach((item, index) => {
        const [id, age] = [item].flat();
        if (index) dd.append(glue);
        dd.append(idLink(this.mesh, id, index ? -1 : 0));
        if (age !== undefined) dd.append(` (${age === 255 ? "255+" : age})`);
      });
      dd.append(after);
    }
    arrowKeys(dd, ".id-link");
    box.append(dt, dd);
    return box;
  }

  #emptyGoal() {
    this.typed.clear();
    this.sentFrom = null;
    setText(byId("fly-error"), "");
    const names = this.#origin ? ["latitude", "longitude"] : ["x", "y"];
    byId("fly-form").toggleAttribute("data-degrees", Boolean(this.#origin));
    names.forEach((name, index) =>
      setText(byId(`fly-${"xy"[index]}`).previousElementSibling, name),
    );
    for (const input of byId("fly-form").querySelectorAll("input"))
      input.removeAttribute("aria-invalid");
    this.#fillGoal();
  }

  /** The fields that nobody typed in show where the drone is now, or where it flies to. */
  #fillGoal() {
    const node = this.mesh.nodes.get(this.mesh.selected);
    const goal = node && goalOf(node);
    const place = String(goal);
    if (this.sentFrom !== null && place !== this.sentFrom) {
      this.typed.clear(); // it flies
      this.sentFrom = null;
    }
    const origin = this.#origin;
    const texts = origin
      ? toEarth(origin, ...(goal ?? [0, 0])).map((angle) => angle.toFixed(6))
      : goal?.slice(0, 2).map((value) => String(Number(value.toFixed(1))));
    ["x", "y", "z"].forEach((axis, index) => {
      const input = byId(`fly-${axis}`);
      const text = goal ? (texts[index] ?? String(Math.round(goal[index]))) : "";
      if (this.typed.has(input) || input.value === text) return;
      input.value = text;
      if (document.activeElement === input) input.select(); // what is typed next replaces it
    });
  }

  #send(event) {
    event.preventDefault();
    const { coordinate, height } = this.mesh.limits;
    const origin = this.#origin;
    const [x, y] = [byId("fly-x"), byId("fly-y")];
    const goal = [
      origin ? typedNumber(x, "latitude", -90, 90) : typedNumber(x, "x", -coordinate, coordinate),
      origin
        ? typedNumber(y, "longitude", -180, 180)
        : typedNumber(y, "y", -coordinate, coordinate),
      typedNumber(byId("fly-z"), "z", 0, height, true),
    ];
    const wrong = goal.find((entry) => entry.error);
    const [first, second, z] = goal.map((entry) => entry.value);
    const place = origin && !wrong ? toFrame(origin, first, second) : [first, second];
    const far = !wrong && place.some((value) => Math.abs(value) > coordinate);
    const farText = `more than ${coordinate} m east or north of the origin, west or south of it`;
    setText(byId("fly-error"), wrong?.error ?? (far ? farText : ""));
    if (wrong || far) (wrong?.input ?? x).select();
    else {
      const node = this.mesh.nodes.get(this.mesh.selected);
      this.sentFrom = String(goalOf(node));
      this.fly(node.id, ...place, z);
    }
  }
}

function placeOf([x, y], words) {
  return [`x ${x.toFixed(1)}, y ${y.toFixed(1)} m`, words].filter(Boolean).join("; ");
}

/** A button that selects this node. `tabIndex` -1: only the arrow keys reach it. */
export function idLink(mesh, id, tabIndex = 0) {
  const link = document.createElement("button");
  link.type = "button";
  link.className = "id-link";
  link.textContent = id;
  link.tabIndex = tabIndex;
  link.setAttribute("aria-label", `node ${id}`);
  link.addEventListener("click", () => mesh.select(id));
  return link;
}

const IDS_SHOWN = 8;

/** These nodes as buttons that select them: the first few, and how many more. */
export function idLinks(mesh, ids) {
  const shown = ids.slice(0, IDS_SHOWN).flatMap((id, at) => [at ? ", " : "", idLink(mesh, id, -1)]);
  return ids.length > IDS_SHOWN ? [...shown, ` and ${ids.length - IDS_SHOWN} more`] : shown;
}

function byId(id) {
  return document.getElementById(id);
}

function setText(element, text) {
  if (element.textContent !== text) element.textContent = text;
}
