// The controls beside the picture. They read and write `state` and call `changed(what)` with what has to be redone:
// "show", "property", "range", "edges", "clip", "clip:afresh" (switched on, or another axis), or "view:front|side|top|home", "save".
import {words} from "./colours.js";
import {checkbox, labelled, make, menu} from "./elements.js";

// A power of ten that moves a number through its range in some fifty steps.
const step_of = (low, high) => (high > low ? 10 ** Math.floor(Math.log10((high - low) / 20)) : 0.01);
const tidy = (x) => String(Number(x.toPrecision(4)));

function group(title, ...children) {
  return make("fieldset", {}, make("legend", {}, title), ...children);
}

const button = (text, onclick, label = null) => make("button", {type: "button", onclick, "aria-label": label}, text);

export class Panel {
  /** `box` [[x,y,z],[x,y,z]] in the specimen's unit; `has` {surface, tets}. */
  constructor(state, {box, unit, has, part}, changed) {
    this.state = state;
    this.box = box;
    this.unit = unit;
    this.part = part;
    this.changed = changed;
    this.form = make("form", {class: "controls", novalidate: true, "aria-label": "Viewer controls"},
        has.surface && has.tets ? this.show_group() : null, this.colour_group(), this.clip_group(), this.view_group());
    this.form.addEventListener("submit", (event) => event.preventDefault());
    this.fill_properties();
    this.fill_clip();
  }

  show_group() {
    const options = [["surface", "surface"], ["tets", "tetrahedra"]];
    this.show = menu(options, () => {
      this.state.show = this.show.value;
      this.changed("show");
    });
    return group("Specimen", labelled("Show", this.show));
  }

  colour_group() {
    const {state} = this;
    this.property = menu([], () => {
      state.property[state.show] = this.property.value;
      this.fill_range();
      this.changed("property");
    });
    const read = () => {
      const low = this.low.valueAsNumber, high = this.high.valueAsNumber;
      const good = low < high;
      for (const input of [this.low, this.high]) input.setAttribute("aria-invalid", !good);
      this.range_note.hidden = good;
      if (!good) return;
      state.ranges.set(this.range_key(), [low, high]);
      this.changed("range");
    };
    this.low = make("input", {type: "number", oninput: read});
    this.high = make("input", {type: "number", oninput: read});
    this.range_note = make("p", {class: "field-note", role: "status", hidden: true}, "The low end has to be below the high end.");
    this.range_units = [make("span", {class: "unit"}), make("span", {class: "unit"})];
    this.range = make("div", {class: "range"}, labelled("From", this.low, this.range_units[0]),
        labelled("to", this.high, this.range_units[1]), this.range_note,
        button("Reset range", () => {
          state.ranges.delete(this.range_key());
          this.fill_range();
          this.changed("range");
        }));
    return group("Colour", labelled("Colour by", this.property), this.range);
  }

  clip_group() {
    const {state} = this;
    const on = checkbox("Cut open", () => {
      state.clip.on = on.box.checked;
      this.fill_clip();
      this.changed("clip:afresh");
    });
    this.clip_on = on.box;
    this.axis = menu([["0", "x"], ["1", "y"], ["2", "z"]], () => {
      state.clip.axis = Number(this.axis.value);
      state.clip.at = (this.box[0][state.clip.axis] + this.box[1][state.clip.axis]) / 2;
      this.fill_clip();
      this.changed("clip:afresh");
    });
    this.at = make("input", {type: "range", oninput: () => {
      state.clip.at = this.at.valueAsNumber;
      this.tell_position();
      this.changed("clip");
    }});
    this.position = make("output", {class: "unit"});
    const flip = checkbox("Other side", () => {
      state.clip.flip = flip.box.checked;
      this.changed("clip");
    });
    this.clip_rest = make("div", {}, labelled("Across", this.axis), labelled("At", this.at, this.position), flip.field);
    this.position.htmlFor = this.at.id;
    return group("Section", on.field, this.clip_rest);
  }

  view_group() {
    const edges = checkbox("Edges of the mesh", () => {
      this.state.edges = edges.box.checked;
      this.changed("edges");
    });
    const views = ["front", "side", "top"].map((name) => button(name, () => this.changed(`view:${name}`), `View from ${name === "top" ? "the top" : `the ${name}`}`));
    return group("View", make("div", {class: "buttons", role: "group", "aria-label": "View from"}, ...views,
        button("reset", () => this.changed("view:home"), "Reset the view")), edges.field,
        button("Save picture", () => this.changed("save")));
  }

  range_key() { return `${this.state.show}/${this.state.property[this.state.show]}`; }

  /** After another part is shown or the property was set from outside. */
  fill_properties() {
    const properties = this.part().properties();
    if (this.show) this.show.value = this.state.show;
    this.property.replaceChildren(...[["", "plain"], ...properties.map((p) => [p.key, p.name])]
        .map(([value, text]) => make("option", {value}, text)));
    this.property.value = this.state.property[this.state.show];
    this.fill_range();
  }

  fill_range() {
    const property = this.part().property(this.property.value);
    this.range.hidden = property?.kind !== "scalar";
    this.range_note.hidden = true;
    if (this.range.hidden) return;
    const [low, high] = this.state.range(property);
    for (const input of [this.low, this.high]) {
      input.step = step_of(low, high);
      input.removeAttribute("aria-invalid");
    }
    this.low.value = tidy(low);
    this.high.value = tidy(high);
    for (const unit of this.range_units) unit.textContent = property.unit ?? "";
  }

  fill_clip() {
    const {clip} = this.state;
    const low = this.box[0][clip.axis], high = this.box[1][clip.axis];
    this.clip_on.checked = clip.on;
    this.clip_rest.hidden = !clip.on;
    this.axis.value = String(clip.axis);
    this.at.min = low;
    this.at.max = high;
    this.at.step = (high - low) / 200;
    this.at.value = clip.at;
    this.tell_position();
  }

  tell_position() {
    const text = `${words(this.state.clip.at)} ${this.unit}`;
    this.position.textContent = text;
    this.at.setAttribute("aria-valuetext", text);
  }
}
