#!/usr/bin/env node
/** `npx enfilade bake`: the bake for those who have no binary. */
import { readFileSync, readdirSync, writeFileSync } from 'node:fs';
import { createRequire } from 'node:module';
import { basename, dirname, join } from 'node:path';
import { parseArgs } from 'node:util';
import { BakeFailure, bake, type BakeInput, type IfcReader } from './bake.js';
import { ifcReader } from './ifc.js';

const USAGE = `usage: enfilade bake FILE... -o WORLD.glb [--plan PLAN.svg] [--detail FILE]... [--config SETTINGS.toml]
                     [--unit UNIT] [--up y|z] [--method METHOD] [--max-memory BYTES] [--max-time SECONDS]
                     [--allow-empty] [--allow-leak] [--json]

Finds the rooms and doorways of GLB, glTF, OBJ, PLY, STL, .map and IFC files, in WebAssembly; IFC by the package web-ifc:
npx -p enfilade -p web-ifc enfilade bake FILE.ifc -o WORLD.glb. The binary of enfilade is faster, reads more formats and has
more commands.`;

/** Reads IFC by the package web-ifc, which is loaded when there is such a file. */
const readIfc: IfcReader = async (bytes) => {
  const load = (): object => {
    // From the project in which this runs, or beside this package.
    for (const place of [join(process.cwd(), 'here.js'), import.meta.url]) {
      try {
        return createRequire(place)('web-ifc') as object;
      } catch (why) {
        if ((why as { code?: string }).code !== 'MODULE_NOT_FOUND') throw why;
      }
    }
    throw new Error('the package is missing: npm install web-ifc');
  };
  return ifcReader(load())(bytes);
};

/** Reads a file, and those beside it that its text names: buffers, materials, pictures. */
function read(path: string, known: Map<string, BakeInput>): void {
  const name = basename(path);
  if (known.has(name)) return;
  const bytes = readFileSync(path);
  known.set(name, { name, bytes });
  if (!/\.(gltf|obj|mtl)$/i.test(name)) return;
  const text = decodeURIComponent(bytes.toString('latin1').replace(/%(?![0-9a-f]{2})/gi, '%25'));
  const beside = readdirSync(dirname(path) || '.', { withFileTypes: true }).filter((entry) => entry.isFile());
  for (const other of beside) if (other.name !== name && text.includes(other.name)) read(join(dirname(path), other.name), known);
}

async function main(args: string[]): Promise<number> {
  const { values, positionals } = parseArgs({
    args,
    allowPositionals: true,
    options: {
      output: { type: 'string', short: 'o' },
      plan: { type: 'string' },
      detail: { type: 'string', multiple: true },
      config: { type: 'string' },
      unit: { type: 'string' },
      up: { type: 'string' },
      method: { type: 'string' },
      'max-memory': { type: 'string' },
      'max-time': { type: 'string' },
      'allow-empty': { type: 'boolean' },
      'allow-leak': { type: 'boolean' },
      json: { type: 'boolean' },
      quiet: { type: 'boolean', short: 'q' },
      help: { type: 'boolean', short: 'h' },
    },
  });
  const [command, ...paths] = positionals;
  if (values.help) {
    console.log(USAGE);
    return 0;
  }
  if (command !== 'bake' || paths.length === 0 || !values.output) {
    console.error(USAGE);
    return 2;
  }
  const [files, detail] = [new Map<string, BakeInput>(), new Map<string, BakeInput>()];
  for (const path of paths) read(path, files);
  for (const path of values.detail ?? []) read(path, detail);
  // A detail file may have the name of a scene in another folder.
  const apart = [...detail.values()].map((input) => (files.has(input.name) ? { ...input, name: `detail/${input.name}` } : input));
  const isWatched = process.stderr.isTTY && !values.quiet;
  const number = (text: string | undefined): number | undefined => (text === undefined ? undefined : Number(text));
  const { unit, up } = values;
  const baked = await bake(files.values(), {
    detail: apart as BakeInput[],
    settings: { ...(unit ? { unit } : {}), ...(up ? { up } : {}) },
    toml: values.config && readFileSync(values.config, 'utf8'),
    method: values.method as 'auto',
    maxMemory: number(values['max-memory']),
    maxTime: number(values['max-time']),
    allowEmpty: values['allow-empty'],
    allowLeak: values['allow-leak'],
    ifc: readIfc,
    onProgress: ({ stage, index, count }) => isWatched && process.stderr.write(`\r\x1b[K${index + 1}/${count} ${stage}`),
  });
  if (isWatched) process.stderr.write('\r\x1b[K');
  writeFileSync(values.output, baked.world);
  if (values.plan) writeFileSync(values.plan, baked.plan);
  if (!values.quiet) for (const warning of baked.warnings) console.error(`warning: ${warning}`);
  const { world, plan: _, ...facts } = baked;
  if (values.json) console.log(JSON.stringify({ ...facts, bytes: world.length }));
  else if (!values.quiet) console.log(`${values.output}: ${world.length} bytes\n${baked.text}`);
  return 0;
}

main(process.argv.slice(2)).then(
  (code) => {
    process.exitCode = code;
  },
  (why: Error) => {
    console.error(`error: ${why.message}`);
    process.exitCode = why instanceof BakeFailure || !('code' in why && String(why.code).startsWith('ERR_PARSE')) ? 1 : 2;
  },
);
