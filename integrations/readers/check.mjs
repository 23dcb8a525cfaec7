// Compares the readers beside this file with `enfilade export` and `enfilade locate`:
//
//     node check.mjs ENFILADE WORLD.glb...
//
// Prints a line of JSON for each reader and world; fails if a graph or an answer differs. It needs g++ with
// nlohmann-json3-dev, mono-mcs with libnewtonsoft-json5.0-cil, and godot3-server.
import { execFileSync } from 'node:child_process';
import { copyFileSync, mkdirSync, mkdtempSync, readFileSync, rmSync, writeFileSync } from 'node:fs';
import { tmpdir } from 'node:os';
import { basename, dirname, join } from 'node:path';
import { fileURLToPath } from 'node:url';

const HERE = dirname(fileURLToPath(import.meta.url));
const N_POINTS = 2000;
const MIB_256 = 2 ** 28;
const NEWTONSOFT = '/usr/lib/cli/Newtonsoft.Json-5.0/Newtonsoft.Json.dll';

// Names in Godot 4, and what Godot 3 calls the same; without the last, both do.
const GODOT_3 = [
  ['class_name EnfiladeWorld\n', ''],
  ['extends RefCounted', 'extends Reference'],
  ['FileAccess.get_file_as_bytes(path)', '_read(path)'],
  ['JSON.parse_string(', 'parse_json('],
];
const READ_3 = `

func _read(path):
	var file = File.new()
	file.open(path, File.READ)
	return file.get_buffer(file.get_len())
`;

const run = (program, args, options = {}) =>
  execFileSync(program, args, { maxBuffer: MIB_256, encoding: 'utf8', stdio: ['pipe', 'pipe', 'inherit'], ...options });

/// Builds the reader of each language in a folder; returns name → function (world, points) → text.
function readers(folder) {
  const exe = join(folder, 'dump.exe');
  const cs = ['EnfiladeWorld.cs', 'Program.cs'].map((name) => join(HERE, 'csharp', name));
  run('mcs', ['-nologo', '-warnaserror', `-r:${NEWTONSOFT}`, `-out:${exe}`, ...cs]);
  const cpp = join(folder, 'dump');
  run('g++', ['-std=c++17', '-O1', '-Wall', '-Wextra', '-Werror', '-o', cpp, join(HERE, 'cpp', 'dump.cpp')]);
  const godot = join(folder, 'godot');
  mkdirSync(godot);
  writeFileSync(join(godot, 'project.godot'), 'config_version=4\n');
  let reader = readFileSync(join(HERE, 'godot', 'enfilade_world.gd'), 'utf8');
  for (const [four, three] of GODOT_3) {
    if (!reader.includes(four)) throw new Error(`the reader for Godot has no '${four.trim()}': change GODOT_3, too`);
    reader = reader.replace(four, three);
  }
  writeFileSync(join(godot, 'reader.gd'), reader + READ_3);
  copyFileSync(join(HERE, 'godot', 'dump.gd'), join(godot, 'dump.gd'));
  return {
    'C#': (world, points) => run('mono', [exe, world, points], { env: { ...process.env, MONO_PATH: dirname(NEWTONSOFT) } }),
    'C++': (world, points) => run(cpp, [world, points]),
    Godot: (world, points) => {
      copyFileSync(world, join(godot, 'world.glb'));
      copyFileSync(points, join(godot, 'points.txt'));
      return run('godot3-server', ['--no-window', '--path', godot, '-s', 'dump.gd'], { env: { ...process.env, LANG: 'en_US' } });
    },
  };
}

/// Returns the lines that a reader should print, from the graph that the command exports.
function expected(graph, cells) {
  const lines = [];
  const all = graph.cells.map((c) => c.id);
  for (const cell of graph.cells) {
    lines.push(`cell ${[cell.kind, ...cell.portals].join(' ')}`);
    lines.push(`sees ${(graph.visible?.[cell.id] ?? all).join(' ')}`);
  }
  for (const portal of graph.portals) {
    lines.push(`portal ${[portal.kind, ...portal.cells].join(' ')}`);
    for (const polygon of [portal.outline, ...portal.pieces]) lines.push(`polygon ${polygon.flat().join(' ')}`);
  }
  return [...lines, ...cells.map((c) => `at ${c === '-' ? -1 : c}`)];
}

/// Points in and around the model, on a grid of 1/256 m so that `f32` holds them, none of them random.
function points(graph) {
  const round = (v) => Math.round(v * 256) / 256;
  const boxes = graph.cells.map((c) => c.aabb);
  const [low, high] = [0, 1].map((side) => [0, 1, 2].map((k) => Math[side ? 'max' : 'min'](...boxes.map((b) => b[side][k]))));
  const spread = Array.from({ length: N_POINTS }, (_, i) =>
    [0.754877666, 0.569840291, 0.437016].map((step, k) => low[k] - 1 + ((i * step) % 1) * (high[k] - low[k] + 2)));
  const beside = graph.portals.flatMap((p) => [-0.06, 0.06].map((d) => p.center.map((v, k) => v + d * p.normal[k])));
  return [...spread, ...beside].map((p) => p.map(round));
}

/// Lines are the same if words are, and numbers as `f32` are.
function isSame(a, b) {
  if (a === b) return true;
  const [x, y] = [a, b].map((line) => line.trim().split(/\s+/));
  return x.length === y.length && x.every((word, i) => word === y[i] || Math.abs(word - y[i]) <= 1e-6 * Math.max(1, Math.abs(y[i])));
}

function main([enfilade, ...worlds]) {
  if (!worlds.length) throw new Error('usage: node check.mjs ENFILADE WORLD.glb...');
  const folder = mkdtempSync(join(tmpdir(), 'enfilade-readers-'));
  try {
    const programs = readers(folder);
    let ok = true;
    for (const world of worlds) {
      const graph = JSON.parse(run(enfilade, ['export', world, '-o', '-'], { stdio: ['pipe', 'pipe', 'ignore'] }));
      const text = points(graph).map((p) => p.join(' ')).join('\n') + '\n';
      const file = join(folder, 'points.txt');
      writeFileSync(file, text);
      const answer = run(enfilade, ['locate', world], { input: text }).trim().split('\n');
      const right = expected(graph, answer);
      for (const [name, program] of Object.entries(programs)) {
        const words = /^(cell|sees|portal|polygon|at)\b/;
        const lines = program(world, file).split('\n').filter((line) => words.test(line));
        const wrong = right.filter((line, i) => !isSame(lines[i] ?? '', line));
        const value = wrong.length + Math.abs(lines.length - right.length);
        ok &&= value === 0;
        if (value) console.error(`${name}, ${world}: ${lines.length} lines of ${right.length}; the first that differs: ${wrong[0]}`);
        const scene = basename(world, '.glb');
        console.log(JSON.stringify({ row: `readers: ${name}`, scene, value, bar: 0, of: right.length, ok: value === 0 }));
      }
    }
    process.exitCode = ok ? 0 : 1;
  } finally {
    rmSync(folder, { recursive: true });
  }
}

main(process.argv.slice(2));
