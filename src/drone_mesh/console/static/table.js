// The table of nodes: one row per node, sorted by the column that was clicked.

import { arrowKeys } from "./arrows.js";
import { batteryOf, orDash } from "./mesh.js";

const COLUMNS = [
  { name: "Node", title: "Id", sort: (n) => n.id, text: (n) => String(n.id) },
  {
    name: "Condition",
    title: "",
    sort: (n) => n.condition,
    text: (n) => n.condition,
    condition: true,
  },
  {
    name: "Does now",
    title: "What it does: its flight, its repair, its mission, or for whom it relays",
    sort: (n) => n.does,
    text: (n) => n.does || "–",
    long: true,
  },
  {
    name: "Battery",
    title: "Its charge, and how long it can hover until it comes down, in minutes and seconds",
    sort: (n) => n.battery ?? Infinity,
    text: (n) => batteryOf(n, " ") || "–",
  },
  { name: "Hops", title: "Hops to its gateway", sort: (n) => n.hops, text: (n) => orDash(n.hops) },
  {
    name: "Next hop",
    title: "The neighbour on its route to that gateway",
    sort: (n) => n.next_hop,
    text: (n) => orDash(n.next_hop),
  },
  { name: "Nb", title: "Neighbours", sort: (n) => n.neighbours, text: (n) => String(n.neighbours) },
  {
    name: "GW",
    title: "The gateway that it uses, or used last",
    sort: (n) => n.gateway,
    text: (n) => orDash(n.gateway),
  },
  {
    name: "Sent",
    title: "Messages sent successfully",
    sort: (n) => n.total_messages,
    text: (n) => String(n.total_messages ?? "–"),
  },
  { name: "x", title: "m", sort: (n) => n.position?.[0] ?? 0, text: (n) => metres(n, 0) },
  { name: "y", title: "m", sort: (n) => n.position?.[1] ?? 0, text: (n) => metres(n, 1) },
  { name: "z", title: "m", sort: (n) => n.position?.[2] ?? 0, text: (n) => metres(n, 2) },
];

function metres(node, axis) {
  return node.position ? node.position[axis].toFixed(1) : "–";
}

export class NodeTable {
  /** `filter` is a field for a text, `onlyProblems` a box: rows that do not match are hidden. */
  constructor(mesh, table, filter, onlyProblems) {
    this.mesh = mesh;
    this.filter = filter;
    this.onlyProblems = onlyProblems;
    this.count = document.getElementById("shown");
    filter.addEventListener("input", () => this.#hide());
    onlyProblems.addEventListener("change", () => this.#hide());
    this.body = table.tBodies[0];
    this.head = table.tHead.rows[0];
    this.rows = new Map();
    this.sortBy = 0;
    this.ascending = true;
    this.#makeHead();
    mesh.addEventListener("frame", (event) => this.#update(event.detail));
    mesh.addEventListener("select", () => this.#mark(true));
    this.body.addEventListener("mousedown", (event) => {
      if (event.shiftKey) event.preventDefault(); // it would select text
    });
    this.body.addEventListener("click", (event) => this.#choose(event));
    this.body.addEventListener("keydown", (event) => this.#key(event));
  }

  #makeHead() {
    COLUMNS.forEach((column, index) => {
      const th = document.createElement("th");
      th.scope = "col";
      const button = document.createElement("button");
      button.type = "button";
      button.tabIndex = index ? -1 : 0;
      button.textContent = column.name;
      button.title = column.title;
      button.addEventListener("click", () => {
        this.ascending = this.sortBy === index ? !this.ascending : true;
        this.sortBy = index;
        this.#sort();
      });
      th.append(button);
      this.head.append(th);
    });
    arrowKeys(this.head, "button"); // one tab stop
    this.#showSort();
  }

  #showSort() {
    [...this.head.cells].forEach((th, index) => {
      if (index === this.sortBy)
        th.setAttribute("aria-sort", this.ascending ? "ascending" : "descending");
      else th.removeAttribute("aria-sort");
    });
  }

  #update({ changed, full, gone }) {
    for (const id of full ? [...this.rows.keys()] : gone) {
      if (full && this.mesh.nodes.has(id)) continue;
      this.rows.get(id)?.remove();
      this.rows.delete(id);
    }
    for (const id of changed) this.#fill(this.mesh.nodes.get(id));
    const known = [...this.mesh.nodes.values()].some(({ battery }) => (battery ?? null) !== null);
    this.head.closest("table").toggleAttribute("data-batteries", known);
    this.#sort();
    this.#hide();
    this.#mark(false);
  }

  /** Whether a row is shown. */
  #matches(node) {
    if (this.onlyProblems.checked && !node.trouble && !node.since) return false;
    const text = this.filter.value.trim().toLowerCase();
    if (/^\d+$/.test(text)) return String(node.id).includes(text); // what it does has numbers, too
    const known = [node.id, node.condition, node.trouble, node.order, node.since, node.does];
    return !text || known.join(" ").toLowerCase().includes(text);
  }

  /** The ids of the rows that are shown. */
  get shown() {
    return [...this.rows].flatMap(([id, row]) => (row.hidden ? [] : [id]));
  }

  #hide() {
    let shown = 0;
    for (const [id, row] of this.rows) {
      row.hidden = !this.#matches(this.mesh.nodes.get(id));
      shown += !row.hidden;
    }
    const text = shown < this.rows.size ? `${shown} of ${this.rows.size}` : "";
    if (this.count.textContent !== text) this.count.textContent = text;
  }

  #fill(node) {
    let row = this.rows.get(node.id);
    if (!row) {
      row = document.createElement("tr");
      row.dataset.id = node.id;
      row.tabIndex = -1;
      for (const column of COLUMNS) {
        const cell = row.insertCell();
        if (column.condition)
          cell.append(Object.assign(document.createElement("span"), { className: "condition" }));
      }
      this.rows.set(node.id, row);
    }
    row.dataset.condition = node.condition;
    row.dataset.colour = node.colour;
    COLUMNS.forEach((column, index) => {
      const cell = column.condition ? row.cells[index].firstChild : row.cells[index];
      const text = column.text(node);
      if (cell.textContent === text) return;
      cell.textContent = text;
      if (column.long) cell.title = text;
    });
  }

