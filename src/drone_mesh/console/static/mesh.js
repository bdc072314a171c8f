// What the page knows about the mesh. Frames of the server are applied here; views listen.
// Conditions, colours and uses of links are decided by the server.

export const UNKNOWN = 255; // NO_ROUTE of the mesh
const TRAIL_STEP_M = 0.5;
const TRAIL_PLACES = 60;
const LINK_USES = ["known", "lost", "route", "soon"]; // in the order in which they are drawn

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
    this.actions = []; // what the server offers: "fly", "power", ...
    this.packetKinds = []; // the names of the kinds of packets, each with a colour of the palette
    // Of goals, m; of the lists that are kept.
    this.limits = { coordinate: Infinity, height: Infinity, events: Infinity, samples: Infinity };
    this.nodes = new Map(); // id -> node
    this.obstacles = []; // {corners: [[x, y]], top}, m
    this.fence = []; // {name, inside, low, high, rings: [[[x, y]]]}, m; low and high may be null
    this.trails = new Map(); // id -> its last positions [x, y], m, one for every TRAIL_STEP_M
    // use -> [[id, higher id]]; of relief: who comes, and whom it relieves
    this.links = { known: [], lost: [], route: [], soon: [], relief: [] };
    this.events = [];
    this.samples = [];
    this.story = {}; // of a demonstration: {running, steps: [{t, text}], wait: {left, of}, cast: [id], places: [[x, y, z]]}
    this.alarms = []; // [{text, nodes, since, over, acknowledged}]
    this.demo = "repair"; // what the button shows
    this.recording = ""; // its name, if the console shows one
    this.timeline = {}; // {start, end, now, live, paused, factor, packets} of the recorded time
    this.map = null; // {url, min_zoom, max_zoom, credit, bounds} of the map under the drones
    this.marks = []; // on the time line: [{t, kind, node}]
    this.hasPresent = false; // whether there is a present to return to
    this.selected = null;
    this.group = new Set(); // of several selected nodes
    this.detail = null; // {node, neighbours: [[id, age]], fallback_age} of the selected node
  }

  apply(frame) {
    if (frame.full) {
      this.nodes.clear();
      this.trails.clear();
      this.events = [];
      this.samples = [];
      this.story = {};
      this.alarms = [];
    }
    if (frame.full || frame.obstacles) this.obstacles = frame.obstacles ?? [];
    if (frame.full || frame.fence) this.fence = frame.fence ?? [];
    this.clock = frame.clock;
    this.link = frame.link;
    const changed = new Set();
    let linksChanged = frame.full;
    for (const id of frame.gone ?? []) {
      this.nodes.delete(id);
      this.trails.delete(id);
      linksChanged = true;
    }
    for (const [key, fields] of Object.entries(frame.nodes ?? {})) {
      const id = Number(key);
      const node = this.nodes.get(id) ?? { id };
      Object.assign(node, fields);
      if (LINK_USES.some((use) => `${use}_links` in fields)) linksChanged = true;
      this.nodes.set(id, node);
      if ("position" in fields) this.#trail(node);
      changed.add(id);
    }
    if (linksChanged) this.#relink();
    this.links.relief = [...this.nodes.values()]
      .filter(({ relieves }) => this.nodes.has(relieves))
      .map(({ id, relieves }) => [id, relieves]);
    if (frame.events) this.events = this.events.concat(frame.events).slice(-this.limits.events);
    if (frame.samples)
      this.samples = this.samples.concat(frame.samples).slice(-this.limits.samples);
    if (frame.alarms) this.alarms = frame.alarms;
    if (frame.story) this.story = frame.story;
    if (frame.full || frame.story) this.#notify("story");
    for (const id of this.group) if (!this.nodes.has(id)) this.group.delete(id);
    if (this.selected !== null && !this.nodes.has(this.selected)) this.select(null);
    this.#notify("frame", {
      changed,
      full: frame.full,
      gone: frame.gone ?? [],
      events: frame.events ?? [],
      samples: frame.samples ?? [],
    });
  }

  #trail(node) {
    if (!node.position) return;
    const trail = this.trails.get(node.id) ?? [];
    const last = trail.at(-1);
    const [x, y] = node.position;
    if (last && Math.hypot(x - last[0], y - last[1]) < TRAIL_STEP_M) return;
    this.trails.set(node.id, [...trail, [x, y]].slice(-TRAIL_PLACES));
  }

  applyDetail(detail) {
    this.detail = detail;
    this.#notify("detail");
  }

  /** The origin on the earth, [latitude, longitude, altitude]; null: there is none. */
  get origin() {
    return this.clock.origin ?? null;
  }

  /** Whether the page shows a mesh that takes orders. */
  get canOrder() {
    return !this.recording && this.timeline.live !== false;
  }

  applyTimeLine(timeline) {
    this.timeline = timeline;
    if (timeline.live) this.hasPresent = true;
    this.#notify("timeline");
  }

  applyMarks({ marks }) {
    this.marks = marks;
    this.#notify("marks");
  }

  applyPackets(packets) {
    this.#notify("packets", packets);
  }

  applyHello({ layouts, limits, actions, recording, demo, packet_kinds: packetKinds, map }) {
    this.map = map;
    this.demo = demo;
    this.packetKinds = packetKinds;
    this.recording = recording;
    this.actions = actions;
    this.layouts = layouts;
    this.limits = limits;
    this.#notify("layouts");
  }

  select(id, keepGroup = false) {
    const hadGroup = !keepGroup && this.group.size > 0 && !this.group.has(id);
    if (hadGroup) this.group.clear();
    if (id === this.selected) {
      if (hadGroup) this.#notify("select");
      return;
    }
    this.selected = id;
    this.detail = null;
    this.#notify("select");
  }

  /** Adds a node to the group or removes it; the node selected before joins the group. */
  toggle(id) {
    if (!this.group.size && this.selected !== null) this.group.add(this.selected);
    if (!this.group.delete(id)) this.group.add(id);
    this.select(this.group.size ? [...this.group].at(-1) : null, true);
    this.#notify("select");
  }

  /** Selects these nodes and no others. */
  selectGroup(ids) {
    this.group = new Set(ids.length > 1 ? ids : []);
    this.select(ids.at(-1) ?? null, true);
    this.#notify("select");
  }

  /** Selects the next or previous node by id, and wraps around. */
  selectNext(step) {
    const ids = [...this.nodes.keys()].sort((a, b) => a - b);
    if (!ids.length) return;
    const at = ids.indexOf(this.selected);
    this.select(
      ids[at < 0 ? (step > 0 ? 0 : ids.length - 1) : (at + step + ids.length) % ids.length],
    );
  }

  #relink() {
    for (const use of LINK_USES) {
      this.links[use] = [];
      for (const node of this.nodes.values()) {
        for (const other of idsOf(node[`${use}_links`])) this.links[use].push([node.id, other]);
      }
    }
  }

  #notify(what, detail) {
    this.dispatchEvent(new CustomEvent(what, { detail }));
  }
}

/** Where a drone flies to, or where it is, [x, y, z] in metres; null: unknown. */
export function goalOf({ path, position }) {
  return path.length ? path.slice(-3) : position;
}

/** The charge of its battery and how long it can hover, such as 63 %, 8:25; empty: unknown. */
export function batteryOf({ battery = null, time_left: left = null }, glue = ", ") {
  if (battery === null) return "";
  const minutes = `${Math.floor(left / 60)}:${String(left % 60).padStart(2, "0")}`;
  return left === null ? `${battery} %` : `${battery} %${glue}${minutes}`;
}

/** A number as text; 255 means unknown. */
export function orDash(value) {
  return value === UNKNOWN || value === undefined ? "–" : String(value);
}
