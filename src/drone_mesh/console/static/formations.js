// Sends the selected drones into a line, a ring, a grid or a V, with a preview of who goes where.

import { typedNumber } from "./numbers.js";

const byId = (id) => document.getElementById(id);

// By shape: place k of n, [forward, right] in metres.
const SHAPES = {
  line: (k, n, s) => [0, (k - (n - 1) / 2) * s],
  ring: (k, n, s) => {
    const radius = n > 1 ? s / (2 * Math.sin(Math.PI / n)) : 0;
    const angle = (2 * Math.PI * k) / n;
    return [radius * Math.cos(angle), radius * Math.sin(angle)];
  },
  grid: (k, n, s) => {
    const columns = Math.ceil(Math.sqrt(n));
    return [-Math.floor(k / columns) * s, (k % columns) * s];
  },
  V: (k, _n, s) => {
    const arm = Math.ceil(k / 2) * s * Math.SQRT1_2;
    return [-arm, k % 2 ? arm : -arm];
  },
};

/**
 * Places [[x, y]] of a formation of `count` drones, `spacing` m apart, around the middle (x, y); it
 * points to `heading`, in degrees clockwise from y.
 */
export function placesOf(shape, count, spacing, [x, y], heading) {
  const offsets = Array.from({ length: count }, (_, k) => SHAPES[shape](k, count, spacing));
  const middle = (axis) =>
    (Math.max(...offsets.map((o) => o[axis])) + Math.min(...offsets.map((o) => o[axis]))) / 2;
  const [ahead, aside] = [middle(0), middle(1)];
  const turn = (heading * Math.PI) / 180;
  const [sin, cos] = [Math.sin(turn), Math.cos(turn)];
  return offsets.map(([forward, right]) => {
    const [f, r] = [forward - ahead, right - aside];
    return [x + f * sin + r * cos, y + f * cos - r * sin];
  });
}

/** Gives each drone {id, position} a place [x, y, z], the shortest ways first. */
export function assigned(drones, places) {
  const pairs = drones.flatMap(({ id, position }) =>
    places.map(([x, y], at) => ({
      id,
      at,
      way: position ? Math.hypot(x - position[0], y - position[1]) : Infinity,
    })),
  );
  const goals = new Map();
  const taken = new Set();
  for (const { id, at } of pairs.sort((a, b) => a.way - b.way || a.id - b.id)) {
    if (goals.has(id) || taken.has(at)) continue;
    goals.set(id, places[at]);
    taken.add(at);
  }
  return [...goals].map(([id, [x, y, z]]) => ({ id, x, y, z }));
}

/** The drones among these moves [{id, x, y, z}] that no chain of links would connect with a gateway. */
function outOfReach(mesh, moves) {
  const places = new Map();
  for (const node of mesh.nodes.values())
    if (node.on && node.position) places.set(node.id, node.position);
  for (const { id, x, y, z } of moves) places.set(id, [x, y, z]);
  const reached = new Set([...places.keys()].filter((id) => mesh.nodes.get(id).role === 1));
  const open = [...reached];
  while (open.length) {
    const from = places.get(open.pop());
    for (const [id, to] of places) {
      const far = Math.hypot(...from.map((value, axis) => value - to[axis]));
      if (reached.has(id) || far >= mesh.clock.range) continue;
      reached.add(id);
      open.push(id);
    }
  }
  return moves.map(({ id }) => id).filter((id) => !reached.has(id));
}

export class Formations {
  /** `hold(moves, what)` orders the flights. */
  constructor(mesh, map, hold) {
    this.mesh = mesh;
    this.map = map;
    this.hold = hold;
    this.form = byId("formation-form");
    this.middle = [0, 0];
    byId("group-formation").addEventListener("click", () =>
      this.open ? this.close() : this.#begin(),
    );
    byId("formation-close").addEventListener("click", () => this.close());
    this.form.addEventListener("input", () => this.#preview());
    this.form.addEventListener("submit", (event) => this.#send(event));
    mesh.addEventListener("select", () => this.open && this.#preview());
    mesh.addEventListener("timeline", () => mesh.canOrder || this.close());
  }

  get open() {
    return !this.form.hidden;
  }

  /** Closes the form; returns whether it was open. */
  close() {
    const { open } = this;
    if (open) this.#show(false);
    return open;
  }

  #begin() {
    const places = this.#drones().flatMap(({ position }) => (position ? [position] : []));
    const mean = (axis) => places.reduce((sum, at) => sum + at[axis], 0) / (places.length || 1);
    this.middle = [mean(0), mean(1)].map((value) => Number(value.toFixed(1)));
    byId("formation-spacing").value ||= String(Number((this.mesh.clock.range * 0.6).toFixed(1)));
    this.#show(true);
    this.#preview();
    byId("formation-shape").focus();
  }

  #show(open) {
    this.form.hidden = !open;
    document.body.toggleAttribute("data-adding", open);
    byId("group-formation").setAttribute("aria-pressed", open);
    this.map.choosePlace(open ? (x, y) => this.#place(x, y) : null);
    if (!open) this.map.showMoves([]);
  }

  #place(x, y) {
    this.middle = [x, y].map((value) => Number(value.toFixed(1)));
    this.#preview();
  }

  #drones() {
    return [...this.mesh.group].map((id) => this.mesh.nodes.get(id)).filter(Boolean);
  }

  /** What was typed: {shape, spacing, heading, height, error}. */
  #typed() {
    const { height: highest } = this.mesh.limits;
    const fields = [
      typedNumber(byId("formation-spacing"), "spacing", 0.5, 1000),
      typedNumber(byId("formation-heading"), "heading", -360, 360),
      typedNumber(byId("formation-height"), "height", 0, highest, true),
    ];
    const [spacing, heading, height] = fields.map((field) => field.value);
    const wrong = fields.find((field) => field.error);
    return { shape: byId("formation-shape").value, spacing, heading, height, wrong };
  }

  #moves({ shape, spacing, heading, height }) {
    const drones = this.#drones();
    const places = placesOf(shape, drones.length, spacing, this.middle, heading);
    return assigned(drones, places).map((move) => ({ ...move, z: height }));
  }

  #preview() {
    const typed = this.#typed();
    byId("formation-error").textContent = typed.wrong?.error ?? "";
    const moves = typed.wrong ? [] : this.#moves(typed);
    const lost = outOfReach(this.mesh, moves);
    this.map.showMoves(moves.map((move) => ({ ...move, lost: lost.includes(move.id) })));
    byId("formation-send").disabled = !moves.length;
    const ids = lost.slice(0, 8).join(", ") + (lost.length > 8 ? " …" : "");
    byId("formation-text").textContent =
      `${moves.length} drones around ${this.middle.join(", ")} m. ` +
      (lost.length ? `${lost.length} would have no route: ${ids}.` : "All would have a route.");
  }

  #send(event) {
    event.preventDefault();
    const typed = this.#typed();
    if (typed.wrong) return typed.wrong.input.select();
    const moves = this.#moves(typed);
    this.close();
    this.hold(moves, `${moves.length} drones: ${typed.shape}`);
  }
}
