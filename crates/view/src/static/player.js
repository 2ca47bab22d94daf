// Loads the images of the shown time, plays, and shows a live camera.

import { colorMaps, lookupTable } from './colors.js';
import { RateImage } from './rate_image.js';
import { el, LABEL_KINDS, LABEL_MAPS, state, session, source, number, clampAt, showError, runJob } from './page.js';
import { saveStateSoon } from './address.js';
import { setWhite, paint } from './drawing.js';

const DEFAULT_HZ = 20000;

// One request is under way at a time. Times between two requests are skipped.
let isLoading = false;
let isDirty = false;

let playing = null;
let isFrozen = false;
let liveRun = 0;

async function rateMap(s, i) {
  if (!session.rateMaps[i]) {
    await runJob(s, 'summary', null, el('summary-progress'));
    session.rateMaps[i] = await source.rates(s);
  }
  return new RateImage(session.rateMaps[i]);
}

export function refresh() {
  isDirty = true;
  if (!isLoading) load();
}

function requestImages() {
  isDirty = false;
  const { at, method, window: size } = state;
  const streams = state.b ? [state.a, state.b] : [state.a];
  const images = Promise.all(streams.map((s, i) => (method === 'rates' ? rateMap(s, i) : source.image(s, at, method, size))));
  // `load` awaits the images later. Without a handler, the browser would report the error of a request twice.
  images.catch(() => {});
  return { at, method, images };
}

async function load() {
  isLoading = true;
  let next = null;
  while (next || isDirty) {
    const { at, method, images: promised } = next || requestImages();
    next = null;
    try {
      const images = await promised;
      // The server computes the next images while the page colors these.
      if (isDirty) next = requestImages();
      if (session.pictures[0].width * session.pictures[0].height !== images[0].length) continue;
      images.forEach((image, i) => { session.pictures[i].image = image; });
      if (!session.white || session.whiteMethod !== method) setWhite();
      if (session.labels) await loadLabelMaps(at);
      paint();
      // The numbers change with the image, because each change of the page costs the browser a frame.
      syncTime();
      el('image').dataset.readout = at;
      el('image').dataset.images = Number(el('image').dataset.images || 0) + 1;
    } catch (error) {
      showError(error);
      syncTime();
      pause();
    }
  }
  isLoading = false;
}

export function refreshOrWait() {
  if (!session.info.is_live) refresh();
  saveStateSoon();
}

export function restyle() {
  syncControls();
  paint();
  saveStateSoon();
}

export function setWindow(size) {
  state.window = Math.max(1, Math.min(session.info.max_window || 4096, Math.round(size) || 1));
  syncControls();
  refreshOrWait();
}

export function syncControls() {
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
  for (const kind of LABEL_KINDS) el(`label-${kind}`).checked = state.labels.includes(kind);
  session.table = lookupTable(colorMaps[state.colors]);
  syncTime();
}

export function setAt(at) {
  if (session.info.is_live) return;
  state.at = clampAt(at);
  refresh();
  saveStateSoon();
}

function syncTime() {
  // The number that a user types stays until the user ends the input.
  if (document.activeElement !== el('at')) el('at').value = state.at;
  el('scrubber').value = state.at;
  el('clock').textContent = session.info.is_live ? '' : session.info.readout_hz
    ? `${((1000 * state.at) / session.info.readout_hz).toFixed(2)} ms of ${((1000 * session.info.readouts) / session.info.readout_hz).toFixed(2)} ms`
    : `of ${session.info.readouts}`;
  if (session.labels) syncLabelText();
}

export function togglePlay() {
  if (session.info.is_live) {
    isFrozen = !isFrozen;
    el('play').textContent = isFrozen ? 'Resume' : 'Freeze';
    return;
  }
  if (playing) pause();
  else play();
}

export function pause() {
  playing = null;
  if (!session.info.is_live) el('play').textContent = 'Play';
}

function play() {
  if (state.at >= session.info.readouts - 1) setAt(0);
  const run = { last: performance.now(), position: state.at };
  playing = run;
  el('play').textContent = 'Pause';
  const step = (now) => {
    if (playing !== run) return;
    run.position += ((now - run.last) / 1000) * ((session.info.readout_hz || DEFAULT_HZ) / Number(el('speed').value));
    run.last = now;
    if (clampAt(run.position) !== state.at) setAt(run.position);
    if (state.at >= session.info.readouts - 1) pause();
    else requestAnimationFrame(step);
  };
  requestAnimationFrame(step);
}

export function stopLive() {
  liveRun++;
}

export async function startLive() {
  const run = ++liveRun;
  isFrozen = false;
  el('play').textContent = 'Freeze';
  while (run === liveRun && session.info.is_live) {
    const start = performance.now();
    if (!isFrozen) {
      try {
        const live = await source.live(state.a, state.method === 'rates' ? 'tfp' : state.method, state.window);
        if (run !== liveRun) return;
        session.pictures[0].image = live.image;
        if (!session.white || session.whiteMethod !== state.method) setWhite();
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

async function loadLabelMaps(at) {
  const readout = session.labels.frames[session.labels.nearest(at)].readout;
  session.labelCanvases = await Promise.all(LABEL_MAPS.filter((k) => state.labels.includes(k)).map((k) => session.labels.map(readout, k)));
}

function syncLabelText() {
  const i = session.labels.nearest(state.at);
  const boxes = session.labels.visible(i).length;
  el('label-text').textContent = `Labels of readout ${session.labels.frames[i].readout} (${i + 1} of ${session.labels.frames.length}), ${boxes} visible vehicles`;
}

export function goToLabel(i) {
  if (i >= 0 && i < session.labels.frames.length) setAt(session.labels.frames[i].readout);
}

// Moves to the first labeled readout from `start` on that shows an object of the selected class and size.
export function findObject(start) {
  const [name, pixels] = [el('label-class').value, Math.max(1, Number(el('label-pixels').value) || 1)];
  const found = session.labels.find(start, name, pixels);
  const what = `${name || 'vehicle'} with at least ${pixels} visible pixels`;
  showError(found < 0 ? `no ${start ? 'later ' : ''}labels contain a ${what}` : null);
  goToLabel(found);
}
