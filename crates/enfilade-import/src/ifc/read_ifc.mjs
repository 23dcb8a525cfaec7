// Writes the products of an IFC file as GLB, by means of web-ifc: node read_ifc.mjs IN.ifc OUT.glb
//
// Lines `note: ...` on standard output are shown to the user. Exit code 127: the package is missing.

import fs from 'node:fs';
import { createRequire } from 'node:module';
import path from 'node:path';
import { glbOfIfc } from './ifc_model.mjs';

const NOT_INSTALLED = 127;

/** Returns web-ifc: from the current folder or one above it, NODE_PATH, or the folder of `npm install --global`. */
function load() {
  const globals = path.join(path.dirname(process.execPath), '..', 'lib', 'node_modules');
  for (const place of [process.cwd(), globals]) {
    try {
      return createRequire(path.join(place, 'here.js'))('web-ifc');
    } catch (error) {
      if (error.code !== 'MODULE_NOT_FOUND') throw error;
    }
  }
  process.exit(NOT_INSTALLED);
}

const webIfc = load();

async function main(input, output) {
  const bytes = new Uint8Array(fs.readFileSync(input));
  const chunks = await glbOfIfc(webIfc, bytes, (note) => console.log(`note: ${note}`));
  const out = fs.openSync(output, 'w');
  for (const chunk of chunks) for (let at = 0; at < chunk.length; ) at += fs.writeSync(out, chunk, at);
  fs.closeSync(out);
}

try {
  await main(...process.argv.slice(2));
} catch (error) {
  console.error(`web-ifc cannot read it: ${error.message}`);
  process.exit(1);
}
