// List of the defective pixels.

import { el, DEFECT_KINDS, state, session, source, view, number, setOptions, runJob, guard } from './page.js';
import { draw } from './drawing.js';
import { selectPixel } from './pixel_panel.js';

const LISTED_DEFECTS = 200;

let defectIndex = -1;

export const showDefects = guard(async () => {
  if (!state.defects) {
    el('defect-kinds').hidden = true;
    el('defect-list').replaceChildren();
    draw();
    return;
  }
  if (!session.defects) {
    const s = state.a;
    const result = await runJob(s, 'summary', null, el('summary-progress'));
    const rates = source.isEmbedded || !session.rateMaps[0] ? await source.rates(s) : session.rateMaps[0];
    if (s !== state.a) return;
    session.rateMaps[0] = rates;
    session.defects = result.defects;
  }
  const options = Object.entries(DEFECT_KINDS).map(([kind, text]) => [kind, `${text}: ${session.defects[kind].length}`]);
  const kept = el('defect-kind').value;
  const first = Object.keys(DEFECT_KINDS).find((kind) => session.defects[kind].length) || 'hot';
  setOptions(el('defect-kind'), options, kept && session.defects[kept].length ? kept : first);
  el('defect-kinds').hidden = false;
  listDefects();
  draw();
});

export function listDefects() {
  defectIndex = -1;
  const list = [...session.defects[el('defect-kind').value]].sort((p, q) => session.rateMaps[0][q] - session.rateMaps[0][p]);
  const rows = list.slice(0, LISTED_DEFECTS).map((p) => {
    const li = document.createElement('li');
    const button = document.createElement('button');
    button.type = 'button';
    button.textContent = `(${p % session.info.width}, ${Math.floor(p / session.info.width)}) rate ${number(session.rateMaps[0][p], 3)}`;
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
  const [x, y] = [p % session.info.width, Math.floor(p / session.info.width)];
  view.centerOn(x, y, 16);
  selectPixel(x, y);
}

export function nextDefect() {
  const buttons = el('defect-list').querySelectorAll('button');
  if (!buttons.length) return;
  defectIndex = (defectIndex + 1) % buttons.length;
  buttons[defectIndex].click();
}
