// What lies over the picture: a bar of round length and the directions of x, y, z.
import {Vector3} from "three";

import {make, make_svg} from "./elements.js";

export const axis_colours = ["#c2410c", "#15803d", "#1d6fd1"];

/** A round length of about `pixels` in Å at so many pixels an Å: [Å, text]. */
export function round_length(pixels, pixels_per_unit, unit) {
  const wanted = pixels / pixels_per_unit;
  const power = 10 ** Math.floor(Math.log10(wanted));
  const length = power * [5, 2, 1].find((m) => m * power <= wanted);
  if (unit === "Å" && length >= 10000) return [length, `${Number((length / 10000).toPrecision(3))} µm`];
  if (unit === "Å" && length >= 1000) return [length, `${Number((length / 10).toPrecision(3))} nm`];
  return [length, `${Number(length.toPrecision(3))} ${unit}`];
}

/** Where the tips of the axes x, y, z are in the picture (right, down), nearest last: [number, x, y]. */
export function triad(turn) {
  const back = turn.clone().invert();
  return [0, 1, 2].map((i) => {
    const v = new Vector3().setComponent(i, 1).applyQuaternion(back);
    return {i, x: v.x, y: -v.y, z: v.z};
  }).sort((a, b) => a.z - b.z);
}

export class Overlay {
  constructor(stage, view, unit) {
    this.view = view;
    this.unit = unit;
    this.text = make("span");
    this.bar = make("div", {class: "scale-bar", "aria-hidden": "true"}, this.text);
    this.axes = make_svg("svg", {class: "triad", viewBox: "-40 -40 80 80", "aria-hidden": "true"});
    this.arms = axis_colours.map((colour, i) => {
      const line = make_svg("line", {x1: 0, y1: 0, stroke: colour, "stroke-width": 3, "stroke-linecap": "round"});
      const name = make_svg("text", {fill: colour, "text-anchor": "middle", "dominant-baseline": "central"}, "xyz"[i]);
      return {line, name, group: make_svg("g", {}, line, name)};
    });
    this.axes.append(...this.arms.map((arm) => arm.group));
    stage.append(this.bar, this.axes);
  }

  update() {
    const [length, text] = round_length(Math.min(140, this.view.width / 4), this.view.pixels_per_unit(), this.unit);
    this.bar.style.width = `${length * this.view.pixels_per_unit()}px`;
    this.text.textContent = text;
    for (const {i, x, y} of triad(this.view.turn_now)) {
      const {line, name, group} = this.arms[i];
      line.setAttribute("x2", 24 * x);
      line.setAttribute("y2", 24 * y);
      name.setAttribute("x", 33 * x);
      name.setAttribute("y", 33 * y);
      this.axes.append(group);  // the nearest is drawn last
    }
  }
}
