// Pixels of the PNG files that the browser makes: 8 bits, RGB or RGBA, not interlaced.
import {inflateSync} from "node:zlib";

export function read_png(file) {
  const parts = [];
  let width = 0, height = 0, channels = 0;
  for (let at = 8; at < file.length;) {
    const length = file.readUInt32BE(at), type = file.toString("latin1", at + 4, at + 8), body = file.subarray(at + 8, at + 8 + length);
    if (type === "IHDR") {
      width = body.readUInt32BE(0);
      height = body.readUInt32BE(4);
      channels = {2: 3, 6: 4}[body[9]];
      if (body[8] !== 8 || !channels || body[12]) throw new Error("a PNG of another kind");
    } else if (type === "IDAT") parts.push(body);
    at += 12 + length;
  }
  const raw = inflateSync(Buffer.concat(parts)), row = width * channels, out = Buffer.alloc(row * height);
  for (let y = 0; y < height; ++y)
    for (let x = 0, filter = raw[y * (row + 1)]; x < row; ++x) {
      const a = x < channels ? 0 : out[y * row + x - channels], b = y ? out[(y - 1) * row + x] : 0;
      const c = x < channels || !y ? 0 : out[(y - 1) * row + x - channels];
      const p = a + b - c, pa = Math.abs(p - a), pb = Math.abs(p - b), pc = Math.abs(p - c);
      const guess = [0, a, b, (a + b) >> 1, pa <= pb && pa <= pc ? a : pb <= pc ? b : c][filter];
      out[y * row + x] = raw[y * (row + 1) + 1 + x] + guess;
    }
  return {width, height, channels, pixels: out};
}

/** Number of different colours in the middle half of the picture. */
export function colours({width, height, channels, pixels}) {
  const seen = new Set();
  for (let y = height >> 2; y < (3 * height) >> 2; ++y)
    for (let x = width >> 2; x < (3 * width) >> 2; ++x) seen.add(pixels.readUIntBE((y * width + x) * channels, 3));
  return seen.size;
}

/** Share of pixels that differ visibly. */
export function difference(a, b) {
  if (a.width !== b.width || a.height !== b.height) return 1;
  let changed = 0;
  for (let i = 0; i < a.width * a.height; ++i)
    if ([0, 1, 2].some((c) => Math.abs(a.pixels[i * a.channels + c] - b.pixels[i * b.channels + c]) > 8)) ++changed;
  return changed / (a.width * a.height);
}
