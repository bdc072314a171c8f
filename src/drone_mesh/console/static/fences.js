// Draws an area of the fence by clicks on the map, and deletes areas.

import { agreed } from "./confirm.js";
import { typedNumber } from "./numbers.js";

const byId = (id) => document.getElementById(id);

export class Fences {
  /** `order(request, button)` shows the outcome of the order, and resolves with whether it was carried out. */
  constructor(mesh, map, order) {
    this.mesh = mesh;
    this.map = map;
    this.order = order;
    this.form = byId("fence-form");
    this.corners = []; // [x, y], m
    byId("fence").addEventListener("click", () => this.close() || this.#open());
    byId("fence-close").addEventListener("click", () => this.close());
    byId("fence-back").addEventListener("click", () => this.#set(this.corners.slice(0, -1)));
    byId("fence-side").addEventListener("change", () => this.#set(this.corners));
    byId("fence-delete").addEventListener("click", () => this.#delete());
    this.form.addEventListener("submit", (event) => this.#save(event));
    mesh.addEventListener("frame", () => mesh.fence === this.shown || this.#list());
    mesh.addEventListener("timeline", () => mesh.canOrder || this.close());
  }

  /** Closes the form; returns whether it was open. */
  close() {
    const open = !this.form.hidden;
    if (open) this.#setOpen(false);
    return open;
  }

  #open() {
    if (!this.mesh.canOrder || !this.mesh.actions.includes("fence")) return;
    this.#setOpen(true);
    this.#set([]);
  }

  #setOpen(open) {
    this.form.hidden = !open;
    document.body.toggleAttribute("data-adding", open);
    byId("fence").setAttribute("aria-pressed", open);
    const round = (value) => Number(value.toFixed(1));
    const add = (x, y) => this.#set([...this.corners, [round(x), round(y)]]);
    this.map.choosePlace(open ? add : null);
    if (!open) this.map.showMission([]);
  }

  #set(corners) {
    this.corners = corners;
    const inside = byId("fence-side").value === "inside";
    byId("fence-text").textContent = `${corners.length} of at least 3 corners`;
    byId("fence-save").disabled = corners.length < 3;
    byId("fence-back").disabled = !corners.length;
    byId("fence-error").textContent = "";
    this.map.showMission(corners, inside);
  }

  /** The areas that there are. */
  #list() {
    this.shown = this.mesh.fence;
    const names = [...new Set(this.mesh.fence.map(({ name }) => name))];
    byId("fence-area").replaceChildren(...names.map((name) => new Option(name)));
    byId("fence-areas").hidden = !names.length;
  }

  async #delete() {
    const name = byId("fence-area").value;
    const question = `The area ${name} of the fence will be deleted. This cannot be undone.`;
    if (await agreed(question, "Delete"))
      this.order({ do: "fence", name, corners: [] }, byId("fence-delete"));
  }

  async #save(event) {
    event.preventDefault();
    const name = byId("fence-name").value.trim();
    const top = byId("fence-top");
    const any = !top.value.trim();
    const height = any ? {} : typedNumber(top, "height", 0, this.mesh.limits.height);
    if (any) top.removeAttribute("aria-invalid");
    byId("fence-error").textContent = name ? (height.error ?? "") : "give the area a name";
    if (!name) return byId("fence-name").focus();
    if (height.error) return top.select();
    const inside = byId("fence-side").value === "inside";
    const area = { name, corners: this.corners, inside, max_height: height.value ?? null };
    if (await this.order({ do: "fence", ...area }, byId("fence-save"))) this.close();
  }
}
