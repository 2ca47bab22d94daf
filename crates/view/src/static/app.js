// Opens streams, and connects the controls, keys and the mouse.

import { colorMaps } from './colors.js';
import { el, LABEL_KINDS, state, session, source, view, number, clampAt, showError, setOptions, guard } from './page.js';
import { saveState, saveStateSoon, readState } from './address.js';
import { redrawPlots } from './plots.js';
import { Picture } from './image_view.js';
import { Labels } from './labels.js';
import { draw, zoom, fit, largePixels, pan } from './drawing.js';
import { refresh, refreshOrWait, restyle, setWindow, syncControls, setAt, togglePlay, pause, startLive, stopLive, goToLabel, findObject } from './player.js';
import { showPixel, selectPixel, clearPixel } from './pixel_panel.js';
import { showRegion, clearRegion, setDrawing, showDistances } from './region_panel.js';
import { showDefects, listDefects, nextDefect } from './defect_panel.js';
import { showFiles, listFiles, markFiles } from './file_panel.js';

const SPEEDS = [1, 2, 5, 10, 20, 50, 100, 200, 500, 1000];

const KEYS = [
  ['Space', 'Play or pause', () => togglePlay()],
  ['ArrowLeft', 'Previous readout; with Shift: previous window', (e) => setAt(state.at - (e.shiftKey ? state.window : 1))],
  ['ArrowRight', 'Next readout; with Shift: next window', (e) => setAt(state.at + (e.shiftKey ? state.window : 1))],
  ['Home', 'First readout', () => setAt(0)],
  ['End', 'Last readout', () => setAt(session.info.readouts - 1)],
  ['[', 'Half the window', () => setWindow(Math.floor(state.window / 2))],
  [']', 'Double the window', () => setWindow(state.window * 2)],
  ['m', 'Next method', () => nextOption('method')],
  ['c', 'Next color map', () => nextOption('colors')],
  ['+', 'Zoom in', () => zoom(1.5)],
  ['-', 'Zoom out', () => zoom(1 / 1.5)],
  ['0', 'Show the whole image', () => fit()],
  ['1', 'Show large pixels', () => largePixels()],
  ['w', 'Move up', () => pan(0, 60)],
  ['a', 'Move left', () => pan(60, 0)],
  ['s', 'Move down', () => pan(0, -60)],
  ['d', 'Move right', () => pan(-60, 0)],
  ['x', 'Find and mark defective pixels', () => toggle('defects')],
  ['n', 'Next defect', () => nextDefect()],
  ['r', 'Draw a region with the mouse', () => setDrawing(!session.isDrawing)],
  ['Escape', 'Clear pixel and region', () => { clearPixel(); clearRegion(); }],
  ['?', 'Show this list', () => el('help').showModal()],
];

let dragged = null;

async function loadList() {
  const listing = await source.list();
  session.items = [];
  listing.sources.forEach((s, i) => {
    if (s.kind === 'stream' || s.kind === 'live') session.items.push({ key: `${i}`, name: s.name, source: s });
    s.items.forEach((item, k) => {
      session.items.push({ key: `${i}.${k}`, name: item.name, item, source: s });
      if (s.kind === 'dataset') session.items.push({ key: `${i}.${k}.clean`, name: `${item.name}, clean`, item, source: s, isClean: true });
    });
  });
  const streams = listing.sources.filter((s) => s.kind === 'stream');
  state.a = session.items.length ? session.items[0].key : '';
  if (streams.length === 2 && listing.sources.length === 2) state.b = '1';
  readState();
  const names = session.items.map((item) => [item.key, item.name]);
  setOptions(el('stream'), names, state.a);
  setOptions(el('other'), [['', 'none'], ...names], state.b);
  el('other-label').hidden = session.items.length < 2;
  showFiles(listing);
}

