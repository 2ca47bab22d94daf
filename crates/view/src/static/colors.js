// Color maps. Each returns the color of a value from 0 to 1 as three numbers from 0 to 255.

const clamp = (v) => Math.max(0, Math.min(255, Math.round(v)));

function polynomial(coefficients) {
  return (t) => [0, 1, 2].map((c) => clamp(255 * coefficients.reduceRight((sum, k) => sum * t + k[c], 0)));
}

// Polynomials of degree 6 that approximate the matplotlib maps viridis and inferno.
const viridis = polynomial([
  [0.2777273, 0.0054073, 0.3340998], [0.1050930, 1.4046135, 1.3845902], [-0.3308618, 0.2148476, 0.0950952],
  [-4.6342305, -5.7991010, -19.3324410], [6.2282699, 14.1799334, 56.6905526], [4.7763850, -13.7451454, -65.3530326],
  [-5.4354559, 4.6458526, 26.3124352],
]);
const inferno = polynomial([
  [0.0002189, 0.0016510, -0.0194810], [0.1065134, 0.5639564, 3.9327123], [11.6024931, -3.9728540, -15.9423941],
  [-41.7039961, 17.4363989, 44.3541452], [77.1629357, -33.4023589, -81.8073093], [-71.3194282, 32.6260643, 73.2095199],
  [25.1311262, -12.2426690, -23.0703250],
]);

export const colorMaps = {
  gray: (t) => [clamp(255 * t), clamp(255 * t), clamp(255 * t)],
  viridis,
  inferno,
};

// Blue for negative, white for zero, red for positive differences.
export function differenceColor(t) {
  const d = 2 * t - 1;
  return d < 0 ? [clamp(255 * (1 + d)), clamp(255 * (1 + 0.6 * d)), 255] : [255, clamp(255 * (1 - 0.7 * d)), clamp(255 * (1 - d))];
}

// 1024 colors as 32-bit words of little-endian RGBA pixels.
export function lookupTable(color) {
  const table = new Uint32Array(1024);
  for (let i = 0; i < 1024; i++) {
    const [r, g, b] = color(i / 1023);
    table[i] = (255 << 24) | (b << 16) | (g << 8) | r;
  }
  return table;
}

// A color for an identifier. Neighboring identifiers have different hues.
export function idColor(id) {
  return hueColor((id * 0.618034) % 1, 0.85, 1);
}

// Hue from 0 to 1, saturation and brightness from 0 to 1.
export function hueColor(hue, saturation, value) {
  const channel = (shift) => {
    const k = (shift + 6 * hue) % 6;
    return clamp(255 * value * (1 - saturation * Math.max(0, Math.min(k, 4 - k, 1))));
  };
  return [channel(5), channel(3), channel(1)];
}
