// Tests of the viewer in a browser. Usage: node run.mjs PROGRAM [quick|full]
//
// The package playwright-core is found from the working folder. Files are written to the working folder.
// Each test lists the controls and keys that it operates. The run fails if the page has a control or a key without a test.

import { spawn, execFileSync } from 'node:child_process';
import { existsSync, mkdirSync, mkdtempSync, readFileSync, rmSync, writeFileSync } from 'node:fs';
import { createRequire } from 'node:module';
import { tmpdir } from 'node:os';
import { join } from 'node:path';
import { pathToFileURL } from 'node:url';
import assert from 'node:assert/strict';
import { BLINKING, DEAD, FLICKER_HZ, HEIGHT, HOT, HZ, READOUTS, WIDTH, bit, makeStream, rate } from './data.mjs';
import { servePageFiles } from './page_files.mjs';

const { chromium } = createRequire(join(process.cwd(), 'package.json'))('playwright-core');
const [program, mode = 'quick'] = process.argv.slice(2);
const folder = mkdtempSync(join(tmpdir(), 'spikelane-view-'));
const STREAM_FLAGS = ['--width', WIDTH, '--height', HEIGHT, '--layout', 'dat-top', '--readout-hz', HZ].map(String);
const quiet = makeStream(join(folder, 'quiet.dat'), 0.02, 1);
const noisy = makeStream(join(folder, 'noisy.dat'), 0.3, 2);
const tests = [];
const servers = [];

const test = (name, group, controls, work) => tests.push({ name, group, controls, work });

async function serve(...args) {
  const child = spawn(program, ['view', ...args, '--no-browser', '--json'], { cwd: folder, stdio: ['ignore', 'pipe', 'inherit'] });
  const server = { child, ended: new Promise((resolve) => child.on('exit', resolve)) };
  servers.push(server);
  server.address = await new Promise((resolve, reject) => {
    let text = '';
    child.stdout.on('data', (part) => {
      text += part;
      const line = text.split('\n').find((l) => l.includes('"address"'));
      if (line) resolve(JSON.parse(line).address);
    });
    child.on('exit', (code) => reject(new Error(`view ended with code ${code}`)));
  });
  return server;
}

const browser = await chromium.launch({ executablePath: '/usr/bin/chromium', args: ['--no-sandbox'] });

async function openPage(address, options = {}) {
  const context = await browser.newContext({ viewport: { width: 1400, height: 900 }, permissions: ['clipboard-read', 'clipboard-write'], ...options });
  const page = await context.newPage();
  await servePageFiles(page);
  const faults = [];
  page.on('pageerror', (e) => faults.push(String(e)));
  page.on('console', (m) => { if (m.type() === 'error') faults.push(m.text()); });
  page.on('request', (r) => { if (!/^(http:\/\/127\.0\.0\.1:|file:|data:)/.test(r.url())) faults.push(`request of ${r.url()}`); });
  page.faults = faults;
  await page.goto(address);
  await page.waitForSelector('body[data-ready]');
  return page;
}

const shown = (page, readout) => page.waitForFunction((n) => document.getElementById('image').dataset.readout === String(n), readout);
// The labels of a data set in which the first car appears in the labeled readout of this index.
const FIRST_CAR = 3;
const carLabelsFile = () => join(folder, 'cars', 'sequences', 'scene-0000', 'labels', 'labels.json');
const carLabels = () => JSON.parse(readFileSync(carLabelsFile(), 'utf8'));

const value = (page, id) => page.$eval(`#${id}`, (e) => e.value);
const text = (page, id) => page.$eval(`#${id}`, (e) => e.textContent);

// Color of the screen at the center of an image pixel. `pane` is the image of a comparison.
const screen = (page, x, y, pane = 0) => page.evaluate(([px, py, n, width, height]) => {
  const canvas = document.getElementById('image');
  const isTall = canvas.clientWidth < canvas.clientHeight * 1.2;
  const isSide = n >= 0 && !document.getElementById('compare-panel').hidden && document.getElementById('compare').value === 'side';
  const w = canvas.clientWidth / (isSide && !isTall ? 2 : 1);
  const h = canvas.clientHeight / (isSide && isTall ? 2 : 1);
  const s = Math.min(w / width, h / height);
  const left = (w - s * width) / 2 + (isSide && !isTall && n ? w : 0);
  const top = (h - s * height) / 2 + (isSide && isTall && n ? h : 0);
  return [left + s * (px + 0.5), top + s * (py + 0.5)];
}, [x, y, pane, WIDTH, HEIGHT]);

async function color(page, x, y, pane = 0) {
  const [sx, sy] = await screen(page, x, y, pane);
  return page.evaluate(([u, v]) => [...document.getElementById('image').getContext('2d').getImageData(u * devicePixelRatio, v * devicePixelRatio, 1, 1).data], [sx, sy]);
}

