// Draws one picture of the mesh on a canvas.

import { LOW_BATTERY } from "./groups.js";

const DIGIT_WIDTH = 0.7; // of a bold digit, as a share of its height
const SMALLEST_ID_PX = 8; // in a drone; a smaller id is drawn beside it
const LABEL_PX = 10; // of an id beside its drone, at most
const SMALLEST_LABEL_PX = 7;
const BETWEEN_LABELS_PX = 2;
const SHARE_OF_ROOM = 0.3; // radius of a drone, of the room that it has
const LEAST_ARMS_PX = 7; // smallest radius of a drone that is drawn with arms and rotors
const MOTORS = [
  [0.7, 0.7],
  [-0.7, 0.7],
  [-0.7, -0.7],
  [0.7, -0.7],
];
const MOTOR_AT = 1.2; // in radii of a drone, as the next two
const ROTOR = 0.45;
const HULL = 0.85;
const ROTOR_RAD_PER_S = 9; // a real one is a blur
const PAD = 1.6; // half an edge of a pad, in radii of a drone, and at most in m
const PAD_M = 0.8;
const MOST_LINKS = 4000; // known links; with more, which would be a grey blot, only those of the selected node are drawn

const MOST_LOST = 1500; // lost links drawn: the shortest ones, as in rviz
const CLEAR_LOST = 150; // lost links in full colour; with more, all of them fade so that drones stay visible
const FAINTEST = 0.25;
const MOST_GOAL_TEXTS = 8; // for drones that are about to leave; with more, the texts would overlap

/** The palette's colours in the current theme, by name. */
export function readColours() {
  const style = getComputedStyle(document.documentElement);
  const names = [
    "card",
    "ink",
    "muted",
    "accent",
    "grid",
    "gateway",
    "connected",
    "flying",
    "disconnected",
    "off",
    "silent",
    "crashed",
    "obstacle",
    "known-link",
    "lost-link",
    "route-link",
    "path",
  ];
  return Object.fromEntries(
    names.map((name) => [name, style.getPropertyValue(`--${name}`).trim()]),
  );
}

/** Radius of a drone, px: as large as the room between drones allows, never too small to see or to hit. */
export function droneRadius(camera, mesh) {
  const positions = [...mesh.nodes.values()]
    .filter((node) => node.position)
    .map((node) => node.position);
  if (!positions.length) return 4.5;
  const span = (axis) =>
    Math.max(...positions.map((at) => at[axis])) - Math.min(...positions.map((at) => at[axis])) + 1;
  const apart = Math.sqrt((span(0) * span(1)) / positions.length) * camera.scale;
  return Math.min(13, Math.max(4.5, apart * SHARE_OF_ROOM));
}

/** Whether a drone of this radius, px, is drawn with its arms and rotors. */
export function hasArms(shape, radius) {
  return shape !== "box" && radius >= LEAST_ARMS_PX;
}

/** Where a node is drawn, px: nodes at one position are fanned out around it. */
export function onScreen(camera, node, radius) {
  const [x, y] = camera.toScreen(node.position[0], node.position[1]);
  if (!node.slot) return [x, y];
  const [number, size] = node.slot;
  const angle = Math.PI / 2 - (2 * Math.PI * number) / size;
  const distance = (1.15 * radius) / Math.sin(Math.PI / size);
  return [x + distance * Math.cos(angle), y - distance * Math.sin(angle)];
}

/** Nodes in the order in which they are drawn: gateways above routers, the selected node on top. */
export function drawingOrder(mesh) {
  const rank = (node) => (node.id === mesh.selected ? 2 : node.role);
  return [...mesh.nodes.values()].sort((a, b) => rank(a) - rank(b) || a.id - b.id);
}

/**
 * Returns the counts {drones, links, linksDrawn, routeLinks, lostLinks} and the radius of drones, px; links are the known and the route links.
 * `goals` are [{id, x, y, lost}] of drones that are dragged or about to leave, in metres; `lost`: whether they would be out of
 * reach there, if that is known.
 */
