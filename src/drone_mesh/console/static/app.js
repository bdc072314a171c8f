// Puts the page together: one mesh, one connection, and the views of it.

import { Alarms } from "./alarms.js";
import { Charts } from "./charts.js";
import { Connection } from "./connection.js";
import { chartsCsv, chartsPicture, nodesCsv, nodesPicture, placesYaml, save } from "./files.js";
import { Fences } from "./fences.js";
import { Fleet } from "./fleet.js";
import { assigned, Formations } from "./formations.js";
import { Groups } from "./groups.js";
import { Flights, names } from "./flights.js";
import { EventLog, isAbout, isNotable } from "./log.js";
import { keepFocus } from "./focus.js";
import { MapView } from "./map.js";
import { goalOf, Mesh } from "./mesh.js";
import { Missions } from "./missions.js";
import { PacketDots } from "./packets.js";
import { NodePanel } from "./panel.js";
import { Story } from "./story.js";
import { NodeTable } from "./table.js";
import { Tiles } from "./tiles.js";
import { TimeLine } from "./timeline.js";

const TOAST_MS = 5000;
const FAILURE_MS = 9000;
const MOST_TOASTS = 2;
const THEME_KEY = "drone-mesh-theme";
const DEGREES_KEY = "drone-mesh-degrees";

const byId = (id) => document.getElementById(id);
const mesh = new Mesh();
const connection = new Connection(mesh);

let undoLatest = null; // undoes the latest order, while its toast is shown

/** Shows a text briefly; with `undo`, a button beside it calls that function. */
function toast(text, bad, undo) {
  const box = document.createElement("div");
  box.className = bad ? "toast bad" : "toast";
  box.append(Object.assign(document.createElement("span"), { textContent: text }));
  const close = () => {
    box.remove();
    if (undoLatest === takeBack) undoLatest = null;
  };
  const takeBack = () => {
    close();
    undo();
  };
  if (undo) {
    const button = Object.assign(document.createElement("button"), { textContent: "Undo" });
    button.type = "button";
    button.title = "Undo (Z)";
    button.addEventListener("click", takeBack);
    box.append(button);
    undoLatest = takeBack;
  }
  while (byId("toasts").children.length >= MOST_TOASTS) byId("toasts").firstElementChild.remove();
  byId("toasts").append(box);
  setTimeout(close, bad ? FAILURE_MS : TOAST_MS);
}

/** Sends an order and shows its outcome; true if it was carried out. `button` is disabled until the answer; `undo` is the order that reverses this one. */
async function order(request, button, undo) {
  const hadFocus = button && document.activeElement === button;
  if (button) button.disabled = true;
  try {
    toast(await connection.order(request), false, undo && (() => order(undo, button)));
    return true;
  } catch (error) {
    toast(error.message, true);
    return false;
  } finally {
    if (button) button.disabled = false;
    if (hadFocus && document.activeElement === document.body) button.focus();
  }
}

keepFocus(() => {
  const map = byId("map");
  return map.checkVisibility() ? map : document.querySelector("nav [aria-current]");
});

const flights = new Flights(mesh, (request) => connection.request(request), toast);

/** The height of a drone's goal, or of the drone itself if it does not fly, in whole metres. */
function heightOf(id) {
  const node = mesh.nodes.get(id);
  return Math.round((node && goalOf(node)?.[2]) ?? 0);
}

const map = new MapView(mesh, byId("map-card"), (moves) =>
  flights.hold(moves.map((move) => ({ ...move, z: heightOf(move.id) }))),
);
flights.addEventListener("change", () => map.showHeld(flights.held));
const table = new NodeTable(mesh, byId("nodes"), byId("filter"), byId("only-problems"));
const panel = new NodePanel(
  mesh,
  (id, on) => {
    const power = { do: "power", node: id };
    order({ ...power, on }, byId("power"), { ...power, on: !on });
  },
  (id, x, y, z) => flights.hold([{ id, x, y, z }]),
);
const fleet = new Fleet(mesh, map, order);
const missions = new Missions(mesh, map, order);
const formations = new Formations(mesh, map, (moves, what) => flights.hold(moves, what));
const fences = new Fences(mesh, map, order);
const forms = { add: fleet, mission: missions, "group-formation": formations, fence: fences };
for (const [button, own] of Object.entries(forms))
  byId(button).addEventListener(
    "click",
    () => Object.values(forms).forEach((form) => form === own || form.close()),
    true, // first: one form at a time has the clicks on the map
  );