async function openStream() {
  showError(null);
  session.info = await source.stream(state.a);
  if (state.b) {
    const other = await source.stream(state.b);
    if (other.is_live || session.info.is_live) {
      state.b = '';
      showError('a live camera is shown alone');
    } else if (other.width !== session.info.width || other.height !== session.info.height) {
      state.b = '';
      showError(`the second stream has ${other.width}x${other.height} pixels, the first ${session.info.width}x${session.info.height}`);
    } else {
      session.info.readouts = Math.min(session.info.readouts, other.readouts);
      session.info.warnings = session.info.warnings.concat(other.warnings);
    }
  }
  el('stream').value = state.a;
  el('other').value = state.b;
  document.title = `${el('stream').selectedOptions[0]?.textContent || ''} - spikelane view`;
  view.setSize(session.info.width, session.info.height);
  session.pictures = [new Picture(session.info.width, session.info.height), new Picture(session.info.width, session.info.height)];
  state.at = clampAt(state.at || 0);
  session.rateMaps = [];
  session.defects = null;
  session.white = 0;
  const rate = session.info.readout_hz ? `${number(session.info.readout_hz, 6)} readouts per second` : 'unknown readout rate';
  el('facts').textContent = session.info.is_live
    ? `live, ${session.info.width}x${session.info.height}, ${rate}`
    : `${session.info.width}x${session.info.height}, ${session.info.readouts} readouts, ${rate}, ${session.info.layout}`;
  for (const id of ['at', 'scrubber']) el(id).max = session.info.readouts - 1;
  for (const id of ['back', 'forward', 'at', 'scrubber', 'speed']) el(id).disabled = session.info.is_live;
  for (const id of ['pixel-show', 'region-show', 'region-draw', 'defects']) el(id).disabled = session.info.is_live;
  el('live-state').hidden = !session.info.is_live;
  el('compare-panel').hidden = !state.b;
  el('distances').hidden = source.isEmbedded;
  el('notes-panel').hidden = !(session.info.warnings || []).length;
  el('notes').replaceChildren(...(session.info.warnings || []).map((text) => {
    const li = document.createElement('li');
    li.textContent = text;
    return li;
  }));
  for (const [id, size] of [['pixel-x', session.info.width], ['pixel-y', session.info.height], ['region-x', session.info.width], ['region-y', session.info.height]]) {
    el(id).max = size - 1;
  }
  await openLabels();
  syncControls();
  markFiles();
  if (session.info.is_live) {
    startLive();
  } else {
    refresh();
    if (state.pixel) showPixel();
    if (state.region) showRegion();
    if (state.defects) showDefects();
  }
}

const isLabeled = () => session.items.find((item) => item.key === state.a)?.source.kind === 'dataset';

async function openLabels() {
  const s = state.a.split('.').slice(0, 2).join('.');
  session.labels = null;
  session.labelCanvases = [];
  if (isLabeled()) {
    const read = await source.labels(s);
    if (read && read.frames && read.frames.length) session.labels = new Labels(source, s, read.frames);
  }
  el('labels-panel').hidden = !session.labels;
  if (session.labels) setOptions(el('label-class'), [['', 'any vehicle'], ...session.labels.classes().map((name) => [name, name])], '');
}

function nextOption(id) {
  const select = el(id);
  select.selectedIndex = (select.selectedIndex + 1) % select.options.length;
  select.dispatchEvent(new Event('change'));
}

function toggle(id) {
  if (!el(id).disabled) el(id).click();
}

async function changeStream() {
  pause();
  stopLive();
  clearPixel();
  clearRegion();
  await openStream();
  saveState();
}

