// Selects drones by a rule or by the name of a group; groups are kept in this browser.

const GROUPS_KEY = "drone-mesh-groups";
export const LOW_BATTERY = 30; // percent

const byId = (id) => document.getElementById(id);

const RULES = {
  "all routers": (node) => node.role === 0,
  "without a route": (node) => node.role === 0 && node.on && node.condition === "disconnected",
  [`battery under ${LOW_BATTERY} %`]: (node) => (node.battery ?? 100) < LOW_BATTERY,
  "in flight": (node) => node.condition === "flying",
  "switched off": (node) => !node.on,
  "with a problem": (node) => Boolean(node.trouble),
};

export class Groups {
  /** `shown()` returns the ids in the filtered table; `toast(text, bad)` shows a text. */
  constructor(mesh, shown, toast) {
    this.mesh = mesh;
    this.shown = shown;
    this.toast = toast;
    this.list = byId("rule");
    this.list.addEventListener("change", () => this.#choose());
    byId("group-save").addEventListener("submit", (event) => this.#save(event));
    this.#offer();
  }

  #groups() {
    try {
      return JSON.parse(localStorage.getItem(GROUPS_KEY)) ?? {};
    } catch {
      return {};
    }
  }

  #offer() {
    const options = [...Object.keys(RULES), "rows shown in the table"].map(
      (rule) => new Option(rule, `rule ${rule}`),
    );
    const named = document.createElement("optgroup");
    named.label = "Groups";
    named.append(...Object.keys(this.#groups()).map((name) => new Option(name, `group ${name}`)));
    this.list.replaceChildren(new Option("Select …", ""), ...options);
    if (named.children.length) this.list.append(named);
  }

  #choose() {
    const [kind, ...rest] = this.list.value.split(" ");
    const name = rest.join(" ");
    this.list.value = "";
    const nodes = [...this.mesh.nodes.values()];
    const ids =
      kind === "group"
        ? this.#groups()[name].filter((id) => this.mesh.nodes.has(id))
        : name in RULES
          ? nodes.filter(RULES[name]).map((node) => node.id)
          : this.shown();
    this.mesh.selectGroup(ids);
    if (!ids.length) this.toast(`no drone: ${name}`, true);
  }

  /** Keeps the selected drones under the typed name, in place of an older group of that name. */
  #save(event) {
    event.preventDefault();
    const input = byId("group-name");
    const name = input.value.trim();
    if (!name) return this.toast("type a name for the group", true);
    const ids = [...this.mesh.group].sort((a, b) => a - b);
    localStorage.setItem(GROUPS_KEY, JSON.stringify({ ...this.#groups(), [name]: ids }));
    input.value = "";
    this.#offer();
    this.toast(`group ${name}: ${ids.length} drones`, false);
  }
}
