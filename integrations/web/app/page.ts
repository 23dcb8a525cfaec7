// Elements of the page.

/** Returns the element of an id. */
export function $<T extends Element = HTMLElement>(id: string): T {
  const found = document.getElementById(id);
  if (!found) throw new Error(`no element ${id}`);
  return found as unknown as T;
}

/** Makes an element with properties and children. */
export function make<K extends keyof HTMLElementTagNameMap>(
  tag: K,
  properties: Partial<HTMLElementTagNameMap[K]> = {},
  ...children: (Node | string)[]
): HTMLElementTagNameMap[K] {
  const element = Object.assign(document.createElement(tag), properties);
  element.append(...children);
  return element;
}

/** Shows some of the parts of the page, and hides the others. */
export function show(...ids: string[]): void {
  for (const id of ['start', 'work', 'failed', 'done', 'plan', 'model', 'told', 'results']) $(id).hidden = !ids.includes(id);
  // A model that is not cut has no choice of it.
  $('cut').hidden = !ids.includes('plan');
}

/** Ends a task: what the person does is heard before the next. */
export const pause = (): Promise<void> => new Promise((done) => setTimeout(done));
