// The map: pan, zoom, select, drag. Drawing itself is in draw.js.

import { Camera } from "./camera.js";
import { batteryOf } from "./mesh.js";
import {
  drawArea,
  drawLasso,
  drawMark,
  drawMesh,
  drawMission,
  drawNewDrone,
  drawingOrder,
  droneRadius,
  hasArms,
  onScreen,
  readColours,
} from "./draw.js";

const DRAG_AFTER_PX = 6;
const NEAR_PX = 8; // a click this close to a drone selects it
const KEY_STEP_PX = 60;
const ZOOM_STEP = 1.3;
const TURN_PERIOD_MS = 50; // between two pictures of turning rotors
const IN_VIEW_PX = 24; // `show` brings a node at least so far from the edge
const OUT_OF_VIEW_PX = 6; // a fitted map is fitted again when a drone comes this near to the edge
const MARK_PX = 15; // from a mark of drones outside to the edge
const MARKS_APART_PX = 70;

/** Whether a point is inside a polygon: a ray from it crosses its edges an odd number of times. */
function isInside([x, y], corners) {
  return corners.reduce((inside, [ax, ay], at) => {
    const [bx, by] = corners.at(at - 1);
    const crosses = ay > y !== by > y && x < ax + ((y - ay) / (by - ay)) * (bx - ax);
    return crosses ? !inside : inside;
  }, false);
}

