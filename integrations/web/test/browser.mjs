// Headless Chromium with software WebGL, and bundles of the test pages.
import { build } from 'esbuild';
import { chromium } from 'playwright-core';
import { existsSync, mkdirSync, readFileSync, writeFileSync } from 'node:fs';
import { fileURLToPath } from 'node:url';

export const at = (path) => fileURLToPath(new URL(`../${path}`, import.meta.url));

/** Opens a browser; set CHROMIUM to use another than Debian's. */
export async function browser() {
  const executablePath = process.env.CHROMIUM ?? '/usr/bin/chromium';
  if (!existsSync(executablePath)) throw new Error(`${executablePath} is missing: install chromium, or set CHROMIUM`);
  const args = ['--no-sandbox', '--use-angle=swiftshader', '--enable-unsafe-swiftshader', '--enable-precise-memory-info'];
  args.push('--js-flags=--expose-gc', '--disable-dev-shm-usage', '--ignore-gpu-blocklist');
  return chromium.launch({ executablePath, args });
}

/** Bundles test/pages/NAME.mjs into a page; returns its path below /web/. */
export async function page(name) {
  return bundle(name, readFileSync(at(`test/pages/${name}.mjs`), 'utf8'));
}

/** Bundles code into a page. */
export async function bundle(name, contents) {
  mkdirSync(at('dist/test'), { recursive: true });
  const alias = Object.fromEntries(['three', 'stream', 'fiber'].map((own) => [`enfilade/${own}`, at(`dist/${own}.js`)]));
  await build({
    stdin: { contents, resolveDir: at('test/pages'), sourcefile: `${name}.mjs` },
    alias,
    define: { 'process.env.NODE_ENV': '"production"' },
    bundle: true,
    format: 'esm',
    outfile: at(`dist/test/${name}.js`),
    logLevel: 'error',
  });
  writeFileSync(at(`dist/test/${name}.html`), `<!doctype html><meta charset="utf-8"><script type="module" src="${name}.js"></script>`);
  return `web/dist/test/${name}.html`;
}

/** Opens a page and, unless `isReady` is false, waits until it says that it is ready; returns it with its errors. */
export async function visit(own, address, isReady = true) {
  const tab = await own.newPage();
  const errors = [];
  tab.on('pageerror', (error) => errors.push(error.message));
  tab.on('console', (message) => message.type() === 'error' && errors.push(message.text()));
  await tab.goto(address);
  if (!isReady) return { tab, errors };
  await tab.waitForFunction(() => globalThis.ready || globalThis.failed, undefined, { timeout: 120_000 }).catch((error) => {
    throw new Error(`${address}: ${errors.join('; ') || error.message}`);
  });
  return { tab, errors };
}
