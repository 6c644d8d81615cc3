// Keys, wherever the focus is. Space and Escape stop: the page has no field in which a space is written, buttons are
// pressed and boxes ticked with Enter.

/** `act` has stop, undo, redo, remove, zoom(factor), fit, use(tool number), run, pause, arm. */
export function listen(act) {
  addEventListener("keydown", (event) => down(event, act), { capture: true });
  // A button is pressed when the space bar comes up.
  addEventListener("keyup", (event) => event.key === " " && event.preventDefault(), { capture: true });
}

function down(event, act) {
  if (event.key === " " || event.key === "Escape") {
    event.preventDefault();
    event.stopPropagation();
    if (!event.repeat) act.stop();
    return;
  }
  const { target } = event;
  if (event.key === "Enter" && target.matches?.("input[type=checkbox]")) {
    event.preventDefault();
    target.click();
    return;
  }
  if (target.matches?.("input:not([type=checkbox]), select")) return;
  const what = command(event, act);
  if (!what) return;
  event.preventDefault();
  what();
}

function command(event, act) {
  const key = event.key.toLowerCase();
  if (event.altKey) return null;
  if (event.ctrlKey || event.metaKey) {
    if (key === "z") return event.shiftKey ? act.redo : act.undo;
    return key === "y" ? act.redo : null;
  }
  const plain = {
    delete: act.remove,
    backspace: act.remove,
    "+": () => act.zoom(1.25),
    "=": () => act.zoom(1.25),
    "-": () => act.zoom(1 / 1.25),
    0: act.fit,
    r: act.run,
    p: act.pause,
    a: act.arm,
  };
  return plain[key] ?? (/^[1-4]$/.test(key) ? () => act.use(Number(key) - 1) : null);
}
