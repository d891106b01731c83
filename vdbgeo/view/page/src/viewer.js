// The viewer: puts together picture, controls and key in #viewer.
import {Vector3} from "three";

import {inside} from "./colours.js";
import {make} from "./elements.js";
import {bind_gestures} from "./gestures.js";
import {key_of, show_key} from "./key.js";
import {make_uniforms} from "./material.js";
import {Overlay} from "./overlay.js";
import {Panel} from "./panel.js";
import {compose, save} from "./picture.js";
import {Surface, Tetrahedra} from "./specimen.js";
import {View, looking} from "./view.js";

const directions = {  // towards the viewer, and up
  front: [[0, -1, 0], [0, 0, 1]],
  side: [[1, 0, 0], [0, 0, 1]],
  top: [[0, 0, 1], [0, 1, 0]],
};

const hint = "Drag to turn, Shift and drag to move, wheel or pinch to zoom after a click on the picture. " +
    "Keys: arrows turn, Shift and arrows move, + and − zoom, Home resets.";

function joint_box(data) {
  const boxes = [data.surface, data.tets].filter(Boolean).map((part) => part.box);
  return [Math.min, Math.max].map((pick, end) => [0, 1, 2].map((c) => pick(...boxes.map((box) => box[end][c]))));
}

export class Viewer {
  constructor(place, data) {
    this.place = place;
    this.data = data;
    this.unit = data.unit ?? "Å";
    this.box = joint_box(data);
    this.centre = [0, 1, 2].map((c) => (this.box[0][c] + this.box[1][c]) / 2);
    this.radius = Math.hypot(...[0, 1, 2].map((c) => this.box[1][c] - this.box[0][c])) / 2 || 1;
    this.parts = {
      surface: data.surface && new Surface(data, data.surface, this.centre),
      tets: data.tets && new Tetrahedra(data, data.tets, this.centre),
    };
    this.state = {
      show: data.surface ? "surface" : "tets",
      property: {surface: "", tets: data.tets?.properties?.[0]?.key ?? ""},
      ranges: new Map(),
      range: (property) => this.state.ranges.get(`${this.state.show}/${property.key}`) ?? property.range ?? [property.low, property.high],
      edges: false,
      clip: {on: false, axis: 0, at: this.centre[0], sign: 1, flip: false},
      pocket: null,
    };
    this.jobs = Promise.resolve();
    this.waiting = new Set();  // what has been asked for and not begun
  }

  part() { return this.parts[this.state.show]; }

  /** Unpacks what is shown first and draws it. Throws where the browser or the data cannot. */
  async start() {
    this.build();
    await this.load(this.state.show);
    const {position} = this.part();
    let far = 0;
    for (let i = 0; i < position.length; i += 3) far = Math.max(far, position[i] ** 2 + position[i + 1] ** 2 + position[i + 2] ** 2);
    this.home_half = 1.04 * Math.sqrt(far);
    this.go_home(true);
    if (this.state.property[this.state.show]) await this.recolour();
    this.place.classList.add("live");
    this.view.resize();
    await this.view.settled();
    performance.mark("vdbgeo-first-picture");
  }

  build() {
    const canvas = make("canvas", {tabindex: 0, role: "application", "aria-label":
        `Three-dimensional model${this.data.title ? ` of ${this.data.title}` : ""}. Arrow keys turn it, Shift and arrow keys move it, plus and minus zoom, Home resets.`});
    const stage = make("div", {class: "stage"}, canvas);
    this.uniforms = make_uniforms(inside);
    this.overlay = null;
    this.view = new View(canvas, this.radius, this.uniforms, () => this.overlay?.update());
    this.overlay = new Overlay(stage, this.view, this.unit);
    this.note = make("p", {class: "stage-note", role: "status"});
    stage.append(this.note);
    this.key = make("div", {class: "key", hidden: true});
    this.panel = new Panel(this.state, {box: this.box, unit: this.unit, part: () => this.part(),
                                        has: {surface: Boolean(this.data.surface), tets: Boolean(this.data.tets)}},
                           (what) => this.changed(what));
    this.place.append(make("div", {class: "viewer-body"},
        make("div", {class: "viewer-main"}, stage, this.key, make("p", {class: "hint"}, hint)), this.panel.form));
    bind_gestures(canvas, this.view, () => this.go_home());
    const dark = matchMedia("(prefers-color-scheme: dark)");
    const theme = (light) => {
      this.uniforms.paper.value.copy(light || !dark.matches ? new Vector3(1, 1, 1) : new Vector3(0.075, 0.082, 0.098));
      this.view.draw();
    };
    dark.addEventListener("change", () => theme(false));
    theme(false);
    addEventListener("beforeprint", () => {
      theme(true);
      this.for_printer?.remove();
      this.for_printer = this.compose("#fff", "#222", null);
      this.for_printer.className = "printed";
      stage.append(this.for_printer);
      theme(false);
    });
    addEventListener("afterprint", () => this.for_printer?.remove());
  }

