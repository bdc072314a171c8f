// Draws one picture of the mesh on a canvas.

import { Mesh } from "./mesh.js";

const MOST_KNOWN_LINKS = 4000; // beyond that a crowd is a grey blot: the selected node's remain

/** The colours of the style sheet, read again when the theme changes. */
export function readColours() {
  const style = getComputedStyle(document.documentElement);
  const names = ["card", "ink", "muted", "accent", "connected", "lost", "off", "stale", "gateway", "way", "known", "grid", "flight"];
  return Object.fromEntries(names.map((name) => [name, style.getPropertyValue(`--${name}`).trim()]));
}

/** Radius of a drone, px: as large as the room between them allows, never too small to see nor to hit. */
export function droneRadius(camera, mesh) {
  const places = [...mesh.nodes.values()].filter((node) => node.at).map((node) => node.at);
  if (!places.length) return 4.5;
  const span = (axis) => Math.max(...places.map((at) => at[axis])) - Math.min(...places.map((at) => at[axis])) + 1;
  const apart = Math.sqrt((span(0) * span(1)) / places.length) * camera.scale;
  return Math.min(13, Math.max(4.5, apart * 0.3));
}

/**
 * Returns what was drawn: {drones, links, linksDrawn, ways, lost}.
 * `drag` is {id, x, y} of a drone that is being dragged, in metres, or null.
 */
export function drawMesh(context, camera, mesh, colours, options, drag) {
  context.clearRect(0, 0, camera.width, camera.height);
  context.lineCap = "round";
  drawGrid(context, camera, colours);
  const selected = mesh.nodes.get(mesh.selected);
  if (options.ranges) for (const node of mesh.nodes.values()) drawRange(context, camera, mesh, node, colours, 0.35);
  else if (selected) drawRange(context, camera, mesh, selected, colours, 1);
  const radius = droneRadius(camera, mesh);
  const drawn = { drones: 0, links: mesh.links.size, linksDrawn: 0, ways: 0, lost: 0 };

  if (options.known) {
    const crowd = mesh.links.size > MOST_KNOWN_LINKS;
    const pairs = [];
    for (const [a, b] of mesh.links.values()) {
      if (!crowd || a === mesh.selected || b === mesh.selected) pairs.push([mesh.nodes.get(a), mesh.nodes.get(b)]);
    }
    drawn.linksDrawn = drawLines(context, camera, pairs, colours.known, 1, []);
  }
  const lost = mesh.justLost().map(([a, b]) => [mesh.nodes.get(a), mesh.nodes.get(b)]);
  drawn.lost = drawLines(context, camera, lost, colours.lost, 1.5, [5, 5]);
  drawn.ways = drawLines(context, camera, mesh.ways(), colours.way, Math.min(3, Math.max(1, radius * 0.25)), []);
  if (selected?.route.length > 1) {
    const stops = selected.route.map((id) => mesh.nodes.get(id));
    drawLines(context, camera, stops.slice(1).map((stop, i) => [stops[i], stop]), colours.accent, 4, []);
  }
  for (const node of mesh.nodes.values()) drawFlight(context, camera, node, colours);
  for (const node of mesh.nodes.values()) drawn.drones += drawDrone(context, camera, node, mesh.selected, colours, radius);
  if (drag) drawDrag(context, camera, mesh.nodes.get(drag.id), drag, colours, radius);
  return drawn;
}

