// Covers W2: packed worlds from servers with and without ranges, as a folder and as one file.
import assert from 'node:assert/strict';
import { execFileSync } from 'node:child_process';
import { readFileSync } from 'node:fs';
import { test } from 'node:test';
import { decodePiece, PackedPlace } from '../dist/packed.js';
import { command, folder, worlds } from '../scripts/worlds.mjs';
import { serve } from './server.mjs';

worlds();
execFileSync(command, ['-q', 'pack', '--one-file', `${folder}/demo.glb`, '-o', `${folder}/demo-one.enf`]);
const body = readFileSync(`${folder}/demo.enf/pieces.enfp`);

for (const name of ['demo.enf', 'demo-one.enf']) {
  for (const ranges of [true, false]) {
    test(`${name}, from a server ${ranges ? 'with' : 'without'} ranges: pieces are those on disk, and nothing comes twice`, async () => {
      const server = await serve({ worlds: folder }, { ranges });
      try {
        const place = await PackedPlace.open(`${server.address}/worlds/${name}?signed=1`);
        const { pieces } = place.head;
        const laid = [...pieces.keys()].sort((a, b) => pieces[a][0] - pieces[b][0]);
        assert.notDeepEqual(laid, [...pieces.keys()]);
        const asked = [laid.slice(0, 3), [laid[5]], [laid.at(-1)]];
        const answers = await Promise.all(asked.map((own) => place.fetch(own)));
        const all = asked.flatMap((own, k) => own.map((piece, i) => [piece, answers[k][i]]));
        for (const [piece, bytes] of all) {
          const [offset, packed, unpacked] = pieces[piece];
          assert.deepEqual(Buffer.from(bytes), body.subarray(offset, offset + packed));
          assert.ok(Array.isArray(decodePiece(bytes, unpacked).json.ranges));
        }
        const wanted = all.reduce((sum, [, bytes]) => sum + bytes.length, 0) + place.head.bytes;
        const most = ranges ? Math.max(wanted, 65_536 + wanted - place.head.bytes) : body.length + place.head.bytes;
        assert.ok(server.counts.bytes <= most, `${server.counts.bytes} bytes for ${wanted}`);
        assert.equal(place.received, server.counts.bytes);
      } finally {
        server.close();
      }
    });
  }
}

test('what is not a packed world is an error that says so', async () => {
  const server = await serve({ worlds: folder });
  await assert.rejects(PackedPlace.open(`${server.address}/worlds/demo.glb`), /not a packed world/);
  await assert.rejects(PackedPlace.open(`${server.address}/worlds/absent.enf`), /404/);
  server.close();
});
