// The compact arrays of the page's data, back to typed arrays. docs/conventions.md says how they are packed.

const views = {8: Uint8Array, 16: Uint16Array, 32: Uint32Array};

function from_base64(text) {
  if (Uint8Array.fromBase64) return Uint8Array.fromBase64(text);
  const letters = atob(text);
  const bytes = new Uint8Array(letters.length);
  for (let i = 0; i < bytes.length; ++i) bytes[i] = letters.charCodeAt(i);
  return bytes;
}

async function inflate(text, expected) {
  const stream = new Blob([from_base64(text)]).stream().pipeThrough(new DecompressionStream("deflate"));
  const bytes = new Uint8Array(await new Response(stream).arrayBuffer());
  if (bytes.length !== expected) throw new Error(`a packed array has ${bytes.length} bytes instead of ${expected}`);
  return bytes;
}

// Low bytes of all values, then the next bytes, and so on.
function join_planes(bytes, bits, count) {
  if (bits === 8) return bytes;
  const values = new views[bits](count);
  for (let plane = 0; plane < bits / 8; ++plane) {
    const begin = plane * count;
    const shift = 8 * plane;
    for (let i = 0; i < count; ++i) values[i] |= bytes[begin + i] << shift;
  }
  return values;
}

/** ARRAY → typed array with `components` runs of `count` values. */
export async function decode_array({bits, components, count, data}) {
  if (!views[bits]) throw new Error(`a packed array has ${bits} bits`);
  const values = join_planes(await inflate(data, components * count * (bits / 8)), bits, components * count);
  for (let c = 0; c < components; ++c)  // the typed array itself wraps round at 2^bits
    for (let i = c * count + 1; i < (c + 1) * count; ++i) values[i] += values[i - 1];
  return values;
}

/** INDEX → vertex numbers below `vertices`. */
export async function decode_index({count, data}, vertices) {
  const index = join_planes(await inflate(data, 4 * count), 32, count);
  let next = 0;
  for (let i = 0; i < count; ++i) {
    const code = index[i];
    if (code > next) throw new Error("a packed index goes backwards beyond the first vertex");
    index[i] = code === 0 ? next++ : next - code;
  }
  if (next > vertices) throw new Error(`a packed index names ${next} vertices of ${vertices}`);
  return index;
}

/** Positions relative to `centre` (float32 is fine near 0 only), interleaved x y z. */
export async function decode_positions(array, box, centre) {
  const packed = await decode_array(array);
  const n = array.count;
  const out = new Float32Array(3 * n);
  for (let c = 0; c < 3; ++c) {
    const step = (box[1][c] - box[0][c]) / 65535;
    const origin = box[0][c] - centre[c];
    for (let i = 0; i < n; ++i) out[3 * i + c] = packed[c * n + i] * step + origin;
  }
  return out;
}