// All colors of the canvas as one number that changes if any pixel changes.
const fingerprint = (page, id = 'image') => page.evaluate((name) => {
  const canvas = document.getElementById(name);
  const data = canvas.getContext('2d').getImageData(0, 0, canvas.width, canvas.height).data;
  let hash = 0;
  for (let i = 0; i < data.length; i++) hash = (hash * 31 + data[i]) | 0;
  return hash;
}, id);

async function clickPixel(page, x, y, options = {}) {
  const [sx, sy] = await screen(page, x, y);
  const box = await page.$eval('#image', (e) => { const b = e.getBoundingClientRect(); return [b.left, b.top]; });
  await page.mouse.move(box[0] + sx, box[1] + sy);
  if (!options.hover) await page.mouse.click(box[0] + sx, box[1] + sy);
  return [box[0] + sx, box[1] + sy];
}

async function slide(page, id, v) {
  await page.$eval(`#${id}`, (e, n) => { e.value = n; e.dispatchEvent(new Event('input')); }, v);
}

async function setNumber(page, id, v) {
  await page.fill(`#${id}`, String(v));
  await page.press(`#${id}`, 'Enter');
}

// ---- One stream

test('bits of a readout are the bits of the file', 'stream', ['method', 'at'], async (page) => {
  await page.selectOption('#method', 'bits');
  for (const t of [0, 1234, READOUTS - 1]) {
    await setNumber(page, 'at', t);
    await shown(page, t);
    for (const [x, y] of [[0, 0], [5, 40], [33, 20], [63, 47], [17, 3]]) {
      assert.equal((await color(page, x, y))[0], bit(quiet, t, x, y) ? 255 : 0, `readout ${t}, pixel (${x}, ${y})`);
    }
  }
});

test('hover shows position, rate and interval of TFP', 'stream', ['window', 'image'], async (page) => {
  await setNumber(page, 'window', 101);
  await setNumber(page, 'at', 2000);
  await shown(page, 2000);
  await page.waitForTimeout(100);
  await clickPixel(page, 20, 30, { hover: true });
  const expected = rate(quiet, 20, 30, 1950, 2051);
  assert.match(await text(page, 'hover'), new RegExp(`x 20, y 30, rate ${Number(expected.toPrecision(4))}, interval`));
});

test('a click shows the spike train of a pixel', 'stream', ['image', 'key Escape', 'pixel-clear'], async (page) => {
  await setNumber(page, 'at', 2000);
  await shown(page, 2000);
  await clickPixel(page, 20, 30);
  await page.waitForSelector('#pixel-result[data-pixel="20,30"]:not([hidden])');
  const spikes = Math.round(rate(quiet, 20, 30, 1000, 3000) * 2000);
  assert.match(await text(page, 'pixel-text'), new RegExp(`Pixel \\(20, 30\\): ${spikes} spikes in readouts 1000 to 2999`));
  assert.equal(await page.$eval('#neighbors td.own', (e) => e.textContent), String(spikes));
  const own = await page.$$eval('#neighbors td', (cells) => cells.map((c) => Number(c.textContent)));
  assert.equal(own[0], Math.round(rate(quiet, 19, 29, 1000, 3000) * 2000));
  assert.equal((await color(page, 20, 30)).length, 4);
  await page.keyboard.press('Escape');
  assert.ok(await page.$eval('#pixel-result', (e) => e.hidden));
  await clickPixel(page, 20, 30);
  await page.waitForSelector('#pixel-result:not([hidden])');
  await page.click('#pixel-clear');
  assert.ok(await page.$eval('#pixel-result', (e) => e.hidden));
});

test('the fields of a pixel work by keyboard', 'stream', ['pixel-x', 'pixel-y', 'pixel-show'], async (page) => {
  await page.focus('#pixel-x');
  await page.keyboard.type(String(HOT[0]));
  await page.keyboard.press('Tab');
  await page.keyboard.type(String(HOT[1]));
  await page.keyboard.press('Tab');
  await page.keyboard.press('Enter');
  await page.waitForSelector(`#pixel-result[data-pixel="${HOT.join(',')}"]:not([hidden])`);
  await page.fill('#pixel-x', '64');
  await page.click('#pixel-show');
  await page.waitForFunction(() => document.getElementById('message').textContent.includes('outside the image'));
});

test('the time controls change the readout', 'stream', ['back', 'forward', 'scrubber', 'key ArrowLeft', 'key ArrowRight', 'key Home', 'key End'], async (page) => {
  await setNumber(page, 'at', 100);
  await page.click('#forward');
  await shown(page, 101);
  await page.click('#back');
  await page.click('#back');
  await shown(page, 99);
  await page.focus('#image');
  await page.keyboard.press('ArrowRight');
  await shown(page, 100);
  await page.keyboard.press('Shift+ArrowRight');
  await shown(page, 141);
  await page.keyboard.press('ArrowLeft');
  await shown(page, 140);
  await page.keyboard.press('Home');
  await shown(page, 0);
  await page.keyboard.press('End');
  await shown(page, READOUTS - 1);
  await slide(page, 'scrubber', 321);
  await shown(page, 321);
  assert.equal(await value(page, 'at'), '321');
  assert.match(await text(page, 'clock'), /^16\.05 ms of 200\.00 ms$/);
});

