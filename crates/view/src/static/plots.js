// Plots on canvases. The colors are those of the page, so each plot is drawn again when the color scheme changes.

const style = (name) => getComputedStyle(document.documentElement).getPropertyValue(name).trim();

const drawn = new Map();

// Sets the content of a plot. `plot` has axes and series; a series has x and y values and a kind.
export function drawPlot(canvas, plot) {
  drawn.set(canvas, plot);
  paintPlot(canvas, plot);
}

export function redrawPlots() {
  for (const [canvas, plot] of drawn) paintPlot(canvas, plot);
}

const rounded = (v) => {
  if (v === 0) return '0';
  const size = Math.abs(v);
  return size >= 1e5 || size < 1e-3 ? v.toExponential(1) : String(Number(v.toPrecision(3)));
};

function ticks(low, high, count) {
  const step = (high - low) / count;
  const power = 10 ** Math.floor(Math.log10(step));
  const nice = [1, 2, 5, 10].map((n) => n * power).find((n) => n >= step);
  const values = [];
  for (let v = Math.ceil(low / nice) * nice; v <= high + 1e-9 * nice; v += nice) values.push(Number(v.toPrecision(12)));
  return values;
}

// Whole powers of ten, as exponents.
function decades(low, high) {
  const step = Math.max(1, Math.ceil((high - low) / 4));
  const values = [];
  for (let v = Math.ceil(low); v <= high; v += step) values.push(v);
  return values;
}

function range(series, axis) {
  let low = 1e300;
  let high = -1e300;
  for (const s of series) {
    for (const v of s[axis]) {
      if (v < low) low = v;
      if (v > high) high = v;
    }
  }
  if (low > high) return [0, 1];
  return low === high ? [low - 0.5, high + 0.5] : [low, high];
}

function paintPlot(canvas, plot) {
  const ratio = window.devicePixelRatio || 1;
  const width = canvas.clientWidth;
  const height = canvas.clientHeight;
  if (!width || !height) return;
  canvas.width = width * ratio;
  canvas.height = height * ratio;
  canvas.setAttribute('aria-label', plot.description);
  const c = canvas.getContext('2d');
  c.scale(ratio, ratio);
  c.font = '11px system-ui, sans-serif';
  const box = { left: 46, right: width - 18, top: 18, bottom: height - 30 };
  const isLog = plot.yScale === 'log';
  const series = plot.series.map((s) => {
    if (!isLog) return s;
    const kept = s.y.map((_, i) => i).filter((i) => s.y[i] > 0);
    return { ...s, x: kept.map((i) => s.x[i]), y: kept.map((i) => Math.log10(s.y[i])) };
  });
  const edge = series.some((s) => s.kind === 'bars') ? 0.6 : 0;
  const [x0, x1] = plot.xRange || range(series, 'x').map((v, i) => v + (i ? edge : -edge));
  let [y0, y1] = plot.yRange || range(series, 'y');
  if (plot.fromZero) y0 = Math.min(0, y0);
  // The highest bar or line does not touch the title.
  if (isLog || plot.fromZero) y1 += 0.05 * (y1 - y0);
  const sx = (v) => box.left + ((v - x0) / (x1 - x0)) * (box.right - box.left);
  const sy = (v) => box.bottom - ((v - y0) / (y1 - y0)) * (box.bottom - box.top);
  c.fillStyle = style('--text');
  c.textAlign = 'left';
  c.fillText(plot.title, 0, 11);
  c.strokeStyle = style('--line');
  c.beginPath();
  c.moveTo(box.left, box.top);
  c.lineTo(box.left, box.bottom);
  c.lineTo(box.right, box.bottom);
  c.stroke();
  c.fillStyle = style('--muted');
  c.textAlign = 'center';
  for (const v of ticks(x0, x1, 5)) c.fillText(rounded(v), sx(v), box.bottom + 13);
  c.fillText(plot.xLabel, (box.left + box.right) / 2, height - 3);
  if (!plot.hideY) {
    c.textAlign = 'right';
    for (const v of isLog ? decades(y0, y1) : ticks(y0, y1, 3)) c.fillText(rounded(isLog ? 10 ** v : v), box.left - 5, sy(v) + 4);
  }
  c.save();
  c.beginPath();
  c.rect(box.left, box.top - 4, box.right - box.left, box.bottom - box.top + 5);
  c.clip();
  for (const s of series) drawSeries(c, s, sx, sy, box);
  if (plot.marker !== undefined) {
    c.strokeStyle = style('--bad');
    c.beginPath();
    c.moveTo(sx(plot.marker), box.top);
    c.lineTo(sx(plot.marker), box.bottom);
    c.stroke();
  }
  c.restore();
}

function drawSeries(c, s, sx, sy, box) {
  c.strokeStyle = style(s.color);
  c.fillStyle = style(s.color);
  c.lineWidth = 1.2;
  c.beginPath();
  for (let i = 0; i < s.x.length; i++) {
    const x = sx(s.x[i]);
    if (s.kind === 'bars') {
      const half = Math.max(0.5, (sx(s.x[i] + 0.4) - x) * (s.narrow ? 0.5 : 1));
      c.fillRect(x - half, sy(s.y[i]), 2 * half, box.bottom - sy(s.y[i]));
    } else if (s.kind === 'events') {
      c.moveTo(x, box.top);
      c.lineTo(x, box.bottom);
    } else if (i === 0) {
      c.moveTo(x, sy(s.y[i]));
    } else {
      c.lineTo(x, sy(s.y[i]));
    }
  }
  if (s.kind !== 'bars') c.stroke();
}
