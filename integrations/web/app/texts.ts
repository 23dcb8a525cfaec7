// All words of the page, in the language of the person.
import all from './texts.json' with { type: 'json' };

/** A language of the page. */
export type Language = keyof typeof all;

type Texts = (typeof all)['en'];
/** The name of a text. */
export type Key = { [K in keyof Texts]: Texts[K] extends string ? K : never }[keyof Texts];

let language: Language = navigator.languages.some((l) => l.startsWith('de')) && !navigator.language.startsWith('en') ? 'de' : 'en';

/** Returns the language of the page. */
export const currentLanguage = (): Language => language;

/** Returns a text, with values for its places in braces. */
export function text(key: Key, values: Record<string, string | number> = {}): string {
  return all[language][key].replace(/\{(\w+)\}/g, (_, name: string) => String(values[name] ?? ''));
}

/** Returns the name of a step of a bake. */
export function step(name: string): string {
  return (all[language].steps as Record<string, string>)[name] ?? name;
}

/** Returns a reason of the bake in the language of the page, and the language in which it is. */
export function reason(said: string): { said: string; in: Language } {
  for (const [pattern, own] of all[language].reasons as [string, string][]) {
    const found = new RegExp(pattern, 's').exec(said);
    if (found) return { said: own.replace(/\$(\d)/g, (_, n: string) => found[Number(n)] ?? ''), in: language };
  }
  return { said, in: 'en' };
}

const formats = new Map<string, Intl.NumberFormat>();

/** Returns a number with digits behind the point, as people write it. */
export function number(value: number, digits: number): string {
  // Making a format takes long, the first one most.
  const key = `${language}${digits}`;
  const known = formats.get(key) ?? new Intl.NumberFormat(language, { minimumFractionDigits: digits, maximumFractionDigits: digits });
  formats.set(key, known);
  return known.format(value);
}

/** Returns an area with its unit. */
export const squareMeters = (value: number): string => `${number(value, 1)} m²`;
/** Returns a length with its unit. */
export const meters = (value: number): string => `${number(value, 2)} m`;

/** Speaks another language, in all marked elements, too. */
export function speak(next: Language): void {
  language = next;
  for (const digits of [0, 1, 2]) number(0, digits);
  document.documentElement.lang = next;
  document.title = `enfilade · ${text('tagline')}`;
  for (const element of document.querySelectorAll<HTMLElement>('[data-text]')) element.textContent = text(element.dataset.text as Key);
  for (const element of document.querySelectorAll<HTMLElement>('[data-label]')) element.setAttribute('aria-label', text(element.dataset.label as Key));
  for (const button of document.querySelectorAll<HTMLElement>('[data-language]')) {
    button.setAttribute('aria-pressed', String(button.dataset.language === next));
  }
}