test('play moves through time until the end', 'stream', ['play', 'speed', 'key Space'], async (page) => {
  await setNumber(page, 'at', 0);
  await page.selectOption('#speed', '20');
  await page.click('#play');
  await page.waitForFunction(() => Number(document.getElementById('image').dataset.readout) > 200);
  await page.focus('#image');
  await page.keyboard.press('Space');
  assert.equal(await text(page, 'play'), 'Play');
  await page.selectOption('#speed', '1');
  await page.focus('#image');
  await page.keyboard.press('Space');
  await shown(page, READOUTS - 1);
  await page.waitForFunction(() => document.getElementById('play').textContent === 'Play');
});

test('window, gain, gamma and colors change the image', 'stream', ['window', 'gain', 'gamma', 'colors', 'key [', 'key ]', 'key m', 'key c'], async (page) => {
  await setNumber(page, 'at', 2000);
  await shown(page, 2000);
  const before = await color(page, 20, 40);
  await slide(page, 'gain', 1);
  const brighter = await color(page, 20, 40);
  assert.ok(brighter[0] > before[0], `${brighter} > ${before}`);
  await slide(page, 'gain', -1);
  const linear = await color(page, 20, 40);
  await slide(page, 'gamma', 2);
  assert.ok((await color(page, 20, 40))[0] > linear[0]);
  await page.selectOption('#colors', 'viridis');
  const [r, g, b] = await color(page, 20, 40);
  assert.ok(r !== g || g !== b);
  await page.focus('#image');
  await page.keyboard.press('c');
  assert.equal(await value(page, 'colors'), 'inferno');
  await page.keyboard.press('[');
  assert.equal(await value(page, 'window'), '20');
  await page.keyboard.press(']');
  assert.equal(await value(page, 'window'), '40');
  await page.keyboard.press('m');
  assert.equal(await value(page, 'method'), 'tfi');
});

test('zoom shows pixels with sharp edges', 'stream', ['zoom-in', 'zoom-out', 'zoom-fit', 'zoom-pixels', 'key +', 'key -', 'key 0', 'key 1', 'key w', 'key a', 'key s', 'key d'], async (page) => {
  await page.selectOption('#method', 'bits');
  await setNumber(page, 'at', 77);
  await shown(page, 77);
  const percent = async () => parseFloat(await text(page, 'zoom-value'));
  const whole = await percent();
  await page.click('#zoom-in');
  assert.ok(await percent() > whole);
  await page.click('#zoom-out');
  assert.equal(await percent(), whole);
  await page.focus('#image');
  await page.keyboard.press('1');
  assert.equal(await percent(), 1600);
  const colors = await page.evaluate(() => {
    const canvas = document.getElementById('image');
    const data = canvas.getContext('2d').getImageData(0, 0, canvas.width, canvas.height).data;
    const found = new Set();
    for (let i = 0; i < data.length; i += 4) if (data[i + 3]) found.add(data[i]);
    return [...found].sort();
  });
  assert.deepEqual(colors, [0, 255]);
  for (const key of ['w', 'a', 's', 'd']) {
    const old = await fingerprint(page);
    await page.keyboard.press(key);
    assert.notEqual(await fingerprint(page), old, key);
  }
  await page.keyboard.press('-');
  assert.ok(await percent() < 1600);
  await page.keyboard.press('+');
  await page.keyboard.press('0');
  assert.equal(await percent(), whole);
  await page.click('#zoom-pixels');
  await page.click('#zoom-fit');
  assert.equal(await percent(), whole);
  const box = await page.$eval('#image', (e) => { const q = e.getBoundingClientRect(); return [q.left + q.width / 2, q.top + q.height / 2]; });
  await page.mouse.move(...box);
  await page.mouse.wheel(0, -900);
  await page.waitForFunction((n) => parseFloat(document.getElementById('zoom-value').textContent) > n, whole);
  const old = await fingerprint(page);
  await page.mouse.down();
  await page.mouse.move(box[0] + 60, box[1] + 30, { steps: 4 });
  await page.mouse.up();
  assert.notEqual(await fingerprint(page), old);
});

test('a drawn region shows the rate and the flicker of its lamp', 'stream', ['region-draw', 'region-clear', 'key r'], async (page) => {
  await page.focus('#image');
  await page.keyboard.press('r');
  assert.equal(await page.getAttribute('#region-draw', 'aria-pressed'), 'true');
  await page.click('#region-draw');
  assert.equal(await page.getAttribute('#region-draw', 'aria-pressed'), 'false');
  await page.click('#region-draw');
  const from = await clickPixel(page, 44, 20, { hover: true });
  await page.mouse.move(...from);
  await page.mouse.down();
  const [sx, sy] = await clickPixel(page, 59, 43, { hover: true });
  await page.mouse.move(sx, sy);
  await page.mouse.up();
  await page.waitForSelector('#region-result[data-region="44,20,16,24,near"]:not([hidden])');
  const lines = await text(page, 'spectrum-lines');
  const found = parseFloat(lines.split(':')[1]);
  assert.ok(Math.abs(found - FLICKER_HZ) <= 20, lines);
  let sum = 0;
  for (let y = 20; y < 44; y++) for (let x = 44; x < 60; x++) sum += rate(quiet, x, y, 0, READOUTS);
  assert.match(await text(page, 'region-text'), new RegExp(`mean rate ${Number((sum / 384).toPrecision(4))}`));
  await page.click('#region-clear');
  assert.ok(await page.$eval('#region-result', (e) => e.hidden));
});