new Groups(mesh, () => table.shown, toast);

function lasso(on) {
  byId("lasso").setAttribute("aria-pressed", on);
  map.chooseLasso(on);
  return on;
}
byId("lasso").addEventListener("click", () => lasso(!map.lasso));
new Alarms(
  mesh,
  (text) => order({ do: "acknowledge", text }),
  () => showTab("events"),
);
connection.addEventListener("told", (event) => toast(event.detail, false));
const allNeighbours = byId("show-neighbours");
const log = new EventLog(mesh, byId("events"), (e) => allNeighbours.checked || isNotable(e));
allNeighbours.addEventListener("change", () => log.rebuild());
const isOfSelected = (event) => isNotable(event) && isAbout(mesh.selected, event);
const ofSelected = new EventLog(mesh, byId("node-events"), isOfSelected, 20);
mesh.addEventListener("select", () => ofSelected.rebuild());
const charts = new Charts(mesh);
const packets = new PacketDots(mesh, map, connection, byId("map-card"));
const tiles = new Tiles(mesh, map.camera, (text) => toast(text, true));
map.drawn = () => tiles.follow();
new TimeLine(mesh, (request) => connection.ask({ do: "time", ...request }));
new Story(
  mesh,
  (on) => order({ do: "demonstrate", on }),
  () =>
    connection
      .order({ do: "demonstrate", on: true, plan: true })
      .catch((error) => toast(error.message, true)),
);
mesh.addEventListener("story", () => map.setStage(mesh.story));

// The header

/** Writes a text only if it changed: a screen reader announces each write to a live region. */
function setText(id, text) {
  if (byId(id).textContent !== text) byId(id).textContent = text;
}

function showHead() {
  document.body.toggleAttribute("data-on-earth", Boolean(mesh.origin));
  const { t, achieved, factor, paused, summary, severity, routing, repair, layouts } = mesh.clock;
  if (t === undefined) return;
  setText(
    "clock",
    paused ? `${t.toFixed(1)} s, paused` : `${t.toFixed(1)} s, ${achieved.toFixed(1)}×`,
  );
  const isOld = Boolean(mesh.link) || connection.silent;
  setText("summary", isOld ? `last known: ${summary}` : summary);
  setText("standing", layouts.at(-1) ?? "");
  byId("standing").hidden = !layouts.length;
  byId("summary").dataset.severity = severity;
  const named = { Routing: routing, repair };
  const names = Object.entries(named).filter(([, name]) => name);
  setText("algorithms", names.map((pair) => pair.join(" ")).join(", "));
  setText("pause", paused ? "Resume" : "Pause");
  byId("pause").setAttribute("aria-pressed", paused);
  const speed = byId("speed");
  if (document.activeElement !== speed) {
    if (![...speed.options].some((option) => Number(option.value) === factor))
      speed.add(new Option(`${factor}×`, factor));
    speed.value = String(factor);
  }
}

const ACTING = "button.live, .live button, .live select, #power, #demonstrate, #fly-form button";
let wasLocked = false;

function showLink() {
  const seconds =
    connection.age < 10 ? Math.round(connection.age) : 10 * Math.floor(connection.age / 10); // read out less often
  const age = Number.isFinite(seconds) ? `, this is ${seconds} s old` : "";
  let text = mesh.link;
  if (!connection.open) text = `no connection to the console, trying again${age}`;
  else if (connection.silent && age) text = `the console is silent${age}`;
  setText("link", text);
  document.body.toggleAttribute("data-old", Boolean(text)); // what is shown is not the present
  const locked = connection.silent;
  if (document.body.toggleAttribute("data-locked", locked) !== wasLocked) {
    wasLocked = locked;
    for (const acting of document.querySelectorAll(ACTING))
      acting.setAttribute("aria-disabled", locked);
  }
  byId("link").dataset.severity = 2;
  byId("link").hidden = !text;
}

for (const [source, what] of [
  [mesh, "frame"],
  [connection, "change"],
])
  source.addEventListener(what, () => {
    showHead();
    showLink();
  });
mesh.addEventListener("layouts", () => {
  byId("layout").replaceChildren(...mesh.layouts.map(([number, name]) => new Option(name, number)));
  byId("layout-form").hidden = !mesh.layouts.length;
  const offers = (action) => mesh.actions.includes(action);
  byId("pause").hidden = byId("speed").parentElement.hidden = !offers("speed");
  byId("power").hidden = !offers("power");
  for (const action of ["demonstrate", "add", "remove", "mission", "fence"])
    byId(action).hidden = !offers(action);
});

