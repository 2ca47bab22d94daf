import { colorMaps, lookupTable, whiteRate } from './colors.js';
import { openSource } from './sources.js';
import { drawPlot, redrawPlots } from './plots.js';
import { ImageView, Picture } from './image_view.js';
import { Labels } from './labels.js';

const el = (id) => document.getElementById(id);

const DEFAULT_HZ = 20000;
const SPEEDS = [1, 2, 5, 10, 20, 50, 100, 200, 500, 1000];
const PIXEL_READOUTS = 2000;
const TRAIN_READOUTS = 200;
const REGION_READOUTS = 8192;
const LISTED_DEFECTS = 200;
const DEFECT_KINDS = { hot: 'hot (rate too high)', weak: 'weak (rate too low)', dead: 'dead (no spikes)', stuck: 'stuck (always fires)' };
const DEFECT_COLORS = { hot: '#ff4d4d', weak: '#4da3ff', dead: '#ffd000', stuck: '#ff66ff' };
const LABEL_MAPS = ['instance', 'semantic', 'depth', 'flow'];

const KEYS = [
  ['Space', 'Play or pause', () => togglePlay()],
  ['ArrowLeft', 'Previous readout; with Shift: previous window', (e) => setAt(state.at - (e.shiftKey ? state.window : 1))],
  ['ArrowRight', 'Next readout; with Shift: next window', (e) => setAt(state.at + (e.shiftKey ? state.window : 1))],
  ['Home', 'First readout', () => setAt(0)],
  ['End', 'Last readout', () => setAt(info.readouts - 1)],
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
  ['r', 'Draw a region with the mouse', () => setDrawing(!isDrawing)],
  ['Escape', 'Clear pixel and region', () => { clearPixel(); clearRegion(); }],
  ['?', 'Show this list', () => el('help').showModal()],
];

const state = {
  a: '', b: '', at: 0, method: 'tfp', window: 41, gain: 0, gamma: 1, colors: 'gray', compare: 'side', wipe: 0.5,
  pixel: null, region: null, defects: false, labels: [],
};

const source = openSource();
const view = new ImageView(el('image'));
let info = { width: 1, height: 1, readouts: 1, readout_hz: null };
let pictures = [];
let white = 1;
let table = lookupTable(colorMaps.gray);
let isDrawing = false;
let dragged = null;
let playing = null;
let defects = null;
let labels = null;
let labelCanvases = [];
let rateMaps = [];
let items = [];

function showError(error) {
  el('message').hidden = !error;
  el('message').textContent = error ? String(error.message || error) : '';
}

const guard = (work) => async (...args) => {
  try {
    await work(...args);
  } catch (error) {
    showError(error);
  }
};

const hz = () => info.readout_hz || DEFAULT_HZ;
const clampAt = (at) => Math.max(0, Math.min(info.readouts - 1, Math.round(at)));
const number = (v, digits = 4) => String(Number(v.toPrecision(digits)));

// ---- The address

function saveState() {
  const parts = [
    ['a', state.a], ['b', state.b], ['t', state.at], ['m', state.method], ['w', state.window], ['g', state.gain],
    ['y', state.gamma], ['c', state.colors], ['k', state.compare], ['p', state.wipe], ['d', state.defects ? 1 : 0],
    ['z', view.zoom.toFixed(3)], ['o', view.center.map((v) => v.toFixed(4)).join(',')],
  ];
  if (state.pixel) parts.push(['i', `${state.pixel.x},${state.pixel.y}`]);
  if (state.region) parts.push(['r', [state.region.x, state.region.y, state.region.w, state.region.h].join(',')]);
  if (state.labels.length) parts.push(['l', state.labels.join(',')]);
  const text = parts.filter(([, v]) => v !== '').map(([k, v]) => `${k}=${v}`).join('&');
  history.replaceState(null, '', `#${text}`);
}

let saveTimer = 0;
function saveStateSoon() {
  clearTimeout(saveTimer);
  saveTimer = setTimeout(saveState, 150);
}