export function drawMesh(context, camera, mesh, colours, options, goals) {
  context.clearRect(0, 0, camera.width, camera.height);
  context.lineCap = "round";
  drawGrid(context, camera, colours, options.top);
  for (const box of mesh.obstacles) drawObstacle(context, camera, box, colours);
  for (const area of mesh.fence) drawArea(context, camera, area, colours, options.top);
  const radius = droneRadius(camera, mesh);
  for (const node of mesh.nodes.values()) drawPad(context, camera, node, colours, radius);
  const selected = mesh.nodes.get(mesh.selected);
  if (options.ranges)
    for (const node of mesh.nodes.values()) drawRange(context, camera, mesh, node, colours, 0.35);
  else if (selected) drawRange(context, camera, mesh, selected, colours, 1);
  const drawn = {
    drones: 0,
    links: mesh.links.known.length + mesh.links.route.length,
    linksDrawn: 0,
    routeLinks: 0,
    lostLinks: 0,
    radius,
  };
  const ends = (links) => links.map(([a, b]) => [mesh.nodes.get(a), mesh.nodes.get(b)]);

  if (options.known) {
    const crowd = mesh.links.known.length > MOST_LINKS;
    const links = crowd
      ? mesh.links.known.filter((link) => link.includes(mesh.selected))
      : mesh.links.known;
    drawn.linksDrawn = drawLines(
      context,
      camera,
      radius,
      ends(links),
      colours["known-link"],
      1,
      [],
    );
  }
  const lost = shortest(ends(mesh.links.lost), MOST_LOST);
  context.globalAlpha = Math.max(FAINTEST, Math.min(1, CLEAR_LOST / lost.length));
  drawn.lostLinks = drawLines(context, camera, radius, lost, colours["lost-link"], 1.5, [5, 5]);
  context.globalAlpha = 1;
  const width = Math.min(3, Math.max(1, radius * 0.25));
  drawn.routeLinks = drawLines(
    context,
    camera,
    radius,
    ends(mesh.links.route),
    colours["route-link"],
    width,
    [],
  );
  drawn.linksDrawn += drawn.routeLinks;
  if (selected?.route.length > 1) {
    const stops = selected.route.map((id) => mesh.nodes.get(id));
    drawLines(
      context,
      camera,
      radius,
      stops.slice(1).map((stop, i) => [stops[i], stop]),
      colours.accent,
      4,
      [],
    );
  }
  drawLines(context, camera, radius, ends(mesh.links.soon), colours.flying, 2, [3, 4]);
  if (options.trails)
    for (const trail of mesh.trails.values()) drawTrail(context, camera, trail, colours);
  for (const node of mesh.nodes.values()) drawHeading(context, camera, node, colours, radius);
  for (const node of mesh.nodes.values()) drawPath(context, camera, node, colours, radius);
  drawLines(context, camera, radius, ends(mesh.links.relief), colours.accent, 3, [8, 5]);
  const drones = drawingOrder(mesh);
  const labelPx = labelSize([...mesh.nodes.keys()], radius);
  const draw = (some) => {
    for (const node of some) {
      const selected = node.id === mesh.selected || mesh.group.has(node.id);
      const { shape } = mesh.clock;
      drawn.drones += drawDrone(context, camera, node, selected, colours, radius, shape, labelPx);
    }
  };
  draw(drones.filter((node) => !options.cast.has(node.id)));
  if (options.cast.size) dim(context, camera, mesh, colours, radius, options.cast);
  draw(drones.filter((node) => options.cast.has(node.id)));
  for (const goal of goals) drawReach(context, camera, goal, mesh.clock.range, colours);
  for (const goal of goals)
    drawGoal(
      context,
      camera,
      mesh.nodes.get(goal.id),
      goal,
      colours,
      radius,
      goals.length <= MOST_GOAL_TEXTS,
    );
  return drawn;
}