// Orders

function setSpeed(paused, factor) {
  const before = { paused: Boolean(mesh.clock.paused), factor: mesh.clock.factor };
  order({ do: "speed", paused, factor }, null, { do: "speed", ...before });
}

/** The moves to these places [[id, x, y, z]], without drones that are not in this fleet. */
function movesTo(places) {
  return places
    .filter(([id]) => mesh.nodes.has(id))
    .map(([id, x, y, z]) => ({ id, x, y, z: Math.round(z) }));
}

/** Describes the drones of a layout, and how many of them are not in this fleet. */
function namesIn(layout, moves, places) {
  const missing = places.length - moves.length;
  return `${layout}: ${names(moves)}${missing ? ` (${missing} not in this fleet)` : ""}`;
}

byId("pause").addEventListener("click", () => setSpeed(!mesh.clock.paused, 0));
byId("speed").addEventListener("change", (event) => {
  setSpeed(Boolean(mesh.clock.paused), Number(event.target.value));
  event.target.blur();
});
byId("layout-form").addEventListener("submit", async (event) => {
  event.preventDefault();
  const number = Number(byId("layout").value);
  const [, , places] = mesh.layouts.find(([known]) => known === number);
  const moves = movesTo(places);
  const send = () => order({ do: "layout", case: number }, event.submitter);
  if (!moves.length) return send();
  const preview = { do: "preview", case: number };
  await flights.hold(moves, namesIn(`Layout ${number}`, moves, places), send, preview);
});

byId("load-places").addEventListener("change", async (event) => {
  const [file] = event.target.files;
  event.target.value = "";
  if (!file) return;
  byId("files").close();
  const most = mesh.limits.characters;
  if (file.size > most) return toast(`${file.name}: longer than ${most} characters`, true);
  try {
    const request = { do: "places", name: file.name, text: await file.text() };
    const { places, ways, speed, notes } = await connection.request(request);
    if (places.length) await flyTo(file.name, places);
    else flyAlong(file.name, ways, speed, notes);
  } catch (error) {
    toast(error.message, true);
  }
});

/** Orders these places [[id, x, y, z]]; those without an id go to the nearest drones of the group, or of all. */
async function flyTo(name, places) {
  const moves = movesTo(places);
  const numbered = new Set(places.map(([id]) => id));
  const free = places.filter(([id]) => id === null).map(([, ...place]) => place);
  const candidates = mesh.group.size ? [...mesh.group] : [...mesh.nodes.keys()];
  const drones = candidates
    .map((id) => mesh.nodes.get(id))
    .filter((node) => node.role === 0 && !numbered.has(node.id));
  moves.push(...assigned(drones, free).map((move) => ({ ...move, z: Math.round(move.z) })));
  if (!moves.length) return toast(`none of the drones in ${name} is in this fleet`, true);
  await flights.hold(moves, namesIn(name, moves, places));
}

/** Offers the only one of these ways [[x, y, z]] as a mission, at this speed if the file has one. */
function flyAlong(name, ways, speed, notes) {
  if (ways.length > 1) return toast(`${name} has ${ways.length} lines: keep the one to fly`, true);
  const mission = `${name} is a mission of one drone: a line, whose points are its waypoints`;
  if (!mesh.actions.includes("mission"))
    return toast(`${mission}. Missions cannot be flown from here`, true);
  toast(mission, false);
  fleet.close();
  fences.close();
  missions.open(ways[0], speed, notes);
}

// Several drones

function showGroup() {
  const ids = [...mesh.group].sort((a, b) => a - b);
  byId("group").hidden = ids.length < 2;
  setText(
    "group-count",
    `${ids.length} drones: ${ids.slice(0, 8).join(", ")}${ids[8] ? " …" : ""}`,
  );
}
mesh.addEventListener("select", showGroup);
mesh.addEventListener("frame", showGroup);

async function switchGroup(on, button) {
  button.disabled = true;
  await switchAll([...mesh.group], on);
  button.disabled = false;
}

