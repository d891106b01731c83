/*!
 * The script of a report page by vdbgeo (GPL-3.0-or-later) with three.js, which has this licence:
 *
 * The MIT License. Copyright (c) 2010-2026 three.js authors
 *
 * Permission is hereby granted, free of charge, to any person obtaining a copy of this software and associated
 * documentation files (the "Software"), to deal in the Software without restriction, including without limitation the
 * rights to use, copy, modify, merge, publish, distribute, sublicense, and/or sell copies of the Software, and to
 * permit persons to whom the Software is furnished to do so, subject to the following conditions:
 *
 * The above copyright notice and this permission notice shall be included in all copies or substantial portions of the
 * Software.
 *
 * THE SOFTWARE IS PROVIDED "AS IS", WITHOUT WARRANTY OF ANY KIND, EXPRESS OR IMPLIED, INCLUDING BUT NOT LIMITED TO THE
 * WARRANTIES OF MERCHANTABILITY, FITNESS FOR A PARTICULAR PURPOSE AND NONINFRINGEMENT. IN NO EVENT SHALL THE AUTHORS OR
 * COPYRIGHT HOLDERS BE LIABLE FOR ANY CLAIM, DAMAGES OR OTHER LIABILITY, WHETHER IN AN ACTION OF CONTRACT, TORT OR
 * OTHERWISE, ARISING FROM, OUT OF OR IN CONNECTION WITH THE SOFTWARE OR THE USE OR OTHER DEALINGS IN THE SOFTWARE.
 */
import {start_compare} from "./compare.js";
import {start_copy} from "./copy.js";
import {make} from "./elements.js";
import {start_pockets} from "./pockets.js";
import {Viewer} from "./viewer.js";

function read_data() {
  const element = document.getElementById("vdbgeo-data");
  if (!element) throw new Error("the page has no data");
  const data = JSON.parse(element.textContent);
  if (data.version !== 1) throw new Error(`the page's data has version ${data.version}, its script knows version 1`);
  return data;
}

/** Why this browser cannot show the model, or "". */
function what_is_missing() {
  if (typeof DecompressionStream === "undefined") return "this browser cannot unpack it (DecompressionStream)";
  if (!document.createElement("canvas").getContext("webgl2")) return "this browser draws no 3-D graphics (WebGL 2)";
  return "";
}

function for_programs(viewer) {
  const {view, state, centre} = viewer;
  const back = (v) => v.toArray().map((x, c) => x + centre[c]);
  return {
    camera: () => ({position: back(view.camera.position), target: back(view.target), half_height: view.half}),
    property: () => state.property[state.show],
    shown: () => state.show,
    clip: () => ({...state.clip}),
    pocket: () => state.pocket,
    settled: () => viewer.settled(),
  };
}

async function start_viewer(place) {
  const note = (text) => place.append(make("p", {class: "viewer-note", role: "status"}, text));
  let viewer = null;
  try {
    const data = read_data();
    if (!data.surface && !data.tets) return;
    const missing = what_is_missing();
    if (missing) return void note(`The model does not turn: ${missing}.`);
    viewer = new Viewer(place, data);
    await viewer.start();
    window.vdbgeo = for_programs(viewer);
    const tables = [...document.querySelectorAll("#pocket-table, #pocket-table-more")];
    if (tables.length && data.pockets?.length) start_pockets(tables, data.pockets, (number) => viewer.choose_pocket(number));
    place.dataset.ready = "true";
  } catch (error) {
    place.classList.remove("live");
    place.querySelector(".viewer-body")?.remove();
    note(`The model cannot be shown: ${error.message}`);
  }
}

function start() {
  document.documentElement.classList.add("scripted");
  document.querySelectorAll("div.compare").forEach(start_compare);
  const status = make("p", {class: "off-screen", role: "status"});
  document.body.append(status);
  document.querySelectorAll("button.copy").forEach((button) => start_copy(button, status));
  const place = document.getElementById("viewer");
  if (place) start_viewer(place);
}

start();
