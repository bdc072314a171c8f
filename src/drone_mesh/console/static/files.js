// Saves what the page shows: the table and the charts, as CSV and as pictures, and the places.

import { UNKNOWN } from "./mesh.js";

const TEXT_PX = 12; // of the table's picture
const PICTURE_SCALE = 2; // sharp in print and on a phone, whatever screen it was saved from
const NODE_COLUMNS = {
  node: (n) => n.id, // a number that is not known is an empty field
  role: (n) => (n.role === 1 ? "gateway" : "router"),
  condition: (n) => n.condition,
  gateway: (n) => known(n.gateway),
  hops: (n) => known(n.hops),
  next_hop: (n) => known(n.next_hop),
  neighbours: (n) => n.neighbours,
  known_nodes: (n) => n.known_nodes ?? "",
  total_messages: (n) => n.total_messages ?? "",
  fallback: (n) => known(n.fallback),
  x_m: (n) => n.position?.[0] ?? "",
  y_m: (n) => n.position?.[1] ?? "",
  z_m: (n) => n.position?.[2] ?? "",
};

function known(id) {
  return id === UNKNOWN ? "" : id;
}

/** The table of nodes. */
export function nodesCsv(mesh) {
  return csv(Object.keys(NODE_COLUMNS), nodeRows(mesh));
}

/** The table of nodes as a picture, in the colours of the page. */
export function nodesPicture(mesh, colours) {
  const picture = document.createElement("canvas");
  const context = picture.getContext("2d");
  const font = `${TEXT_PX * PICTURE_SCALE}px system-ui, sans-serif`;
  const names = Object.keys(NODE_COLUMNS);
  const rows = [names, ...nodeRows(mesh)].map((row) =>
    row.map((value) => (value === "" ? "–" : String(value))),
  );
  context.font = font;
  const gap = 2 * TEXT_PX;
  const widths = names.map(
    (_name, i) => gap + Math.max(...rows.map((row) => context.measureText(row[i]).width)),
  );
  const height = 1.7 * TEXT_PX * PICTURE_SCALE;
  picture.width = gap + widths.reduce((sum, width) => sum + width, 0);
  picture.height = height * (rows.length + 0.5);
  context.fillStyle = colours.card;
  context.fillRect(0, 0, picture.width, picture.height);
  context.font = font;
  rows.forEach((row, index) => {
    context.fillStyle = index ? colours.ink : colours.muted;
    let left = gap;
    row.forEach((text, column) => {
      context.fillText(text, left, height * (index + 0.9));
      left += widths[column];
    });
  });
  return png(picture);
}

/** The numbers of the charts. */
export function chartsCsv(mesh) {
  const columns = Object.keys(mesh.samples[0] ?? { stamp_s: 0 });
  return csv(
    columns,
    mesh.samples.map((sample) => columns.map((column) => sample[column] ?? "")),
  );
}

/** The current places, as a file that `casus:=` and "Fly to the positions of a layout file" read. */
export function placesYaml(mesh, number) {
  const lines = [...mesh.nodes.values()]
    .filter((node) => node.role === 0 && node.position)
    .sort((a, b) => a.id - b.id)
    .map(({ id, position: [x, y, z] }) => `    ${id}: [${x}, ${y}, ${Math.round(Math.max(0, z))}]`);
  return `cases:\n  ${number}:\n${lines.join("\n")}\n`;
}

/** The charts below each other, in the colours of the page. */
export function chartsPicture(figures, colours) {
  const canvases = figures.map((figure) => figure.querySelector("canvas"));
  const titleHeight = 24 * window.devicePixelRatio;
  const picture = document.createElement("canvas");
  picture.width = Math.max(...canvases.map((canvas) => canvas.width));
  picture.height = canvases.reduce((sum, canvas) => sum + canvas.height + titleHeight, 0);
  const context = picture.getContext("2d");
  context.fillStyle = colours.card;
  context.fillRect(0, 0, picture.width, picture.height);
  context.fillStyle = colours.ink;
  context.font = `${13 * window.devicePixelRatio}px system-ui, sans-serif`;
  let top = 0;
  canvases.forEach((canvas, index) => {
    const title = figures[index].querySelector("figcaption").textContent;
    context.fillText(title.replace(/\s+/g, " ").trim(), 10, top + titleHeight * 0.7);
    context.drawImage(canvas, 0, top + titleHeight);
    top += canvas.height + titleHeight;
  });
  return png(picture);
}

/** Saves a file through the browser. */
export function save(name, content, type) {
  const link = document.createElement("a");
  link.href = URL.createObjectURL(new Blob([content], { type }));
  link.download = name;
  link.click();
  setTimeout(() => URL.revokeObjectURL(link.href), 1000);
}

function nodeRows(mesh) {
  const nodes = [...mesh.nodes.values()].sort((a, b) => a.id - b.id);
  return nodes.map((node) => Object.values(NODE_COLUMNS).map((value) => value(node)));
}

function png(canvas) {
  return new Promise((resolve) => canvas.toBlob(resolve, "image/png"));
}

function csv(columns, rows) {
  return [columns, ...rows].map((row) => row.join(",")).join("\n") + "\n";
}