/** The farthest from a gateway goes off first, so that those that wait keep their routes. */
async function switchAll(ids, on, canUndo = true) {
  const [changed, failed] = [[], []];
  const hops = (id) => mesh.nodes.get(id)?.hops ?? 0;
  for (const id of on ? ids : ids.sort((a, b) => hops(b) - hops(a))) {
    const was = mesh.nodes.get(id)?.on;
    await connection
      .order({ do: "power", node: id, on })
      .then(() => was !== on && changed.push(id))
      .catch((error) => failed.push(error.message));
  }
  const undo = canUndo && changed.length && (() => switchAll(changed.reverse(), !on, false));
  const done = ids.length - failed.length;
  if (failed.length) toast(failed[0], true);
  if (done) toast(`${done} nodes are ${on ? "on" : "off"}`, false, undo);
}
byId("group-off").addEventListener("click", (event) => switchGroup(false, event.target));
byId("group-on").addEventListener("click", (event) => switchGroup(true, event.target));
byId("group-clear").addEventListener("click", () => mesh.select(null));

// Files

const PLACES_CASE = 900; // the number of the layout in a saved file; arbitrary
byId("files-button").addEventListener("click", () => byId("files").showModal());
byId("save-nodes").addEventListener("click", () => save("nodes.csv", nodesCsv(mesh), "text/csv"));
byId("save-nodes-picture").addEventListener("click", async () =>
  save("nodes.png", await nodesPicture(mesh, charts.colours), "image/png"),
);
byId("save-charts").addEventListener("click", () =>
  save("charts.csv", chartsCsv(mesh), "text/csv"),
);
byId("save-charts-picture").addEventListener("click", async () => {
  const figures = [...document.querySelectorAll("#charts-card figure")];
  const shown = figures.filter((figure) => figure.querySelector("canvas").width);
  save("charts.png", await chartsPicture(shown, charts.colours), "image/png");
});
byId("save-places").addEventListener("click", () =>
  save("places.yaml", placesYaml(mesh, PLACES_CASE), "application/yaml"),
);

for (const button of document.querySelectorAll("[data-save]"))
  button.addEventListener("click", () => {
    const { live, now } = mesh.timeline;
    const moment = live === false ? `?t=${now}` : "";
    const link = document.createElement("a");
    link.href = `/earth/${button.dataset.save}${moment}`;
    link.download = button.dataset.save;
    link.click();
  });

// The view

byId("zoom-in").addEventListener("click", () => map.zoom(1.3));
byId("zoom-out").addEventListener("click", () => map.zoom(1 / 1.3));
byId("fit").addEventListener("click", () => map.fit());
byId("show-known").addEventListener("change", (event) =>
  map.setOption("known", event.target.checked),
);
byId("show-ranges").addEventListener("change", (event) =>
  map.setOption("ranges", event.target.checked),
);
byId("show-trails").addEventListener("change", (event) =>
  map.setOption("trails", event.target.checked),
);
byId("degrees").checked = localStorage.getItem(DEGREES_KEY) === "yes";
byId("degrees").addEventListener("change", (event) =>
  localStorage.setItem(DEGREES_KEY, event.target.checked ? "yes" : "no"),
);
byId("show-legend").checked = matchMedia("(min-width: 761px)").matches; // a phone has little room
byId("find-form").addEventListener("submit", (event) => {
  event.preventDefault();
  const text = byId("find").value.trim();
  const id = /^\d+$/.test(text) ? Number(text) : null;
  if (!mesh.nodes.has(id)) return toast(text ? `no node ${text}` : "type a node id", true);
  mesh.select(id);
  map.show(id);
  table.reveal(id);
  byId("find").value = "";
  byId("map").focus();
});
function follow(on) {
  byId("follow").checked = map.following = on;
  map.redraw();
}
byId("follow").addEventListener("change", (event) => follow(event.target.checked));
mesh.addEventListener("select", () => mesh.selected === null && follow(false));

/** What an address like #node=3&t=61.2 selects: a node and a moment, as numbers; null: none. */
function linked() {
  const words = new URLSearchParams(location.hash.slice(1));
  const of = (name) => (/^\d+(\.\d+)?$/.test(words.get(name)) ? Number(words.get(name)) : null);
  return { node: of("node"), t: of("t") };
}
let awaited = linked(); // what has not come yet

/** Seconds with two digits, never before `t`: rounded down it could show the state before. */
function upToCentis(t) {
  const rounded = Number(t.toFixed(2));
  return rounded < t ? Number((rounded + 0.01).toFixed(2)) : rounded;
}

