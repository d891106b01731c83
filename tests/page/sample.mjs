// node sample.mjs OUT.html --script page.js --style page.css [--faces 60000] [--tets 60000]
//                 [--without surface,tets,pockets,noise]
// A report page with a made-up specimen: a bumpy ball with three dents, its tetrahedra and all the sections.
import {readFileSync, writeFileSync} from "node:fs";
import {parseArgs} from "node:util";

import {by_first_use, pack_classes, pack_index, pack_positions, pack_scalars} from "./pack.mjs";

const centre = [210, 180, 95];  // Å
const ball = 60;
const dents = [  // direction, depth Å, width in radians
  {d: [1, 0, 0], depth: 20, width: 0.32}, {d: [-0.5, -0.8, 0.33], depth: 14, width: 0.25}, {d: [0.1, 0.3, 0.95], depth: 9, width: 0.2},
].map((dent) => ({...dent, d: dent.d.map((x) => x / Math.hypot(...dent.d))}));

const dot = (a, b) => a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
const away = (d, u) => Math.acos(Math.max(-1, Math.min(1, dot(d, u))));
const bumps = (u) => 3 * Math.sin(9 * u[0] + 1) * Math.sin(8 * u[1]) * Math.sin(7 * u[2] + 2);
const radius = (u) => ball + bumps(u) - dents.reduce((sum, {d, depth, width}) => sum + depth * Math.exp(-((away(d, u) / width) ** 2)), 0);
const pocket_of = (u) => dents.findIndex(({d, width}) => away(d, u) < 1.1 * width) + 1;

function make_surface(faces) {
  const rings = Math.round(Math.sqrt(faces / 4)), around = 2 * rings;
  const units = [[0, 0, 1]];
  for (let i = 1; i < rings; ++i)
    for (let j = 0; j < around; ++j) {
      const t = Math.PI * i / rings, f = 2 * Math.PI * j / around;
      units.push([Math.sin(t) * Math.cos(f), Math.sin(t) * Math.sin(f), Math.cos(t)]);
    }
  units.push([0, 0, -1]);
  const at = (i, j) => (i === 0 ? 0 : i === rings ? units.length - 1 : 1 + (i - 1) * around + j % around);
  const index = [];
  for (let i = 0; i < rings; ++i)
    for (let j = 0; j < around; ++j) {
      const [a, b, c, d] = [at(i, j), at(i, j + 1), at(i + 1, j), at(i + 1, j + 1)];
      if (i > 0) index.push(a, d, b);
      if (i < rings - 1) index.push(a, c, d);
    }
  const [fresh, old] = by_first_use(index);
  const u = old.map((k) => units[k]);
  const heights = u.map((v, i) => (i % 5000 === 7 ? NaN : radius(v) - ball));
  const {box, position} = pack_positions(u.map((v) => v.map((x, c) => centre[c] + radius(v) * x)));
  return {
    vertices: u.length, faces: fresh.length / 3, faces_full: 2 * fresh.length / 3, box, position, index: pack_index(fresh),
    properties: [
      {key: "H", name: "Mean curvature H", unit: "1/Å", colormap: "diverging", range: [-0.15, 0.15],
       help: "How strongly the surface bends: red where it bulges, blue where it is hollow.", ...pack_scalars(heights.map((h) => h / 40))},
      {key: "depth", name: "Depth", unit: "Å", colormap: "sequential", range: [0, 20], help: "How far a point lies below the ball.",
       ...pack_scalars(heights.map((h) => -h))},
      {key: "type", name: "Surface type", unit: "", colormap: "categorical", help: "Peaks, pits and what lies between.",
       classes: [{value: 1, name: "peak"}, {value: 2, name: "saddle"}, {value: 3, name: "pit"}],
       ...pack_classes(heights.map((h) => (h > 1 ? 1 : h > -3 ? 2 : 3)))},
      {key: "pocket", name: "Pockets", unit: "", colormap: "categorical", help: "Each pocket has its own colour.",
       ...pack_classes(u.map(pocket_of))},
    ],
  };
}