export class MapView {
  /** `fly([{id, x, y}])` is called when drones were dragged there. */
  constructor(mesh, card, fly) {
    this.mesh = mesh;
    this.canvas = card.querySelector("canvas");
    this.top = card.querySelector("#map-top");
    this.note = card.querySelector("#map-note");
    this.hover = card.querySelector("#hover");
    this.legendCrashed = card.querySelector("#legend-crashed");
    this.legendObstacle = card.querySelector("#legend-obstacle");
    this.legendInside = card.querySelector("#legend-inside");
    this.legendOutside = card.querySelector("#legend-outside");
    this.legendPad = card.querySelector("#legend-pad");
    this.legendRelief = card.querySelector("#legend-relief");
    this.fly = fly;
    this.camera = new Camera();
    this.radius = 0; // of a drone, px
    this.following = false; // keeps the selected node in the middle
    this.onPlace = null; // called with the place (x, y) of a click, while the user chooses one
    this.newDrone = null; // {x, y, gateway}, where a drone would be added
    this.held = []; // [{id, x, y}] that are about to leave
    this.shownMoves = []; // [{id, x, y}] of a formation that is planned
    this.lasso = null; // the corners [x, y], px, while the user draws it; []: before the first
    this.mission = [];
    this.area = null; // of which `mission` has the corners
    this.options = { known: true, ranges: false, trails: false };
    this.colours = readColours();
    this.drag = null;
    this.fitted = false; // whether it has been fitted to a first mesh
    this.moved = false; // whether the user has moved it since
    this.pointers = new Map();
    this.pending = false;
    this.stage = { places: [], cast: new Set() }; // of a demonstration
    this.marks = []; // at the edges: {x, y, ids, angle} of drones outside, px
    this.drawn = null; // called after each picture
    this.still = matchMedia("(prefers-reduced-motion: reduce)");
    const canvas = this.canvas;
    new ResizeObserver(() => this.#resize()).observe(canvas);
    for (const what of ["frame", "select"]) mesh.addEventListener(what, () => this.redraw());
    canvas.addEventListener("pointerleave", () => this.#point(null));
    canvas.addEventListener("pointerdown", (event) => this.#down(event));
    canvas.addEventListener("pointermove", (event) => this.#move(event));
    canvas.addEventListener("pointerup", (event) => this.#up(event));
    canvas.addEventListener("pointercancel", (event) => this.#cancel(event));
    canvas.addEventListener("wheel", (event) => this.#wheel(event), { passive: false });
    canvas.addEventListener("keydown", (event) => this.#key(event));
  }

  redraw() {
    if (this.pending) return;
    this.pending = true;
    requestAnimationFrame(() => this.#draw());
  }

  setOption(name, value) {
    this.options[name] = value;
    this.redraw();
  }

  themeChanged() {
    this.colours = readColours();
    this.redraw();
  }

  zoom(factor) {
    this.moved = true;
    this.camera.zoom(factor);
    this.redraw();
  }

  /** Moves the map if this node is not in view. */
  show(id) {
    const node = this.mesh.nodes.get(id);
    if (!node?.position) return;
    const [x, y] = this.camera.toScreen(node.position[0], node.position[1]);
    const [left, low] = [IN_VIEW_PX, this.camera.height - IN_VIEW_PX];
    const px = Math.min(this.camera.width - left, Math.max(left, x));
    const py = Math.min(low, Math.max(this.#covered() + IN_VIEW_PX, y));
    if (px === x && py === y) return;
    this.moved = true;
    this.camera.pan(px - x, py - y);
    this.redraw();
  }

  /** The middle of the visible part, [x, y] in metres. */
  middle() {
    return this.camera.toWorld(this.camera.width / 2, (this.camera.height + this.#covered()) / 2);
  }

  /** From now on a click calls `onPlace(x, y)` and selects nothing; null: it selects again. */
  choosePlace(onPlace) {
    this.onPlace = onPlace;
  }

  /** Shows where a drone {x, y, gateway} would be added; null: nothing. */
  showPlace(newDrone) {
    this.newDrone = newDrone;
    this.redraw();
  }

  /** Shows the waypoints [x, y] of a mission that is being drawn, or the corners of an area to stay `inside` or out of. */
  showMission(waypoints, inside = null) {
    this.mission = waypoints;
    this.area = inside === null ? null : { name: "", inside, low: null, high: null };
    this.redraw();
  }

  /** Shows where these drones [{id, x, y}], which are about to leave, will fly; all of it comes into view. */
  showHeld(moves) {
    this.held = moves;
    if (!moves.every(({ x, y }) => this.#inView([x, y], OUT_OF_VIEW_PX)))
      this.camera.fit(this.#points(), this.#covered());
    this.redraw();
  }

  /** Shows where these drones [{id, x, y}] would fly. */
  showMoves(moves) {
    this.shownMoves = moves;
    this.redraw();
  }

  /** From now on a drag draws a lasso, and selects the drones inside; false: it moves the map again. */
  chooseLasso(on) {
    this.lasso = on ? [] : null;
    document.body.toggleAttribute("data-lasso", on);
    this.redraw();
  }

  /** Selects the routers inside the lasso. A gateway, on which the mesh hangs, is only selected by itself. */
  #catch() {
    const radius = droneRadius(this.camera, this.mesh);
    const caught = [...this.mesh.nodes.values()].filter(
      (node) =>
        node.role === 0 &&
        node.position &&
        isInside(onScreen(this.camera, node, radius), this.lasso),
    );
    this.mesh.selectGroup(caught.map((node) => node.id));
    this.lasso = [];
  }

  fit() {
    this.camera.fit(this.#points(), this.#covered());
    this.moved = false;
    this.redraw();
  }

  /** The drones and places {cast: [id], places: [[x, y, z]]} of a demonstration; others are dimmed. */
  setStage({ cast = [], places = [] }) {
    const begins = places.length && !this.stage.places.length;
    this.stage = { cast: new Set(cast), places };
    if (begins && !this.moved) this.fit(); // then the scale stays
    this.redraw();
  }

  /** What fits into the view: all drones and where they fly to; in a demonstration only its places. */
  #points() {
    const nodes = [...this.mesh.nodes.values()];
    const { places, cast } = this.stage;
    if (places.length) {
      const shown = nodes.filter((node) => cast.has(node.id) && node.role === 1 && node.position);
      return [...places, ...shown.map((node) => node.position)];
    }
    const planned = [...this.held, ...this.shownMoves].map(({ x, y }) => [x, y]);
    const present = nodes.flatMap((node) => [
      ...(node.position ? [node.position] : []),
      ...(node.path.length ? [node.path.slice(-3)] : []),
    ]);
    return [...planned, ...present];
  }

  /** Whether this place is in view; `margin` px from the edges. */
  #inView([x, y], margin) {
    const [px, py] = this.camera.toScreen(x, y);
    const { width, height } = this.camera;
    const top = this.#covered();
    return px >= margin && px <= width - margin && py >= top + margin && py <= height - margin;
  }

  /** Fits again when drones leave the view, unless the user has moved it. */
  #follow() {
    if (this.moved || this.drag || this.stage.places.length) return;
    if (this.#points().some((point) => !this.#inView(point, OUT_OF_VIEW_PX))) this.fit();
  }

  /** Cancels a drag; returns whether there was one. */
  cancelDrag() {
    const dragged = this.drag !== null;
    this.drag = null;
    this.pointers.clear();
    this.redraw();
    return dragged;
  }

  #draw() {
    this.pending = false;
    if (!this.fitted && this.mesh.nodes.size && this.camera.width > 1) {
      this.fitted = true;
      this.fit();
    }
    if (this.following) this.#centre(this.mesh.nodes.get(this.mesh.selected));
    else if (this.fitted) this.#follow();
    this.marks = this.#outside();
    const context = this.canvas.getContext("2d");
    const ratio = window.devicePixelRatio;
    context.setTransform(ratio, 0, 0, ratio, 0, 0);
    const options = { ...this.options, top: this.#covered(), cast: this.stage.cast };
    const drawn = drawMesh(context, this.camera, this.mesh, this.colours, options, this.#goals());
    this.radius = drawn.radius;
    if (this.area && this.mission.length > 2)
      drawArea(context, this.camera, { ...this.area, rings: [this.mission] }, this.colours, 0);
    drawMission(context, this.camera, this.mission, this.colours);
    if (this.lasso?.length) drawLasso(context, this.lasso, this.colours);
    for (const mark of this.marks) drawMark(context, mark, this.colours);
    if (this.newDrone)
      drawNewDrone(
        context,
        this.camera,
        this.newDrone,
        this.mesh.clock.range,
        this.colours,
        this.radius,
      );
    this.#describe(drawn);
    this.#keepTurning(drawn);
    this.drawn?.();
  }

  /** Where drones that are dragged, or about to leave, would fly. */
  #goals() {
    return [
      ...this.held,
      ...this.shownMoves,
      ...(this.drag ? this.#moves(this.drag.id, this.drag.x, this.drag.y) : []),
    ];
  }

  #centre(node) {
    if (!node?.position) return;
    this.moved = true;
    const [x, y] = this.camera.toScreen(node.position[0], node.position[1]);
    this.camera.pan(this.camera.width / 2 - x, (this.camera.height + this.#covered()) / 2 - y);
  }

  /** Redraws after TURN_PERIOD_MS while turning rotors are visible. */
  #keepTurning({ radius }) {
    clearTimeout(this.turning);
    if (this.still.matches || !hasArms(this.mesh.clock.shape, radius)) return;
    const flying = [...this.mesh.nodes.values()].some(
      (node) => node.path.length || node.heading.length,
    );
    if (flying) this.turning = setTimeout(() => this.redraw(), TURN_PERIOD_MS);
  }

  #describe(drawn) {
    const left =
      this.options.known && drawn.linksDrawn < drawn.links
        ? " (those of the selected node are shown)"
        : "";
    const text = `${drawn.drones} drones, ${drawn.links} links${left}, ${drawn.routeLinks} on routes to a gateway`;
    if (this.note.textContent !== text) this.note.textContent = text;
    const { x, y, scale } = this.camera;
    const nodes = [...this.mesh.nodes.values()];
    this.legendCrashed.hidden = !nodes.some((node) => node.condition === "crashed");
    this.legendObstacle.hidden = !this.mesh.obstacles.length;
    this.legendInside.hidden = !this.mesh.fence.some(({ inside }) => inside);
    this.legendOutside.hidden = this.mesh.fence.every(({ inside }) => inside);
    this.legendPad.hidden = !nodes.some(({ home }) => home?.length);
    this.legendRelief.hidden = !this.mesh.links.relief.length;
    const outside = this.marks.reduce((sum, { ids }) => sum + ids.length, 0);
    Object.assign(this.note.dataset, drawn, { x, y, scale, outside });
  }

  /** How much of the canvas its tools cover at the top, px. */
  #covered() {
    return this.top.offsetTop + this.top.offsetHeight;
  }

  /** A mark at the edge for each group of drones outside of the view. */
  #outside() {
    const marks = [];
    if (this.stage.places.length) return marks; // they would cover what is shown
    const { width, height } = this.camera;
    const [left, top] = [MARK_PX, this.#covered() + MARK_PX];
    for (const node of this.mesh.nodes.values()) {
      if (!node.position || this.#inView(node.position, 0)) continue;
      const [px, py] = this.camera.toScreen(node.position[0], node.position[1]);
      const x = Math.min(width - left, Math.max(left, px));
      const y = Math.min(height - left, Math.max(top, py));
      const near = marks.find((mark) => Math.hypot(mark.x - x, mark.y - y) < MARKS_APART_PX);
      if (near) near.ids.push(node.id);
      else marks.push({ x, y, ids: [node.id], angle: Math.atan2(py - y, px - x) });
    }
    return marks;
  }

  /** Shows who is under the pointer; null: nobody. */
  #point(node, event) {
    this.hover.hidden = !node;
    if (!node) return;
    const parts = [
      `${node.role === 1 ? "Gateway" : "Router"} ${node.id}`,
      node.trouble || node.condition,
    ];
    if (batteryOf(node)) parts.push(`battery ${batteryOf(node)}`);
    if (node.pad) parts.push(node.pad);
    this.hover.textContent = [parts.join(", "), node.order].filter(Boolean).join("; ");
    const { width, height } = this.camera;
    const [x, y] = [event.offsetX, event.offsetY];
    this.hover.style.left = `${Math.max(4, Math.min(x + 14, width - this.hover.offsetWidth - 4))}px`;
    const below = y + 18 + this.hover.offsetHeight < height;
    this.hover.style.top = `${below ? y + 18 : y - 12 - this.hover.offsetHeight}px`;
  }

  #resize() {
    const ratio = window.devicePixelRatio;
    const { clientWidth, clientHeight } = this.canvas;
    if (!clientWidth) return;
    this.canvas.width = Math.round(clientWidth * ratio);
    this.canvas.height = Math.round(clientHeight * ratio);
    this.camera.width = clientWidth;
    this.camera.height = clientHeight;
    const { places } = this.stage; // while they are in view, the scale stays
    const seen = places.length && places.every((place) => this.#inView(place, IN_VIEW_PX));
    if (this.fitted && !this.moved && !seen) this.fit();
    else if (this.mesh.selected !== null) this.show(this.mesh.selected);
    this.#draw();
  }

  #nodeAt(px, py) {
    let nearest = null;
    const radius = droneRadius(this.camera, this.mesh);
    let best = radius + NEAR_PX;
    for (const node of drawingOrder(this.mesh)) {
      if (!node.position) continue;
      const [x, y] = onScreen(this.camera, node, radius);
      const distance = Math.hypot(x - px, y - py);
      if (distance <= best) [nearest, best] = [node, distance];
    }
    return nearest;
  }

  #markAt(px, py) {
    return this.marks.find(({ x, y }) => Math.hypot(x - px, y - py) < MARK_PX);
  }

  #down(event) {
    if (event.button !== 0) return;
    this.canvas.focus({ preventScroll: true });
    this.canvas.setPointerCapture(event.pointerId);
    const node = this.#nodeAt(event.offsetX, event.offsetY);
    // A swipe that moves the map must not send away a drone that happens to be under the finger.
    const mayDrag =
      node &&
      this.mesh.canOrder &&
      (event.pointerType === "mouse" || node.id === this.mesh.selected);
    this.pointers.set(event.pointerId, {
      x: event.offsetX,
      y: event.offsetY,
      startX: event.offsetX,
      startY: event.offsetY,
      node: node?.id ?? null,
      mayDrag,
      moved: false,
    });
    if (this.pointers.size > 1) this.drag = null;
  }

  #move(event) {
    const pointer = this.pointers.get(event.pointerId);
    if (!pointer) {
      const node = this.#nodeAt(event.offsetX, event.offsetY);
      const mark = this.#markAt(event.offsetX, event.offsetY);
      this.canvas.style.cursor = node || mark ? "pointer" : "grab";
      this.#point(event.pointerType === "mouse" ? node : null, event);
      return;
    }
    this.#point(null);
    const [dx, dy] = [event.offsetX - pointer.x, event.offsetY - pointer.y];
    if (Math.hypot(event.offsetX - pointer.startX, event.offsetY - pointer.startY) > DRAG_AFTER_PX)
      pointer.moved = true;
    if (this.pointers.size > 1) this.#pinch(pointer, event);
    else if (pointer.moved && this.lasso) {
      if (!this.lasso.length) this.lasso.push([pointer.startX, pointer.startY]);
      this.lasso.push([event.offsetX, event.offsetY]);
    } else if (pointer.moved && pointer.mayDrag) {
      const [x, y] = this.camera.toWorld(event.offsetX, event.offsetY);
      this.drag = { id: pointer.node, x, y };
      this.mesh.select(pointer.node);
    } else if (pointer.moved) {
      this.moved = true;
      this.camera.pan(dx, dy);
    }
    pointer.x = event.offsetX;
    pointer.y = event.offsetY;
    this.redraw();
  }

  #pinch(pointer, event) {
    this.moved = true;
    const other = [...this.pointers.values()].find((one) => one !== pointer);
    const before = Math.hypot(pointer.x - other.x, pointer.y - other.y);
    const after = Math.hypot(event.offsetX - other.x, event.offsetY - other.y);
    if (before > 0 && after > 0) this.camera.zoom(after / before, other.x, other.y);
  }

  #up(event) {
    const pointer = this.pointers.get(event.pointerId);
    this.pointers.delete(event.pointerId);
    if (!pointer) return;
    if (pointer.moved && this.lasso) this.#catch();
    else if (this.drag) {
      const { id, x, y } = this.drag;
      this.drag = null;
      this.fly(this.#moves(id, x, y));
    } else if (!pointer.moved && this.#markAt(event.offsetX, event.offsetY))
      this.show(this.#markAt(event.offsetX, event.offsetY).ids[0]);
    else if (!pointer.moved && this.onPlace)
      this.onPlace(...this.camera.toWorld(event.offsetX, event.offsetY));
    else if (!pointer.moved && event.shiftKey && pointer.node !== null)
      this.mesh.toggle(pointer.node);
    else if (!pointer.moved) this.mesh.select(pointer.node);
    this.redraw();
  }

  /** A drag of one drone of a group moves all of them by as much. */
  #moves(id, x, y) {
    const start = this.mesh.nodes.get(id)?.position;
    const ids = this.mesh.group.has(id) && start ? [...this.mesh.group] : [id];
    return ids
      .filter((one) => one === id || this.mesh.nodes.get(one).position)
      .map((one) => {
        const from = this.mesh.nodes.get(one).position;
        return one === id
          ? { id, x, y }
          : { id: one, x: from[0] + x - start[0], y: from[1] + y - start[1] };
      });
  }

  #cancel(event) {
    this.pointers.delete(event.pointerId);
    this.drag = null;
    this.redraw();
  }

  #wheel(event) {
    event.preventDefault();
    this.moved = true;
    this.camera.zoom(Math.exp(-event.deltaY * 0.0015), event.offsetX, event.offsetY);
    this.redraw();
  }

  #key(event) {
    const step = { ArrowLeft: [1, 0], ArrowRight: [-1, 0], ArrowUp: [0, 1], ArrowDown: [0, -1] }[
      event.key
    ];
    if (step) this.camera.pan(step[0] * KEY_STEP_PX, step[1] * KEY_STEP_PX);
    else if (event.key === "+" || event.key === "=") this.camera.zoom(ZOOM_STEP);
    else if (event.key === "-") this.camera.zoom(1 / ZOOM_STEP);
    else return;
    this.moved = true;
    event.preventDefault();
    this.redraw();
  }
}
