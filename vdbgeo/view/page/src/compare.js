// div.compare: two pictures on top of each other with a border that moves.
import {make} from "./elements.js";

export function start_compare(block, number) {
  const before = block.querySelector("img.before"), after = block.querySelector("img.after");
  if (!before || !after) return;
  const axis = block.dataset.axis;
  const slider = make("input", {type: "range", min: 0, max: 100, value: 50, step: 1, id: `vdbgeo-compare-${number}`});
  const stack = make("div", {class: "stack"}, before, after, make("span", {class: "border", "aria-hidden": "true"}),
                     make("span", {class: "tag left", "aria-hidden": "true"}, "before"),
                     make("span", {class: "tag right", "aria-hidden": "true"}, "after"));
  const split = () => {
    stack.style.setProperty("--split", `${slider.value}%`);
    slider.setAttribute("aria-valuetext", `${slider.value} % before, ${100 - slider.value} % after`);
  };
  slider.addEventListener("input", split);
  const follow = (event) => {
    const box = stack.getBoundingClientRect();
    slider.value = Math.round(100 * (event.clientX - box.left) / box.width);
    split();
  };
  stack.addEventListener("pointerdown", (event) => {
    stack.setPointerCapture(event.pointerId);
    follow(event);
    event.preventDefault();
  });
  stack.addEventListener("pointermove", (event) => { if (event.buttons & 1) follow(event); });
  const name = axis ? `Before and after, section across ${axis}` : "Before and after";
  block.prepend(stack, make("div", {class: "field"}, make("label", {for: slider.id}, name), slider));
  block.classList.add("live");
  split();
}