function connect() {
  setOptions(el('speed'), SPEEDS.map((n) => [n, n === 1 ? 'real time' : `1/${n}`]), '200');
  setOptions(el('colors'), Object.keys(colorMaps).map((name) => [name, name]), state.colors);
  const on = (id, event, work) => el(id).addEventListener(event, work);
  on('stream', 'change', guard(async () => { state.a = el('stream').value; await changeStream(); }));
  on('other', 'change', guard(async () => { state.b = el('other').value; await changeStream(); }));
  on('play', 'click', togglePlay);
  on('back', 'click', () => setAt(state.at - 1));
  on('forward', 'click', () => setAt(state.at + 1));
  on('at', 'change', () => { setAt(Number(el('at').value)); el('at').value = state.at; });
  on('scrubber', 'input', () => setAt(Number(el('scrubber').value)));
  on('method', 'change', () => { state.method = el('method').value; syncControls(); refreshOrWait(); });
  on('window', 'change', () => setWindow(Number(el('window').value)));
  on('gain', 'input', () => { state.gain = Number(el('gain').value); restyle(); });
  on('gamma', 'input', () => { state.gamma = Number(el('gamma').value); restyle(); });
  on('colors', 'change', () => { state.colors = el('colors').value; restyle(); });
  on('compare', 'change', () => { state.compare = el('compare').value; restyle(); });
  on('wipe', 'input', () => { state.wipe = Number(el('wipe').value); draw(); saveStateSoon(); });
  on('distances', 'click', showDistances);
  on('zoom-in', 'click', () => zoom(1.5));
  on('zoom-out', 'click', () => zoom(1 / 1.5));
  on('zoom-fit', 'click', fit);
  on('zoom-pixels', 'click', largePixels);
  on('pixel-show', 'click', () => selectPixel(Number(el('pixel-x').value), Number(el('pixel-y').value)));
  on('pixel-clear', 'click', clearPixel);
  on('region-draw', 'click', () => setDrawing(!session.isDrawing));
  on('region-show', 'click', () => {
    const value = (side) => Math.round(Number(el(`region-${side}`).value));
    state.region = { x: value('x'), y: value('y'), w: value('w'), h: value('h') };
    showRegion();
  });
  on('region-range', 'change', () => { if (state.region) showRegion(); });
  on('region-clear', 'click', clearRegion);
  on('defects', 'change', () => { state.defects = el('defects').checked; showDefects(); saveStateSoon(); });
  on('defect-kind', 'change', listDefects);
  on('defect-next', 'click', nextDefect);
  on('filter', 'input', listFiles);
  on('split', 'change', listFiles);
  for (const kind of LABEL_KINDS) {
    on(`label-${kind}`, 'change', () => {
      state.labels = LABEL_KINDS.filter((k) => el(`label-${k}`).checked);
      refreshOrWait();
    });
  }
  on('label-opacity', 'input', draw);
  on('label-previous', 'click', () => goToLabel(session.labels.nearest(state.at) - 1));
  on('label-next', 'click', () => goToLabel(session.labels.nearest(state.at) + 1));
  on('label-first', 'click', () => findObject(0));
  on('label-later', 'click', () => findObject(session.labels.nearest(state.at) + 1));
  on('copy', 'click', guard(async () => {
    saveState();
    await navigator.clipboard.writeText(location.href);
    el('copy').textContent = 'Copied';
    setTimeout(() => { el('copy').textContent = 'Copy link'; }, 1500);
  }));
  on('help-open', 'click', () => el('help').showModal());
  on('help-close', 'click', () => el('help').close());
  el('keys').replaceChildren(...KEYS.map(([key, text]) => {
    const tr = document.createElement('tr');
    const kbd = document.createElement('kbd');
    kbd.textContent = key;
    tr.insertCell().append(kbd);
    tr.insertCell().textContent = text;
    return tr;
  }));
  document.addEventListener('keydown', onKey);
  window.addEventListener('hashchange', guard(async () => { readState(); await openStream(); }));
  new ResizeObserver(() => { draw(); redrawPlots(); }).observe(el('stage'));
  matchMedia('(prefers-color-scheme: dark)').addEventListener('change', redrawPlots);
  connectPointer();
}

