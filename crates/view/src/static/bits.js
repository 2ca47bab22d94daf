// Images and statistics of packed bits, for pages without a server. Pixel p of a readout is bit p % 8 of byte p / 8.

export class PackedStream {
  constructor(bytes, width, height) {
    this.bytes = bytes;
    this.width = width;
    this.height = height;
    this.frameBytes = Math.ceil((width * height) / 8);
    this.readouts = Math.floor(bytes.length / this.frameBytes);
  }

  bit(readout, p) {
    return (this.bytes[readout * this.frameBytes + (p >> 3)] >> (p & 7)) & 1;
  }

  // Calls visit(p) for each pixel that fires at a readout.
  forEachSpike(readout, visit) {
    const start = readout * this.frameBytes;
    for (let i = 0; i < this.frameBytes; i++) {
      let byte = this.bytes[start + i];
      while (byte) {
        const low = byte & -byte;
        visit(8 * i + 31 - Math.clz32(low));
        byte ^= low;
      }
    }
  }

  image(at, method, window) {
    const pixels = this.width * this.height;
    const rates = new Float32Array(pixels);
    if (method === 'bits') {
      this.forEachSpike(at, (p) => { rates[p] = 1; });
      return rates;
    }
    if (method === 'tfi') return this.tfi(at, window);
    const half = window >> 1;
    const from = Math.max(0, at - half);
    const to = Math.min(this.readouts, at + half + 1);
    const count = new Uint32Array(pixels);
    const first = new Int32Array(pixels).fill(-1);
    const last = new Int32Array(pixels);
    for (let t = from; t < to; t++) {
      this.forEachSpike(t, (p) => {
        count[p]++;
        if (first[p] < 0) first[p] = t;
        last[p] = t;
      });
    }
    const isSpan = method === 'span';
    for (let p = 0; p < pixels; p++) {
      rates[p] = isSpan && count[p] > 1 ? (count[p] - 1) / (last[p] - first[p]) : count[p] / (to - from);
    }
    return rates;
  }

  // 1 / (interval around a readout). Pixels without a spike on both sides have 1 / (2 * search).
  tfi(at, search) {
    const pixels = this.width * this.height;
    const before = new Int32Array(pixels).fill(-1);
    const after = new Int32Array(pixels).fill(-1);
    for (let d = 0; d <= search && at - d >= 0; d++) {
      this.forEachSpike(at - d, (p) => { if (before[p] < 0) before[p] = d; });
    }
    for (let d = 1; d <= search && at + d < this.readouts; d++) {
      this.forEachSpike(at + d, (p) => { if (after[p] < 0) after[p] = d; });
    }
    const rates = new Float32Array(pixels).fill(1 / (2 * search));
    for (let p = 0; p < pixels; p++) {
      if (before[p] >= 0 && after[p] >= 0) rates[p] = 1 / (before[p] + after[p]);
    }
    return rates;
  }

  rateMap() {
    const rates = new Float32Array(this.width * this.height);
    for (let t = 0; t < this.readouts; t++) this.forEachSpike(t, (p) => { rates[p]++; });
    return rates.map((n) => n / this.readouts);
  }

  pixel(x, y, from, to) {
    const pixels = [];
    let times = [];
    for (let row = Math.max(0, y - 1); row < Math.min(this.height, y + 2); row++) {
      for (let col = Math.max(0, x - 1); col < Math.min(this.width, x + 2); col++) {
        const own = [];
        for (let t = from; t < to; t++) if (this.bit(t, row * this.width + col)) own.push(t);
        const counts = new Map();
        for (let i = 1; i < own.length; i++) {
          const length = own[i] - own[i - 1];
          counts.set(length, (counts.get(length) || 0) + 1);
        }
        const intervals = [...counts].sort((a, b) => a[0] - b[0]);
        pixels.push({ x: col, y: row, spikes: own.length, intervals });
        if (col === x && row === y) times = own;
      }
    }
    return { x, y, from, to, times, pixels };
  }

  // Mean rate of a rectangle over time, and its spectrum as in `spikelane measure`.
  region(x, y, w, h, from, to) {
    const totals = new Float64Array(to - from);
    for (let t = from; t < to; t++) {
      let sum = 0;
      for (let row = y; row < y + h; row++) {
        for (let col = x; col < x + w; col++) sum += this.bit(t, row * this.width + col);
      }
      totals[t - from] = sum;
    }
    const pixels = w * h;
    const bin = Math.ceil(totals.length / 1000);
    const rates = [];
    let all = 0;
    for (let start = 0; start < totals.length; start += bin) {
      const part = totals.subarray(start, start + bin);
      const sum = part.reduce((a, b) => a + b, 0);
      all += sum;
      rates.push(sum / (part.length * pixels));
    }
    const meanRate = all / (totals.length * pixels);
    return { from, to, bin, rates, mean_rate: meanRate, pixels, spectrum: spectrumOf(totals) };
  }
}

// Averaged periodogram with a Hann window and segments that overlap by half.
function spectrumOf(totals) {
  const segment = Math.min(512, Math.floor(totals.length / 4)) & ~1;
  if (segment < 64) return null;
  const weights = Array.from({ length: segment }, (_, i) => 0.5 - 0.5 * Math.cos((2 * Math.PI * i) / segment));
  const power = new Array(segment / 2 + 1).fill(0);
  let segments = 0;
  for (let start = 0; start + segment <= totals.length; start += segment / 2) {
    const part = totals.subarray(start, start + segment);
    const mean = part.reduce((a, b) => a + b, 0) / segment;
    for (let k = 0; k < power.length; k++) {
      let re = 0;
      let im = 0;
      for (let i = 0; i < segment; i++) {
        const v = (part[i] - mean) * weights[i];
        const angle = (2 * Math.PI * ((k * i) % segment)) / segment;
        re += v * Math.cos(angle);
        im += v * Math.sin(angle);
      }
      power[k] += re * re + im * im;
    }
    segments++;
  }
  const weight = weights.reduce((a, w) => a + w * w, 0);
  const last = power.length - 1;
  const scaled = power.map((p, k) => (p * (k === 0 || k === last ? 1 : 2)) / (segment * weight * segments));
  return { segment, power: scaled, lines: spectralLines(scaled, segment) };
}

function spectralLines(power, segment) {
  const lines = [];
  for (let k = 4; k < power.length; k++) {
    if (power[k + 1] > power[k] || power[k - 1] > power[k]) continue;
    const around = power.slice(Math.max(1, k - 16), k + 17).sort((a, b) => a - b);
    const median = around[around.length >> 1];
    const prominence = median > 0 ? power[k] / median : 0;
    if (prominence > 30) lines.push({ frequency: k / segment, prominence, harmonic: null });
  }
  return lines.sort((a, b) => b.prominence - a.prominence).slice(0, 5);
}
