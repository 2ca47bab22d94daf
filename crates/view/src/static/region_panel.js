// Rate and spectrum of a region, and the distances of two streams.

import { el, REGION_READOUTS, state, session, source, number, runJob, nearReadouts, guard } from './page.js';
import { saveStateSoon } from './address.js';
import { drawPlot } from './plots.js';
import { draw } from './drawing.js';

export const showRegion = guard(async () => {
  const r = state.region;
  if (!(r.x >= 0 && r.y >= 0 && r.w > 0 && r.h > 0 && r.x + r.w <= session.info.width && r.y + r.h <= session.info.height)) {
    state.region = null;
    throw new Error(`the region is outside the image of ${session.info.width}x${session.info.height} pixels`);
  }
  for (const side of ['x', 'y', 'w', 'h']) el(`region-${side}`).value = r[side];
  draw();
  saveStateSoon();
  const isWhole = el('region-range').value === 'all';
  const result = isWhole
    ? await runJob(state.a, 'region', r, el('region-progress'))
    : await source.region(state.a, r, ...nearReadouts(REGION_READOUTS));
  el('region-result').hidden = false;
  const seconds = session.info.readout_hz ? ` (${number(result.mean_rate * session.info.readout_hz)} spikes per second)` : '';
  el('region-text').textContent = `${result.pixels} pixels, readouts ${result.from} to ${result.to - 1}: `
    + `mean rate ${number(result.mean_rate)}${seconds}`;
  drawPlot(el('rate-plot'), {
    title: 'Mean rate (spikes per readout)', xLabel: 'readout', marker: state.at, xRange: [result.from, result.to],
    series: [{ kind: 'line', x: result.rates.map((_, i) => result.from + (i + 0.5) * result.bin), y: result.rates, color: '--series-1' }],
    description: `Mean rate of the region over time, ${number(result.mean_rate)} on average`,
  });
  const spectrum = result.spectrum;
  el('spectrum-plot').hidden = !spectrum;
  const unit = session.info.readout_hz ? session.info.readout_hz : 1;
  const name = session.info.readout_hz ? 'Hz' : 'cycles per readout';
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
      const cause = line.harmonic ? `, perhaps harmonic ${line.harmonic} of the firing rate` : '';
      li.textContent = `${number(line.frequency * unit)} ${name}, ${number(line.prominence, 3)} times its surroundings${cause}`;
      ul.append(li);
    }
    box.append(p, ul);
  }
  el('region-result').dataset.region = `${r.x},${r.y},${r.w},${r.h},${isWhole ? 'all' : 'near'}`;
});

export function clearRegion() {
  state.region = null;
  setDrawing(false);
  el('region-result').hidden = true;
  draw();
  saveStateSoon();
}

export function setDrawing(on) {
  session.isDrawing = on;
  el('region-draw').setAttribute('aria-pressed', String(on));
}

export const showDistances = guard(async () => {
  const r = state.region || { x: 0, y: 0, w: session.info.width, h: session.info.height };
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
