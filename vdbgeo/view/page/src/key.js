// The colour key under the picture: a bar with numbers, or a list of classes, and the property in plain words.
import {class_colour, colormap, css, plain, words} from "./colours.js";
import {make} from "./elements.js";

const with_unit = (property) => property.name + (property.unit ? ` (${property.unit})` : "");

/** The classes of a category as [name, colour]; those that have values where the data names none. */
export function classes_of(property, map, values) {
  const named = property.classes?.length ? property.classes
      : [...new Set(values)].sort((a, b) => a - b).filter((v) => v !== 255 && !(v === 0 && property.key === "pocket"))
          .map((value) => ({value, name: String(value)}));
  const list = named.map(({value, name}) => [name, class_colour(property, map, value)]);
  if (property.key === "pocket" && !named.some((c) => c.value === 0)) list.unshift(["none", plain]);
  return list;
}

/** What picture.js draws beside the specimen. */
export function key_of(data, property, range, values) {
  if (!property) return null;
  const map = colormap(data, property.colormap);
  if (property.kind === "category") return {title: property.name, classes: classes_of(property, map, values)};
  return {title: with_unit(property), colours: map, range};
}

function bar(map) {
  const canvas = make("canvas", {class: "colour-bar", width: map.length, height: 1, "aria-hidden": "true"});
  const g = canvas.getContext("2d");
  map.forEach((rgb, i) => {
    g.fillStyle = css(rgb);
    g.fillRect(i, 0, 1, 1);
  });
  return canvas;
}

/** Fills `place` with the key of the property (null: nothing). */
export function show_key(place, data, property, range, values) {
  place.replaceChildren();
  place.hidden = !property;
  if (!property) return;
  const key = key_of(data, property, range, values);
  place.append(make("p", {class: "key-title"}, key.title));
  if (key.colours) {
    const under = property.low < range[0], over = property.high > range[1];
    place.append(bar(key.colours), make("div", {class: "key-numbers"},
        make("span", {}, (under ? "≤ " : "") + words(range[0])),
        make("span", {}, words((range[0] + range[1]) / 2)),
        make("span", {}, (over ? "≥ " : "") + words(range[1]))));
  } else {
    place.append(make("ul", {class: "classes", tabindex: key.classes.length > 16 ? 0 : null},
        ...key.classes.map(([name, rgb]) => {
          const dot = make("span", {class: "dot"});
          dot.style.background = css(rgb);
          return make("li", {}, dot, name);
        })));
  }
  if (property.help) place.append(make("p", {class: "key-help"}, property.help));
}