function readState() {
  const values = new Map(location.hash.slice(1).split('&').map((part) => part.split('=')));
  const numbers = (key, count) => {
    const list = (values.get(key) || '').split(',').map(Number);
    return list.length === count && list.every((v) => Number.isFinite(v)) && values.get(key) ? list : null;
  };
  const take = (key, set) => {
    const list = numbers(key, 1);
    if (list) set(list[0]);
  };
  const choose = (key, options, set) => {
    if (options.includes(values.get(key))) set(values.get(key));
  };
  const streams = items.map((item) => item.key);
  choose('a', streams, (v) => { state.a = v; });
  choose('b', streams, (v) => { state.b = v; });
  take('t', (v) => { state.at = Math.max(0, Math.round(v)); });
  choose('m', ['tfp', 'tfi', 'span', 'bits', 'rates'], (v) => { state.method = v; });
  take('w', (v) => { state.window = Math.max(1, Math.min(4096, Math.round(v))); });
  take('g', (v) => { state.gain = Math.max(-3, Math.min(6, v)); });
  take('y', (v) => { state.gamma = Math.max(0.4, Math.min(3, v)); });
  choose('c', Object.keys(colorMaps), (v) => { state.colors = v; });
  choose('k', ['side', 'difference', 'wipe'], (v) => { state.compare = v; });
  take('p', (v) => { state.wipe = Math.max(0, Math.min(1, v)); });
  take('d', (v) => { state.defects = v === 1; });
  take('z', (v) => { view.zoom = Math.max(0, Math.min(64, v)); });
  const center = numbers('o', 2);
  if (center) view.center = center;
  const pixel = numbers('i', 2);
  if (pixel) state.pixel = { x: pixel[0], y: pixel[1] };
  const region = numbers('r', 4);
  if (region) state.region = { x: region[0], y: region[1], w: region[2], h: region[3] };
  if (values.get('l')) state.labels = values.get('l').split(',').filter((l) => document.getElementById(`label-${l}`));
}

// ---- Streams

function setOptions(select, options, value) {
  select.replaceChildren(...options.map(([v, text]) => {
    const option = document.createElement('option');
    option.value = v;
    option.textContent = text;
    return option;
  }));
  select.value = value;
}

let listing = { sources: [] };

async function loadList() {
  listing = await source.list();
  items = [];
  listing.sources.forEach((s, i) => {
    if (s.kind === 'stream' || s.kind === 'live') items.push({ key: `${i}`, name: s.name, source: s });
    s.items.forEach((item, k) => {
      items.push({ key: `${i}.${k}`, name: item.name, item, source: s });
      if (s.kind === 'dataset') items.push({ key: `${i}.${k}.clean`, name: `${item.name}, clean`, item, source: s, isClean: true });
    });
  });
  const streams = listing.sources.filter((s) => s.kind === 'stream');
  state.a = items.length ? items[0].key : '';
  if (streams.length === 2 && listing.sources.length === 2) state.b = '1';
  readState();
  const names = items.map((item) => [item.key, item.name]);
  setOptions(el('stream'), names, state.a);
  setOptions(el('other'), [['', 'none'], ...names], state.b);
  el('other-label').hidden = items.length < 2;
  showFiles();
}

async function openStream() {
  showError(null);
  info = await source.stream(state.a);
  if (state.b) {
    const other = await source.stream(state.b);
    if (other.is_live || info.is_live) {
      state.b = '';
      showError('a live camera is shown alone');
    } else if (other.width !== info.width || other.height !== info.height) {
      state.b = '';
      showError(`the second stream has ${other.width}x${other.height} pixels, the first ${info.width}x${info.height}`);
    } else {
      info.readouts = Math.min(info.readouts, other.readouts);
      info.warnings = info.warnings.concat(other.warnings);
    }
  }
  el('stream').value = state.a;
  el('other').value = state.b;
  document.title = `${el('stream').selectedOptions[0]?.textContent || ''} - spikelane view`;
  view.setSize(info.width, info.height);
  pictures = [new Picture(info.width, info.height), new Picture(info.width, info.height)];
  state.at = clampAt(state.at || 0);
  rateMaps = [];
  defects = null;
  white = 0;
  const rate = info.readout_hz ? `${number(info.readout_hz, 6)} readouts per second` : 'unknown readout rate';
  el('facts').textContent = info.is_live
    ? `live, ${info.width}x${info.height}, ${rate}`
    : `${info.width}x${info.height}, ${info.readouts} readouts, ${rate}, ${info.layout}`;
  for (const id of ['at', 'scrubber']) el(id).max = info.readouts - 1;
  for (const id of ['back', 'forward', 'at', 'scrubber', 'speed']) el(id).disabled = info.is_live;
  for (const id of ['pixel-show', 'region-show', 'region-draw', 'defects']) el(id).disabled = info.is_live;
  el('live-state').hidden = !info.is_live;
  el('compare-panel').hidden = !state.b;
  el('distances').hidden = source.isEmbedded;
  el('notes-panel').hidden = !(info.warnings || []).length;
  el('notes').replaceChildren(...(info.warnings || []).map((text) => {
    const li = document.createElement('li');
    li.textContent = text;
    return li;
  }));
  for (const [id, size] of [['pixel-x', info.width], ['pixel-y', info.height], ['region-x', info.width], ['region-y', info.height]]) {
    el(id).max = size - 1;
  }
  await openLabels();
  syncControls();
  markFiles();
  if (info.is_live) {
    startLive();
  } else {
    refresh();
    if (state.pixel) showPixel();
    if (state.region) showRegion();
    if (state.defects) showDefects();
  }
}