/** Dims what is drawn, and draws the links and flights of these nodes above it. */
function dim(context, camera, mesh, colours, radius, ids) {
  context.globalAlpha = 0.75;
  context.fillStyle = colours.card;
  context.fillRect(0, 0, camera.width, camera.height);
  context.globalAlpha = 1;
  for (const [use, colour, width, dash] of [
    ["known", "known-link", 1, []],
    ["lost", "lost-link", 1.5, [5, 5]],
    ["route", "route-link", 3, []],
    ["relief", "accent", 3, [8, 5]],
  ]) {
    const links = mesh.links[use].filter(([a, b]) => ids.has(a) && ids.has(b));
    const ends = links.map(([a, b]) => [mesh.nodes.get(a), mesh.nodes.get(b)]);
    drawLines(context, camera, radius, ends, colours[colour], width, dash);
  }
  for (const id of ids) {
    const node = mesh.nodes.get(id);
    if (!node) continue;
    drawPad(context, camera, node, colours, radius);
    drawPath(context, camera, node, colours, radius);
  }
}

/** The lasso that the user draws, with these corners [x, y], px. */
export function drawLasso(context, corners, colours) {
  context.beginPath();
  for (const corner of corners) context.lineTo(...corner);
  context.closePath();
  context.strokeStyle = context.fillStyle = colours.accent;
  context.lineWidth = 2;
  context.setLineDash([6, 4]);
  context.stroke();
  context.setLineDash([]);
  context.globalAlpha = 0.12;
  context.fill();
  context.globalAlpha = 1;
}

/** A mark {x, y, ids, angle} at the edge: how many drones are outside there. */
export function drawMark(context, { x, y, ids, angle }, colours) {
  context.save();
  context.translate(x, y);
  context.fillStyle = colours.accent;
  context.beginPath();
  context.arc(0, 0, 11, 0, 2 * Math.PI);
  context.fill();
  context.rotate(angle);
  context.beginPath();
  context.moveTo(15, 0);
  context.lineTo(9, -6);
  context.lineTo(9, 6);
  context.fill();
  context.restore();
  context.fillStyle = colours.card;
  context.font = "600 10px system-ui, sans-serif";
  context.textAlign = "center";
  context.textBaseline = "middle";
  context.fillText(ids.length, x, y + 0.5);
  context.textBaseline = "alphabetic";
}

/** The shortest of these [node, node] pairs, at most `most` of them. */
function shortest(pairs, most) {
  if (pairs.length <= most) return pairs;
  const length = ([a, b]) =>
    a?.position && b?.position
      ? Math.hypot(a.position[0] - b.position[0], a.position[1] - b.position[1])
      : Infinity;
  return pairs
    .map((pair) => [length(pair), pair])
    .sort((a, b) => a[0] - b[0])
    .slice(0, most)
    .map(([, pair]) => pair);
}

function drawGrid(context, camera, colours, top) {
  const step = niceStep(70 / camera.scale);
  const [left, high] = camera.toWorld(0, 0);
  const [right, low] = camera.toWorld(camera.width, camera.height);
  const across = multiples(step, left, right).map((x) => [x, camera.toScreen(x, 0)[0]]);
  const up = multiples(step, low, high).map((y) => [y, camera.toScreen(0, y)[1]]);
  context.strokeStyle = colours.grid;
  context.lineWidth = 1;
  context.setLineDash([]);
  context.beginPath();
  for (const [, px] of across) {
    context.moveTo(Math.round(px) + 0.5, 0);
    context.lineTo(Math.round(px) + 0.5, camera.height);
  }
  for (const [, py] of up) {
    context.moveTo(0, Math.round(py) + 0.5);
    context.lineTo(camera.width, Math.round(py) + 0.5);
  }
  context.stroke();
  context.font = "11px system-ui, sans-serif";
  context.fillStyle = colours.muted;
  context.strokeStyle = colours.card; // around a text, so that no line crosses it
  context.lineWidth = 4;
  const write = (text, px, py) => {
    context.strokeText(text, px, py);
    context.fillText(text, px, py);
  };
  context.textAlign = "center";
  for (const [x, px] of across)
    if (px > 60 && px < camera.width - 20) write(metres(x, step), px, camera.height - 8);
  context.textAlign = "right";
  for (const [y, py] of up)
    if (py > top + 12 && py < camera.height - 24) write(metres(y, step), camera.width - 8, py - 4);
}

