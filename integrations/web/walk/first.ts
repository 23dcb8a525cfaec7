// The first picture: a small model of what is seen from the beginning, drawn before the world has come.
import { decompress } from 'fzstd';
import type { Group, Mesh } from 'three';
import { GLTFLoader } from 'three/addons/loaders/GLTFLoader.js';
import { drawBothSides } from '../src/three.js';
import { glaze } from './glass.js';
import type { Stage } from './stage.js';

/** The model, and the place from which it was made. */
export interface FirstPicture {
  model: Group;
  eye: [number, number, number];
  yaw: number;
}

/** Shows the model; returns undefined if the page has none. */
export async function showFirst(stage: Stage, packed: Promise<Uint8Array> | undefined): Promise<FirstPicture | undefined> {
  if (!packed) return undefined;
  // It may lie in a larger buffer.
  const bytes = decompress(await packed);
  const { scene: model } = await new GLTFLoader().parseAsync(bytes.slice().buffer as ArrayBuffer, '');
  const { eye, yaw } = model.userData as FirstPicture;
  drawBothSides(model);
  glaze(model);
  stage.scene.add(model);
  return { model, eye, yaw };
}

/** Takes the model away. */
export function removeFirst({ model }: FirstPicture): void {
  model.removeFromParent();
  model.traverse((object) => (object as Mesh).geometry?.dispose());
}
