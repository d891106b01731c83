// Mouse, fingers and keys on the picture.

const turn_per_pixel = 0.008;
const key_turn = Math.PI / 36;
const key_pan = 24;

/** Binds the canvas to the view; `home` is called by the Home key. */
export function bind_gestures(canvas, view, home) {
  const pointers = new Map();
  let before = null;  // middle, distance and angle of two fingers

  const from_middle = (event) => {
    const box = canvas.getBoundingClientRect();
    return [event.clientX - box.left - box.width / 2, event.clientY - box.top - box.height / 2];
  };
  const pair = () => {
    const [[ax, ay], [bx, by]] = [...pointers.values()];
    return {x: (ax + bx) / 2, y: (ay + by) / 2, size: Math.hypot(bx - ax, by - ay) || 1, angle: Math.atan2(by - ay, bx - ax)};
  };

  canvas.addEventListener("pointerdown", (event) => {
    canvas.focus({preventScroll: true});
    canvas.setPointerCapture(event.pointerId);
    pointers.set(event.pointerId, from_middle(event));
    before = pointers.size === 2 ? pair() : null;
    event.preventDefault();
  });
  canvas.addEventListener("pointermove", (event) => {
    const last = pointers.get(event.pointerId);
    if (!last) return;
    const now = from_middle(event);
    pointers.set(event.pointerId, now);
    if (pointers.size === 1) {
      const dx = now[0] - last[0], dy = now[1] - last[1];
      if (event.shiftKey || event.buttons & 6) view.pan(dx, dy);
      else view.turn(dx * turn_per_pixel, dy * turn_per_pixel);
    } else if (pointers.size === 2 && before) {
      const after = pair();
      view.pan(after.x - before.x, after.y - before.y);
      view.zoom(after.size / before.size, after.x, after.y);
      const twist = Math.atan2(Math.sin(after.angle - before.angle), Math.cos(after.angle - before.angle));
      view.turn(0, 0, twist);
      before = after;
    }
  });
  const up = (event) => {
    pointers.delete(event.pointerId);
    before = null;
  };
  canvas.addEventListener("pointerup", up);
  canvas.addEventListener("pointercancel", up);
  canvas.addEventListener("contextmenu", (event) => event.preventDefault());
  // The wheel scrolls the page until the picture has been clicked; a pinch on a touchpad comes with ctrlKey.
  canvas.addEventListener("wheel", (event) => {
    if (document.activeElement !== canvas && !event.ctrlKey) return;
    event.preventDefault();
    const pixels = event.deltaY * (event.deltaMode === 1 ? 24 : event.deltaMode === 2 ? 400 : 1);
    view.zoom(Math.exp(-Math.max(-300, Math.min(300, pixels)) * (event.ctrlKey ? 0.008 : 0.0015)), ...from_middle(event));
  }, {passive: false});

  const arrows = {ArrowLeft: [-1, 0], ArrowRight: [1, 0], ArrowUp: [0, -1], ArrowDown: [0, 1]};
  canvas.addEventListener("keydown", (event) => {
    if (event.ctrlKey || event.metaKey || event.altKey) return;
    const arrow = arrows[event.key];
    if (arrow && event.shiftKey) view.pan(key_pan * arrow[0], key_pan * arrow[1]);
    else if (arrow) view.turn(key_turn * arrow[0], key_turn * arrow[1]);
    else if (event.key === "+" || event.key === "=") view.zoom(1.2);
    else if (event.key === "-" || event.key === "_") view.zoom(1 / 1.2);
    else if (event.key === "Home") home();
    else return;
    event.preventDefault();
  });
}
