// The page's WebSocket: frames in, orders out. When it breaks, the page tries again until it is open.

const FIRST_WAIT_MS = 500;
const LONGEST_WAIT_MS = 5000;
const ANSWER_WITHIN_MS = 30000;

export class Connection extends EventTarget {
  #socket = null;
  #wait = FIRST_WAIT_MS;
  #number = 0;
  #orders = new Map(); // number -> {resolve, reject, timer}

  constructor(mesh) {
    super();
    this.mesh = mesh;
    this.open = false;
    this.#connect();
    mesh.addEventListener("select", () => this.#watch());
  }

  /** Sends an order. Resolves with a short text, or throws an Error with the reason. */
  async order(request) {
    return (await this.request(request)).text;
  }

  /** Sends a request. Resolves with the answer, or throws an Error with the reason. */
  request(request) {
    if (!this.open) return Promise.reject(new Error("there is no connection to the console"));
    const number = ++this.#number;
    return new Promise((resolve, reject) => {
      const timer = setTimeout(() => {
        this.#orders.delete(number);
        reject(new Error("no answer yet: the simulation may be busy or gone"));
      }, ANSWER_WITHIN_MS);
      this.#orders.set(number, { resolve, reject, timer });
      this.#socket.send(JSON.stringify({ ...request, number }));
    });
  }

  /** Sends a request that gets no answer. */
  ask(request) {
    if (this.open) this.#socket.send(JSON.stringify(request));
  }

  #connect() {
    const socket = new WebSocket(
      `${location.protocol === "https:" ? "wss" : "ws"}://${location.host}/ws`,
    );
    this.#socket = socket;
    socket.onopen = () => {
      this.#wait = FIRST_WAIT_MS;
      this.#setOpen(true);
      this.#watch();
    };
    socket.onmessage = (message) => this.#receive(JSON.parse(message.data));
    socket.onclose = () => {
      this.#setOpen(false);
      for (const { reject, timer } of this.#orders.values()) {
        clearTimeout(timer);
        reject(new Error("the connection broke before an answer came"));
      }
      this.#orders.clear();
      setTimeout(() => this.#connect(), this.#wait);
      this.#wait = Math.min(this.#wait * 1.6, LONGEST_WAIT_MS);
    };
  }

  #receive(message) {
    if (message.type === "frame") this.mesh.apply(message);
    else if (message.type === "packets") this.mesh.applyPackets(message);
    else if (message.type === "detail") this.mesh.applyDetail(message);
    else if (message.type === "timeline") this.mesh.applyTimeLine(message);
    else if (message.type === "marks") this.mesh.applyMarks(message);
    else if (message.type === "hello") this.mesh.applyHello(message);
    else if (message.type === "answer") {
      const order = this.#orders.get(message.number);
      if (!order) return;
      this.#orders.delete(message.number);
      clearTimeout(order.timer);
      if (message.done) order.resolve(message);
      else order.reject(new Error(message.text));
    }
  }

  #watch() {
    if (this.open) this.#socket.send(JSON.stringify({ do: "watch", node: this.mesh.selected }));
  }

  #setOpen(open) {
    this.open = open;
    this.dispatchEvent(new Event("change"));
  }
}
