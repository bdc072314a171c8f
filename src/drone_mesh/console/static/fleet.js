// Adds drones to the simulation, and removes them.

import { agreed } from "./confirm.js";
import { typedNumber } from "./numbers.js";

const FIELDS = ["id", "x", "y"];

const byId = (id) => document.getElementById(id);

export class Fleet {
  /** `order(request, button)` shows the outcome of the order, and resolves with whether it was carried out. */
  constructor(mesh, map, order) {
    this.mesh = mesh;
    this.map = map;
    this.order = order;
    this.form = byId("add-form");
    byId("add").addEventListener("click", () => (this.adding ? this.close() : this.open()));
    byId("add-close").addEventListener("click", () => this.close());
    byId("remove").addEventListener("click", () => this.remove());
    this.form.addEventListener("submit", (event) => this.#add(event));
    this.form.addEventListener("input", () => this.#showPlace());
    mesh.addEventListener("select", () => mesh.selected !== null && this.close());
    mesh.addEventListener("timeline", () => mesh.canOrder || this.close());
  }

  get adding() {
    return !this.form.hidden;
  }

  /** Opens the form; a click on the map fills in the position. */
  open() {
    if (!this.mesh.canOrder || !this.mesh.actions.includes("add")) return;
    this.mesh.select(null);
    this.#setOpen(true);
    byId("add-id").value = "";
    byId("add-id").placeholder = `lowest free (${this.#lowestFree()})`;
    this.#fill(...this.map.middle());
    byId("add-x").select();
  }

  /** Closes the form; returns whether it was open. */
  close() {
    const adding = this.adding;
    if (adding && this.form.contains(document.activeElement)) byId("add").focus();
    if (adding) this.#setOpen(false); // otherwise another form may have the clicks on the map
    return adding;
  }

  /** Removes the selected drone, if the user confirms it. */
  async remove() {
    const node = this.mesh.nodes.get(this.mesh.selected);
    if (!node || !this.mesh.canOrder || !this.mesh.actions.includes("remove")) return;
    const what = `${node.role === 1 ? "Gateway" : "Router"} ${node.id}`;
    const question = `${what} will be removed from the simulation. This cannot be undone.`;
    if (await agreed(question, `Remove ${node.id}`))
      this.order({ do: "remove", node: node.id }, byId("remove"));
  }

  #setOpen(open) {
    this.form.hidden = !open;
    document.body.toggleAttribute("data-adding", open);
    byId("add").setAttribute("aria-pressed", open);
    this.map.choosePlace(open ? (x, y) => this.#fill(x, y) : null);
    this.#complain();
    this.#showPlace();
  }

  #lowestFree() {
    let id = 0;
    while (this.mesh.nodes.has(id)) id++;
    return id;
  }

  #fill(x, y) {
    byId("add-x").value = Number(x.toFixed(1));
    byId("add-y").value = Number(y.toFixed(1));
    this.#showPlace();
  }

  #showPlace() {
    const [x, y] = ["x", "y"].map((axis) => Number(byId(`add-${axis}`).value.replace(",", ".")));
    const known = this.adding && Number.isFinite(x) && Number.isFinite(y);
    this.map.showPlace(known ? { x, y, gateway: byId("add-role").value === "gateway" } : null);
  }

  #complain(text = "") {
    byId("add-error").textContent = text;
    if (!text) for (const name of FIELDS) byId(`add-${name}`).removeAttribute("aria-invalid");
  }

  async #add(event) {
    event.preventDefault();
    this.#complain();
    const { coordinate, id: mostId } = this.mesh.limits;
    const [x, y] = ["x", "y"].map((axis) =>
      typedNumber(byId(`add-${axis}`), axis, -coordinate, coordinate),
    );
    const chosen = byId("add-id").value.trim() !== "";
    const id = chosen ? typedNumber(byId("add-id"), "id", 0, mostId, true) : { error: "" };
    const wrong = [id, x, y].find((entry) => entry.error);
    if (wrong) {
      this.#complain(wrong.error);
      wrong.input.select();
      return;
    }
    const gateway = byId("add-role").value === "gateway";
    const request = { do: "add", gateway, x: x.value, y: y.value };
    if (chosen) request.node = id.value;
    if (await this.order(request, event.submitter)) this.close();
  }
}
