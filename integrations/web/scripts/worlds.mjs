// Makes the worlds of tests and measurements in dist/worlds: the demo house and, where real scenes are, the institute, as it
// is and furnished; with native answers. ENFILADE is the command, ENFILADE_SCENES the folder of scenes.
import { execFileSync } from 'node:child_process';
import { existsSync, mkdirSync } from 'node:fs';
import { join } from 'node:path';
import { fileURLToPath } from 'node:url';

const here = fileURLToPath(new URL('..', import.meta.url));
const top = join(here, '../..');
/** The command. */
export const command = process.env.ENFILADE ?? join(top, 'target/release/enfilade');
const scenes = process.env.ENFILADE_SCENES ?? join(top, '../shared/scenes');
const target = process.env.CARGO_TARGET_DIR ?? join(top, 'target/abi');

/** Folder of the worlds. */
export const folder = join(here, 'dist/worlds');
const at = (name) => join(folder, name);
const run = (program, ...args) => execFileSync(program, args, { stdio: ['ignore', 'ignore', 'inherit'] });

/** Makes what is missing; returns the names of the worlds. */
export function worlds(views = 10_000) {
  mkdirSync(folder, { recursive: true });
  if (!existsSync(command)) throw new Error(`${command} is missing: cargo build --release, or set ENFILADE`);
  const env = { ...process.env, CARGO_TARGET_DIR: target };
  execFileSync('cargo', ['build', '--release', '--quiet', '--locked', '--bins'], { cwd: join(here, '../abi'), env, stdio: 'inherit' });
  const native = (name, ...args) => run(join(target, 'release', name), ...args);
  const bakes = { demo: () => bakeDemo() };
  const institute = join(scenes, 'institute/scene.glb');
  if (existsSync(institute)) bakes.institute = () => run(command, '-q', 'bake', institute, '-o', at('institute-0.glb'));
  for (const [name, bake] of Object.entries(bakes)) {
    if (!existsSync(at(`${name}.glb`))) {
      bake();
      run(command, '-q', 'pvs', at(`${name}-0.glb`), '--into', at(`${name}.glb`));
    }
    if (!existsSync(at(`${name}.enf`))) run(command, '-q', 'pack', at(`${name}.glb`), '-o', at(`${name}.enf`));
    if (!existsSync(at(`${name}.${views}.answers`))) native('oracle', at(`${name}.glb`), at(`${name}.${views}.answers`), `${views}`, '1');
  }
  if (bakes.institute && !existsSync(at('furnished.enf'))) {
    native('furnish', at('institute.glb'), at('furnished.glb'), '820000');
    run(command, '-q', 'pack', at('furnished.glb'), '-o', at('furnished.enf'));
  }
  return Object.keys(bakes);
}

function bakeDemo() {
  run(command, '-q', 'demo', '-o', at('demo'));
  run('cp', at('demo/world.glb'), at('demo-0.glb'));
}
