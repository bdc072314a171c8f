// Packets as dots that run along their links, on a canvas of its own above the map.
// They are real packets: the server sends a sample of what the air carried.

import { onScreen } from "./draw.js";

const RUN_MS = 700; // a packet takes 2 ms, which cannot be seen
const START_MS = 300; // from a packet's arrival to the start of its dot: each sample has reached the page by then
const MOST_DOTS = 600;
const FRAME_MS = 33;

export class PacketDots {
  #dots = []; // {from, to, kind, start}: ids, and the time in ms at which the dot starts
  #asked = false;
  #drawn = 0;
  #frame = null;

  /** `card` holds the map and its legend; `map` is its view; `connection` delivers the packets. */
  constructor(mesh, map, connection, card) {
    this.mesh = mesh;
    this.map = map;
    this.connection = connection;
    this.canvas = card.querySelector("#packets");
    this.box = card.querySelector("#show-packets");
    this.share = card.querySelector("#packets-share");
    this.legend = card.querySelector("#packets-legend");
    this.box.checked = !matchMedia("(prefers-reduced-motion: reduce)").matches;
    this.themeChanged();
    mesh.addEventListener("layouts", () => this.#listKinds());
    mesh.addEventListener("packets", (event) => this.#take(event.detail));
    for (const what of ["timeline", "layouts"]) mesh.addEventListener(what, () => this.#ask());
    this.box.addEventListener("change", () => this.#ask());
    document.addEventListener("visibilitychange", () => this.#ask());
    connection.addEventListener("change", () => {
      this.#asked = false; // the request was for the previous connection
      this.#ask();
    });
  }

  themeChanged() {
    const style = getComputedStyle(document.documentElement);
    const colour = (name) => style.getPropertyValue(`--${name}`).trim();
    this.edge = colour("card");
    const kinds = this.mesh.packetKinds;
    this.colours = Object.fromEntries(kinds.map((kind) => [kind, colour(`packet-${kind}`)]));
  }

  #listKinds() {
    this.legend.replaceChildren(...this.mesh.packetKinds.map(legendEntry), this.share);
    this.themeChanged();
  }

  /** Packets are sampled only while a page shows them. */
  #ask() {
    const { canOrder, timeline, actions } = this.mesh;
    const offered = actions.includes("packets") && (canOrder || timeline.packets);
    this.box.parentElement.hidden = !offered;
    const shown = this.box.checked && offered;
    document.body.toggleAttribute("data-packets", shown);
    const on = shown && !document.hidden;
    if (!on) this.#dots = [];
    if (on === this.#asked || !this.connection.open) return;
    this.#asked = on;
    this.connection.ask({ do: "packets", on });
  }

  #take({ carried, dots }) {
    if (!this.#asked) return;
    const now = performance.now();
    for (const [from, to, kind, age] of dots)
      this.#dots.push({ from, to, kind, start: now + START_MS - Math.min(START_MS, 1000 * age) });
    this.#dots = this.#dots.slice(-MOST_DOTS);
    const each = Math.round(carried / dots.length);
    const text = each > 1 ? `1 of ${each} shown` : "";
    if (this.share.textContent !== text) this.share.textContent = text;
    this.canvas.dataset.carried = Number(this.canvas.dataset.carried ?? 0) + carried;
    if (this.#frame === null) this.#frame = requestAnimationFrame((time) => this.#draw(time));
  }

  #draw(now) {
    this.#frame = null;
    this.#dots = this.#dots.filter((dot) => now < dot.start + RUN_MS);
    const { width, height } = this.map.camera;
    const ratio = window.devicePixelRatio;
    this.canvas.width = Math.round(width * ratio); // this clears it, too
    this.canvas.height = Math.round(height * ratio);
    const context = this.canvas.getContext("2d");
    context.scale(ratio, ratio);
    const size = Math.min(4.5, Math.max(2.2, this.map.radius * 0.33));
    for (const dot of this.#dots)
      if (now >= dot.start) this.#drawDot(context, dot, (now - dot.start) / RUN_MS, size);
    this.canvas.dataset.drawn = this.#drawn;
    if (!this.#dots.length) return;
    this.#frame = setTimeout(() => {
      this.#frame = requestAnimationFrame((time) => this.#draw(time));
    }, FRAME_MS);
  }

  #drawDot(context, { from, to, kind }, share, size) {
    const [a, b] = [this.mesh.nodes.get(from), this.mesh.nodes.get(to)];
    if (!a?.position || !b?.position) return;
    const { camera, radius } = this.map;
    const [ax, ay] = onScreen(camera, a, radius);
    const [bx, by] = onScreen(camera, b, radius);
    context.beginPath();
    context.arc(ax + share * (bx - ax), ay + share * (by - ay), size, 0, 2 * Math.PI);
    context.fillStyle = this.colours[kind];
    context.fill();
    context.strokeStyle = this.edge;
    context.lineWidth = 1;
    context.stroke();
    this.#drawn++;
  }
}

function legendEntry(kind) {
  const entry = document.createElement("li");
  const dot = document.createElement("i");
  dot.className = "dot packet";
  dot.style.background = `var(--packet-${kind})`;
  entry.append(dot, kind);
  return entry;
}
