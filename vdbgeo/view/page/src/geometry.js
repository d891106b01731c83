// What is computed of meshes in the page: normals of vertices, neighbours of tetrahedra, their boundary.

/** Vertex normals with N. Max's weights (|e|² |f|² under the cross product of the edges e, f at a corner). */
export function vertex_normals(position, index) {
  const normal = new Float32Array(position.length);
  const corner = [0, 0, 0];
  for (let t = 0; t < index.length; t += 3) {
    for (let k = 0; k < 3; ++k) corner[k] = 3 * index[t + k];
    const [a, b, c] = corner;
    const ux = position[b] - position[a], uy = position[b + 1] - position[a + 1], uz = position[b + 2] - position[a + 2];
    const vx = position[c] - position[a], vy = position[c + 1] - position[a + 1], vz = position[c + 2] - position[a + 2];
    const wx = vx - ux, wy = vy - uy, wz = vz - uz;
    const nx = uy * vz - uz * vy, ny = uz * vx - ux * vz, nz = ux * vy - uy * vx;
    const uu = ux * ux + uy * uy + uz * uz, vv = vx * vx + vy * vy + vz * vz, ww = wx * wx + wy * wy + wz * wz;
    if (uu === 0 || vv === 0 || ww === 0) continue;
    const at_a = 1 / (uu * vv), at_b = 1 / (uu * ww), at_c = 1 / (vv * ww);
    normal[a] += nx * at_a; normal[a + 1] += ny * at_a; normal[a + 2] += nz * at_a;
    normal[b] += nx * at_b; normal[b + 1] += ny * at_b; normal[b + 2] += nz * at_b;
    normal[c] += nx * at_c; normal[c + 1] += ny * at_c; normal[c + 2] += nz * at_c;
  }
  for (let i = 0; i < normal.length; i += 3) {
    const length = Math.hypot(normal[i], normal[i + 1], normal[i + 2]) || 1;
    normal[i] /= length; normal[i + 1] /= length; normal[i + 2] /= length;
  }
  return normal;
}

/** One copy of each `size`-tuple of `values` for every corner. */
export function spread(values, size, index) {
  const out = new values.constructor(size * index.length);
  for (let i = 0, o = 0; i < index.length; ++i)
    for (let k = 0, v = size * index[i]; k < size; ++k) out[o++] = values[v + k];
  return out;
}

// Face k of a tetrahedron is the one without corner k.
const corners_of_face = [[1, 2, 3], [0, 3, 2], [0, 1, 3], [0, 2, 1]];

/** neighbour[4t+k] = the tetrahedron beyond face k of t, or -1. */
export function tet_neighbours(index) {
  const faces = index.length;
  const neighbour = new Int32Array(faces).fill(-1);
  const low = new Uint32Array(faces), middle = new Uint32Array(faces), high = new Uint32Array(faces);
  let bits = 4;
  while (1 << bits < 2 * faces) ++bits;
  const mask = (1 << bits) - 1;
  const table = new Int32Array(1 << bits).fill(-1);  // open addressing: numbers of faces not yet met twice
  for (let f = 0; f < faces; ++f) {
    const [i, j, k] = corners_of_face[f & 3];
    const t = f & ~3;
    let a = index[t + i], b = index[t + j], c = index[t + k], swap;
    if (a > b) { swap = a; a = b; b = swap; }
    if (b > c) { swap = b; b = c; c = swap; }
    if (a > b) { swap = a; a = b; b = swap; }
    low[f] = a; middle[f] = b; high[f] = c;
    let slot = Math.imul(Math.imul(a, 73856093) ^ Math.imul(b, 19349663) ^ Math.imul(c, 83492791), 0x9e3779b1) >>> (32 - bits);
    for (;;) {
      const other = table[slot];
      if (other < 0) { table[slot] = f; break; }
      if (low[other] === a && middle[other] === b && high[other] === c) {
        if (neighbour[other] < 0) { neighbour[f] = other >> 2; neighbour[other] = f >> 2; }
        break;
      }
      slot = (slot + 1) & mask;
    }
  }
  return neighbour;
}

/** Middle of each tetrahedron, axis after axis. */
export function tet_centres(position, index) {
  const n = index.length / 4;
  const out = [new Float32Array(n), new Float32Array(n), new Float32Array(n)];
  for (let t = 0; t < n; ++t)
    for (let c = 0; c < 3; ++c)
      out[c][t] = (position[3 * index[4 * t] + c] + position[3 * index[4 * t + 1] + c] +
                   position[3 * index[4 * t + 2] + c] + position[3 * index[4 * t + 3] + c]) / 4;
  return out;
}

/**
 * The faces between what stays and what does not, as corners (Uint32Array, three a face), with the tetrahedron
 * each belongs to and whether the face is new (1: cut open, 0: the mesh's own surface). `keep` is a number for each
 * tetrahedron.
 */
export function tet_boundary(index, neighbour, keep) {
  let faces = 0;
  const shows = (f) => keep[f >> 2] && (neighbour[f] < 0 || !keep[neighbour[f]]);
  for (let f = 0; f < index.length; ++f) if (shows(f)) ++faces;
  const corners = new Uint32Array(3 * faces), owner = new Uint32Array(faces), cut = new Uint8Array(faces);
  let o = 0;
  for (let f = 0; f < index.length; ++f) {
    if (!shows(f)) continue;
    const [i, j, k] = corners_of_face[f & 3];
    const t = f & ~3;
    corners[3 * o] = index[t + i]; corners[3 * o + 1] = index[t + j]; corners[3 * o + 2] = index[t + k];
    owner[o] = f >> 2;
    cut[o++] = neighbour[f] < 0 ? 0 : 1;
  }
  return {corners, owner, cut};
}
