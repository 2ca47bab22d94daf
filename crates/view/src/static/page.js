// What all parts of the page use: the elements, the stream and the state of the view.

import { colorMaps, lookupTable } from './colors.js';
import { openSource } from './sources.js';
import { ImageView } from './image_view.js';

export const el = (id) => document.getElementById(id);

export const DEFECT_KINDS = { hot: 'hot (rate too high)', weak: 'weak (rate too low)', dead: 'dead (no spikes)', stuck: 'stuck (always fires)', blinking: 'blinking (rate switches)' };
export const LABEL_MAPS = ['instance', 'semantic', 'depth', 'flow'];
export const LABEL_KINDS = ['boxes', 'tracks', ...LABEL_MAPS];
export const REGION_READOUTS = 8192;

// What the address of the page contains.
export const state = {
  a: '', b: '', at: 0, method: 'tfp', window: 41, gain: 0, gamma: 1, colors: 'gray', compare: 'side', wipe: 0.5,
  pixel: null, region: null, defects: false, labels: [],
};

// What the page has read, and the current mode of the mouse.
export const session = {
  items: [], info: { width: 1, height: 1, readouts: 1, readout_hz: null },
  pictures: [], white: 1, whiteMethod: '', table: lookupTable(colorMaps.gray), rateMaps: [],
  defects: null, labels: null, labelCanvases: [], isDrawing: false,
};

export const source = openSource();
export const view = new ImageView(el('image'));

export const number = (v, digits = 4) => String(Number(v.toPrecision(digits)));
export const clampAt = (at) => Math.max(0, Math.min(session.info.readouts - 1, Math.round(at)));

export function showError(error) {
  el('message').hidden = !error;
  el('message').textContent = error ? String(error.message || error) : '';
}

export function setOptions(select, options, value) {
  select.replaceChildren(...options.map(([v, text]) => {
    const option = document.createElement('option');
    option.value = v;
    option.textContent = text;
    return option;
  }));
  select.value = value;
}

export async function runJob(s, task, region, progress) {
  progress.hidden = false;
  progress.value = 0;
  try {
    return await source.job(s, task, region, (share) => { progress.value = share; });
  } finally {
    progress.hidden = true;
  }
}

// Readouts around the current readout, at most `count`.
export function nearReadouts(count) {
  const length = Math.min(count, session.info.readouts, session.info.max_request_readouts);
  const from = Math.max(0, Math.min(session.info.readouts - length, state.at - Math.floor(length / 2)));
  return [from, from + length];
}

export const guard = (work) => async (...args) => {
  try {
    await work(...args);
  } catch (error) {
    showError(error);
  }
};
