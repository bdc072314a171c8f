// Draws a mission by clicks on the map, and sends it to the pilots of the selected drones.

import { typedNumber } from "./numbers.js";

const FASTEST_M_S = 20;

const byId = (id) => document.getElementById(id);

export class Missions {
  /** `order(request, button)` shows the outcome of the order, and resolves with whether it was carried out. */
  constructor(mesh, map, order) {
    this.mesh = mesh;
    this.map = map;
    this.order = order;
    this.form = byId("mission-form");
    this.waypoints = []; // [x, y, z], m; without z at the height that is typed
    this.notes = []; // what is told of the file that they are from
    this.drones = []; // that will fly it
    byId("mission").addEventListener("click", () => (this.drawing ? this.close() : this.open()));
    byId("mission-close").addEventListener("click", () => this.close());
    byId("mission-back").addEventListener("click", () => this.#set(this.waypoints.slice(0, -1)));
    byId("mission-height").addEventListener("input", () =>
      this.#set(this.waypoints.map(([x, y]) => [x, y])),
    );
    this.form.addEventListener("submit", (event) => this.#send(event));
    for (const action of ["pause", "resume", "stop"])
      byId(`mission-${action}`).addEventListener("click", (event) =>
        this.order({ do: "pilots", action }, event.target),
      );
    mesh.addEventListener("timeline", () => mesh.canOrder || this.close());
  }

  get drawing() {
    return !this.form.hidden;
  }

  /**
   * Opens the form for the selected drones; each click on the map adds a waypoint to these [x, y, z] of a
   * file, which may say a speed and of which there may be notes.
   */
  open(waypoints = [], speed = null, notes = []) {
    const { mesh } = this;
    if (!mesh.canOrder || !mesh.actions.includes("mission")) return;
    this.drones = mesh.group.size ? [...mesh.group] : [mesh.selected].filter((id) => id !== null);
    this.notes = notes;
    if (waypoints.length) byId("mission-loop").checked = false;
    if (speed !== null) byId("mission-speed").value = String(speed);
    const top = Math.round(Math.max(0, ...waypoints.map(([, , z]) => z)));
    if (top) byId("mission-height").value = String(top);
    this.#setOpen(true);
    this.#set(top ? waypoints : waypoints.map(([x, y]) => [x, y])); // a line may have no heights
  }

  /** Closes the form; returns whether it was open. */
  close() {
    const { drawing } = this;
    if (drawing) this.#setOpen(false);
    return drawing;
  }

  #setOpen(open) {
    this.form.hidden = !open;
    document.body.toggleAttribute("data-adding", open);
    byId("mission").setAttribute("aria-pressed", open);
    const add = (x, y) =>
      this.#set([...this.waypoints, [Number(x.toFixed(1)), Number(y.toFixed(1))]]);
    this.map.choosePlace(open ? add : null);
    if (!open) this.map.showMission([]);
  }

  #set(waypoints) {
    this.waypoints = waypoints;
    const who = this.drones.length
      ? `${this.drones.length > 1 ? "drones" : "drone"} ${this.drones.slice(0, 8).join(", ")}`
      : "no drone: select one first";
    const { length } = waypoints;
    const heights = [...new Set(waypoints.map(([, , z]) => z))].filter((z) => z !== undefined);
    const range = `heights ${Math.min(...heights)} to ${Math.max(...heights)} m, until one is typed`;
    byId("mission-text").textContent = [
      `${length} ${length === 1 ? "waypoint" : "waypoints"}, ${who}`,
      ...(heights.length > 1 ? [range] : []),
      ...this.notes,
    ].join("; ");
    byId("mission-send").disabled = !length || !this.drones.length;
    byId("mission-back").disabled = !length;
    byId("mission-error").textContent = "";
    this.map.showMission(waypoints);
  }

  async #send(event) {
    event.preventDefault();
    const height = typedNumber(byId("mission-height"), "height", 0, this.mesh.limits.height, true);
    const speed = typedNumber(byId("mission-speed"), "speed", 0.01, FASTEST_M_S);
    const wrong = [height, speed].find((entry) => entry.error);
    byId("mission-error").textContent = wrong?.error ?? "";
    if (wrong) return wrong.input.select();
    const request = {
      do: "mission",
      nodes: this.drones,
      waypoints: this.waypoints.map(([x, y, z]) => [x, y, z ?? height.value]),
      speed: speed.value,
      loop: byId("mission-loop").checked,
    };
    if (await this.order(request, byId("mission-send"))) this.close();
  }
}
