// Draws the images, and over them the labels, defects, the pixel and the region.

import { el, DEFECT_KINDS, state, session, view, number } from './page.js';
import { saveStateSoon } from './address.js';
import { Picture } from './image_view.js';

const DEFECT_COLORS = { hot: '#ff4d4d', weak: '#4da3ff', dead: '#ffd000', stuck: '#ff66ff', blinking: '#00e5ff' };

export function setWhite() {
  session.white = state.method === 'bits' ? 1 : session.pictures[0].image.white();
  session.whiteMethod = state.method;
}

export function paint() {
  const limit = session.white / 2 ** state.gain;
  const both = Boolean(state.b);
  view.layout = !both ? 'one' : state.compare === 'difference' ? 'one' : state.compare;
  if (both && state.compare === 'difference') {
    const difference = paint.difference && paint.difference.width === session.info.width && paint.difference.height === session.info.height
      ? paint.difference : new Picture(session.info.width, session.info.height);
    paint.difference = difference;
    difference.colorDifference(session.pictures[0], session.pictures[1], limit);
    view.pictures = [difference];
  } else {
    view.pictures = both ? session.pictures : session.pictures.slice(0, 1);
    view.pictures.forEach((p) => p.color(session.table, limit, state.gamma));
  }
  draw();
}

export function draw() {
  view.wipe = state.wipe;
  view.overlay = drawOverlay;
  view.draw();
  el('zoom-value').textContent = `${number(view.scale() * 100, 3)} %`;
}

function drawOverlay(c, scale, pane) {
  if (pane === 0 && session.labels) {
    c.globalAlpha = Number(el('label-opacity').value);
    for (const canvas of session.labelCanvases) if (canvas) c.drawImage(canvas, 0, 0);
    c.globalAlpha = 1;
    const i = session.labels.nearest(state.at);
    if (state.labels.includes('boxes')) session.labels.drawBoxes(c, scale, i);
    if (state.labels.includes('tracks')) session.labels.drawTracks(c, scale, i);
  }
  const thin = 1.5 / scale;
  if (state.defects && session.defects && pane === 0) {
    c.lineWidth = thin;
    for (const kind of Object.keys(DEFECT_KINDS)) {
      c.strokeStyle = DEFECT_COLORS[kind];
      const margin = 3 / scale;
      for (const p of session.defects[kind]) {
        c.strokeRect((p % session.info.width) - margin, Math.floor(p / session.info.width) - margin, 1 + 2 * margin, 1 + 2 * margin);
      }
    }
  }
  if (state.region) {
    const r = state.region;
    c.lineWidth = thin;
    c.strokeStyle = '#000';
    c.strokeRect(r.x, r.y, r.w, r.h);
    c.setLineDash([4 / scale, 4 / scale]);
    c.strokeStyle = '#fff';
    c.strokeRect(r.x, r.y, r.w, r.h);
    c.setLineDash([]);
  }
  if (state.pixel) {
    const m = 4 / scale;
    c.lineWidth = thin;
    c.strokeStyle = '#3ddc84';
    c.strokeRect(state.pixel.x - m, state.pixel.y - m, 1 + 2 * m, 1 + 2 * m);
  }
}

export function zoom(factor) {
  view.zoomBy(factor);
  draw();
  saveStateSoon();
}

export function fit() {
  view.zoom = 0;
  draw();
  saveStateSoon();
}

export function largePixels() {
  const at = state.pixel || { x: session.info.width / 2, y: session.info.height / 2 };
  view.centerOn(at.x, at.y, 16);
  draw();
  saveStateSoon();
}

export function pan(dx, dy) {
  view.pan(dx, dy);
  draw();
  saveStateSoon();
}