/** The address of what the page shows: in the past, while it stands still, with the moment. */
function address(still = mesh.timeline.paused) {
  const { live, now } = mesh.timeline;
  const words = { node: mesh.selected, t: live === false && still ? upToCentis(now) : null };
  const named = Object.entries(words).filter(([, value]) => value !== null);
  return named.length ? `#${named.map((pair) => pair.join("=")).join("&")}` : location.pathname;
}

function showAddress() {
  if (awaited.node !== null || awaited.t !== null) return;
  const shown = location.hash || location.pathname;
  if (shown !== address()) history.replaceState(null, "", address());
}

function followLink() {
  const { node } = awaited;
  if (node !== null && mesh.nodes.has(node)) {
    awaited.node = null;
    mesh.select(node);
    map.show(node);
  }
  const { t } = awaited;
  const { start, end } = mesh.timeline;
  if (t !== null && start !== undefined) {
    awaited.t = null;
    if (start <= t && t <= upToCentis(end)) connection.ask({ do: "time", t, paused: true });
    else {
      const has = `${start.toFixed(1)} to ${end.toFixed(1)} s`;
      toast(`${t} s is not on the time line: it has ${has}`, true);
    }
  }
  showAddress();
}
window.addEventListener("hashchange", () => {
  awaited = linked();
  followLink();
});
for (const what of ["frame", "timeline"]) mesh.addEventListener(what, followLink);
mesh.addEventListener("select", () => {
  if (mesh.selected !== null) awaited.node = null; // whoever looks at another node has given it up
  followLink();
});

byId("time-link").addEventListener("click", async () => {
  const link = new URL(address(true), location.href).href;
  connection.ask({ do: "time", paused: true });
  const where = "to this moment is in the address bar";
  const copied = navigator.clipboard?.writeText(link).then(
    () => "to this moment was copied",
    () => where,
  );
  toast(`the link ${(await copied) ?? where}`, false);
});

byId("help-button").addEventListener("click", () => byId("help").showModal());

function showTab(name) {
  document.body.dataset.tab = name;
  for (const tab of document.querySelectorAll("nav button")) {
    if (tab.dataset.tab === name) tab.setAttribute("aria-current", "page");
    else tab.removeAttribute("aria-current");
  }
}
for (const tab of document.querySelectorAll("nav button"))
  tab.addEventListener("click", () => showTab(tab.dataset.tab));

const dark = matchMedia("(prefers-color-scheme: dark)");
function showTheme() {
  document.documentElement.dataset.theme =
    localStorage.getItem(THEME_KEY) ?? (dark.matches ? "dark" : "light");
  map.themeChanged();
  charts.themeChanged();
  packets.themeChanged();
}
dark.addEventListener("change", showTheme);
byId("theme").addEventListener("click", () => {
  localStorage.setItem(
    THEME_KEY,
    document.documentElement.dataset.theme === "dark" ? "light" : "dark",
  );
  showTheme();
});
showTheme();

/** Cancels the flight that is about to be ordered; if there is none, undoes the latest order. */
function undo() {
  return flights.undo() || undoLatest?.();
}

// Keys

const KEYS = {
  " ": () => byId(mesh.canOrder ? "pause" : "time-play").click(),
  n: () => mesh.selectNext(1),
  b: () => mesh.selectNext(-1),
  "/": () => byId("find").focus(),
  p: () => mesh.canOrder && panel.switchPower(),
  g: () => panel.focusGoal(),
  f: () => map.fit(),
  a: () => missions.close() || fences.close() || fleet.open(),
  m: () => fleet.close() || fences.close() || missions.open(),
  l: () => lasso(!map.lasso),
  Delete: () => fleet.remove(),
  z: () => undo(),
  "?": () => byId("help").showModal(),
  Escape: () =>
    map.cancelDrag() ||
    fleet.close() ||
    missions.close() ||
    formations.close() ||
    fences.close() ||
    flights.undo() ||
    (map.lasso && !lasso(false)) ||
    mesh.select(null),
};

document.addEventListener("keydown", (event) => {
  const typing = event.target.closest("input, select, dialog");
  const pressing = event.key === " " && event.target.closest("button");
  if (typing && event.key === "Escape" && !flights.undo()) event.target.blur();
  const undoing = event.key === "z" && (event.ctrlKey || event.metaKey) && !event.shiftKey;
  const chord = event.ctrlKey || event.metaKey || event.altKey;
  if (typing || pressing || (chord && !undoing)) return;
  const key = event.key.length === 1 ? event.key.toLowerCase() : event.key;
  if (!(key in KEYS)) return;
  event.preventDefault();
  KEYS[key]();
});
