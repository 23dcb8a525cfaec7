// Files that are dropped or chosen, with those in dropped folders.

/** A file with its path below what was dropped. */
export interface Given {
  name: string;
  bytes: Blob;
}

const READ = /\.(ifc|gbxml|xml|hbjson|glb|gltf|obj|ply|stl|map|vox|nii|nrrd|e57|las|laz|tiff?|bin|mtl|png|jpe?g|webp|ktx2|bmp|tga|gif|avif|dds|wad)$/i;
const SCENE = /\.(ifc|gbxml|xml|hbjson|glb|gltf|obj|ply|stl|map|vox|nii|nrrd|e57|las|laz|tiff?)$/i;

/** Returns the files that can be read, and the settings among them; `undefined` if there is no scene. */
export function sorted(files: Given[]): { scenes: Given[]; settings?: Blob; name: string } | undefined {
  const read = files.filter(({ name }) => READ.test(name));
  // Beside a model, they are its pictures, which are not read.
  const isHeights = ({ name }: Given): boolean => /\.tiff?$/i.test(name);
  const hasModel = read.some((file) => SCENE.test(file.name) && !isHeights(file));
  const scenes = read.filter((file) => !hasModel || !isHeights(file));
  const first = scenes.find(({ name }) => SCENE.test(name));
  if (!first) return undefined;
  const settings = files.find(({ name }) => /\.toml$/i.test(name))?.bytes;
  const n = scenes.filter(({ name }) => SCENE.test(name)).length;
  const name = first.name.split('/').pop()!;
  return { scenes, settings, name: n > 1 ? `${name} + ${n - 1}` : name };
}

/** Returns `true` if there are files that must be unpacked. */
export const arePacked = (files: Given[]): boolean => files.some(({ name }) => /\.(ifczip|zip|7z|gz)$/i.test(name));

/** Returns all files of a list. */
export const listed = (files: FileList): Given[] => [...files].map((file) => ({ name: file.webkitRelativePath || file.name, bytes: file }));

/** Most files of a dropped folder. */
const MOST = 5000;

/** Returns all dropped files, those in folders, too. */
export async function dropped(transfer: DataTransfer): Promise<Given[]> {
  const entries = [...transfer.items].map((item) => item.webkitGetAsEntry?.()).filter((entry) => entry !== null && entry !== undefined);
  if (entries.length === 0) return listed(transfer.files);
  const found: Given[] = [];
  const walk = async (entry: FileSystemEntry): Promise<void> => {
    if (found.length >= MOST) return;
    if (entry.isFile) {
      const file = await new Promise<File>((done, fail) => (entry as FileSystemFileEntry).file(done, fail));
      found.push({ name: entry.fullPath.replace(/^\//, ''), bytes: file });
      return;
    }
    const reader = (entry as FileSystemDirectoryEntry).createReader();
    for (;;) {
      const some = await new Promise<FileSystemEntry[]>((done, fail) => reader.readEntries(done, fail));
      if (some.length === 0) return;
      for (const inner of some) await walk(inner);
    }
  };
  for (const entry of entries) await walk(entry);
  return found;
}
