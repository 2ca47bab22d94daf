// With PAGE_FILES=source, a browser receives the files of the page from the sources, so a changed page needs no build.

import { readFileSync } from 'node:fs';

const TYPES = { js: 'text/javascript', css: 'text/css', svg: 'image/svg+xml', html: 'text/html' };

export async function servePageFiles(page) {
  if (process.env.PAGE_FILES !== 'source') return;
  await page.route(/^http:\/\/127\.0\.0\.1:\d+\/[0-9a-f]{32}\/([a-z_.]*)(#.*)?$/, (route) => {
    const name = new URL(route.request().url()).pathname.split('/')[2] || 'index.html';
    const body = readFileSync(new URL(`../../src/static/${name}`, import.meta.url));
    return route.fulfill({ body, contentType: TYPES[name.split('.')[1]] });
  });
}