test('the fields of a region work by keyboard, also for the whole stream', 'stream', ['region-x', 'region-y', 'region-w', 'region-h', 'region-show', 'region-range'], async (page) => {
  for (const [id, v] of [['region-x', 2], ['region-y', 4], ['region-w', 24], ['region-h', 40]]) await page.fill(`#${id}`, String(v));
  await page.focus('#region-show');
  await page.keyboard.press('Enter');
  await page.waitForSelector('#region-result[data-region="2,4,24,40,near"]:not([hidden])');
  await page.selectOption('#region-range', 'all');
  await page.waitForSelector('#region-result[data-region="2,4,24,40,all"]');
  assert.match(await text(page, 'region-text'), new RegExp(`readouts 0 to ${READOUTS - 1}`));
  assert.ok(!(await text(page, 'spectrum-lines')).includes(` ${FLICKER_HZ} Hz`), 'the left half has no flicker');
  await page.fill('#region-w', '100');
  await page.click('#region-show');
  await page.waitForFunction(() => document.getElementById('message').textContent.includes('outside the image'));
});

test('defects are found, listed and marked', 'stream', ['defects', 'defect-kind', 'defect-next', 'defect-list', 'key x', 'key n'], async (page) => {
  await setNumber(page, 'at', 2000);
  await shown(page, 2000);
  await page.focus('#image');
  await page.keyboard.press('x');
  await page.waitForSelector('#defect-kinds:not([hidden])');
  assert.equal(await value(page, 'defect-kind'), 'hot');
  const hot = await page.$$eval('#defect-list button', (list) => list.map((b) => b.textContent));
  assert.ok(hot[0].startsWith(`(${HOT.join(', ')}) rate 0.7`), hot[0]);
  await page.selectOption('#defect-kind', 'dead');
  assert.deepEqual(await page.$$eval('#defect-list button', (list) => list.map((b) => b.textContent)), [`(${DEAD.join(', ')}) rate 0`]);
  await page.click('#defect-list button');
  await page.waitForSelector(`#pixel-result[data-pixel="${DEAD.join(',')}"]`);
  assert.equal(await text(page, 'zoom-value'), '1600 %');
  await page.selectOption('#defect-kind', 'blinking');
  const blinking = await page.$$eval('#defect-list button', (list) => list.map((b) => b.textContent));
  assert.equal(blinking.length, 1);
  assert.ok(blinking[0].startsWith(`(${BLINKING.join(', ')}) rate`), blinking[0]);
  await page.selectOption('#defect-kind', 'hot');
  await page.focus('#image');
  await page.keyboard.press('n');
  await page.waitForSelector(`#pixel-result[data-pixel="${HOT.join(',')}"]`);
  await page.click('#defect-next');
  await page.keyboard.press('Escape');
  await page.click('#zoom-fit');
  const marked = await fingerprint(page);
  await page.click('#defects');
  assert.notEqual(await fingerprint(page), marked);
});

test('the rate map shows the whole stream', 'stream', ['method'], async (page) => {
  await page.selectOption('#method', 'rates');
  await page.waitForTimeout(300);
  await page.waitForFunction(() => document.getElementById('summary-progress').hidden);
  await clickPixel(page, 5, 5, { hover: true });
  await page.waitForFunction((r) => document.getElementById('hover').textContent.includes(`rate ${r},`), Number(rate(quiet, 5, 5, 0, READOUTS).toPrecision(4)));
});

test('the address contains the view', 'stream', ['copy'], async (page, server) => {
  await setNumber(page, 'at', 1111);
  await page.selectOption('#method', 'span');
  await page.selectOption('#colors', 'inferno');
  await page.fill('#pixel-x', '7');
  await page.fill('#pixel-y', '9');
  await page.click('#pixel-show');
  await page.waitForSelector('#pixel-result[data-pixel="7,9"]');
  await page.click('#copy');
  await page.waitForFunction(() => document.getElementById('copy').textContent === 'Copied');
  const link = await page.evaluate(() => navigator.clipboard.readText());
  assert.ok(link.startsWith(server.address));
  const other = await openPage(link);
  await shown(other, 1111);
  assert.deepEqual([await value(other, 'method'), await value(other, 'colors')], ['span', 'inferno']);
  await other.waitForSelector('#pixel-result[data-pixel="7,9"]');
  await shown(page, 1111);
  await other.context().close();
});

