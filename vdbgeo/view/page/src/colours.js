// From values of properties to colours.

export const plain = [0.47, 0.67, 0.85].map((c) => Math.round(255 * c));   // outside, as in vdbgeo's pictures
export const inside = [0.86, 0.62, 0.36].map((c) => Math.round(255 * c));  // inside
export const picked = [214, 20, 122];                                      // the pocket that was asked for
export const unknown = [150, 150, 150];

const parse = (hex) => [1, 3, 5].map((i) => parseInt(hex.slice(i, i + 2), 16));
export const css = (rgb) => `rgb(${rgb.join(" ")})`;

/** The named map as rows of red, green, blue; grey steps where the page lacks it. */
export function colormap(data, name) {
  const map = data.colormaps?.[name];
  if (map?.length) return map.map(parse);
  return Array.from({length: 256}, (_, i) => [i, i, i]);
}

/** Colour of class `value` of a categorical property; pocket 0 is no pocket. */
export function class_colour(property, map, value) {
  if (value === 255) return unknown;
  if (value === 0 && property.key === "pocket") return plain;
  return map[value % map.length];
}

/** One rgba colour a value: `values` as packed, `range` [low, high] of the first and the last colour. */
export function paint(property, values, range, map) {
  const top = property.kind === "category" ? 256 : 65536;
  const table = new Uint32Array(top);
  const bytes = new Uint8Array(table.buffer);
  const scale = (property.high - property.low) / 65534;
  for (let v = 0; v < top; ++v) {
    let rgb;
    if (property.kind === "category") rgb = class_colour(property, map, v);
    else if (v === 65535) rgb = unknown;
    else {
      const t = (property.low + v * scale - range[0]) / (range[1] - range[0]);
      rgb = map[Math.max(0, Math.min(map.length - 1, Math.floor(t * map.length)))];
    }
    bytes[4 * v] = rgb[0]; bytes[4 * v + 1] = rgb[1]; bytes[4 * v + 2] = rgb[2]; bytes[4 * v + 3] = 255;
  }
  const out = new Uint32Array(values.length);
  for (let i = 0; i < out.length; ++i) out[i] = table[values[i]];
  return new Uint8Array(out.buffer);
}

/** `count` times one colour. */
export function flood(count, rgb) {
  const out = new Uint8Array(4 * count);
  for (let i = 0; i < out.length; i += 4) { out[i] = rgb[0]; out[i + 1] = rgb[1]; out[i + 2] = rgb[2]; out[i + 3] = 255; }
  return out;
}

/** A number for people: three digits, a true minus. */
export function words(x) {
  if (!Number.isFinite(x)) return "–";
  const text = x !== 0 && (Math.abs(x) < 1e-3 || Math.abs(x) >= 1e5) ? x.toExponential(2) : String(Number(x.toPrecision(3)));
  return text.replace(/-/g, "−");
}
