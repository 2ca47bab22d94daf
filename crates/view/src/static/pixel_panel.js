// Spikes and intervals of one pixel and of its neighbors.

import { el, state, session, source, number, nearReadouts, guard } from './page.js';
import { saveStateSoon } from './address.js';
import { drawPlot } from './plots.js';
import { draw } from './drawing.js';

const PIXEL_READOUTS = 2000;
const TRAIN_READOUTS = 200;

export const showPixel = guard(async () => {
  const { x, y } = state.pixel;
  if (x >= session.info.width || y >= session.info.height || x < 0 || y < 0) {
    state.pixel = null;
    throw new Error(`pixel (${x}, ${y}) is outside the image of ${session.info.width}x${session.info.height} pixels`);
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

export function selectPixel(x, y) {
  if (session.info.is_live) return;
  state.pixel = { x, y };
  showPixel();
}

export function clearPixel() {
  state.pixel = null;
  el('pixel-result').hidden = true;
  draw();
  saveStateSoon();
}