test('the list of keys opens and closes', 'stream', ['help-open', 'help-close', 'key ?'], async (page) => {
  await page.click('#help-open');
  assert.ok(await page.$eval('#help', (e) => e.open));
  await page.click('#help-close');
  await page.focus('#image');
  await page.keyboard.press('?');
  assert.ok(await page.$eval('#help', (e) => e.open));
  await page.keyboard.press('Escape');
  assert.ok(!(await page.$eval('#help', (e) => e.open)));
});

test('the Tab key reaches every enabled control', 'stream', [], async (page) => {
  const wanted = await page.$$eval('input, select, button, summary, [tabindex]', (list) => list
    .filter((e) => !e.disabled && e.checkVisibility() && e.id !== '').map((e) => e.id));
  const reached = new Set();
  for (let i = 0; i < wanted.length + 40; i++) {
    await page.keyboard.press('Tab');
    reached.add(await page.evaluate(() => document.activeElement.id));
  }
  assert.deepEqual(wanted.filter((id) => !reached.has(id)), []);
});

test('text and controls have enough contrast in both color schemes', 'stream', [], async (page) => {
  for (const scheme of ['light', 'dark']) {
    await page.emulateMedia({ colorScheme: scheme });
    const weak = await page.evaluate(() => {
      const parse = (t) => t.match(/[\d.]+/g).map(Number);
      const luminance = ([r, g, b]) => [r, g, b].map((v) => v / 255).map((v) => (v <= 0.04045 ? v / 12.92 : ((v + 0.055) / 1.055) ** 2.4))
        .reduce((s, v, i) => s + v * [0.2126, 0.7152, 0.0722][i], 0);
      const background = (e) => {
        for (let p = e; p; p = p.parentElement) {
          const c = parse(getComputedStyle(p).backgroundColor);
          if (c.length < 4 || c[3] === 1) return c;
        }
        return [255, 255, 255];
      };
      const low = [];
      for (const e of document.querySelectorAll('body *')) {
        const own = [...e.childNodes].some((n) => n.nodeType === 3 && n.textContent.trim());
        if (!own || !e.checkVisibility() || e.disabled || e.closest('canvas')) continue;
        const [a, b] = [luminance(parse(getComputedStyle(e).color)), luminance(background(e))].sort((x, y) => y - x);
        if ((a + 0.05) / (b + 0.05) < 4.5) low.push(`${e.tagName} ${e.id} ${e.textContent.slice(0, 20)}`);
      }
      return low;
    });
    assert.deepEqual(weak, [], scheme);
  }
});

// ---- Two streams

test('two streams are shown side by side, as a difference and with a wipe', 'pair', ['compare', 'wipe', 'other', 'stream'], async (page) => {
  await page.selectOption('#method', 'bits');
  await setNumber(page, 'at', 500);
  await shown(page, 500);
  for (const [x, y] of [[3, 3], [30, 20], [50, 40], [20, 44]]) {
    assert.equal((await color(page, x, y, 0))[0], bit(quiet, 500, x, y) ? 255 : 0);
    assert.equal((await color(page, x, y, 1))[0], bit(noisy, 500, x, y) ? 255 : 0);
  }
  await page.selectOption('#compare', 'difference');
  for (let x = 10; x < 40; x++) {
    const d = bit(quiet, 500, x, 20) - bit(noisy, 500, x, 20);
    const [r, , b] = await color(page, x, 20, -1);
    assert.ok(d === 0 ? r > 250 && b > 250 : d > 0 ? r === 255 && b === 0 : r === 0 && b === 255, `${x}: ${d} ${r} ${b}`);
  }
  await page.selectOption('#compare', 'wipe');
  await slide(page, 'wipe', 1);
  assert.equal((await color(page, 40, 30, -1))[0], bit(quiet, 500, 40, 30) ? 255 : 0);
  await slide(page, 'wipe', 0);
  for (const [x, y] of [[40, 30], [20, 20], [12, 8]]) assert.equal((await color(page, x, y, -1))[0], bit(noisy, 500, x, y) ? 255 : 0);
  await page.selectOption('#other', '');
  await page.waitForFunction(() => document.getElementById('compare-panel').hidden);
  await page.selectOption('#stream', '1');
  await page.waitForFunction(() => location.hash.startsWith('#a=1'));
});

test('the noisier stream has the larger variance of intervals', 'pair', ['distances'], async (page) => {
  for (const [id, v] of [['region-x', 2], ['region-y', 4], ['region-w', 24], ['region-h', 40]]) await page.fill(`#${id}`, String(v));
  await page.click('#region-show');
  await page.waitForSelector('#region-result:not([hidden])');
  await page.click('#distances');
  await page.waitForSelector('#distance-text table');
  const [first, second] = await page.$$eval('#distance-text tr:last-child td', (cells) => cells.map((c) => Number(c.textContent)));
  assert.ok(second > first, `${second} > ${first}`);
  const [, distance, floor] = (await text(page, 'distance-text')).match(/variation ([\d.e-]+) .*stream: ([\d.e-]+)\)/);
  assert.ok(Number(distance) > 3 * Number(floor), `${distance} ${floor}`);
});