/** The multiples of `step` from `low` to `high`. */
function multiples(step, low, high) {
  const first = Math.ceil(low / step);
  return Array.from(
    { length: Math.max(0, Math.floor(high / step) - first + 1) },
    (_, i) => (first + i) * step,
  );
}

/** A box from above, with the height of its top where there is room for it. */
function drawObstacle(context, camera, box, colours) {
  const corners = box.corners.map(([x, y]) => camera.toScreen(x, y));
  context.beginPath();
  for (const corner of corners) context.lineTo(...corner);
  context.closePath();
  context.fillStyle = colours.obstacle;
  context.fill();
  context.strokeStyle = colours.muted;
  context.lineWidth = 1;
  context.stroke();
  const middle = (axis) => corners.reduce((sum, corner) => sum + corner[axis], 0) / corners.length;
  const wide = Math.hypot(corners[1][0] - corners[0][0], corners[1][1] - corners[0][1]);
  if (wide < 44) return;
  context.fillStyle = colours.ink;
  context.font = "11px system-ui, sans-serif";
  context.textAlign = "center";
  context.fillText(`${Math.round(box.top)} m`, middle(0), middle(1) + 4);
}

/** An area of the fence; its name and heights stand at the highest of its corners that are in view, below `top`, px. */
export function drawArea(context, camera, { name, inside, low, high, rings }, colours, top) {
  context.beginPath();
  let at = null;
  for (const ring of rings) {
    for (const [index, [x, y]] of ring.entries()) {
      const [px, py] = camera.toScreen(x, y);
      if (index) context.lineTo(px, py);
      else context.moveTo(px, py);
      const seen = px >= 0 && px < camera.width && py > top + 16 && py < camera.height;
      if (seen && (!at || py < at[1] - 0.5 || (py < at[1] + 0.5 && px < at[0]))) at = [px, py];
    }
    context.closePath();
  }
  context.strokeStyle = context.fillStyle = inside ? colours.accent : colours.disconnected;
  if (!inside) {
    context.globalAlpha = 0.15;
    context.fill("evenodd");
    context.globalAlpha = 1;
  }
  context.lineWidth = 2;
  context.setLineDash(inside ? [8, 5] : []);
  context.stroke();
  context.setLineDash([]);
  if (!at) return;
  const to = high === null ? "" : `to ${high} m`;
  const heights = [low === null ? "" : `from ${low} m`, to].filter(Boolean).join(" ");
  context.font = "11px system-ui, sans-serif";
  context.textAlign = "left";
  context.fillText([name, heights].filter(Boolean).join(", "), at[0] + 2, at[1] - 5);
}

/** Where crews swap the battery of a drone: filled while they do, dashed while it waits for them. */
function drawPad(context, camera, { role, home, pad }, colours, radius) {
  if (!home?.length || role === 1) return; // nobody relieves a gateway
  const [px, py] = camera.toScreen(...home);
  const half = Math.max(4, Math.min(PAD * radius, PAD_M * camera.scale));
  context.beginPath();
  context.roundRect(px - half, py - half, 2 * half, 2 * half, 0.3 * half);
  context.strokeStyle = context.fillStyle = pad ? colours.accent : colours.muted;
  context.lineWidth = 1.5;
  context.setLineDash(pad.startsWith("waits") ? [3, 3] : []);
  context.stroke();
  context.setLineDash([]);
  if (!pad || pad.startsWith("waits")) return;
  context.globalAlpha = 0.3;
  context.fill();
  context.globalAlpha = 1;
}

