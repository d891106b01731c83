// The surface and the tetrahedra: unpacked when they are asked for, coloured, cut.
import {BufferAttribute, BufferGeometry, Mesh} from "three";

import {colormap, flood, inside, paint, picked, plain} from "./colours.js";
import {decode_array, decode_index, decode_positions} from "./decode.js";
import {spread, tet_boundary, tet_centres, tet_neighbours, vertex_normals} from "./geometry.js";
import {make_material} from "./material.js";

const nothing_cut = 1e30;

function make_geometry(arrays, index) {
  const geometry = new BufferGeometry();
  for (const [name, values] of Object.entries(arrays))
    geometry.setAttribute(name, new BufferAttribute(values, name === "tint" ? 4 : 3, name === "tint"));
  if (index) geometry.setIndex(new BufferAttribute(index, 1));
  return geometry;
}

function set_tint(geometry, values, name = "tint") {
  const old = geometry.attributes[name];
  if (!old) {
    geometry.setAttribute(name, new BufferAttribute(values, 4, true));
  } else {
    old.array = values;
    old.needsUpdate = true;
  }
}

/** What surface and tetrahedra share: unpacked properties. */
class Part {
  constructor(data, packed, centre) {
    this.data = data;
    this.packed = packed;
    this.centre = centre;
    this.values = new Map();
  }

  properties() { return this.packed.properties ?? []; }
  property(key) { return this.properties().find((p) => p.key === key) ?? null; }

  async values_of(key) {
    if (!this.values.has(key)) this.values.set(key, await decode_array(this.property(key).values));
    return this.values.get(key);
  }

  /** Colours of all vertices or tetrahedra, or null for plain. */
  async tints(key, range) {
    const property = this.property(key);
    if (!property) return null;
    return paint(property, await this.values_of(key), range, colormap(this.data, property.colormap));
  }
}

export class Surface extends Part {
  async load(uniforms) {
    const {vertices, position, index, box} = this.packed;
    [this.position, this.index] =
        await Promise.all([decode_positions(position, box, this.centre), decode_index(index, vertices)]);
    this.normal = vertex_normals(this.position, this.index);
    this.tint = flood(vertices, plain);
    this.uniforms = uniforms;
    this.smooth = make_geometry({position: this.position, normal: this.normal, tint: this.tint}, this.index);
    this.mesh = new Mesh(this.smooth, make_material(uniforms, false));
    this.mesh.frustumCulled = false;
  }

  // Lines along edges and crisp borders of classes need the corners of each face by themselves; that copy is made
  // when it is first wanted.
  choose_geometry() {
    const {edges, crisp} = this.uniforms;
    if (edges.value > 0 || crisp.value > 0) {
      this.torn ??= make_geometry({position: spread(this.position, 3, this.index), normal: spread(this.normal, 3, this.index)});
      const of_corners = [0, 1, 2].map((k) => this.index.map((_, i) => this.index[i - i % 3 + (i % 3 + k) % 3]));
      ["tint", "tint_next", "tint_last"].forEach((name, k) => set_tint(this.torn, spread(this.tint, 4, of_corners[k]), name));
      this.mesh.geometry = this.torn;
    } else {
      set_tint(this.smooth, this.tint);
      this.mesh.geometry = this.smooth;
    }
  }

  show_edges(on) {
    this.uniforms.edges.value = on ? 0.75 : 0;
    this.choose_geometry();
  }

  /** Colours by property `key` ("" plain), with the vertices of pocket `pocket` picked out. */
  async colour(key, range, pocket) {
    const tint = (await this.tints(key, range)) ?? flood(this.packed.vertices, plain);
    if (pocket !== null && this.property("pocket")) {
      const numbers = await this.values_of("pocket");
      for (let i = 0; i < numbers.length; ++i)
        if (numbers[i] === pocket) { tint[4 * i] = picked[0]; tint[4 * i + 1] = picked[1]; tint[4 * i + 2] = picked[2]; }
    }
    this.tint = tint;
    this.uniforms.crisp.value = this.property(key)?.kind === "category" ? 1 : 0;
    this.choose_geometry();
  }

  /** Cut off where sign · coordinate > sign · at; null: whole. */
  clip(cut) {
    const n = [0, 0, 0];
    if (cut) n[cut.axis] = cut.sign;
    this.uniforms.plane.value.set(...n, cut ? cut.sign * (cut.at - this.centre[cut.axis]) : nothing_cut);
  }
}

export class Tetrahedra extends Part {
  async load(uniforms) {
    const {vertices, position, index, box} = this.packed;
    [this.position, this.index] =
        await Promise.all([decode_positions(position, box, this.centre), decode_index(index, vertices)]);
    this.neighbour = tet_neighbours(this.index);
    this.middle = tet_centres(this.position, this.index);
    this.keep = new Uint8Array(this.index.length / 4).fill(1);
    this.uniforms = uniforms;
    this.uniforms.plane.value.set(0, 0, 0, nothing_cut);
    this.mesh = new Mesh(new BufferGeometry(), make_material(uniforms, true));
    this.mesh.frustumCulled = false;
    this.of_tets = null;
    this.rebuild();
  }

  show_edges(on) { this.uniforms.edges.value = on ? 0.85 : 0; }

  async colour(key, range) {
    this.of_tets = await this.tints(key, range);
    this.send_tint();
  }

  send_tint() {
    const {owner, cut} = this.boundary;
    const tint = new Uint8Array(12 * owner.length);
    for (let f = 0; f < owner.length; ++f)
      for (let k = 0; k < 3; ++k)
        for (let c = 0; c < 4; ++c)
          tint[12 * f + 4 * k + c] = this.of_tets ? this.of_tets[4 * owner[f] + c] : c === 3 ? 255 : (cut[f] ? inside : plain)[c];
    set_tint(this.mesh.geometry, tint);
  }

  rebuild() {
    this.boundary = tet_boundary(this.index, this.neighbour, this.keep);
    this.mesh.geometry.dispose();
    this.mesh.geometry = make_geometry({position: spread(this.position, 3, this.boundary.corners)});
    this.send_tint();
  }

  /** Whole tetrahedra are left out by where their middle is. */
  clip(cut) {
    const {keep} = this;
    if (!cut) keep.fill(1);
    else {
      const middle = this.middle[cut.axis], at = cut.at - this.centre[cut.axis];
      for (let t = 0; t < keep.length; ++t) keep[t] = cut.sign * (middle[t] - at) > 0 ? 0 : 1;
    }
    this.rebuild();
  }
}