// ---- Files

test('a recording set lists its recordings, with text from files as text', 'files', ['files', 'filter'], async (page) => {
  const names = await page.$$eval('#files button span', (list) => list.map((e) => e.firstChild.textContent));
  assert.equal(names.length, 9);
  assert.ok(names.includes('<img src=x onerror=alert(1)>.dat'));
  assert.equal(await page.$$eval('#files img', (l) => l.length), 0);
  await page.fill('#filter', 'onerror');
  assert.equal(await page.$$eval('#files button', (l) => l.length), 1);
  await page.click('#files button');
  await page.waitForFunction(() => document.querySelector('#files button').getAttribute('aria-current') === 'true');
  assert.match(await page.title(), /onerror/);
});

test('an output folder shows its report without scripts', 'folder', ['report-toggle', 'report'], async (page) => {
  assert.ok(await page.$eval('#report', (e) => e.hidden));
  await page.click('#report-toggle');
  await page.frameLocator('#report').locator('p').waitFor();
  const frame = page.frames().find((f) => f.url().includes('api/report'));
  await frame.waitForSelector('p');
  assert.equal(await frame.$eval('p', (e) => e.textContent), 'the report');
  await page.click('#report-toggle');
  assert.ok(await page.$eval('#report', (e) => e.hidden));
  page.faults.splice(0, page.faults.length, ...page.faults.filter((f) => !f.includes('Blocked script')));
});

test('a data set shows its sequences and labels', 'dataset', ['split', 'files', 'label-boxes', 'label-tracks', 'label-instance', 'label-semantic', 'label-depth', 'label-flow', 'label-opacity', 'label-previous', 'label-next', 'label-first'], async (page) => {
  const all = await page.$$eval('#files button', (l) => l.length);
  assert.ok(all >= 2);
  assert.match(await text(page, 'set-statistics'), /SplitSequencesReadoutsMB(test|train|val)\d+/);
  if (await page.$eval('#split-label', (e) => !e.hidden)) {
    await page.selectOption('#split', { index: 1 });
    assert.ok(await page.$$eval('#files button', (l) => l.length) < all);
    await page.selectOption('#split', '');
  }
  await page.waitForFunction(() => {
    const canvas = document.querySelector('#files canvas');
    return canvas.width === 128 && canvas.getContext('2d').getImageData(0, 0, 128, 80).data.some((v) => v > 40);
  });
  await page.focus('#files li:nth-child(2) button');
  await page.keyboard.press('Enter');
  await page.waitForFunction(() => document.querySelector('#files li:nth-child(2) button').getAttribute('aria-current') === 'true');
  await page.waitForSelector('#labels-panel:not([hidden])');
  await page.click('#label-first');
  await page.waitForFunction(() => !/ 0 visible/.test(document.getElementById('label-text').textContent));
  const before = await text(page, 'label-text');
  await page.click('#label-next');
  await page.waitForFunction((t) => document.getElementById('label-text').textContent !== t, before);
  await page.click('#label-previous');
  await page.waitForFunction((t) => document.getElementById('label-text').textContent === t, before);
  await page.waitForTimeout(300);
  for (const kind of ['boxes', 'tracks', 'instance', 'semantic', 'depth', 'flow']) {
    const plain = await fingerprint(page);
    await page.focus(`#label-${kind}`);
    await page.keyboard.press('Space');
    await page.waitForTimeout(400);
    assert.notEqual(await fingerprint(page), plain, kind);
    if (kind === 'depth') {
      const old = await fingerprint(page);
      await slide(page, 'label-opacity', 0.2);
      assert.notEqual(await fingerprint(page), old);
    }
    await page.keyboard.press('Space').catch(() => {});
    await page.$eval(`#label-${kind}`, (e) => { if (e.checked) e.click(); });
    await page.waitForTimeout(300);
  }
});

test('the first image with a car is found', 'cars', ['label-class', 'label-pixels', 'label-first', 'label-later'], async (page) => {
  const { frames } = carLabels();
  const sizes = frames.map((frame) => Math.max(0, ...frame.boxes.filter((b) => b.class === 'Car').map((b) => b.visible_pixels)));
  const at = async () => Number(await value(page, 'at'));
  await page.selectOption('#label-class', 'Car');
  await page.click('#label-first');
  await shown(page, frames[FIRST_CAR].readout);
  assert.equal(await at(), frames[FIRST_CAR].readout);
  assert.equal(sizes.findIndex((n) => n > 0), FIRST_CAR);
  await page.click('#label-later');
  await shown(page, frames[FIRST_CAR + 1].readout);
  await page.fill('#label-pixels', String(Math.max(...sizes) + 1));
  await page.click('#label-first');
  await page.waitForFunction(() => document.getElementById('message').textContent.includes('no labels contain a Car'));
  await page.selectOption('#label-class', '');
  await page.fill('#label-pixels', '1');
  await page.click('#label-first');
  await shown(page, frames[0].readout);
  assert.ok(await page.$eval('#message', (e) => e.hidden));
});

