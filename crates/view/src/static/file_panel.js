// List of the streams of a folder, with thumbnails and filters.

import { colorMaps, lookupTable } from './colors.js';
import { el, state, session, source, number, setOptions } from './page.js';
import { Picture } from './image_view.js';

const observer = new IntersectionObserver((entries) => {
  for (const entry of entries) {
    if (!entry.isIntersecting) continue;
    observer.unobserve(entry.target);
    drawThumbnail(entry.target);
  }
});

export function showFiles(listing) {
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
  const splits = [...new Set(session.items.map((item) => item.item?.split).filter(Boolean))];
  el('split-label').hidden = splits.length < 2;
  setOptions(el('split'), [['', 'all'], ...splits.map((s) => [s, s])], '');
  el('filter').parentElement.hidden = session.items.length < 8 && splits.length < 2;
  listFiles();
  const table = document.createElement('table');
  const head = table.insertRow();
  for (const text of ['Split', 'Sequences', 'Readouts', 'MB']) {
    const th = document.createElement('th');
    th.textContent = text;
    head.append(th);
  }
  for (const split of splits) {
    const sequences = session.items.filter((item) => item.item?.split === split && !item.isClean);
    const sum = (key) => sequences.reduce((total, item) => total + (item.item[key] || 0), 0);
    const tr = table.insertRow();
    const cells = [split, sequences.length, sum('readouts'), (sum('bytes') / 1e6).toFixed(1)];
    for (const text of cells) tr.insertCell().textContent = text;
  }
  el('set-statistics').replaceChildren(...(splits.length ? [table] : []));
}

async function drawThumbnail(canvas) {
  try {
    const s = canvas.dataset.stream;
    const { width, height, readouts } = await source.stream(s);
    const picture = new Picture(width, height);
    picture.image = await source.image(s, Math.floor(readouts / 2), 'tfp', 81);
    picture.color(lookupTable(colorMaps.gray), picture.image.white(), 1);
    canvas.width = 128;
    canvas.height = 80;
    const scale = Math.min(128 / width, 80 / height);
    canvas.getContext('2d').drawImage(picture.canvas, (128 - width * scale) / 2, (80 - height * scale) / 2, width * scale, height * scale);
  } catch {
    canvas.title = 'no preview';
  }
}

export function listFiles() {
  const text = el('filter').value.toLowerCase();
  const split = el('split').value;
  const shown = session.items.filter((item) => item.item && !item.isClean && item.name.toLowerCase().includes(text) && (!split || item.item.split === split));
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
    small.textContent = [part, readouts && `${readouts} readouts`, light !== undefined && `light ${light === 'scene' ? light : number(light, 4)}`, input].filter(Boolean).join(', ');
    words.append(small);
    button.append(canvas, words);
    button.addEventListener('click', () => {
      el('stream').value = item.key;
      el('stream').dispatchEvent(new Event('change'));
    });
    li.append(button);
    observer.observe(canvas);
    return li;
  }));
  markFiles();
}

export function markFiles() {
  for (const button of el('files').querySelectorAll('button')) {
    button.setAttribute('aria-current', String(button.dataset.stream === state.a));
  }
}
