// The canvas as a file, with bar, axes and colour scale; and a copy of it for the printer.
import {axis_colours, round_length, triad} from "./overlay.js";
import {words} from "./colours.js";

const font = (size, weight = 400) => `${weight} ${size}px system-ui, sans-serif`;

function draw_bar(g, view, unit, scale, height, ink) {
  const [length, text] = round_length(Math.min(140, view.width / 4), view.pixels_per_unit(), unit);
  const width = length * view.pixels_per_unit() * scale;
  g.fillStyle = ink;
  g.fillRect(16 * scale, height - 18 * scale, width, 3 * scale);
  g.font = font(13 * scale);
  g.textAlign = "center";
  g.fillText(text, 16 * scale + width / 2, height - 25 * scale);
}

function draw_triad(g, view, scale, x0, y0) {
  g.lineWidth = 3 * scale;
  g.lineCap = "round";
  g.font = font(13 * scale, 600);
  g.textAlign = "center";
  g.textBaseline = "middle";
  for (const {i, x, y} of triad(view.turn_now)) {
    g.strokeStyle = g.fillStyle = axis_colours[i];
    g.beginPath();
    g.moveTo(x0, y0);
    g.lineTo(x0 + 24 * scale * x, y0 + 24 * scale * y);
    g.stroke();
    g.fillText("xyz"[i], x0 + 33 * scale * x, y0 + 33 * scale * y);
  }
  g.textBaseline = "alphabetic";
}

function draw_key(g, key, scale, width, ink) {
  const w = 190 * scale, x = width - w - 16 * scale, y = 34 * scale;
  g.fillStyle = ink;
  g.font = font(13 * scale, 600);
  g.textAlign = "right";
  g.fillText(key.title, width - 16 * scale, y - 10 * scale);
  g.font = font(12 * scale);
  if (key.colours) {
    key.colours.forEach((rgb, i) => {
      g.fillStyle = `rgb(${rgb.join(" ")})`;
      const left = Math.floor(x + w * i / key.colours.length), right = Math.floor(x + w * (i + 1) / key.colours.length);
      g.fillRect(left, y, right - left, 12 * scale);
    });
    g.fillStyle = ink;
    g.fillText(words(key.range[1]), x + w, y + 27 * scale);
    g.textAlign = "left";
    g.fillText(words(key.range[0]), x, y + 27 * scale);
  } else {
    key.classes.slice(0, 12).forEach(([name, rgb], i) => {
      g.fillStyle = `rgb(${rgb.join(" ")})`;
      g.fillRect(width - 28 * scale, y + 18 * i * scale, 12 * scale, 12 * scale);
      g.fillStyle = ink;
      g.fillText(name, width - 34 * scale, y + (18 * i + 10.5) * scale);
    });
  }
}

/** A new canvas with the present picture on `paper`; `key` describes the colours (null: plain). */
export function compose(view, {unit, paper, ink, key}) {
  view.draw();  // the picture can be read in the same task only
  const source = view.canvas;
  const canvas = document.createElement("canvas");
  canvas.width = source.width;
  canvas.height = source.height;
  const g = canvas.getContext("2d");
  const scale = source.width / view.width;
  g.fillStyle = paper;
  g.fillRect(0, 0, canvas.width, canvas.height);
  g.drawImage(source, 0, 0);
  draw_bar(g, view, unit, scale, canvas.height, ink);
  draw_triad(g, view, scale, canvas.width - 50 * scale, canvas.height - 50 * scale);
  if (key) draw_key(g, key, scale, canvas.width, ink);
  return canvas;
}

export function save(canvas, name) {
  canvas.toBlob((blob) => {
    const link = document.createElement("a");
    link.href = URL.createObjectURL(blob);
    link.download = name;
    link.click();
    setTimeout(() => URL.revokeObjectURL(link.href), 10000);
  }, "image/png");
}