/** A low battery, at the upper right of its drone. */
function drawBattery(context, px, py, battery, colours, radius) {
  const [x, y] = [px + radius, py - radius - 7];
  context.fillStyle = colours.card;
  context.strokeStyle = colours.disconnected;
  context.lineWidth = 1.5;
  context.beginPath();
  context.roundRect(x, y, 15, 8, 2);
  context.fill();
  context.stroke();
  context.fillStyle = colours.disconnected;
  context.fillRect(x + 15, y + 2.5, 2, 3);
  context.fillRect(x + 2, y + 2, (11 * battery) / LOW_BATTERY, 4);
}

function metres(value, step) {
  return `${value.toFixed(step < 1 ? 1 : 0).replace(/^-(0(\.0)?)$/, "$1")} m`;
}

/** 1, 2 or 5 times a power of ten, at least `least`. */
export function niceStep(least) {
  const power = 10 ** Math.floor(Math.log10(least));
  return power * [1, 2, 5, 10].find((factor) => factor * power >= least * 0.999);
}

function drawRange(context, camera, mesh, node, colours, alpha) {
  if (!node.position || !node.on) return;
  const [px, py] = camera.toScreen(node.position[0], node.position[1]);
  context.globalAlpha = 0.07 * alpha;
  context.fillStyle = colours.accent;
  context.beginPath();
  context.arc(px, py, mesh.clock.range * camera.scale, 0, 2 * Math.PI);
  context.fill();
  context.globalAlpha = 0.5 * alpha;
  context.strokeStyle = colours.accent;
  context.lineWidth = 1;
  context.stroke();
  context.globalAlpha = 1;
}

function drawLines(context, camera, radius, pairs, colour, width, dash) {
  let count = 0;
  context.strokeStyle = colour;
  context.lineWidth = width;
  context.setLineDash(dash);
  context.beginPath();
  for (const [a, b] of pairs) {
    if (!a?.position || !b?.position) continue;
    context.moveTo(...onScreen(camera, a, radius));
    context.lineTo(...onScreen(camera, b, radius));
    count++;
  }
  context.stroke();
  context.setLineDash([]);
  return count;
}

/** Where a drone has been. */
function drawTrail(context, camera, trail, colours) {
  context.strokeStyle = colours.muted;
  context.lineWidth = 1;
  context.globalAlpha = 0.5;
  context.beginPath();
  for (const place of trail) context.lineTo(...camera.toScreen(...place));
  context.stroke();
  context.globalAlpha = 1;
}

/** The line to where a drone's pilot flies it. */
function drawHeading(context, camera, node, colours, radius) {
  if (!node.heading.length || !node.position) return;
  context.strokeStyle = colours.muted;
  context.lineWidth = 1.5;
  context.setLineDash([1, 4]);
  context.beginPath();
  context.moveTo(...onScreen(camera, node, radius));
  context.lineTo(...camera.toScreen(node.heading[0], node.heading[1]));
  context.stroke();
  context.setLineDash([]);
}

function drawPath(context, camera, node, colours, radius) {
  if (!node.path.length || !node.position) return;
  context.strokeStyle = colours.path;
  context.lineWidth = 2;
  context.setLineDash([2, 5]);
  context.beginPath();
  context.moveTo(...onScreen(camera, node, radius));
  for (let i = 0; i < node.path.length; i += 3)
    context.lineTo(...camera.toScreen(node.path[i], node.path[i + 1]));
  context.stroke();
  context.setLineDash([]);
  const [px, py] = camera.toScreen(...node.path.slice(-3, -1));
  context.beginPath();
  context.moveTo(px - 5, py);
  context.lineTo(px + 5, py);
  context.moveTo(px, py - 5);
  context.lineTo(px, py + 5);
  context.stroke();
}