test('a live camera shows new readouts', 'live', ['play'], async (page) => {
  await page.waitForFunction(() => Number(document.getElementById('image').dataset.images) > 20);
  assert.match(await text(page, 'live-state'), /running, readout \d+, lag \d+ readouts, \d+ dropped/);
  const readout = () => page.$eval('#image', (e) => Number(e.dataset.readout));
  const first = await readout();
  await page.waitForFunction((n) => Number(document.getElementById('image').dataset.readout) > n + 1000, first);
  await page.click('#play');
  await page.waitForTimeout(200);
  const frozen = await readout();
  await page.waitForTimeout(300);
  assert.equal(await readout(), frozen);
  assert.equal(await text(page, 'play'), 'Resume');
});

test('an exported page works from disk and has the images of the server', 'export', [], async (page, server) => {
  const live = await openPage(server.address);
  for (const [method, window] of [['tfp', 41], ['span', 41], ['tfi', 60], ['bits', 1], ['rates', 1]]) {
    const pixels = [];
    for (const [p, readout] of [[page, 150], [live, 250]]) {
      await p.selectOption('#method', method);
      if (!['bits', 'rates'].includes(method)) await setNumber(p, 'window', window);
      await setNumber(p, 'at', readout);
      await shown(p, readout);
      await p.waitForTimeout(250);
      const found = [];
      for (const [x, y] of [[5, 5], [30, 20], [50, 40]]) {
        await clickPixel(p, x, y, { hover: true });
        found.push(await text(p, 'hover'));
      }
      pixels.push(found);
    }
    // The rate map of the page covers only its readouts.
    if (method !== 'rates') assert.deepEqual(pixels[0], pixels[1], method);
  }
  await page.fill('#pixel-x', '20');
  await page.fill('#pixel-y', '30');
  await page.click('#pixel-show');
  await page.waitForSelector('#pixel-result[data-pixel="20,30"]');
  assert.match(await text(page, 'pixel-text'), new RegExp(`: ${Math.round(rate(quiet, 20, 30, 100, 1100) * 1000)} spikes in readouts 0 to 999`));
  for (const [id, v] of [['region-x', 44], ['region-y', 20], ['region-w', 16], ['region-h', 24]]) await page.fill(`#${id}`, String(v));
  await page.click('#region-show');
  await page.waitForSelector('#region-result:not([hidden])');
  const lines = await text(page, 'spectrum-lines');
  assert.ok(Math.abs(parseFloat(lines.split(':')[1]) - FLICKER_HZ) <= 100, lines);
  await page.click('#defects');
  await page.waitForSelector('#defect-kinds:not([hidden])');
  assert.match(await text(page, 'defect-list'), new RegExp(`\\(${HOT.join(', ')}\\)`));
  await live.context().close();
});

test('the program ends after the page is closed', 'end', [], async (page, server) => {
  await page.reload();
  await page.waitForSelector('body[data-ready]');
  await page.context().close();
  const start = Date.now();
  assert.equal(await server.ended, 0);
  assert.ok(Date.now() - start > 3000);
});

// ---- Groups: the paths of each server

const TWO = ['quiet.dat', 'noisy.dat', ...STREAM_FLAGS];
const groups = {
  stream: () => serve('quiet.dat', ...STREAM_FLAGS),
  pair: () => serve(...TWO),
  files: () => {
    mkdirSync(join(folder, 'set'), { recursive: true });
    const names = ['dark.dat', ...[1, 2, 3, 4, 5, 6, 7].map((n) => `level-${n}.dat`), '<img src=x onerror=alert(1)>.dat'];
    for (const name of names) writeFileSync(join(folder, 'set', name), quiet);
    const recording = (name, i) => `[[recording]]\nfile = "${name}"\nlight = ${(0.1 * i).toFixed(1)}\n`;
    const head = `width = ${WIDTH}\nheight = ${HEIGHT}\nreadout_hz = ${HZ}.0\nlayout = "dat-top"\n`;
    writeFileSync(join(folder, 'set', 'recordings.toml'), head + names.map(recording).join(''));
    return serve('set/recordings.toml');
  },
  folder: () => {
    mkdirSync(join(folder, 'out'), { recursive: true });
    writeFileSync(join(folder, 'out', 'report.html'), '<!doctype html><p>the report</p><script>document.body.textContent="bad"</script>');
    writeFileSync(join(folder, 'out', 'quiet.dat'), quiet);
    return serve('out', ...STREAM_FLAGS);
  },
  dataset: () => {
    execFileSync(program, ['dataset', '-o', 'drives', '--scene-preset', 'tiny'], { cwd: folder, stdio: 'ignore' });
    return serve('drives');
  },
  cars: () => {
    const flags = '--sequences 1 --images-per-scene 6 --width 64 --height 40 --label-every 1 --test-share 0'.split(' ');
    execFileSync(program, ['dataset', '-o', 'cars', ...flags], { cwd: folder, stdio: 'ignore' });
    // The first images keep only vehicles of other classes.
    const labels = carLabels();
    labels.frames.forEach((frame, i) => {
      frame.boxes.forEach((b) => { if (i < FIRST_CAR && b.class === 'Car') b.class = 'Van'; });
    });
    writeFileSync(carLabelsFile(), JSON.stringify(labels));
    return serve('cars');
  },
  live: async () => {
    const name = join(folder, 'ring');
    const camera = spawn(program, ['live', '--builtin-light', 'chart', '--sink', `shm:${name}`], { stdio: 'ignore' });
    servers.push({ child: camera, ended: new Promise((resolve) => camera.on('exit', resolve)) });
    for (let i = 0; i < 200 && !existsSync(name); i++) await new Promise((resolve) => setTimeout(resolve, 50));
    await new Promise((resolve) => setTimeout(resolve, 1500));
    return serve(`shm:${name}`);
  },
  export: async () => {
    const file = join(folder, 'clip.html');
    execFileSync(program, ['view', 'quiet.dat', ...STREAM_FLAGS, '--export', file, '--readouts', '100..1100', '--force'], { cwd: folder });
    const server = await serve('quiet.dat', ...STREAM_FLAGS);
    return { ...server, page: pathToFileURL(file).href };
  },
  end: () => serve('quiet.dat', ...STREAM_FLAGS),
};
const QUICK = ['stream', 'pair', 'files', 'folder', 'export'];