function make_tets(tets) {
  const n = Math.round(Math.cbrt(tets / 6 / 0.5236));
  const number = (i, j, k) => (i * (n + 1) + j) * (n + 1) + k;
  const place = (i) => (2 * i / n - 1) * (ball + 2);
  const paths = [[0, 1, 2], [0, 2, 1], [1, 0, 2], [1, 2, 0], [2, 0, 1], [2, 1, 0]];
  const index = [], middles = [];
  for (let i = 0; i < n; ++i)
    for (let j = 0; j < n; ++j)
      for (let k = 0; k < n; ++k) {
        const p = [i, j, k].map((x) => place(x + 0.5));
        if (Math.hypot(...p) > radius(p.map((x) => x / (Math.hypot(...p) || 1)))) continue;
        for (const path of paths) {
          const at = [i, j, k];
          index.push(number(...at));
          for (const axis of path) { ++at[axis]; index.push(number(...at)); }
          middles.push(p);
        }
      }
  const [fresh, old] = by_first_use(index);
  const points = old.map((v) => [Math.floor(v / (n + 1) ** 2), Math.floor(v / (n + 1)) % (n + 1), v % (n + 1)].map((x, c) => centre[c] + place(x)));
  const {box, position} = pack_positions(points);
  return {
    vertices: points.length, tets: fresh.length / 4, tets_full: fresh.length / 4, box, position, index: pack_index(fresh),
    properties: [
      {key: "min_dihedral_deg", name: "Smallest dihedral angle", unit: "°", colormap: "sequential", range: [10, 70],
       help: "Large angles are good for solvers.", ...pack_scalars(middles.map((p) => 40 + 25 * Math.sin(p[0] / 9) * Math.cos(p[1] / 11)))},
      {key: "radius_edge", name: "Radius over shortest edge", unit: "", colormap: "sequential", range: [0, 1],
       help: "Small is good.", ...pack_scalars(middles.map((p) => Math.hypot(...p) / ball))},
    ],
  };
}

const hex = (rgb) => `#${rgb.map((x) => Math.round(Math.max(0, Math.min(255, x))).toString(16).padStart(2, "0")).join("")}`;
const steps = (f) => Array.from({length: 256}, (_, i) => hex(f(i / 255)));
const colormaps = {
  sequential: steps((t) => [30 + 220 * t ** 1.6, 35 + 205 * t, 110 + 60 * Math.sin(3 * t)]),
  diverging: steps((t) => [t < 0.5 ? 50 + 400 * t : 245, 245 - 380 * Math.abs(t - 0.5), t > 0.5 ? 50 + 400 * (1 - t) : 245]),
  categorical: ["#4477aa", "#ee6677", "#228833", "#ccbb44", "#66ccee", "#aa3377", "#997755", "#667788"],
};

const picture = (body, w = 320, h = 320) =>
    "data:image/svg+xml;base64," + Buffer.from(`<svg xmlns="http://www.w3.org/2000/svg" width="${w}" height="${h}">${body}</svg>`).toString("base64");
const blobs = (noise) => picture(`<rect width="320" height="320" fill="#333"/>` + Array.from({length: 40}, (_, i) =>
    `<circle cx="${(i * 71) % 320}" cy="${(i * 113) % 320}" r="${14 + i % 9}" fill="#aaa"/>`).join("") + (noise ? Array.from({length: 900}, (_, i) =>
    `<rect x="${(i * 7919) % 320}" y="${(i * 6151) % 320}" width="3" height="3" fill="${i % 2 ? "#fff" : "#000"}"/>`).join("") : ""));

const plot = `<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 400 240" width="400" height="240" role="img" aria-label="Densities" font-family="sans-serif" font-size="12">
<title>Densities</title><rect class="paper" width="400" height="240" fill="#fff"/>
${[60, 110, 160].map((y) => `<line class="grid" x1="50" x2="390" y1="${y}" y2="${y}" stroke="#ddd"/>`).join("")}
<path d="M50 200 Q120 20 180 150 T390 195" fill="none" stroke="#1d6fd1" stroke-width="2"/>
<path class="ink-line" d="M50 20V200H390" fill="none" stroke="#222"/><text class="ink-text" fill="#222" x="220" y="228" text-anchor="middle">density</text></svg>`;

