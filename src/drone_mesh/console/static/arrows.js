// A group of buttons that is one tab stop: arrow keys move between them.

const STEPS = { ArrowDown: 1, ArrowRight: 1, ArrowUp: -1, ArrowLeft: -1 };

/** Lets the arrow keys move the focus between the matching elements in `container`. */
export function arrowKeys(container, selector) {
  container.addEventListener("keydown", (event) => {
    const step = STEPS[event.key];
    const items = [...container.querySelectorAll(selector)];
    if (!step || !items.length || event.ctrlKey || event.metaKey || event.altKey) return;
    event.preventDefault();
    const at = items.indexOf(document.activeElement);
    items[at < 0 ? 0 : Math.min(items.length - 1, Math.max(0, at + step))].focus();
  });
}
