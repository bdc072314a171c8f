// The focus is never lost: when what had it disappears, something visible gets it.

const LOOK_EVERY_MS = 200;

/** `otherwise()` returns what gets the focus. */
export function keepFocus(otherwise) {
  let last = null;
  document.addEventListener("focusin", (event) => (last = event.target));
  setInterval(() => {
    if (!last || document.activeElement !== document.body) return;
    const gone = !last.isConnected || !last.checkVisibility();
    if (!gone) return;
    last = null;
    otherwise().focus({ preventScroll: true });
  }, LOOK_EVERY_MS);
}