function onKey(event) {
  const target = event.target;
  if (event.ctrlKey || event.altKey || event.metaKey || el('help').open) return;
  const isText = target instanceof HTMLInputElement && ['number', 'search', 'text'].includes(target.type);
  if ((isText || target instanceof HTMLSelectElement) && event.key !== 'Escape') return;
  const isRange = target instanceof HTMLInputElement && target.type === 'range' && target.id !== 'scrubber';
  const isControl = target instanceof HTMLButtonElement || target instanceof HTMLInputElement || target.tagName === 'SUMMARY';
  if (isRange && ['ArrowLeft', 'ArrowRight', 'Home', 'End'].includes(event.key)) return;
  if (event.key === ' ' && isControl) return;
  const name = event.key === ' ' ? 'Space' : event.key.length === 1 ? event.key.toLowerCase() : event.key;
  const found = KEYS.find(([key]) => key === name) || (name === '=' && KEYS.find(([key]) => key === '+'));
  if (!found) return;
  event.preventDefault();
  found[2](event);
}

function connectPointer() {
  const canvas = el('image');
  const place = (event) => {
    const box = canvas.getBoundingClientRect();
    return [event.clientX - box.left, event.clientY - box.top];
  };
  canvas.addEventListener('pointerdown', (event) => {
    const [x, y] = place(event);
    dragged = { x, y, moved: false, start: view.pixelAt(x, y), draws: session.isDrawing || event.shiftKey };
    canvas.setPointerCapture(event.pointerId);
  });
  canvas.addEventListener('pointermove', (event) => {
    const [x, y] = place(event);
    const at = view.pixelAt(x, y);
    showHover(at);
    if (!dragged) return;
    if (Math.hypot(x - dragged.x, y - dragged.y) > 3) dragged.moved = true;
    if (!dragged.moved) return;
    if (dragged.draws) {
      const clampX = (v) => Math.max(0, Math.min(session.info.width - 1, v));
      const clampY = (v) => Math.max(0, Math.min(session.info.height - 1, v));
      const [x0, x1] = [clampX(dragged.start.x), clampX(at.x)].sort((p, q) => p - q);
      const [y0, y1] = [clampY(dragged.start.y), clampY(at.y)].sort((p, q) => p - q);
      state.region = { x: x0, y: y0, w: x1 - x0 + 1, h: y1 - y0 + 1 };
      draw();
    } else {
      pan(x - (dragged.lastX ?? dragged.x), y - (dragged.lastY ?? dragged.y));
      dragged.lastX = x;
      dragged.lastY = y;
    }
  });
  canvas.addEventListener('pointerup', () => {
    const done = dragged;
    dragged = null;
    if (!done || session.info.is_live) return;
    if (done.moved && done.draws) {
      setDrawing(false);
      showRegion();
    } else if (!done.moved && done.start.isInside) {
      selectPixel(done.start.x, done.start.y);
    }
  });
  canvas.addEventListener('pointercancel', () => { dragged = null; });
  canvas.addEventListener('pointerleave', () => { el('hover').textContent = ''; });
  canvas.addEventListener('wheel', (event) => {
    event.preventDefault();
    const [x, y] = place(event);
    const [w, h] = view.paneSize();
    view.setZoom(view.scale() * 1.0015 ** -event.deltaY, x % w || x, y % h || y);
    draw();
    saveStateSoon();
  }, { passive: false });
}

function showHover({ x, y, pane, isInside }) {
  if (!isInside || !session.pictures.length) {
    el('hover').textContent = '';
    return;
  }
  const p = y * session.info.width + x;
  const rate = session.pictures[state.b && state.compare !== 'difference' ? pane : 0].image.at(p);
  let text = `x ${x}, y ${y}, `;
  if (state.b && state.compare === 'difference') {
    text += `difference ${number(session.pictures[0].image.at(p) - session.pictures[1].image.at(p))}`;
  } else if (state.method === 'bits') {
    text += rate ? 'spike' : 'no spike';
  } else {
    text += `rate ${number(rate)}${rate > 0 ? `, interval ${number(1 / rate)} readouts` : ''}`;
  }
  el('hover').textContent = text;
}

guard(async () => {
  connect();
  await loadList();
  if (state.a) {
    await openStream();
    saveState();
  } else {
    el('facts').textContent = 'no streams';
  }
  document.body.dataset.ready = 'true';
})();
