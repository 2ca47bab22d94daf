// The state of the view in the address, so that a link shows the same view.

import { colorMaps } from './colors.js';
import { state, session, view } from './page.js';

let saveTimer = 0;

export function saveState() {
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

export function saveStateSoon() {
  clearTimeout(saveTimer);
  saveTimer = setTimeout(saveState, 150);
}

export function readState() {
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
  const streams = session.items.map((item) => item.key);
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
