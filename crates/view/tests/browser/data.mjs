// Streams of the tests. They are computed here, so the expected values do not come from the program.

import { writeFileSync } from 'node:fs';

export const WIDTH = 64;
export const HEIGHT = 48;
export const READOUTS = 4000;
export const HZ = 20000;
export const FLICKER_HZ = 500;
export const HOT = [40, 10];
export const DEAD = [12, 30];
export const BLINKING = [26, 8];

// Light of a pixel in spikes per readout: a gradient, with a lamp that flickers in the right half.
function light(x, y, t) {
  const base = 0.1 + (0.2 * y) / HEIGHT;
  return x < WIDTH / 2 ? base : base * (1 + 0.5 * Math.sin((2 * Math.PI * FLICKER_HZ * t) / HZ));
}

function random(seed) {
  let s = seed >>> 0;
  return () => {
    s = (s + 0x6d2b79f5) >>> 0;
    let t = Math.imul(s ^ (s >>> 15), 1 | s);
    t = (t + Math.imul(t ^ (t >>> 7), 61 | t)) ^ t;
    return ((t ^ (t >>> 14)) >>> 0) / 4294967296;
  };
}

// Integrates the light of every pixel. `noise` is the standard deviation of the threshold.
export function makeStream(path, noise, seed) {
  const next = random(seed);
  const frame = (WIDTH * HEIGHT) / 8;
  const bytes = new Uint8Array(frame * READOUTS);
  const charge = Float64Array.from({ length: WIDTH * HEIGHT }, next);
  const draw = () => 1 + noise * (next() + next() + next() - 1.5) * 2;
  const threshold = Float64Array.from({ length: WIDTH * HEIGHT }, draw);
  for (let t = 0; t < READOUTS; t++) {
    for (let p = 0; p < WIDTH * HEIGHT; p++) {
      const [x, y] = [p % WIDTH, Math.floor(p / WIDTH)];
      let rate = light(x, y, t);
      if (x === HOT[0] && y === HOT[1]) rate = 0.7;
      if (x === DEAD[0] && y === DEAD[1]) rate = 0;
      if (x === BLINKING[0] && y === BLINKING[1]) rate *= Math.floor(t / 400) % 2 ? 1.4 : 0.6;
      charge[p] += rate;
      if (charge[p] >= threshold[p]) {
        charge[p] -= threshold[p];
        threshold[p] = draw();
        bytes[t * frame + (p >> 3)] |= 1 << (p & 7);
      }
    }
  }
  writeFileSync(path, bytes);
  return bytes;
}

export const bit = (bytes, t, x, y) => {
  const p = y * WIDTH + x;
  return (bytes[(t * WIDTH * HEIGHT) / 8 + (p >> 3)] >> (p & 7)) & 1;
};

// Spikes of a pixel in readouts from..to, divided by the readouts.
export function rate(bytes, x, y, from, to) {
  let sum = 0;
  for (let t = from; t < to; t++) sum += bit(bytes, t, x, y);
  return sum / (to - from);
}
