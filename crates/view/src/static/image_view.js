import { differenceColor, lookupTable } from './colors.js';
import { RateImage } from './rate_image.js';

// The image area: pans, zooms, and draws one or two images with overlays.

const differenceTable = lookupTable(differenceColor);

// One image as rates and as colors.
export class Picture {
  constructor(width, height) {
    this.width = width;
    this.height = height;
    this.image = new RateImage(new Float32Array(width * height));
    this.canvas = document.createElement('canvas');
    this.canvas.width = width;
    this.canvas.height = height;
    this.context = this.canvas.getContext('2d');
    this.pixels = this.context.createImageData(width, height);
    this.words = new Uint32Array(this.pixels.data.buffer);
  }

  // Colors the rates. Rate `white` has the last color of the table.
  color(table, white, gamma) {
    this.image.color(this.words, table, white, gamma);
    this.context.putImageData(this.pixels, 0, 0);
  }

  // Colors the difference of two images. A difference of `limit` has the last color.
  colorDifference(a, b, limit) {
    for (let i = 0; i < this.words.length; i++) {
      const d = (a.image.at(i) - b.image.at(i)) / limit;
      this.words[i] = differenceTable[Math.max(0, Math.min(1023, Math.round(511.5 * (1 + d))))];
    }
    this.context.putImageData(this.pixels, 0, 0);
  }
}

export class ImageView {
  constructor(canvas) {
    this.canvas = canvas;
    this.context = canvas.getContext('2d');
    this.width = 1;
    this.height = 1;
    this.layout = 'one';
    this.wipe = 0.5;
    this.pictures = [];
    this.overlay = () => {};
    this.zoom = 0; // 0 means the whole image.
    this.center = [0.5, 0.5];
  }

  setSize(width, height) {
    this.width = width;
    this.height = height;
  }

  // Screen size of one image in CSS pixels.
  paneSize() {
    const { clientWidth: w, clientHeight: h } = this.canvas;
    if (this.layout !== 'side') return [w, h];
    return this.isStacked() ? [w, h / 2] : [w / 2, h];
  }

  isStacked() {
    return this.canvas.clientWidth < this.canvas.clientHeight * 1.2;
  }

  scale() {
    const [w, h] = this.paneSize();
    const fit = Math.min(w / this.width, h / this.height);
    return this.zoom > 0 ? this.zoom : fit;
  }

  // Position of the image in a pane.
  origin() {
    const [w, h] = this.paneSize();
    const s = this.scale();
    if (this.zoom === 0) return [(w - s * this.width) / 2, (h - s * this.height) / 2];
    return [w / 2 - s * this.center[0] * this.width, h / 2 - s * this.center[1] * this.height];
  }

  // Returns the pixel at a position of the canvas, and the number of the image. Null outside the image.
  pixelAt(x, y) {
    const [w, h] = this.paneSize();
    let pane = 0;
    if (this.layout === 'side') {
      pane = this.isStacked() ? Number(y >= h) : Number(x >= w);
      if (pane && this.isStacked()) y -= h;
      else if (pane) x -= w;
    } else if (this.layout === 'wipe') {
      pane = Number(x >= this.wipe * w);
    }
    const s = this.scale();
    const [ox, oy] = this.origin();
    const col = Math.floor((x - ox) / s);
    const row = Math.floor((y - oy) / s);
    const isInside = col >= 0 && row >= 0 && col < this.width && row < this.height;
    return { x: col, y: row, pane, isInside };
  }

  setZoom(zoom, x, y) {
    const [w, h] = this.paneSize();
    const fit = Math.min(w / this.width, h / this.height);
    if (zoom <= fit) {
      this.zoom = 0;
      return;
    }
    const s = this.scale();
    const [ox, oy] = this.origin();
    const px = (x - ox) / s;
    const py = (y - oy) / s;
    this.zoom = Math.min(zoom, 64);
    this.center = [(px + (w / 2 - x) / this.zoom) / this.width, (py + (h / 2 - y) / this.zoom) / this.height];
    this.clampCenter();
  }

  zoomBy(factor) {
    const [w, h] = this.paneSize();
    this.setZoom(this.scale() * factor, w / 2, h / 2);
  }

  pan(dx, dy) {
    if (this.zoom === 0) return;
    this.center = [this.center[0] - dx / (this.zoom * this.width), this.center[1] - dy / (this.zoom * this.height)];
    this.clampCenter();
  }

  clampCenter() {
    this.center = this.center.map((v) => Math.max(0, Math.min(1, v)));
  }

  // Shows pixel (x, y) in the middle with large pixels.
  centerOn(x, y, zoom) {
    this.zoom = zoom;
    this.center = [(x + 0.5) / this.width, (y + 0.5) / this.height];
  }

  draw() {
    const { canvas, context: c } = this;
    const ratio = window.devicePixelRatio || 1;
    const [w, h] = [Math.round(canvas.clientWidth * ratio), Math.round(canvas.clientHeight * ratio)];
    if (canvas.width !== w || canvas.height !== h) {
      canvas.width = w;
      canvas.height = h;
    }
    c.setTransform(1, 0, 0, 1, 0, 0);
    c.clearRect(0, 0, w, h);
    c.imageSmoothingEnabled = false;
    const [pw, ph] = this.paneSize();
    this.pictures.forEach((picture, i) => {
      c.save();
      c.scale(ratio, ratio);
      c.beginPath();
      if (this.layout === 'side') {
        c.translate(i && !this.isStacked() ? pw : 0, i && this.isStacked() ? ph : 0);
        c.rect(0, 0, pw, ph);
      } else if (this.layout === 'wipe') {
        const x = this.wipe * pw;
        c.rect(i ? x : 0, 0, i ? pw - x : x, ph);
      } else {
        c.rect(0, 0, pw, ph);
      }
      c.clip();
      const [ox, oy] = this.origin();
      const s = this.scale();
      c.translate(ox, oy);
      c.scale(s, s);
      c.drawImage(picture.canvas, 0, 0);
      this.overlay(c, s, i);
      c.restore();
    });
    if (this.layout === 'side' && this.pictures.length === 2) {
      c.save();
      c.scale(ratio, ratio);
      c.fillStyle = '#8c959f';
      if (this.isStacked()) c.fillRect(0, ph - 1, pw, 2);
      else c.fillRect(pw - 1, 0, 2, ph);
      c.restore();
    }
    if (this.layout === 'wipe') {
      c.save();
      c.scale(ratio, ratio);
      c.fillStyle = '#fff';
      c.fillRect(this.wipe * pw - 1, 0, 2, ph);
      c.restore();
    }
  }
}