function drawGrid(context, camera, colours) {
  const step = niceStep(70 / camera.scale);
  const [left, top] = camera.toWorld(0, 0);
  const [right, low] = camera.toWorld(camera.width, camera.height);
  context.strokeStyle = colours.grid;
  context.fillStyle = colours.muted;
  context.font = "11px system-ui, sans-serif";
  context.lineWidth = 1;
  context.setLineDash([]);
  context.beginPath();
  context.textAlign = "center";
  for (let x = Math.ceil(left / step) * step; x <= right; x += step) {
    const px = Math.round(camera.toScreen(x, 0)[0]) + 0.5;
    context.moveTo(px, 0);
    context.lineTo(px, camera.height);
    if (px > 60 && px < camera.width - 20) context.fillText(metres(x, step), px, camera.height - 42);
  }
  context.textAlign = "right";
  for (let y = Math.ceil(low / step) * step; y <= top; y += step) {
    const py = Math.round(camera.toScreen(0, y)[1]) + 0.5;
    context.moveTo(0, py);
    context.lineTo(camera.width, py);
    if (py > 60 && py < camera.height - 50) context.fillText(metres(y, step), camera.width - 8, py - 4);
  }
  context.stroke();
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
  if (!node.at || !node.on) return;
  const [px, py] = camera.toScreen(node.at[0], node.at[1]);
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

function drawLines(context, camera, pairs, colour, width, dash) {
  let count = 0;
  context.strokeStyle = colour;
  context.lineWidth = width;
  context.setLineDash(dash);
  context.beginPath();
  for (const [a, b] of pairs) {
    if (!a?.at || !b?.at) continue;
    context.moveTo(...camera.toScreen(a.at[0], a.at[1]));
    context.lineTo(...camera.toScreen(b.at[0], b.at[1]));
    count++;
  }
  context.stroke();
  context.setLineDash([]);
  return count;
}

function drawFlight(context, camera, node, colours) {
  if (!node.path.length || !node.at) return;
  context.strokeStyle = colours.flight;
  context.lineWidth = 2;
  context.setLineDash([2, 5]);
  context.beginPath();
  context.moveTo(...camera.toScreen(node.at[0], node.at[1]));
  for (let i = 0; i < node.path.length; i += 3) context.lineTo(...camera.toScreen(node.path[i], node.path[i + 1]));
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

function drawDrone(context, camera, node, selected, colours, r) {
  if (!node.at) return 0;
  const [px, py] = camera.toScreen(node.at[0], node.at[1]);
  const state = Mesh.stateOf(node);
  const colour = colours[state === "flying" ? "flight" : state];
  if (node.id === selected) {
    context.strokeStyle = colours.accent;
    context.lineWidth = 2.5;
    context.beginPath();
    context.arc(px, py, r + 5, 0, 2 * Math.PI);
    context.stroke();
  }
  context.beginPath();
  if (node.role === 1) context.roundRect(px - r, py - r, 2 * r, 2 * r, r * 0.35);
  else context.arc(px, py, r, 0, 2 * Math.PI);
  context.fillStyle = state === "off" ? colours.card : colour;
  context.fill();
  context.strokeStyle = state === "off" ? colour : colours.card;
  context.lineWidth = state === "off" ? 2 : 1.5;
  context.stroke();
  if (r >= 7) {
    context.fillStyle = state === "off" ? colour : colours.card;
    context.font = `600 ${Math.max(9, r * (node.id > 99 ? 0.8 : 0.95))}px system-ui, sans-serif`;
    context.textAlign = "center";
    context.textBaseline = "middle";
    context.fillText(node.id, px, py + 0.5);
    context.textBaseline = "alphabetic";
  }
  return 1;
}

function drawDrag(context, camera, node, drag, colours, r) {
  if (!node?.at) return;
  const [px, py] = camera.toScreen(drag.x, drag.y);
  context.strokeStyle = colours.accent;
  context.lineWidth = 2;
  context.setLineDash([6, 4]);
  context.beginPath();
  context.moveTo(...camera.toScreen(node.at[0], node.at[1]));
  context.lineTo(px, py);
  context.stroke();
  context.setLineDash([]);
  context.beginPath();
  context.arc(px, py, r, 0, 2 * Math.PI);
  context.globalAlpha = 0.5;
  context.fillStyle = colours.accent;
  context.fill();
  context.globalAlpha = 1;
  context.fillStyle = colours.ink;
  context.font = "600 12px system-ui, sans-serif";
  context.textAlign = "center";
  context.fillText(`${drag.x.toFixed(1)}, ${drag.y.toFixed(1)} m`, px, py - r - 8);
}