const isLabeled = () => items.find((item) => item.key === state.a)?.source.kind === 'dataset';

async function openLabels() {
  const s = state.a.split('.').slice(0, 2).join('.');
  labels = null;
  labelCanvases = [];
  if (isLabeled()) {
    const read = await source.labels(s);
    if (read && read.frames && read.frames.length) labels = new Labels(source, s, read.frames);
  }
  el('labels-panel').hidden = !labels;
}

// ---- Images: the newest request wins, and one request is under way at a time.

let isLoading = false;
let isDirty = false;

function refresh() {
  isDirty = true;
  if (!isLoading) load();
}

async function load() {
  isLoading = true;
  while (isDirty) {
    isDirty = false;
    const { at, method, window: size } = state;
    try {
      const streams = state.b ? [state.a, state.b] : [state.a];
      const rates = await Promise.all(streams.map((s, i) => (method === 'rates' ? rateMap(s, i) : source.image(s, at, method, size))));
      if (pictures[0].width * pictures[0].height !== rates[0].length) continue;
      rates.forEach((r, i) => { pictures[i].rates = r; });
      if (!white || whiteMethod !== method) setWhite();
      if (labels) await loadLabelMaps(at);
      paint();
      el('image').dataset.readout = at;
      el('image').dataset.images = Number(el('image').dataset.images || 0) + 1;
    } catch (error) {
      showError(error);
      pause();
    }
  }
  isLoading = false;
}

let whiteMethod = '';

function setWhite() {
  white = state.method === 'bits' ? 1 : whiteRate(pictures[0].rates);
  whiteMethod = state.method;
}

async function rateMap(s, i) {
  if (!rateMaps[i]) {
    await runJob(s, 'summary', null, el('summary-progress'));
    rateMaps[i] = await source.rates(s);
  }
  return rateMaps[i];
}

function paint() {
  const limit = white / 2 ** state.gain;
  const both = Boolean(state.b);
  view.layout = !both ? 'one' : state.compare === 'difference' ? 'one' : state.compare;
  if (both && state.compare === 'difference') {
    const difference = paint.difference && paint.difference.width === info.width && paint.difference.height === info.height
      ? paint.difference : new Picture(info.width, info.height);
    paint.difference = difference;
    difference.colorDifference(pictures[0], pictures[1], limit);
    view.pictures = [difference];
  } else {
    view.pictures = both ? pictures : pictures.slice(0, 1);
    view.pictures.forEach((p) => p.color(table, limit, state.gamma));
  }
  draw();
}

function draw() {
  view.wipe = state.wipe;
  view.overlay = drawOverlay;
  view.draw();
  el('zoom-value').textContent = `${number(view.scale() * 100, 3)} %`;
}

