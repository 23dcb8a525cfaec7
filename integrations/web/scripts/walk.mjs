// Builds dist/walk.html: the whole walk in one file, compressed, with three.js and the module inside.
import { build } from 'esbuild';
import { readFileSync, writeFileSync } from 'node:fs';
import { gzipSync } from 'node:zlib';
import { fileURLToPath } from 'node:url';

const at = (path) => fileURLToPath(new URL(`../${path}`, import.meta.url));
const { outputFiles } = await build({
  entryPoints: [at('walk/walk.ts')],
  bundle: true,
  format: 'esm',
  minify: true,
  write: false,
  target: 'es2022',
  loader: { '.wasm': 'binary' },
  external: ['node:fs/promises'],
  legalComments: 'none',
});
const packed = gzipSync(outputFiles[0].contents, { level: 9 }).toString('base64');
const script = `<script type="module">
// three.js (MIT), fzstd (MIT) and enfilade, compressed. Sources: integrations/web of enfilade.
const packed = Uint8Array.from(atob(document.getElementById('code').textContent), (c) => c.charCodeAt(0));
const text = await new Response(new Blob([packed]).stream().pipeThrough(new DecompressionStream('gzip'))).blob();
await import(URL.createObjectURL(new Blob([text], { type: 'text/javascript' })));
</script>`;
const page = readFileSync(at('walk/walk.html'), 'utf8');
const whole = page.replace('<!--script-->', () => `<script id="code" type="text/plain">${packed}</script>\n${script}`);
writeFileSync(at('dist/walk.html'), whole);
console.log(`walk.html: ${whole.length} bytes`);