async function screenshots() {
  mkdirSync('screenshots', { recursive: true });
  const link = '#t=2000&m=tfp&w=101&i=40,10&r=44,20,16,24&d=1';
  const sets = [['stream', 'quiet.dat', ...STREAM_FLAGS], ['pair', ...TWO], ['dataset', 'drives']];
  for (const [name, ...args] of sets) {
    const server = await serve(...args);
    for (const width of [1400, 420]) {
      for (const colorScheme of ['light', 'dark']) {
        const hash = name === 'dataset' ? '#a=0.0&t=40&w=81&l=boxes,tracks' : link;
        const page = await openPage(server.address + hash, { viewport: { width, height: 900 }, colorScheme });
        if (name === 'pair') await page.click('#distances');
        await page.waitForTimeout(2500);
        await page.screenshot({ path: `screenshots/${name}-${width}-${colorScheme}.png`, fullPage: width < 700 });
        await page.context().close();
      }
    }
  }
}

let failures = 0;
try {
  for (const [group, start] of Object.entries(groups)) {
    if (mode === 'quick' && !QUICK.includes(group)) continue;
    if (process.env.ONLY && group !== process.env.ONLY) continue;
    const server = await start();
    for (const { name, work } of tests.filter((t) => t.group === group)) {
      const began = Date.now();
      let page;
      try {
        page = await openPage(server.page || server.address);
        page.setDefaultTimeout(15000);
        await work(page, server);
        assert.deepEqual(page.faults, []);
        console.log(`ok    ${group}: ${name} (${Date.now() - began} ms)`);
      } catch (error) {
        failures++;
        console.log(`FAIL  ${group}: ${name}\n${error.stack}`);
      }
      await page?.context().close().catch(() => {});
    }
  }
  // Every control of the page and every key has a test.
  const html = readFileSync(new URL('../../src/static/index.html', import.meta.url), 'utf8');
  const script = readFileSync(new URL('../../src/static/app.js', import.meta.url), 'utf8');
  const ids = [...html.matchAll(/<(?:input|select|button|canvas|iframe|ul)[^>]* id="([^"]+)"/g)].map((m) => m[1]);
  const isOutput = (id) => id.endsWith('-plot') || id === 'notes';
  const keys = [...script.matchAll(/^ {2}\['(.+?)', '/gm)].map((m) => `key ${m[1]}`);
  assert.ok(keys.length > 15 && ids.length > 40);
  const tested = new Map();
  for (const t of tests) for (const c of t.controls) tested.set(c, [...(tested.get(c) || []), `${t.group}: ${t.name}`]);
  const all = [...ids.filter((id) => !isOutput(id)), ...keys];
  const untested = all.filter((c) => !tested.has(c));
  const unknown = [...tested.keys()].filter((c) => !all.includes(c));
  writeFileSync('controls.json', JSON.stringify(Object.fromEntries(tested), null, 1));
  if (untested.length || unknown.length) {
    failures++;
    console.log('FAIL  controls without a test:', untested, 'tested but not in the page:', unknown);
  } else {
    console.log(`ok    ${all.length} controls and keys have a test`);
  }
  if (process.env.SCREENSHOTS) await screenshots();
} finally {
  await browser.close();
  for (const { child } of servers) child.kill('SIGINT');
  await Promise.all(servers.map((s) => s.ended));
  rmSync(folder, { recursive: true, force: true });
}
console.log(failures ? `${failures} failed` : 'all passed');
process.exit(failures ? 1 : 0);
