import { PackedStream } from './bits.js';
import { RateImage } from './rate_image.js';

// The data of the page: from the server, or from the page itself. Both classes have the same methods.

async function get(request) {
  const response = await fetch(`api/${request}`);
  if (!response.ok) {
    const isJson = (response.headers.get('content-type') || '').includes('json');
    throw new Error(isJson ? (await response.json()).error : await response.text());
  }
  return response;
}

const json = async (request) => (await get(request)).json();
const floats = async (request) => new Float32Array(await (await get(request)).arrayBuffer());

// Decodes an image: a table of rates and one index per pixel, or the rates themselves.
function decodeImage(buffer) {
  const [width, length] = new Uint32Array(buffer, 0, 2);
  if (width === 0) return new RateImage(new Float32Array(buffer, 8));
  const table = new Float32Array(buffer, 8, length);
  return new RateImage(table, width === 1 ? new Uint8Array(buffer, 8 + 4 * length) : new Uint16Array(buffer, 8 + 4 * length));
}

export class ServerSource {
  constructor() {
    this.isEmbedded = false;
    // The server ends some seconds after the last page closes this connection.
    this.heartbeat = new EventSource('api/open');
  }

  list() { return json('sources'); }
  stream(s) { return json(`stream?s=${s}`); }

  async image(s, at, method, window) {
    const response = await get(`image?s=${s}&at=${at}&method=${method}&window=${window}`);
    return decodeImage(await response.arrayBuffer());
  }

  rates(s) { return floats(`rates?s=${s}`); }
  pixel(s, x, y, from, to) { return json(`pixel?s=${s}&x=${x}&y=${y}&from=${from}&to=${to}`); }
  region(s, r, from, to) { return json(`region?s=${s}&${rectangle(r)}&from=${from}&to=${to}`); }
  distances(s, b, r, from, to) { return json(`distances?s=${s}&b=${b}&${rectangle(r)}&from=${from}&to=${to}`); }
  labels(s) { return json(`labels?s=${s}`); }

  async labelMap(s, readout, kind) {
    const response = await get(`label_map?s=${s}&readout=${readout}&kind=${kind}`);
    const [width, height] = response.headers.get('x-size').split(',').map(Number);
    return { width, height, values: new Float32Array(await response.arrayBuffer()) };
  }

  async live(s, method, window) {
    const response = await get(`live?s=${s}&method=${method}&window=${window}`);
    const [received, latest, dropped, lag, state] = response.headers.get('x-live').split(',');
    const image = new RateImage(new Float32Array(await response.arrayBuffer()));
    return { image, received: Number(received), latest: Number(latest), dropped: Number(dropped), lag: Number(lag), state };
  }

  // Waits for a computation over a whole stream. `progress` receives the finished share.
  async job(s, task, r, progress) {
    const request = task === 'region' ? `job?task=region&s=${s}&${rectangle(r)}` : `job?task=${task}&s=${s}`;
    for (;;) {
      const job = await json(request);
      if (job.state === 'done') return job.result;
      if (job.state === 'failed') throw new Error(job.error);
      progress(job.share);
      await new Promise((resolve) => setTimeout(resolve, 200));
    }
  }
}

const rectangle = (r) => `x=${r.x}&y=${r.y}&w=${r.w}&h=${r.h}`;

export class EmbeddedSource {
  constructor(data) {
    this.isEmbedded = true;
    this.data = data;
    const text = atob(data.bits);
    const bytes = new Uint8Array(text.length);
    for (let i = 0; i < text.length; i++) bytes[i] = text.charCodeAt(i);
    this.packed = new PackedStream(bytes, data.width, data.height);
  }

  async list() {
    return { sources: [{ name: this.data.name, kind: 'stream', items: [], has_report: false }], version: this.data.version };
  }

  async stream() {
    const { width, height, readouts, readout_hz } = this.data;
    return {
      width, height, readouts, readout_hz, layout: `readouts ${this.data.first_readout} to ${this.data.first_readout + readouts - 1}`,
      warnings: [], is_live: false, max_window: 4096, max_request_readouts: readouts,
    };
  }

  async image(s, at, method, window) { return new RateImage(this.packed.image(at, method, window)); }
  async rates() { return this.packed.rateMap(); }
  async pixel(s, x, y, from, to) { return this.packed.pixel(x, y, from, to); }
  async region(s, r, from, to) { return this.packed.region(r.x, r.y, r.w, r.h, from, to); }

  async job(s, task, r) {
    return task === 'region' ? this.packed.region(r.x, r.y, r.w, r.h, 0, this.packed.readouts) : this.data.summary;
  }
}

// Returns the source of this page.
export function openSource() {
  const embedded = document.getElementById('embedded');
  return embedded ? new EmbeddedSource(JSON.parse(embedded.textContent)) : new ServerSource();
}
