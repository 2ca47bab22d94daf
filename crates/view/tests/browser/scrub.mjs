// Measures the viewer with a large stream. Usage: node scrub.mjs PROGRAM STREAM [FLAGS OF VIEW]...
//
// Prints the time from the start of the program to the first image in the browser. For each method, it drags the slider
// of the time and plays for some seconds, and prints images per second and the CPU time per image. No test depends on
// these numbers. MEASURE_SECONDS sets the seconds of each measurement (5), and METHODS its methods ("tfp 41,tfi 300").
// SPAN sets the number of readouts that a drag crosses (all readouts). PAGE_FILES=source serves the page of the sources.

import { spawn } from 'node:child_process';
import { readFileSync } from 'node:fs';
import { createRequire } from 'node:module';
import { join } from 'node:path';
import { servePageFiles } from './page_files.mjs';

const { chromium } = createRequire(join(process.cwd(), 'package.json'))('playwright-core');
const [program, ...args] = process.argv.slice(2);
const seconds = Number(process.env.MEASURE_SECONDS || 5);
const methods = (process.env.METHODS || 'tfp 41,tfp 161,tfi 300,span 41,span 161,bits 1').split(',').map((m) => m.split(' '));

const browser = await chromium.launch({ executablePath: '/usr/bin/chromium', args: ['--no-sandbox'] });
const devtools = await browser.newBrowserCDPSession();
const page = await (await browser.newContext({ viewport: { width: 1400, height: 900 } })).newPage();
await servePageFiles(page);

const began = performance.now();
const server = spawn(program, ['view', ...args, '--no-browser', '--json'], { stdio: ['ignore', 'pipe', 'inherit'] });
const address = await new Promise((resolve, reject) => {
  let text = '';
  server.stdout.on('data', (part) => {
    text += part;
    const line = text.split('\n').find((l) => l.includes('"address"'));
    if (line) resolve(JSON.parse(line).address);
  });
  server.on('exit', (code) => reject(new Error(`view ended with code ${code}`)));
});
const listening = performance.now();
await page.goto(address);
await page.waitForSelector('#image[data-images]');
console.log(`first image after ${Math.round(performance.now() - began)} ms, of which the program needs ${Math.round(listening - began)} ms to listen`);

// CPU seconds of the server and of all processes of the browser.
async function cpuSeconds() {
  const fields = readFileSync(`/proc/${server.pid}/stat`, 'utf8').split(') ')[1].split(' ');
  const { processInfo } = await devtools.send('SystemInfo.getProcessInfo');
  return [(Number(fields[11]) + Number(fields[12])) / 100, processInfo.reduce((sum, p) => sum + p.cpuTime, 0)];
}

const images = () => page.$eval('#image', (e) => Number(e.dataset.images));

async function measure(name, work) {
  await page.waitForTimeout(500);
  const [count, cpu, start] = [await images(), await cpuSeconds(), performance.now()];
  await work();
  const [shown, used] = [(await images()) - count, await cpuSeconds()];
  const rate = (1000 * shown) / (performance.now() - start);
  const [ofServer, ofBrowser] = used.map((v, i) => ((1000 * (v - cpu[i])) / shown).toFixed(1));
  console.log(`${name}: ${rate.toFixed(1)} images per second, CPU time per image: server ${ofServer} ms, browser ${ofBrowser} ms`);
}

for (const [method, window] of methods) {
  await page.selectOption('#method', method);
  if (method !== 'bits') {
    await page.fill('#window', window);
    await page.press('#window', 'Enter');
  }
  // A hand moves the slider once per frame of the screen, over the whole stream and back in two seconds.
  await measure(`${method} ${window}, drag`, () => page.evaluate(([length, crossed]) => new Promise((resolve) => {
    const slider = document.getElementById('scrubber');
    const start = performance.now();
    const step = (now) => {
      if (now - start > length) return resolve();
      slider.value = Math.round((crossed || Number(slider.max)) * (0.5 - 0.5 * Math.cos(((now - start) / 1000) * Math.PI)));
      slider.dispatchEvent(new Event('input'));
      return requestAnimationFrame(step);
    };
    requestAnimationFrame(step);
  }), [1000 * seconds, Number(process.env.SPAN || 0)]));
  await page.fill('#at', '1000');
  await page.press('#at', 'Enter');
  await measure(`${method} ${window}, play at 1/200`, async () => {
    await page.click('#play');
    await page.waitForTimeout(1000 * seconds);
    await page.click('#play');
  });
}
const peak = readFileSync(`/proc/${server.pid}/status`, 'utf8').match(/VmHWM:\s+(\d+)/)[1];
console.log(`peak memory of the server: ${Math.round(peak / 1024)} MiB`);
await browser.close();
server.kill('SIGINT');