/** Arms and rotors, around a drone's middle; the rotors turn while it flies. */
function drawArms(context, px, py, node, colours, r) {
  context.strokeStyle = colours.muted;
  context.lineWidth = Math.max(1.5, 0.18 * r);
  context.beginPath();
  for (const [east, north] of MOTORS) {
    context.moveTo(px, py);
    context.lineTo(px + east * MOTOR_AT * r, py + north * MOTOR_AT * r);
  }
  context.stroke();
  const flying = node.path.length > 0 || node.heading.length > 0;
  const turned = flying ? (performance.now() / 1000) * ROTOR_RAD_PER_S : 0.6;
  for (const [number, [east, north]] of MOTORS.entries()) {
    const [x, y] = [px + east * MOTOR_AT * r, py + north * MOTOR_AT * r];
    const angle = number % 2 ? turned : -turned;
    const [reachX, reachY] = [ROTOR * r * Math.cos(angle), ROTOR * r * Math.sin(angle)];
    context.lineWidth = 1;
    context.beginPath();
    context.arc(x, y, ROTOR * r, 0, 2 * Math.PI);
    if (flying) {
      context.globalAlpha = 0.3;
      context.fillStyle = colours.muted;
      context.fill();
      context.globalAlpha = 1;
    }
    context.stroke();
    context.lineWidth = Math.max(1.5, 0.14 * r);
    context.beginPath();
    context.moveTo(x - reachX, y - reachY);
    context.lineTo(x + reachX, y + reachY);
    context.stroke();
  }
}

function drawDrone(context, camera, node, selected, colours, radius, shape, labelPx) {
  if (!node.position) return 0;
  const [px, py] = onScreen(camera, node, radius);
  const colour = colours[node.colour];
  const hollow = !node.on;
  const arms = hasArms(shape, radius);
  const r = arms ? HULL * radius : radius;
  if (arms) drawArms(context, px, py, node, colours, radius);
  if (selected) {
    context.strokeStyle = colours.accent;
    context.lineWidth = 2.5;
    context.beginPath();
    context.arc(px, py, (arms ? 1.5 : 1) * radius + 5, 0, 2 * Math.PI);
    context.stroke();
  }
  context.beginPath();
  if (node.role === 1) context.roundRect(px - r, py - r, 2 * r, 2 * r, r * 0.35);
  else context.arc(px, py, r, 0, 2 * Math.PI);
  context.fillStyle = hollow ? colours.card : colour;
  context.fill();
  context.strokeStyle = hollow ? colour : colours.card;
  context.lineWidth = hollow ? 2 : 1.5;
  context.stroke();
  if (idSize(node.id, r) < SMALLEST_ID_PX) {
    if (selected) drawLabel(context, node.id, px, py + r + LABEL_PX, colours, LABEL_PX);
    else if (labelPx) drawLabel(context, node.id, px, py + r + labelPx, colours, labelPx);
  } else {
    context.fillStyle = hollow ? colour : colours.card;
    context.font = `600 ${idSize(node.id, r)}px system-ui, sans-serif`;
    context.textAlign = "center";
    context.textBaseline = "middle";
    context.fillText(node.id, px, py + 0.5);
    context.textBaseline = "alphabetic";
  }
  if ((node.battery ?? LOW_BATTERY) < LOW_BATTERY)
    drawBattery(context, px, py, node.battery, colours, radius);
  return 1;
}

function drawLabel(context, text, px, py, colours, size) {
  context.font = `600 ${size}px system-ui, sans-serif`;
  context.textAlign = "center";
  context.strokeStyle = colours.card;
  context.lineWidth = 3;
  context.strokeText(text, px, py);
  context.fillStyle = colours.ink;
  context.fillText(text, px, py);
}

/** Height of the digits of ids beside drones of this radius, px; 0: not all of them have room. */
export function labelSize(ids, radius) {
  const digits = String(Math.max(0, ...ids)).length;
  const size = (radius / SHARE_OF_ROOM - BETWEEN_LABELS_PX) / (DIGIT_WIDTH * digits);
  return size < SMALLEST_LABEL_PX ? 0 : Math.min(LABEL_PX, size);
}

