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
    this.waypoints = []; // [x, y], m
    this.drones = []; // that will fly it
    byId("mission").addEventListener("click", () => (this.drawing ? this.close() : this.open()));
    byId("mission-close").addEventListener("click", () => this.close());
    byId("mission-back").addEventListener("click", () => this.#set(this.waypoints.slice(0, -1)));
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

  /** Opens the form for the selected drones; each click on the map adds a waypoint to these [x, y]. */
  open(waypoints = []) {
    const { mesh } = this;
    if (!mesh.canOrder || !mesh.actions.includes("mission")) return;
    this.drones = mesh.group.size ? [...mesh.group] : [mesh.selected].filter((id) => id !== null);
    this.#setOpen(true);
    this.#set(waypoints);
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
    byId("mission-text").textContent =
      `${length} ${length === 1 ? "waypoint" : "waypoints"}, ${who}`;
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
      waypoints: this.waypoints,
      z: height.value,
      speed: speed.value,
      loop: byId("mission-loop").checked,
    };
    if (await this.order(request, byId("mission-send"))) this.close();
  }
}
