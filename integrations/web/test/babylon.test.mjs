// Covers R1 in Babylon.js: what is shown is what is seen.
import assert from 'node:assert/strict';
import { readFileSync } from 'node:fs';
import { test } from 'node:test';
import { NullEngine } from '@babylonjs/core/Engines/nullEngine.js';
import { Scene } from '@babylonjs/core/scene.js';
import { LoadAssetContainerAsync } from '@babylonjs/core/Loading/sceneLoader.js';
import { FreeCamera } from '@babylonjs/core/Cameras/freeCamera.js';
import { Vector3 } from '@babylonjs/core/Maths/math.vector.js';
import '@babylonjs/core/Materials/standardMaterial.js';
import '@babylonjs/loaders/glTF/2.0/glTFLoader.js';
import '@babylonjs/loaders/glTF/glTFFileLoader.js';
import { BabylonCuller } from '../dist/babylon.js';
import { World } from '../dist/index.js';
import { folder, worlds } from '../scripts/worlds.mjs';

worlds();

for (const isRight of [false, true]) {
  test(`the meshes shown are those of the view, in a ${isRight ? 'right' : 'left'}-handed scene`, async () => {
    const glb = new Uint8Array(readFileSync(`${folder}/demo.glb`));
    const engine = new NullEngine({ renderWidth: 320, renderHeight: 200, textureSize: 64 });
    const scene = new Scene(engine);
    scene.useRightHandedSystem = isRight;
    const container = await LoadAssetContainerAsync(glb, scene, { pluginExtension: '.glb' });
    container.addAllToScene();
    const culler = await BabylonCuller.of(glb, container);
    const eye = [2, 1.6, 2];
    const x = isRight ? 1 : -1;
    const camera = new FreeCamera('eye', new Vector3(x * eye[0], eye[1], eye[2]), scene);
    camera.minZ = 0.05;
    camera.setTarget(new Vector3(x * (eye[0] + 1), eye[1], eye[2] + 0.2));
    const seen = culler.update(camera);
    const world = await World.open(glb);
    assert.equal(seen.eyeCell, world.locate(eye));
    const nodes = [...container.meshes, ...container.transformNodes];
    const shown = nodes.filter((node) => node.isVisible && node.isEnabled() && node.getTotalVertices?.() > 0);
    const all = nodes.filter((node) => node.getTotalVertices?.() > 0);
    assert.ok(shown.length > 3 && shown.length * 2 < all.length, `${shown.length} of ${all.length}`);
    // The same view, given to the run-time by numbers alone.
    const ahead = [1, 0, 0.2].map((v) => v / Math.hypot(1, 0.2));
    assert.ok(culler.pick(camera.position, camera.getTarget().subtract(camera.position), 50));
    const hit = world.pick(eye, eye.map((v, k) => v + 50 * ahead[k]));
    const own = culler.pick(camera.position, camera.getTarget().subtract(camera.position), 50);
    assert.deepEqual([own.target, own.index], [hit.target, hit.index]);
    world.close();
    scene.dispose();
    engine.dispose();
  });
}
