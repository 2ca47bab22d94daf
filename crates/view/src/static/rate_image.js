// An image in spikes per readout: one rate per pixel, or a table of rates and one index per pixel.

export class RateImage {
  constructor(rates, indices = null) {
    this.rates = rates;
    this.indices = indices;
    this.length = (indices || rates).length;
  }

  // Rate of pixel p.
  at(p) {
    return this.rates[this.indices ? this.indices[p] : p];
  }

  // Writes the color of each pixel to `words`. Rate `white` has the last color of the table.
  color(words, table, white, gamma) {
    const { rates, indices } = this;
    const last = gamma === 1 ? 1023 : 4095;
    const curve = gamma === 1 ? table : Uint32Array.from({ length: 4096 }, (_, i) => table[Math.round(1023 * (i / 4095) ** (1 / gamma))]);
    const scale = last / white;
    // With indices, the loop computes the color of each rate of the table, and then looks up the color of each pixel.
    const colors = indices ? new Uint32Array(rates.length) : words;
    for (let i = 0; i < colors.length; i++) colors[i] = curve[Math.min(last, (rates[i] * scale + 0.5) | 0)];
    if (indices) for (let p = 0; p < words.length; p++) words[p] = colors[indices[p]];
  }

  // The rate above which one pixel in 500 lies, estimated from at most 20,000 pixels.
  white() {
    const step = Math.max(1, Math.floor(this.length / 20000));
    const sample = [];
    for (let p = 0; p < this.length; p += step) sample.push(this.at(p));
    sample.sort((a, b) => a - b);
    const white = sample[Math.min(sample.length - 1, Math.floor(sample.length * 0.998))];
    return white > 0 ? white : 1;
  }
}
