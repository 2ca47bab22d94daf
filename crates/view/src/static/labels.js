import { colorMaps, hueColor, idColor } from './colors.js';

// Narrowest box on the screen that has a text, in CSS pixels.
const MIN_TEXT_BOX_PX = 30;

// Labels of a sequence: boxes, tracks and maps of the labeled readout that is nearest to the shown readout.

export class Labels {
  constructor(source, s, frames) {
    this.source = source;
    this.s = s;
    this.frames = frames;
    this.maps = new Map();
  }

  // Index of the labeled readout that is nearest to `at`.
  nearest(at) {
    let best = 0;
    this.frames.forEach((frame, i) => {
      if (Math.abs(frame.readout - at) < Math.abs(this.frames[best].readout - at)) best = i;
    });
    return best;
  }

  visible(i) {
    return this.frames[i].boxes.filter((b) => b.visible_pixels > 0);
  }

  // Classes of all boxes.
  classes() {
    return [...new Set(this.frames.flatMap((frame) => frame.boxes.map((b) => b.class)))].sort();
  }

  // Index of the first labeled readout from index `start` on with an object of class `name`, or of any class if `name` is
  // empty. At least `pixels` pixels of the object are visible. -1 if there is none.
  find(start, name, pixels) {
    const isWanted = (b) => b.visible_pixels >= pixels && (!name || b.class === name);
    return this.frames.findIndex((frame, i) => i >= start && frame.boxes.some(isWanted));
  }

  // Returns a map as a canvas. Null if the sequence has no such map.
  async map(readout, kind) {
    const key = `${readout} ${kind}`;
    if (!this.maps.has(key)) {
      if (this.maps.size > 12) this.maps.delete(this.maps.keys().next().value);
      this.maps.set(key, this.source.labelMap(this.s, readout, kind).then((map) => colorMap(map, kind), () => null));
    }
    return this.maps.get(key);
  }

  drawBoxes(c, scale, i) {
    c.lineWidth = 2 / scale;
    c.font = `${12 / scale}px system-ui, sans-serif`;
    for (const b of this.visible(i)) {
      const [x0, y0, x1, y1] = b.visible_box || b.clipped_amodal_box;
      const color = `rgb(${idColor(b.track_id).join(',')})`;
      c.strokeStyle = color;
      c.strokeRect(x0, y0, x1 - x0, y1 - y0);
      // Texts over the boxes of distant vehicles would cover each other.
      if ((x1 - x0) * scale < MIN_TEXT_BOX_PX) continue;
      const text = `${b.class} ${b.track_id}`;
      const width = c.measureText(text).width;
      c.fillStyle = '#000b';
      c.fillRect(x0, y0 - 15 / scale, width + 6 / scale, 15 / scale);
      c.fillStyle = color;
      c.fillText(text, x0 + 3 / scale, y0 - 3 / scale);
    }
  }

  // Draws the path of the box centers of each track up to labeled readout `i`.
  drawTracks(c, scale, i) {
    const paths = new Map();
    for (let k = 0; k <= i; k++) {
      for (const b of this.visible(k)) {
        const [x0, y0, x1, y1] = b.clipped_amodal_box;
        if (!paths.has(b.track_id)) paths.set(b.track_id, []);
        paths.get(b.track_id).push([(x0 + x1) / 2, (y0 + y1) / 2]);
      }
    }
    c.lineWidth = 2 / scale;
    for (const [id, points] of paths) {
      c.strokeStyle = `rgb(${idColor(id).join(',')})`;
      c.fillStyle = c.strokeStyle;
      c.beginPath();
      points.forEach(([x, y], k) => (k ? c.lineTo(x, y) : c.moveTo(x, y)));
      c.stroke();
      const [x, y] = points[points.length - 1];
      c.fillRect(x - 3 / scale, y - 3 / scale, 6 / scale, 6 / scale);
    }
  }
}

// Colors of a map. Depth: near is bright, the sky is transparent. Flow: hue is the direction, saturation the speed.
function colorMap({ width, height, values }, kind) {
  const canvas = document.createElement('canvas');
  canvas.width = width;
  canvas.height = height;
  const context = canvas.getContext('2d');
  const image = context.createImageData(width, height);
  const set = (p, [r, g, b]) => image.data.set([r, g, b, 255], 4 * p);
  const pixels = width * height;
  if (kind === 'depth') {
    let near = 1e30;
    for (const v of values) if (v > 0 && v < near) near = v;
    for (let p = 0; p < pixels; p++) if (values[p] > 0) set(p, colorMaps.viridis(near / values[p]));
  } else if (kind === 'flow') {
    let fastest = 1e-6;
    for (let p = 0; p < pixels; p++) fastest = Math.max(fastest, Math.hypot(values[2 * p], values[2 * p + 1]));
    for (let p = 0; p < pixels; p++) {
      const [u, v] = [values[2 * p], values[2 * p + 1]];
      const hue = (Math.atan2(v, u) / (2 * Math.PI) + 1) % 1;
      set(p, hueColor(hue, Math.min(1, Math.hypot(u, v) / fastest), 1));
    }
  } else {
    for (let p = 0; p < pixels; p++) if (values[p] > 0) set(p, idColor(values[p]));
  }
  context.putImageData(image, 0, 0);
  return canvas;
}
