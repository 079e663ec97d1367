// What a heat map is painted with: hatching, marks, labels that fit, and the overview,
// a picture with one pixel a cell that stands for thousands of rectangles.

// Canvases of browsers end somewhere; beyond this cells are drawn one by one.
const MOST_PIXELS = 8192;

/** ✕ for failed, ! for wrong; beside the value where there is one. */
export function drawMark(context, status, [px, py, cw, ch], colour, withValue) {
  const r = Math.max(1.5, Math.min(cw, ch, 16) * 0.28);
  const [cx, cy] = [withValue && cw >= 60 ? px + 10 : px + cw / 2, py + ch / 2];
  context.strokeStyle = colour;
  context.lineWidth = Math.max(1, r / 2.6);
  context.beginPath();
  if (status === "failed") {
    context.moveTo(cx - r, cy - r);
    context.lineTo(cx + r, cy + r);
    context.moveTo(cx + r, cy - r);
    context.lineTo(cx - r, cy + r);
  } else {
    context.moveTo(cx, cy - r * 1.2);
    context.lineTo(cx, cy + r * 0.4);
    context.moveTo(cx, cy + r * 0.85);
    context.lineTo(cx, cy + r * 1.3);
    context.rect(px + 1, py + 1, cw - 2, ch - 2);
  }
  context.stroke();
}

/** Slanted lines: not measured yet. */
export function hatch(line, paper) {
  const tile = document.createElement("canvas");
  tile.width = tile.height = 6;
  const c = tile.getContext("2d");
  c.fillStyle = paper;
  c.fillRect(0, 0, 6, 6);
  c.strokeStyle = line;
  c.beginPath();
  for (const d of [-6, 0, 6]) {
    c.moveTo(d - 1, 7);
    c.lineTo(d + 7, -1);
  }
  c.stroke();
  return c.createPattern(tile, "repeat");
}

/** Text that fits, with … for what does not. Measuring is slow, so answers are kept. */
export function labelCutter(context) {
  const known = new Map();
  const widthOf = (t) => context.measureText(t).width;
  return (text, width) => {
    const key = `${Math.round(width)} ${text}`;
    if (known.has(key)) return known.get(key);
    let shown = text;
    if (widthOf(text) > width) {
      let keep = Math.max(1, Math.floor((text.length * width) / widthOf(text)) - 1);
      while (keep > 1 && widthOf(`${text.slice(0, keep)}…`) > width) keep -= 1;
      shown = `${text.slice(0, keep)}…`;
    }
    known.set(key, shown);
    return shown;
  };
}

/**
 * The whole map, a pixel a cell, and which cells need a mark on top; null where no canvas
 * is that large. Scaled up without smoothing it is the map itself as long as cells have
 * no gaps and no text.
 */
export function overview(data, colours, lut) {
  const [width, height] = [data.across.length, data.down.length];
  if (width > MOST_PIXELS || height > MOST_PIXELS) return null;
  const canvas = document.createElement("canvas");
  canvas.width = width;
  canvas.height = height;
  const context = canvas.getContext("2d");
  const image = context.createImageData(width, height);
  const rgb = lut.map((c) => c.fill.match(/\d+/g).map(Number));
  const marked = new Uint8Array(width * height);
  for (let i = 0; i < width * height; i += 1) {
    const k = data.cellAt(i % width, Math.floor(i / width));
    if (k < 0) continue;
    const has = colours.has(k);
    if (has) image.data.set([...rgb[colours.steps[k]], 255], i * 4);
    // Everything but a plain value is drawn by itself.
    if (!has || data.statusOf(k) !== "done") marked[i] = 1;
  }
  context.putImageData(image, 0, 0);
  return { canvas, isMarked: (x, y) => marked[y * width + x] === 1 };
}
