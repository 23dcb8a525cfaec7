// Buttons that lead to the storeys.
import type { Storey } from './made.js';

/** Buttons for storeys, the lowest first; none for a single one. */
export class StoreyButtons {
  private readonly buttons: HTMLButtonElement[] = [];

  constructor(
    parent: HTMLElement,
    private readonly storeys: Storey[],
    go: (storey: Storey) => void,
  ) {
    if (storeys.length < 2) return;
    for (const storey of storeys) {
      const button = document.createElement('button');
      button.textContent = storey.name;
      button.title = `Storey ${storey.name}`;
      button.addEventListener('click', () => {
        go(storey);
        // Keys belong to the walk.
        button.blur();
      });
      parent.append(button);
      this.buttons.push(button);
    }
  }

  /** Marks the storey on which an eye at this height is: the highest whose place is not above it by half a meter. */
  mark(y: number): void {
    const below = this.storeys.map((storey, i) => ({ i, height: storey.eye[1] })).filter(({ height }) => height < y + 0.5);
    const own = below.sort((a, b) => b.height - a.height)[0]?.i ?? 0;
    this.buttons.forEach((button, i) => button.setAttribute('aria-pressed', String(i === own)));
  }
}
