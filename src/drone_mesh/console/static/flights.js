// Orders flights: asks for confirmation of a long one, and holds each order briefly so that it can be undone. An order
// that would cost a drone its route is held until the user sends it.
// A drone in flight may be out of reach, so an order cannot be recalled once it is sent.

import { agreed } from "./confirm.js";

const HOLD_MS = 5000;
const FAR_M = 50;
const MAX_NAME = 100; // of a formation

const byId = (id) => document.getElementById(id);

export class Flights extends EventTarget {
  #timer = null;
  #send = null; // sends the held orders
  #from = null; // had the focus before

  /**
   * `ask(request)` resolves with the answer, or throws; its text is short. `toast(text, bad)` shows it.
   */
  constructor(mesh, ask, toast) {
    super();
    this.mesh = mesh;
    this.ask = ask;
    this.toast = toast;
    this.held = []; // [{id, x, y, z}], ordered when HOLD_MS are over
    byId("held-undo").addEventListener("click", () => this.undo());
    byId("held-now").addEventListener("click", () => this.#release());
  }

  /**
   * Orders these drones [{id, x, y, z}] to fly after HOLD_MS, unless the user undoes it.
   * `what` describes them; `send` sends all the orders; `preview` asks what would come of them.
   */
  async hold(
    moves,
    what = names(moves),
    send = () => this.#order(moves, what),
    preview = { do: "foresee", places: places(moves) },
  ) {
    if (this.#timer) this.#release();
    else this.undo(); // nobody has confirmed it
    if (!(await this.#agreed(moves, what)) || !(await this.#gatewaysAgreed(moves))) return;
    this.#hold(moves, send);
    const goal = moves.length > 1 ? "" : ` to ${metres(moves[0].x)}, ${metres(moves[0].y)}`;
    byId("held-text").textContent = `${what} will leave${goal}`;
    this.#timer = setTimeout(() => this.#release(), HOLD_MS);
    this.#foresee(preview);
  }

  /** Says what will come of the held orders. If a drone would be out of reach, they wait for the user. */
  async #foresee(preview) {
    const { held } = this;
    const answer = await this.ask(preview).catch(() => null); // the order itself is answered
    if (!answer?.text || this.held !== held) return;
    const { text, lost } = answer;
    byId("held-text").textContent += `: ${text}`;
    if (lost.length) {
      this.#stopTimer();
      byId("held-text").textContent += ". It waits for you";
    }
    this.held = held.map((move) => ({ ...move, lost: lost.includes(move.id) }));
    this.dispatchEvent(new Event("change"));
  }

  #stopTimer() {
    clearTimeout(this.#timer);
    this.#timer = null;
  }

  /** Drops the held orders and says so; returns whether there were any. */
  undo() {
    const held = this.held.length > 0;
    if (held) this.toast(`not sent: ${byId("held-text").textContent}`, false);
    this.#hold([], null);
    return held;
  }

  #hold(moves, send) {
    this.#stopTimer();
    this.held = moves;
    this.#send = send;
    byId("held").hidden = !moves.length;
    const focused = document.activeElement;
    if (moves.length && focused.closest("input, select")) {
      this.#from = focused; // so that one key undoes a typed order
      byId("held-undo").focus();
    } else if (!moves.length && this.#from) {
      if (focused === document.body || focused.closest("#held")) this.#from.focus();
      this.#from = null;
    }
    this.dispatchEvent(new Event("change"));
  }

  #release() {
    const send = this.#send;
    this.#hold([], null);
    send?.();
  }

  /** Several drones go as one standing order, if somebody keeps those. */
  async #order(moves, what) {
    if (moves.length === 1 || !this.mesh.actions.includes("formation"))
      return this.#orderEach(moves);
    const gateways = this.#gateways(moves); // which the user agreed to
    const name = what.slice(0, MAX_NAME);
    const request = { do: "formation", name, places: places(moves), gateways };
    try {
      this.toast((await this.ask(request)).text, false);
    } catch (error) {
      this.toast(error.message, true);
    }
  }

  /**
   * The drones farthest from the gateway first, so that relays leave last. A place that another of these drones leaves is
   * free; for the place of any other drone, the user is asked.
   */
  async #orderEach(moves) {
    const hops = ({ id }) => this.mesh.nodes.get(id)?.hops ?? 0;
    const leaving = new Set(moves.map((move) => move.id));
    const failed = [];
    let text = "";
    for (const { id, x, y, z } of [...moves].sort((a, b) => hops(b) - hops(a))) {
      const request = { do: "fly", node: id, x: metres(x), y: metres(y), z };
      try {
        text = await this.#sendOne(request, leaving);
      } catch (error) {
        failed.push(`${id}: ${error.message}`);
      }
      leaving.delete(id); // from now on the gateway knows where it will stand
    }
    if (moves.length > 1)
      text = `ordered ${moves.length - failed.length} of ${moves.length} drones`;
    if (failed.length) this.toast(failed.slice(0, 3).join("; "), true);
    if (failed.length < moves.length) this.toast(text, false);
  }

  /** Sends one order, and again if it leads to the place of a drone that leaves, or if the user agrees. */
  async #sendOne(request, leaving) {
    try {
      return (await this.ask(request)).text;
    } catch (error) {
      const taken = /^drone (\d+) .*allow_shared_place/.exec(error.message);
      if (!taken) throw error;
      const reason = error.message.split(";")[0];
      const question = `Drone ${request.node}: ${reason}. Send it all the same?`;
      if (!leaving.has(Number(taken[1])) && !(await agreed(question, "Send"))) throw error;
      return (await this.ask({ ...request, allow_shared_place: true })).text;
    }
  }

  /** Whether no drone flies far, or the user agrees. */
  async #agreed(moves, what) {
    const far = Math.max(...moves.map((move) => this.#distance(move)));
    if (far <= FAR_M) return true;
    const question =
      `${what} would fly ${far.toFixed(0)} m` + (moves.length > 1 ? " at most." : ".");
    return agreed(question, "Send");
  }

  /** Whether none of these drones is a gateway, or the user agrees. */
  async #gatewaysAgreed(moves) {
    const ids = this.#gateways(moves);
    if (!ids.length) return true;
    const who = `${ids.length > 1 ? "Gateways" : "Gateway"} ${ids.join(", ")}`;
    return agreed(`${who} would fly, on which the mesh hangs.`, "Send");
  }

  #gateways(moves) {
    return moves.map(({ id }) => id).filter((id) => this.mesh.nodes.get(id)?.role === 1);
  }

  #distance({ id, x, y, z }) {
    const place = this.mesh.nodes.get(id)?.position;
    return place ? Math.hypot(x - place[0], y - place[1], z - place[2]) : 0;
  }
}

function metres(value) {
  return Number(value.toFixed(2));
}

/** As requests name them: [[id, x, y, z]]. */
function places(moves) {
  return moves.map(({ id, x, y, z }) => [id, metres(x), metres(y), z]);
}

/** These drones [{id}] in words. */
export function names(moves) {
  return moves.length > 1 ? `${moves.length} drones` : `Drone ${moves[0].id}`;
}