function page(data, style, script, {noise}) {
  const cards = [["Volume", "904 800 Å³"], ["Area", "45 240 Å²"], ["Pieces", "1"], ["Genus", "0"], ["Pockets", String(data.pockets.length)]]
      .map(([name, value]) => `<div class="card"><dt>${name}</dt><dd>${value}</dd></div>`).join("");
  const pockets = data.pockets.map((p) => `<tr data-pocket="${p.id}"><td class="num">${p.id}</td><td class="num">${p.radius.toFixed(1)}</td><td>open to ${p.opening.map((x) => x.toFixed(2)).join(", ")}</td></tr>`).join("");
  const compare = ["z", "y", "x"].map((axis) => `<div class="compare" data-axis="${axis}"><img class="before" alt="Section across ${axis}, before" src="${blobs(true)}"><img class="after" alt="Section across ${axis}, after" src="${blobs(false)}"></div>`).join("");
  const sections = [
    ["summary", "Summary", `<dl>${cards}</dl>`],
    data.surface || data.tets ? ["specimen", "Specimen", `<div id="viewer" class="viewer"><img class="poster" alt="The specimen" src="${picture('<circle cx="320" cy="200" r="150" fill="#78abd9"/>', 640, 400)}"></div>`] : null,
    pockets ? ["pockets", "Pockets", `<button class="copy" data-copy="pocket-table">Copy</button><table class="data" id="pocket-table"><thead><tr><th class="num">Pocket</th><th class="num">Radius (Å)</th><th>Where</th></tr></thead><tbody>${pockets}</tbody></table>`] : null,
    noise ? ["noise", "Noise", compare] : null,
    ["plots", "Plots", `<figure class="plot">${plot}<figcaption>Densities of the map.</figcaption></figure><figure class="plot">${plot}<figcaption>The same again.</figcaption></figure>`],
    ["numbers", "Numbers", `<button class="copy" data-copy="measures">Copy</button><table class="data" id="measures"><thead><tr><th>Quantity</th><th class="num">Value</th><th>Unit</th></tr></thead><tbody>${Array.from({length: 40}, (_, i) => `<tr><td>quantity ${i}</td><td class="num">${(i * 3.1416).toFixed(3)}</td><td>Å</td></tr>`).join("")}</tbody></table><details><summary>More</summary><p>Further numbers.</p></details>`],
    ["how", "How it was made", `<button class="copy" data-copy="command">Copy</button><pre id="command">vdbgeo model emd.map -o run --preset molecule --a-rather-long-option-that-goes-on-and-on=and/a/path/that/does/not/end</pre>`],
  ].filter(Boolean);
  return `<!DOCTYPE html>
<html lang="en"><head><meta charset="utf-8"><meta name="viewport" content="width=device-width, initial-scale=1"><title>${data.title}</title><style>${style}</style></head>
<body><header class="top"><h1>${data.title}</h1><p class="subtitle">A made-up specimen</p><nav>${sections.map(([id, title]) => `<a href="#${id}">${title}</a>`).join("")}</nav></header>
<main>${sections.map(([id, title, body]) => `<section id="${id}"><h2>${title}</h2>${body}</section>`).join("\n")}</main>
<script type="application/json" id="vdbgeo-data">${JSON.stringify(data).replaceAll("</", "<\\/")}</script><script>${script}</script></body></html>`;
}

const {values: options, positionals: [out]} = parseArgs({allowPositionals: true, options: {
  script: {type: "string"}, style: {type: "string"}, faces: {type: "string", default: "60000"},
  tets: {type: "string", default: "60000"}, without: {type: "string", default: ""}}});
if (!out || !options.script || !options.style) {
  console.error("usage: node sample.mjs OUT.html --script page.js --style page.css [--faces N] [--tets N] [--without surface,tets,pockets,noise]");
  process.exit(2);
}
const without = new Set(options.without.split(","));
const data = {
  version: 1, title: "Bumpy ball", unit: "Å", colormaps,
  surface: without.has("surface") ? null : make_surface(Number(options.faces)),
  tets: without.has("tets") ? null : make_tets(Number(options.tets)),
  pockets: without.has("pockets") ? [] : dents.map(({d, width}, i) => ({id: i + 1, centre: d.map((x, c) => centre[c] + x * radius(d)), opening: d, radius: ball * width})),
  views: {up: [0, 0, 1]},
};
writeFileSync(out, page(data, readFileSync(options.style, "utf8"), readFileSync(options.script, "utf8"), {noise: !without.has("noise")}));