  async load(name) {
    const part = this.parts[name];
    if (part.mesh) return;
    // Each part cuts in its own way and has its own lines; light and paper are common.
    const own = make_uniforms(inside);
    await part.load({...this.uniforms, plane: own.plane, edges: own.edges, crisp: own.crisp});
    part.clip(null);
    this.view.scene.add(part.mesh);
  }

  // One change after the other, since unpacking takes its time; a failure is told and the rest goes on.
  changed(what) {
    if (this.waiting.has(what)) return this.jobs;  // it will find the newest state
    this.waiting.add(what);
    this.jobs = this.jobs.then(() => {
      this.waiting.delete(what);
      this.note.textContent = "";
      return this.apply(what);
    }).catch((error) => {
      this.note.textContent = `This part of the data cannot be shown: ${error.message}`;
    });
    return this.jobs;
  }

  async apply(what) {
    const [verb, name] = what.split(":");
    if (verb === "view") this.look(name);
    else if (verb === "save") save(this.compose(...this.paper_and_ink(), this.picture_key),
        `${(this.data.title || "specimen").replace(/[^\w.-]+/g, "_")}.png`);
    else if (verb === "show") await this.show();
    else if (verb === "clip") this.clip(name === "afresh");
    else if (verb === "edges") this.part().show_edges(this.state.edges);
    else await this.recolour();
    this.view.changed();
  }

  async show() {
    const {show} = this.state;
    this.panel.fill_properties();
    if (!this.parts[show].mesh) {
      this.note.textContent = "Unpacking …";
      await this.view.settled();  // so that the words are seen
      await this.load(show);
      this.note.textContent = "";
    }
    await this.recolour();
    this.clip(false);
    this.part().show_edges(this.state.edges);
    for (const [name, part] of Object.entries(this.parts)) if (part?.mesh) part.mesh.visible = name === show;
  }

  // A new section takes away the side that faces the viewer.
  clip(afresh) {
    const {clip} = this.state;
    if (afresh) clip.sign = this.view.towards().getComponent(clip.axis) < 0 ? -1 : 1;
    this.part().clip(clip.on ? {axis: clip.axis, at: clip.at, sign: clip.flip ? -clip.sign : clip.sign} : null);
  }

  async recolour() {
    const {show, property: keys, pocket} = this.state;
    const part = this.part(), property = part.property(keys[show]);
    const range = property && this.state.range(property);
    await part.colour(keys[show], range, pocket);
    const values = property && await part.values_of(property.key);
    show_key(this.key, this.data, property, range, values);
    this.picture_key = key_of(this.data, property, range, values);
  }

  look(name) {
    if (name === "home") this.go_home();
    else this.view.fly({turn: looking(...directions[name]), target: new Vector3(), half: this.home_half});
  }

  go_home(at_once = false) {
    const up = this.data.views?.up ?? [0, 0, 1];
    const to = {turn: looking([0.55, -0.75, 0.55], up), target: new Vector3(), half: this.home_half};
    if (!at_once) return this.view.fly(to);
    this.view.turn_now.copy(to.turn);
    this.view.target.copy(to.target);
    this.view.half = to.half;
  }

  /** Shows pocket `number` from outside; null: none is picked out any more. */
  async choose_pocket(number) {
    this.state.pocket = number;
    const pocket = this.data.pockets?.find((p) => p.id === number);
    if (number !== null && this.state.show !== "surface" && this.data.surface) {
      this.state.show = "surface";
      await this.changed("show");
    } else {
      await this.changed("property");
    }
    if (!pocket) return;
    const target = new Vector3(...pocket.centre.map((x, c) => x - this.centre[c]));
    const half = Math.min(this.home_half, Math.max(3 * (pocket.radius || 0), this.home_half / 12));
    this.view.fly({turn: looking(pocket.opening, this.data.views?.up ?? [0, 0, 1]), target, half});
    const calm = matchMedia("(prefers-reduced-motion: reduce)").matches;
    this.view.canvas.parentElement.scrollIntoView({block: "nearest", behavior: calm ? "auto" : "smooth"});
  }

  paper_and_ink() {
    const style = getComputedStyle(this.place);
    return [style.getPropertyValue("--paper").trim() || "#fff", style.getPropertyValue("--ink").trim() || "#222"];
  }

  compose(paper, ink, key) { return compose(this.view, {unit: this.unit, paper, ink, key}); }

  async settled() {
    await this.jobs;
    await this.view.settled();
  }
}
