// Small helpers to make elements.

const svg_space = "http://www.w3.org/2000/svg";

function fill(node, attributes, children) {
  for (const [name, value] of Object.entries(attributes)) {
    if (name.startsWith("on")) node.addEventListener(name.slice(2), value);
    else if (value === true) node.setAttribute(name, "");
    else if (value !== false && value !== null) node.setAttribute(name, value);
  }
  node.append(...children.filter((child) => child !== null));
  return node;
}

export const make = (tag, attributes = {}, ...children) => fill(document.createElement(tag), attributes, children);
export const make_svg = (tag, attributes = {}, ...children) => fill(document.createElementNS(svg_space, tag), attributes, children);

let last = 0;
/** A control with its label before it, in one block. */
export function labelled(text, control, ...after) {
  control.id ||= `vdbgeo-control-${++last}`;
  return make("div", {class: "field"}, make("label", {for: control.id}, text), control, ...after);
}

/** A checkbox with its label behind it. */
export function checkbox(text, onchange) {
  const box = make("input", {type: "checkbox", onchange});
  box.id = `vdbgeo-control-${++last}`;
  return {box, field: make("div", {class: "field check"}, box, make("label", {for: box.id}, text))};
}

export const menu = (options, onchange) =>
    make("select", {onchange}, ...options.map(([value, text]) => make("option", {value}, text)));
