// The package as who installs it gets it: from its tarball, in an empty project.
import assert from 'node:assert/strict';
import { execFileSync } from 'node:child_process';
import { copyFileSync, mkdtempSync, readFileSync, rmSync, writeFileSync } from 'node:fs';
import { tmpdir } from 'node:os';
import { join } from 'node:path';
import { test } from 'node:test';
import { folder, worlds } from '../scripts/worlds.mjs';

const PROGRAM = `
import { World } from 'enfilade';
import { readFileSync } from 'node:fs';
const world = await World.open(readFileSync('world.glb'));
console.log(JSON.stringify({ cells: world.cells.length, at: world.locate([2, 1, 2]) }));
`;

test('the tarball works in an empty project, has the licenses, and gives the packager nothing to warn of', () => {
  worlds();
  const dir = mkdtempSync(join(tmpdir(), 'enfilade-'));
  try {
    const said = execFileSync('npm', ['pack', '--json', '--pack-destination', dir], { encoding: 'utf8', stdio: 'pipe' });
    const [{ filename, files }] = JSON.parse(said);
    const names = files.map(({ path }) => path);
    for (const name of ['LICENSE-APACHE', 'LICENSE-MIT', 'README.md', 'dist/index.js', 'dist/index.d.ts', 'dist/enfilade.wasm', 'dist/enfilade-bake.wasm']) {
      assert.ok(names.includes(name), name);
    }
    // Neither worlds of tests nor the page of the walk, which the command has.
    assert.ok(names.every((name) => /^(dist\/[^/]+\.(d\.ts|js|wasm)|package\.json|README\.md|LICENSE-\w+)$/.test(name)), names.join());
    writeFileSync(join(dir, 'package.json'), '{"type":"module"}');
    writeFileSync(join(dir, 'main.mjs'), PROGRAM);
    copyFileSync(`${folder}/demo.glb`, join(dir, 'world.glb'));
    const install = ['install', '--offline', '--no-audit', '--no-fund', `./${filename}`];
    execFileSync('npm', install, { cwd: dir, stdio: 'pipe' });
    const { cells, at } = JSON.parse(execFileSync('node', ['main.mjs'], { cwd: dir, encoding: 'utf8' }));
    assert.equal(cells, 13);
    assert.ok(at >= 0);
    copyFileSync(`${folder}/demo/house.glb`, join(dir, 'house.glb'));
    const npx = ['--offline', 'enfilade', 'bake', 'house.glb', '-o', 'w.glb', '--plan', 'plan.svg', '-q'];
    execFileSync('npx', npx, { cwd: dir, stdio: 'pipe' });
    assert.ok(readFileSync(join(dir, 'w.glb')).equals(readFileSync(`${folder}/demo-0.glb`)), 'npx bakes other bytes');
  } finally {
    rmSync(dir, { recursive: true });
  }
});
