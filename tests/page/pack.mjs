// Packing of the page's arrays, the inverse of vdbgeo/view/page/src/decode.js.
import {deflateSync} from "node:zlib";

function planes(values, bits) {
  const bytes = Buffer.alloc(values.length * bits / 8);
  for (let plane = 0; plane < bits / 8; ++plane)
    for (let i = 0; i < values.length; ++i) bytes[plane * values.length + i] = (values[i] >>> (8 * plane)) & 255;
  return deflateSync(bytes).toString("base64");
}

/** `values`: component after component. */
export function pack_array(values, bits, components = 1) {
  const count = values.length / components;
  const deltas = new Uint32Array(values.length);
  for (let c = 0; c < components; ++c)
    for (let i = 0; i < count; ++i) {
      const at = c * count + i;
      deltas[at] = (values[at] - (i ? values[at - 1] : 0)) & (bits === 32 ? -1 : 2 ** bits - 1);
    }
  return {bits, components, count, data: planes(deltas, bits)};
}

/** Vertices must be numbered by first use. */
export function pack_index(index) {
  let next = 0;
  const codes = Uint32Array.from(index, (i) => {
    if (i === next) { ++next; return 0; }
    return next - i;
  });
  return {count: index.length, data: planes(codes, 32)};
}

/** Order of first use: [new index, old number of each new vertex]. */
export function by_first_use(index) {
  const number = new Map();
  const fresh = index.map((i) => {
    if (!number.has(i)) number.set(i, number.size);
    return number.get(i);
  });
  return [fresh, [...number.keys()]];
}

export function pack_positions(points) {
  const box = [0, 1].map((end) => [0, 1, 2].map((c) => points.reduce((m, p) => (end ? Math.max(m, p[c]) : Math.min(m, p[c])), points[0][c])));
  const values = new Uint32Array(3 * points.length);
  for (let c = 0; c < 3; ++c)
    points.forEach((p, i) => { values[c * points.length + i] = Math.round(65535 * (p[c] - box[0][c]) / (box[1][c] - box[0][c])); });
  return {box, position: pack_array(values, 16, 3)};
}

export function pack_scalars(values) {
  const good = values.filter(Number.isFinite);
  const low = good.reduce((a, b) => Math.min(a, b), Infinity), high = good.reduce((a, b) => Math.max(a, b), -Infinity);
  const packed = values.map((v) => (Number.isFinite(v) ? Math.round(65534 * (v - low) / (high - low)) : 65535));
  return {kind: "scalar", low, high, values: pack_array(packed, 16)};
}

export const pack_classes = (values) => ({kind: "category", low: 0, high: 255, values: pack_array(values, 8)});
