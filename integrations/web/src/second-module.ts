/** Files for which the second module is needed: it has more readers, and is larger. */
import type { ModuleFile } from './bake-module.js';

const latin = new TextDecoder('latin1');
const DRACO = 'KHR_draco_mesh_compression';

/** Returns `true` for scans in E57, LAS and LAZ, for energy models, for TIFF, and for glTF that is compressed by Draco. */
export function needsSecond({ name, bytes }: Pick<ModuleFile, 'name' | 'bytes'>): boolean {
  const head = latin.decode(bytes.subarray(0, 8));
  if (/^(ASTM-E57|LASF|II[*+]\0|MM\0[*+])/.test(head)) return true;
  if (/\.(gbxml|hbjson)$/i.test(name) || (/\.xml$/i.test(name) && !head.startsWith('glTF'))) return true;
  if (/\.gltf$/i.test(name)) return latin.decode(bytes).includes(DRACO);
  if (!head.startsWith('glTF') || bytes.length < 20) return false;
  const n = new DataView(bytes.buffer, bytes.byteOffset).getUint32(12, true);
  return latin.decode(bytes.subarray(20, 20 + n)).includes(DRACO);
}