function drawOverlay(c, scale, pane) {
  if (pane === 0 && labels) {
    c.globalAlpha = Number(el('label-opacity').value);
    for (const canvas of labelCanvases) if (canvas) c.drawImage(canvas, 0, 0);
    c.globalAlpha = 1;
    const i = labels.nearest(state.at);
    if (state.labels.includes('boxes')) labels.drawBoxes(c, scale, i);
    if (state.labels.includes('tracks')) labels.drawTracks(c, scale, i);
  }
  const thin = 1.5 / scale;
  if (state.defects && defects && pane === 0) {
    c.lineWidth = thin;
    for (const kind of Object.keys(DEFECT_KINDS)) {
      c.strokeStyle = DEFECT_COLORS[kind];
      const margin = 3 / scale;
      for (const p of defects[kind]) {
        c.strokeRect((p % info.width) - margin, Math.floor(p / info.width) - margin, 1 + 2 * margin, 1 + 2 * margin);
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

// ---- Time

function setAt(at) {
  if (info.is_live) return;
  state.at = clampAt(at);
  syncTime();
  refresh();
  saveStateSoon();
}

function syncTime() {
  el('at').value = state.at;
  el('scrubber').value = state.at;
  el('clock').textContent = info.readout_hz
    ? `${((1000 * state.at) / info.readout_hz).toFixed(2)} ms of ${((1000 * info.readouts) / info.readout_hz).toFixed(2)} ms`
    : `of ${info.readouts}`;
  if (labels) syncLabelText();
}

function togglePlay() {
  if (info.is_live) {
    isFrozen = !isFrozen;
    el('play').textContent = isFrozen ? 'Resume' : 'Freeze';
    return;
  }
  if (playing) pause();
  else play();
}

function pause() {
  playing = null;
  if (!info.is_live) el('play').textContent = 'Play';
}

function play() {
  if (state.at >= info.readouts - 1) setAt(0);
  const run = { last: performance.now(), position: state.at };
  playing = run;
  el('play').textContent = 'Pause';
  const step = (now) => {
    if (playing !== run) return;
    run.position += ((now - run.last) / 1000) * (hz() / Number(el('speed').value));
    run.last = now;
    if (clampAt(run.position) !== state.at) setAt(run.position);
    if (state.at >= info.readouts - 1) pause();
    else requestAnimationFrame(step);
  };
  requestAnimationFrame(step);
}

// ---- Live camera

let isFrozen = false;
let liveRun = 0;

async function startLive() {
  const run = ++liveRun;
  isFrozen = false;
  el('play').textContent = 'Freeze';
  while (run === liveRun && info.is_live) {
    const start = performance.now();
    if (!isFrozen) {
      try {
        const live = await source.live(state.a, state.method === 'rates' ? 'tfp' : state.method, state.window);
        if (run !== liveRun) return;
        pictures[0].rates = live.rates;
        if (!white || whiteMethod !== state.method) setWhite();
        paint();
        const image = el('image');
        image.dataset.readout = live.latest;
        image.dataset.images = Number(image.dataset.images || 0) + 1;
        el('live-state').textContent = `${live.state}, readout ${live.latest}, lag ${live.lag} readouts, ${live.dropped} dropped`;
        showError(null);
      } catch (error) {
        el('live-state').textContent = String(error.message || error);
      }
    }
    await new Promise((resolve) => setTimeout(resolve, Math.max(2, 33 - (performance.now() - start))));
  }
}

// ---- Controls of the image

function setWindow(size) {
  state.window = Math.max(1, Math.min(info.max_window || 4096, Math.round(size) || 1));
  syncControls();
  refreshOrWait();
}

function refreshOrWait() {
  if (!info.is_live) refresh();
  saveStateSoon();
}

function syncControls() {
  el('method').value = state.method;
  el('window').value = state.window;
  el('window').disabled = ['bits', 'rates'].includes(state.method);
  el('gain').value = state.gain;
  el('gain-value').textContent = `x${number(2 ** state.gain, 3)}`;
  el('gamma').value = state.gamma;
  el('gamma-value').textContent = number(state.gamma, 3);
  el('colors').value = state.colors;
  el('compare').value = state.compare;
  el('wipe').value = state.wipe;
  el('wipe').disabled = state.compare !== 'wipe';
  el('defects').checked = state.defects;
  for (const kind of ['boxes', 'tracks', ...LABEL_MAPS]) el(`label-${kind}`).checked = state.labels.includes(kind);
  table = lookupTable(colorMaps[state.colors]);
  syncTime();
}

function nextOption(id) {
  const select = el(id);
  select.selectedIndex = (select.selectedIndex + 1) % select.options.length;
  select.dispatchEvent(new Event('change'));
}

function toggle(id) {
  if (!el(id).disabled) el(id).click();
}

function zoom(factor) {
  view.zoomBy(factor);
  draw();
  saveStateSoon();
}

function fit() {
  view.zoom = 0;
  draw();
  saveStateSoon();
}

function largePixels() {
  const at = state.pixel || { x: info.width / 2, y: info.height / 2 };
  view.centerOn(at.x, at.y, 16);
  draw();
  saveStateSoon();
}

function pan(dx, dy) {
  view.pan(dx, dy);
  draw();
  saveStateSoon();
}

// ---- Pixel

// Readouts around the current readout, at most `count`.
function nearReadouts(count) {
  const length = Math.min(count, info.readouts, info.max_request_readouts);
  const from = Math.max(0, Math.min(info.readouts - length, state.at - Math.floor(length / 2)));
  return [from, from + length];
}

const showPixel = guard(async () => {
  const { x, y } = state.pixel;
  if (x >= info.width || y >= info.height || x < 0 || y < 0) {
    state.pixel = null;
    throw new Error(`pixel (${x}, ${y}) is outside the image of ${info.width}x${info.height} pixels`);
  }
  el('pixel-x').value = x;
  el('pixel-y').value = y;
  draw();
  saveStateSoon();
  const [from, to] = nearReadouts(PIXEL_READOUTS);
  const result = await source.pixel(state.a, x, y, from, to);
  if (!state.pixel || state.pixel.x !== x || state.pixel.y !== y) return;
  el('pixel-result').hidden = false;
  const own = result.pixels.find((p) => p.x === x && p.y === y);
  const others = result.pixels.filter((p) => p !== own);
  const count = result.times.length;
  const mean = count > 1 ? (result.times[count - 1] - result.times[0]) / (count - 1) : 0;
  el('pixel-text').textContent = `Pixel (${x}, ${y}): ${count} spikes in readouts ${from} to ${to - 1}, `
    + `rate ${number(count / (to - from))}${mean ? `, mean interval ${number(mean)} readouts` : ''}`;
  const train = nearReadouts(TRAIN_READOUTS);
  drawPlot(el('train-plot'), {
    title: 'Spikes around this readout', xLabel: 'readout', hideY: true, xRange: train, yRange: [0, 1], marker: state.at,
    series: [{ kind: 'events', x: result.times, y: [], color: '--series-1' }],
    description: `Spike times of pixel ${x}, ${y}: ${count} spikes`,
  });
  const share = (list) => {
    const all = list.reduce((sum, [, n]) => sum + n, 0) || 1;
    return { x: list.map(([length]) => length), y: list.map(([, n]) => n / all) };
  };
  const joined = new Map();
  for (const p of others) for (const [length, n] of p.intervals) joined.set(length, (joined.get(length) || 0) + n);
  const series = [
    { kind: 'bars', ...share(own.intervals), color: '--series-1' },
    { kind: 'bars', narrow: true, ...share([...joined].sort((p, q) => p[0] - q[0])), color: '--series-2' },
  ];
  drawPlot(el('interval-plot'), {
    title: 'Share of intervals: pixel (wide), neighbors (narrow)', xLabel: 'interval (readouts)', fromZero: true, series,
    description: `Intervals of the pixel and its ${others.length} neighbors`,
  });
  const rows = [];
  for (let row = y - 1; row <= y + 1; row++) {
    const tr = document.createElement('tr');
    for (let col = x - 1; col <= x + 1; col++) {
      const td = document.createElement('td');
      const p = result.pixels.find((q) => q.x === col && q.y === row);
      td.textContent = p ? p.spikes : '';
      if (p === own) td.className = 'own';
      tr.append(td);
    }
    rows.push(tr);
  }
  el('neighbors').tBodies[0].replaceChildren(...rows);
  el('pixel-result').dataset.pixel = `${x},${y}`;
});

function selectPixel(x, y) {
  if (info.is_live) return;
  state.pixel = { x, y };
  showPixel();
}

function clearPixel() {
  state.pixel = null;
  el('pixel-result').hidden = true;
  draw();
  saveStateSoon();
}

// ---- Region

async function runJob(s, task, region, progress) {
  progress.hidden = false;
  progress.value = 0;
  try {
    return await source.job(s, task, region, (share) => { progress.value = share; });
  } finally {
    progress.hidden = true;
  }
}

const showRegion = guard(async () => {
  const r = state.region;
  if (!(r.x >= 0 && r.y >= 0 && r.w > 0 && r.h > 0 && r.x + r.w <= info.width && r.y + r.h <= info.height)) {
    state.region = null;
    throw new Error(`the region is outside the image of ${info.width}x${info.height} pixels`);
  }
  for (const side of ['x', 'y', 'w', 'h']) el(`region-${side}`).value = r[side];
  draw();
  saveStateSoon();
  const isWhole = el('region-range').value === 'all';
  const result = isWhole
    ? await runJob(state.a, 'region', r, el('region-progress'))
    : await source.region(state.a, r, ...nearReadouts(REGION_READOUTS));
  el('region-result').hidden = false;
  const seconds = info.readout_hz ? ` (${number(result.mean_rate * info.readout_hz)} spikes per second)` : '';
  el('region-text').textContent = `${result.pixels} pixels, readouts ${result.from} to ${result.to - 1}: `
    + `mean rate ${number(result.mean_rate)}${seconds}`;
  drawPlot(el('rate-plot'), {
    title: 'Mean rate (spikes per readout)', xLabel: 'readout', marker: state.at, xRange: [result.from, result.to],
    series: [{ kind: 'line', x: result.rates.map((_, i) => result.from + (i + 0.5) * result.bin), y: result.rates, color: '--series-1' }],
    description: `Mean rate of the region over time, ${number(result.mean_rate)} on average`,
  });
  const spectrum = result.spectrum;
  el('spectrum-plot').hidden = !spectrum;
  const unit = info.readout_hz ? info.readout_hz : 1;
  const name = info.readout_hz ? 'Hz' : 'cycles per readout';
  const box = el('spectrum-lines');
  box.replaceChildren();
  if (spectrum) {
    drawPlot(el('spectrum-plot'), {
      title: 'Power of the mean rate', xLabel: `frequency (${name})`, yScale: 'log',
      series: [{
        kind: 'line', color: '--series-2', y: spectrum.power.slice(1),
        x: spectrum.power.slice(1).map((_, k) => ((k + 1) / spectrum.segment) * unit),
      }],
      description: 'Power spectrum of the region',
    });
    const step = number(unit / spectrum.segment, 3);
    const p = document.createElement('p');
    p.textContent = spectrum.lines.length ? `Lines (resolution ${step} ${name}):` : `No lines (resolution ${step} ${name}).`;
    const ul = document.createElement('ul');
    for (const line of spectrum.lines) {
      const li = document.createElement('li');
      const cause = line.harmonic ? `, harmonic ${line.harmonic} of the firing rate` : '';
      li.textContent = `${number(line.frequency * unit)} ${name}, ${number(line.prominence, 3)} times its surroundings${cause}`;
      ul.append(li);
    }
    box.append(p, ul);
  }
  el('region-result').dataset.region = `${r.x},${r.y},${r.w},${r.h},${isWhole ? 'all' : 'near'}`;
});

function clearRegion() {
  state.region = null;
  setDrawing(false);
  el('region-result').hidden = true;
  draw();
  saveStateSoon();
}

function setDrawing(on) {
  isDrawing = on;
  el('region-draw').setAttribute('aria-pressed', String(on));
}

const showDistances = guard(async () => {
  const r = state.region || { x: 0, y: 0, w: info.width, h: info.height };
  const [from, to] = nearReadouts(REGION_READOUTS);
  el('distance-text').textContent = 'Computing...';
  const result = await source.distances(state.a, state.b, r, from, to);
  el('distance-plot').hidden = false;
  const kinds = ['--series-1', '--series-2'];
  drawPlot(el('distance-plot'), {
    title: 'Share of intervals: first (wide), second (narrow)', xLabel: 'interval (readouts)', fromZero: true,
    series: result.shares.map((y, i) => ({ kind: 'bars', narrow: i === 1, x: y.map((_, n) => n), y, color: kinds[i] })),
    description: 'Interval distributions of both streams',
  });
  const rows = [
    ['Intervals', ...result.intervals],
    ['Mean interval (readouts)', ...result.mean_and_variance.map(([m]) => number(m))],
    ['Variance of intervals', ...result.mean_and_variance.map(([, v]) => number(v))],
  ];
  const table = document.createElement('table');
  for (const [name, a, b] of [['', 'First', 'Second'], ...rows]) {
    const tr = table.insertRow();
    const th = document.createElement('th');
    th.textContent = name;
    tr.append(th);
    for (const text of [a, b]) tr.insertCell().textContent = text;
  }
  const p = document.createElement('p');
  p.textContent = `Total variation ${number(result.total_variation, 3)} (two halves of the first stream: `
    + `${number(result.total_variation_floor, 3)}), earth mover ${number(result.earth_mover, 3)} readouts.`;
  el('distance-text').replaceChildren(p, table);
});

// ---- Defects

const showDefects = guard(async () => {
  if (!state.defects) {
    el('defect-kinds').hidden = true;
    el('defect-list').replaceChildren();
    draw();
    return;
  }
  if (!defects) {
    const s = state.a;
    const result = await runJob(s, 'summary', null, el('summary-progress'));
    const rates = source.isEmbedded || !rateMaps[0] ? await source.rates(s) : rateMaps[0];
    if (s !== state.a) return;
    rateMaps[0] = rates;
    defects = result.defects;
  }
  const options = Object.entries(DEFECT_KINDS).map(([kind, text]) => [kind, `${text}: ${defects[kind].length}`]);
  const kept = el('defect-kind').value;
  const first = Object.keys(DEFECT_KINDS).find((kind) => defects[kind].length) || 'hot';
  setOptions(el('defect-kind'), options, kept && defects[kept].length ? kept : first);
  el('defect-kinds').hidden = false;
  listDefects();
  draw();
});

function listDefects() {
  const list = [...defects[el('defect-kind').value]].sort((p, q) => rateMaps[0][q] - rateMaps[0][p]);
  const rows = list.slice(0, LISTED_DEFECTS).map((p) => {
    const li = document.createElement('li');
    const button = document.createElement('button');
    button.type = 'button';
    button.textContent = `(${p % info.width}, ${Math.floor(p / info.width)}) rate ${number(rateMaps[0][p], 3)}`;
    button.addEventListener('click', () => jumpTo(p));
    li.append(button);
    return li;
  });
  if (list.length > LISTED_DEFECTS) {
    const li = document.createElement('li');
    li.textContent = `and ${list.length - LISTED_DEFECTS} more`;
    rows.push(li);
  }
  el('defect-list').replaceChildren(...rows);
  el('defect-list').dataset.count = list.length;
}

function jumpTo(p) {
  const [x, y] = [p % info.width, Math.floor(p / info.width)];
  view.centerOn(x, y, 16);
  selectPixel(x, y);
}

let defectIndex = -1;
function nextDefect() {
  const buttons = el('defect-list').querySelectorAll('button');
  if (!buttons.length) return;
  defectIndex = (defectIndex + 1) % buttons.length;
  buttons[defectIndex].click();
}

// ---- Labels

async function loadLabelMaps(at) {
  const readout = labels.frames[labels.nearest(at)].readout;
  labelCanvases = await Promise.all(LABEL_MAPS.filter((k) => state.labels.includes(k)).map((k) => labels.map(readout, k)));
}

function syncLabelText() {
  const i = labels.nearest(state.at);
  const boxes = labels.visible(i).length;
  el('label-text').textContent = `Labels of readout ${labels.frames[i].readout} (${i + 1} of ${labels.frames.length}), ${boxes} visible vehicles`;
}

function goToLabel(i) {
  if (i >= 0 && i < labels.frames.length) setAt(labels.frames[i].readout);
}

// ---- Files

function showFiles() {
  const hasItems = listing.sources.some((s) => s.items.length);
  const report = listing.sources.findIndex((s) => s.has_report);
  el('files-panel').hidden = !hasItems && report < 0;
  el('report-toggle').hidden = report < 0;
  if (report >= 0) {
    el('report-toggle').addEventListener('click', () => {
      const frame = el('report');
      if (!frame.src) frame.src = `api/report?s=${report}`;
      frame.hidden = !frame.hidden;
      el('report-toggle').textContent = frame.hidden ? 'Show the report' : 'Hide the report';
    });
    if (!hasItems) el('report-toggle').click();
  }
  const splits = [...new Set(items.map((item) => item.item?.split).filter(Boolean))];
  el('split-label').hidden = splits.length < 2;
  setOptions(el('split'), [['', 'all'], ...splits.map((s) => [s, s])], '');
  el('filter').parentElement.hidden = items.length < 8 && splits.length < 2;
  listFiles();
  const table = document.createElement('table');
  const head = table.insertRow();
  for (const text of ['Split', 'Sequences', 'Readouts', 'MB']) {
    const th = document.createElement('th');
    th.textContent = text;
    head.append(th);
  }
  for (const split of splits) {
    const sequences = items.filter((item) => item.item?.split === split && !item.isClean);
    const sum = (key) => sequences.reduce((total, item) => total + (item.item[key] || 0), 0);
    const tr = table.insertRow();
    const cells = [split, sequences.length, sum('readouts'), (sum('bytes') / 1e6).toFixed(1)];
    for (const text of cells) tr.insertCell().textContent = text;
  }
  el('set-statistics').replaceChildren(...(splits.length ? [table] : []));
}

const observer = new IntersectionObserver((entries) => {
  for (const entry of entries) {
    if (!entry.isIntersecting) continue;
    observer.unobserve(entry.target);
    drawThumbnail(entry.target);
  }
});

async function drawThumbnail(canvas) {
  try {
    const s = canvas.dataset.stream;
    const { width, height, readouts } = await source.stream(s);
    const rates = await source.image(s, Math.floor(readouts / 2), 'tfp', 81);
    const picture = new Picture(width, height);
    picture.rates = rates;
    picture.color(lookupTable(colorMaps.gray), whiteRate(rates), 1);
    canvas.width = 128;
    canvas.height = 80;
    const scale = Math.min(128 / width, 80 / height);
    canvas.getContext('2d').drawImage(picture.canvas, (128 - width * scale) / 2, (80 - height * scale) / 2, width * scale, height * scale);
  } catch {
    canvas.title = 'no preview';
  }
}

function listFiles() {
  const text = el('filter').value.toLowerCase();
  const split = el('split').value;
  const shown = items.filter((item) => item.item && !item.isClean && item.name.toLowerCase().includes(text) && (!split || item.item.split === split));
  el('files').replaceChildren(...shown.map((item) => {
    const li = document.createElement('li');
    const button = document.createElement('button');
    button.type = 'button';
    button.dataset.stream = item.key;
    const canvas = document.createElement('canvas');
    canvas.dataset.stream = item.key;
    const words = document.createElement('span');
    words.textContent = item.name;
    const small = document.createElement('small');
    const { split: part, readouts, light, input } = item.item;
    small.textContent = [part, readouts && `${readouts} readouts`, light && `light ${light}`, input].filter(Boolean).join(', ');
    words.append(small);
    button.append(canvas, words);
    button.addEventListener('click', guard(async () => {
      state.a = item.key;
      await changeStream();
    }));
    li.append(button);
    observer.observe(canvas);
    return li;
  }));
  markFiles();
}

function markFiles() {
  for (const button of el('files').querySelectorAll('button')) {
    button.setAttribute('aria-current', String(button.dataset.stream === state.a));
  }
}

async function changeStream() {
  pause();
  liveRun++;
  clearPixel();
  clearRegion();
  await openStream();
  saveState();
}

// ---- Events

function connect() {
  setOptions(el('speed'), SPEEDS.map((n) => [n, n === 1 ? 'real time' : `1/${n}`]), '200');
  setOptions(el('colors'), Object.keys(colorMaps).map((name) => [name, name]), state.colors);
  const on = (id, event, work) => el(id).addEventListener(event, work);
  on('stream', 'change', guard(async () => { state.a = el('stream').value; await changeStream(); }));
  on('other', 'change', guard(async () => { state.b = el('other').value; await changeStream(); }));
  on('play', 'click', togglePlay);
  on('back', 'click', () => setAt(state.at - 1));
  on('forward', 'click', () => setAt(state.at + 1));
  on('at', 'change', () => setAt(Number(el('at').value)));
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
  on('region-draw', 'click', () => setDrawing(!isDrawing));
  on('region-show', 'click', () => {
    const value = (side) => Math.round(Number(el(`region-${side}`).value));
    state.region = { x: value('x'), y: value('y'), w: value('w'), h: value('h') };
    showRegion();
  });
  on('region-range', 'change', () => { if (state.region) showRegion(); });
  on('region-clear', 'click', clearRegion);
  on('defects', 'change', () => { state.defects = el('defects').checked; showDefects(); saveStateSoon(); });
  on('defect-kind', 'change', () => { defectIndex = -1; listDefects(); });
  on('defect-next', 'click', nextDefect);
  on('filter', 'input', listFiles);
  on('split', 'change', listFiles);
  for (const kind of ['boxes', 'tracks', ...LABEL_MAPS]) {
    on(`label-${kind}`, 'change', () => {
      state.labels = ['boxes', 'tracks', ...LABEL_MAPS].filter((k) => el(`label-${k}`).checked);
      refreshOrWait();
    });
  }
  on('label-opacity', 'input', draw);
  on('label-previous', 'click', () => goToLabel(labels.nearest(state.at) - 1));
  on('label-next', 'click', () => goToLabel(labels.nearest(state.at) + 1));
  on('label-first', 'click', () => goToLabel(labels.firstVehicle()));
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

function restyle() {
  syncControls();
  paint();
  saveStateSoon();
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
    dragged = { x, y, moved: false, start: view.pixelAt(x, y), draws: isDrawing || event.shiftKey };
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
      const clampX = (v) => Math.max(0, Math.min(info.width - 1, v));
      const clampY = (v) => Math.max(0, Math.min(info.height - 1, v));
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
    if (!done || info.is_live) return;
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
  if (!isInside || !pictures.length) {
    el('hover').textContent = '';
    return;
  }
  const p = y * info.width + x;
  const rate = pictures[state.b && state.compare !== 'difference' ? pane : 0].rates[p];
  let text = `x ${x}, y ${y}, `;
  if (state.b && state.compare === 'difference') {
    text += `difference ${number(pictures[0].rates[p] - pictures[1].rates[p])}`;
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