  #sort() {
    const key = COLUMNS[this.sortBy].sort;
    const sign = this.ascending ? 1 : -1;
    const nodes = [...this.mesh.nodes.values()].sort((a, b) => {
      const [x, y] = [key(a), key(b)];
      return sign * (x < y ? -1 : x > y ? 1 : 0) || a.id - b.id;
    });
    let at = this.body.firstElementChild;
    for (const node of nodes) {
      const row = this.rows.get(node.id);
      if (row === at) at = at.nextElementSibling;
      else this.body.insertBefore(row, at);
    }
    this.#showSort();
  }

  #mark(scroll) {
    for (const [id, row] of this.rows) {
      const selected = id === this.mesh.selected || this.mesh.group.has(id);
      if (row.hasAttribute("aria-selected") === selected) continue;
      if (selected) row.setAttribute("aria-selected", "true");
      else row.removeAttribute("aria-selected");
      if (selected && scroll) row.scrollIntoView({ block: "nearest" });
    }
    const focusable =
      this.rows.get(this.mesh.selected) ?? this.body.querySelector("tr:not([hidden])");
    for (const row of this.body.rows) row.tabIndex = row === focusable ? 0 : -1;
  }

  /** Scrolls to the row of this node; a filter that hides it ends. */
  reveal(id) {
    if (this.rows.get(id)?.hidden) {
      this.filter.value = "";
      this.onlyProblems.checked = false;
      this.#hide();
    }
    this.rows.get(id)?.scrollIntoView({ block: "nearest" });
  }

  #choose(event) {
    const row = event.target.closest("tr");
    if (!row) return;
    if (event.shiftKey || event.ctrlKey || event.metaKey) this.mesh.toggle(Number(row.dataset.id));
    else this.mesh.select(Number(row.dataset.id));
  }

  #key(event) {
    const row = event.target.closest("tr");
    const next = { ArrowDown: "nextElementSibling", ArrowUp: "previousElementSibling" }[event.key];
    let to = row[next];
    while (to?.hidden) to = to[next];
    if (event.key === "Enter") this.#choose(event);
    else if (to) {
      event.preventDefault();
      if (event.shiftKey) this.mesh.toggle(Number(to.dataset.id));
      else this.mesh.select(Number(to.dataset.id));
      to.focus();
    }
  }
}
