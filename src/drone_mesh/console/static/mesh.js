// What the page knows about the mesh. Frames of the server are applied here; views listen.

const UNKNOWN = 255;
const JUST_LOST_MS = 6000;
const EVENTS_KEPT = 1000;
const SAMPLES_KEPT = 600;

/** Numbers of the set bits of a hex string, ascending. */
function idsOf(hex) {
  const ids = [];
  for (let i = hex.length - 1, base = 0; i >= 0; i--, base += 4) {
    const digit = parseInt(hex[i], 16);
    for (let bit = 0; bit < 4; bit++) if (digit & (1 << bit)) ids.push(base + bit);
  }
  return ids;
}

export class Mesh extends EventTarget {
  constructor() {
    super();
    this.clock = {};
    this.link = "";
    this.layouts = [];
    this.nodes = new Map(); // id -> node
    this.links = new Map(); // a * 256 + b with a < b -> [a, b]
    this.lost = new Map(); // the same key -> when it was lost, ms
    this.events = [];
    this.samples = [];
    this.selected = null;
    this.detail = null; // {node, neighbours: [[id, age]]} of the selected node
  }

  apply(frame) {
    if (frame.full) {
      this.nodes.clear();
      this.events = [];
      this.samples = [];
    }
    this.clock = frame.clock;
    this.link = frame.link;
    const changed = new Set();
    let linksChanged = frame.full;
    for (const id of frame.gone ?? []) {
      this.nodes.delete(id);
      linksChanged = true;
    }
    for (const [key, fields] of Object.entries(frame.nodes ?? {})) {
      const id = Number(key);
      const node = this.nodes.get(id) ?? { id };
      Object.assign(node, fields);
      if ("neighbours" in fields) node.ids = idsOf(fields.neighbours);
      if ("neighbours" in fields || "on" in fields) linksChanged = true;
      this.nodes.set(id, node);
      changed.add(id);
    }
    if (linksChanged) this.#relink(frame.full);
    if (frame.events) this.events = this.events.concat(frame.events).slice(-EVENTS_KEPT);
    if (frame.samples) this.samples = this.samples.concat(frame.samples).slice(-SAMPLES_KEPT);
    if (this.selected !== null && !this.nodes.has(this.selected)) this.select(null);
    this.#tell("frame", { changed, full: frame.full, gone: frame.gone ?? [], events: frame.events ?? [], samples: frame.samples ?? [] });
  }

  applyDetail(detail) {
    this.detail = detail;
    this.#tell("detail");
  }

  setLayouts(layouts) {
    this.layouts = layouts;
    this.#tell("layouts");
  }

  select(id) {
    if (id === this.selected) return;
    this.selected = id;
    this.detail = null;
    this.#tell("select");
  }

  /** Steps through the nodes by id, round and round. */
  selectNext(step) {
    const ids = [...this.nodes.keys()].sort((a, b) => a - b);
    if (!ids.length) return;
    const at = ids.indexOf(this.selected);
    this.select(ids[at < 0 ? (step > 0 ? 0 : ids.length - 1) : (at + step + ids.length) % ids.length]);
  }

  /** gateway, connected, lost, flying, off or stale: what colours and words go by. */
  static stateOf(node) {
    if (node.severity === 3) return "stale";
    if (!node.on) return "off";
    if (node.path.length) return "flying";
    if (node.role === 1) return "gateway";
    return node.connected ? "connected" : "lost";
  }

  /** Pairs [node, next] that packets to a gateway take now. */
  ways() {
    const ways = [];
    for (const node of this.nodes.values()) {
      const next = this.nodes.get(node.next);
      if (node.role === 0 && node.on && node.connected && next?.on) ways.push([node, next]);
    }
    return ways;
  }

  /** Links that were there a moment ago, the long gone ones left out. */
  justLost() {
    const oldest = performance.now() - JUST_LOST_MS;
    for (const [key, at] of this.lost) if (at < oldest) this.lost.delete(key);
    return [...this.lost.keys()].map((key) => [key >> 8, key & 255]);
  }

  #relink(forget) {
    const links = new Map();
    for (const node of this.nodes.values()) {
      if (!node.on) continue;
      for (const other of node.ids) {
        if (!this.nodes.get(other)?.on) continue;
        const [a, b] = node.id < other ? [node.id, other] : [other, node.id];
        links.set(a * 256 + b, [a, b]);
      }
    }
    const now = performance.now();
    if (forget) this.lost.clear();
    else for (const key of this.links.keys()) if (!links.has(key)) this.lost.set(key, now);
    for (const key of this.lost.keys()) if (links.has(key)) this.lost.delete(key);
    this.links = links;
  }

  #tell(what, detail) {
    this.dispatchEvent(new CustomEvent(what, { detail }));
  }
}

/** A number of the wire for people: 255 means that it is not known. */
export function orDash(value) {
  return value === UNKNOWN || value === undefined ? "–" : String(value);
}
