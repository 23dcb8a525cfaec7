// The walk through the baked world, in a frame over the page. Its parts are fetched with the page and put into the frame with
// the world, so that it needs no network.
import { make } from './page.js';
import { text } from './texts.js';

const PARTS = ['walk-code.bin', 'walk-module.bin'];

/** The walk. */
export class Walk {
  private readonly parts: Promise<[page: string, ...parts: string[]]>;

  /** `fetched` gets a file of the page. */
  constructor(fetched: (name: string) => Promise<Blob>) {
    const page = fetched('walk/index.html').then((found) => found.text());
    const inside = async (name: string): Promise<string> => `<script id="${name}" type="text/plain">${await base64(await fetched(`walk/${name}`))}</script>\n`;
    this.parts = Promise.all([page, ...PARTS.map(inside)]) as Promise<[string, ...string[]]>;
    this.parts.catch(() => undefined);
  }

  /** Opens the walk through a world; resolves when it is closed. */
  async open(world: Uint8Array<ArrayBuffer>, title: string): Promise<void> {
    const [page, ...parts] = await this.parts;
    // The ending tells the walk what it is.
    const address = `${URL.createObjectURL(new Blob([world], { type: 'model/gltf-binary' }))}#world.glb`;
    const made = JSON.stringify({ page: { world: address, title, storeys: [] }, hasFirst: false });
    const quoted = made.replaceAll('&', '&amp;').replaceAll('"', '&quot;');
    const whole = page.replace('data-walk=""', () => `data-walk="${quoted}"`).replace('<!--parts-->', () => parts.join(''));
    const frame = make('iframe', { title: text('walk'), srcdoc: whole, allow: 'pointer-lock; fullscreen' });
    const close = make('button', { type: 'button' }, text('closeWalk'));
    const dialog = make('dialog', { className: 'walk' }, frame, close);
    document.body.append(dialog);
    dialog.showModal();
    frame.addEventListener('load', () => frame.contentWindow?.focus());
    await new Promise<void>((closed) => {
      dialog.addEventListener('close', () => closed());
      close.addEventListener('click', () => dialog.close());
    });
    dialog.remove();
    URL.revokeObjectURL(address.split('#')[0]!);
  }
}

/** Returns bytes as text that a page can have inside. */
function base64(bytes: Blob): Promise<string> {
  return new Promise((done, fail) => {
    const reader = new FileReader();
    reader.onload = () => done((reader.result as string).replace(/^[^,]*,/, ''));
    reader.onerror = () => fail(reader.error!);
    reader.readAsDataURL(bytes);
  });
}
