/** Rooms, doorways, and what is visible through them. */
export { World } from './world.js';
export type { Cell, CellKind, Hit, Leaf, Portal, PortalKind, Room, Seen } from './world.js';
export { Runtime, type WasmSource } from './wasm.js';
export { EXTENSION, extensionOf, takeApart, type GltfJson, type WorldExtension } from './glb.js';
