// The page's WebSocket: frames in, orders out. When it breaks, the page tries again until it is open.

const FIRST_WAIT_MS = 500;
const LONGEST_WAIT_MS = 5000;
const ANSWER_WITHIN_MS = 30000;
const SILENT_AFTER_MS = 2000; // the console sends something at least twice a second
const LOOK_EVERY_MS = 250;

export class Connection extends EventTarget {
  #socket = null;
  #wait = FIRST_WAIT_MS;
  #number = 0;
  #orders = new Map(); // number -> {resolve, reject, timer}
  #alive = null; // the console's clock in its last sign of life
  #heard = -Infinity; // when the last message came, on this page's clock

  constructor(mesh) {
    super();
    this.mesh = mesh;
    this.open = false;
    this.silent = true; // whether what the page shows may be old
    this.#connect();
    setInterval(() => this.#look(), LOOK_EVERY_MS);
    mesh.addEventListener("select", () => this.#watch());
  }

  /** Sends an order. Resolves with a short text, or throws an Error with the reason. */
  async order(request) {
    return (await this.request(request)).text;
  }

  /** Sends a request. Resolves with the answer, or throws an Error with the reason. */
  request(request) {
    this.#look();
    if (!this.open) return Promise.reject(new Error("there is no connection to the console"));
    // The browser would queue it, and it would be carried out whenever the network returns.
    if (this.silent) return Promise.reject(new Error("the console is silent: nothing was sent"));
    const number = ++this.#number;
    return new Promise((resolve, reject) => {
      const timer = setTimeout(() => {
        this.#orders.delete(number);
        reject(new Error("no answer yet: the simulation may be busy or gone"));
      }, ANSWER_WITHIN_MS);
      this.#orders.set(number, { resolve, reject, timer });
      this.#socket.send(JSON.stringify({ heard: this.#alive, ...request, number }));
    });
  }

  /** Sends a request that gets no answer. */
  ask(request) {
    if (this.open && !this.silent) this.#socket.send(JSON.stringify(request));
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

  /** Seconds since the console was last heard. */
  get age() {
    return (performance.now() - this.#heard) / 1000;
  }

  #look() {
    const silent = !this.open || 1000 * this.age > SILENT_AFTER_MS;
    if (!silent && !this.silent) return;
    this.silent = silent;
    this.dispatchEvent(new Event("change"));
  }

  #receive(message) {
    this.#heard = performance.now();
    if (this.silent) this.#look();
    if (message.type === "alive") this.#alive = message.at;
    else if (message.type === "frame") this.mesh.apply(message);
    else if (message.type === "packets") this.mesh.applyPackets(message);
    else if (message.type === "detail") this.mesh.applyDetail(message);
    else if (message.type === "timeline") this.mesh.applyTimeLine(message);
    else if (message.type === "marks") this.mesh.applyMarks(message);
    else if (message.type === "hello") this.mesh.applyHello(message);
    else if (message.type === "told")
      this.dispatchEvent(new CustomEvent("told", { detail: message.text }));
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