/** Height of an id's digits, px, so that they fit into a drone of radius `r`. */
export function idSize(id, r) {
  return Math.min(0.95 * r, (1.6 * r) / (DIGIT_WIDTH * String(id).length));
}

/** How far (`range`, m) a drone's radio would reach at its goal, if that was looked into. */
function drawReach(context, camera, goal, range, colours) {
  if (goal.lost === undefined) return;
  context.strokeStyle = goal.lost ? colours.disconnected : colours.accent;
  context.lineWidth = 1;
  context.globalAlpha = goal.lost ? 0.7 : 0.25;
  context.beginPath();
  context.arc(...camera.toScreen(goal.x, goal.y), range * camera.scale, 0, 2 * Math.PI);
  context.stroke();
  context.globalAlpha = 1;
}

function drawGoal(context, camera, node, goal, colours, r, withText) {
  if (!node?.position) return;
  const [px, py] = camera.toScreen(goal.x, goal.y);
  const colour = goal.lost ? colours.disconnected : colours.accent;
  context.strokeStyle = colour;
  context.lineWidth = 2;
  context.setLineDash([6, 4]);
  context.beginPath();
  context.moveTo(...camera.toScreen(node.position[0], node.position[1]));
  context.lineTo(px, py);
  context.stroke();
  context.setLineDash([]);
  context.beginPath();
  context.arc(px, py, r, 0, 2 * Math.PI);
  context.globalAlpha = 0.5;
  context.fillStyle = colour;
  context.fill();
  context.globalAlpha = 1;
  if (!withText) return;
  context.fillStyle = colours.ink;
  context.font = "600 12px system-ui, sans-serif";
  context.textAlign = "center";
  context.fillText(`${goal.x.toFixed(1)}, ${goal.y.toFixed(1)} m`, px, py - r - 8);
}

/** The waypoints [x, y] of a mission that is being drawn. */
export function drawMission(context, camera, waypoints, colours) {
  context.strokeStyle = context.fillStyle = colours.accent;
  context.lineWidth = 2;
  context.setLineDash([6, 4]);
  context.beginPath();
  for (const waypoint of waypoints) context.lineTo(...camera.toScreen(...waypoint));
  context.stroke();
  context.setLineDash([]);
  context.font = "600 12px system-ui, sans-serif";
  context.textAlign = "center";
  for (const [number, waypoint] of waypoints.entries()) {
    const [px, py] = camera.toScreen(...waypoint);
    context.beginPath();
    context.arc(px, py, 4, 0, 2 * Math.PI);
    context.fill();
    context.fillText(String(number + 1), px, py - 9);
  }
}

/** Where a drone {x, y, gateway} would be added, and how far (`range`, m) its radio would reach. */
export function drawNewDrone(context, camera, place, range, colours, r) {
  const [px, py] = camera.toScreen(place.x, place.y);
  context.strokeStyle = context.fillStyle = place.gateway ? colours.gateway : colours.accent;
  context.lineWidth = 2;
  context.setLineDash([4, 3]);
  context.beginPath();
  if (place.gateway) context.roundRect(px - r, py - r, 2 * r, 2 * r, r * 0.35);
  else context.arc(px, py, r, 0, 2 * Math.PI);
  context.stroke();
  context.lineWidth = 1;
  context.globalAlpha = 0.5;
  context.beginPath();
  context.arc(px, py, range * camera.scale, 0, 2 * Math.PI);
  context.stroke();
  context.setLineDash([]);
  context.globalAlpha = 0.07;
  context.fill();
  context.globalAlpha = 1;
  context.font = `600 ${1.4 * r}px system-ui, sans-serif`;
  context.textAlign = "center";
  context.textBaseline = "middle";
  context.fillText("+", px, py);
  context.textBaseline = "alphabetic";
}
