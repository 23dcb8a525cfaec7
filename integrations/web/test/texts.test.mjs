// Words of the page: the same in both languages, and a German sentence for each decision of the bake.
import assert from 'node:assert/strict';
import { readFileSync } from 'node:fs';
import { test } from 'node:test';
import { at } from './browser.mjs';

const { en, de } = JSON.parse(readFileSync(at('app/texts.json'), 'utf8'));

test('both languages have the same texts, with the same values', () => {
  assert.deepEqual(Object.keys(de).sort(), Object.keys(en).sort());
  const places = (text) => (text.match(/\{\w+\}/g) ?? []).sort();
  for (const [key, text] of Object.entries(en)) {
    if (typeof text === 'string') assert.deepEqual(places(de[key]), places(text), key);
  }
  assert.deepEqual(Object.keys(de.steps), Object.keys(en.steps));
});

test('each decision has a German sentence', () => {
  const source = readFileSync(at('../../crates/enfilade-cpg/src/why.rs'), 'utf8');
  const words = /fn words\(self\) -> &'static str \{([^]*?)\n    \}\n/.exec(source)[1];
  const decisions = [...words.matchAll(/=> (?:\{\s*)?"([^"]+)"/g)].map(([, text]) => text);
  assert.ok(decisions.length > 25, `${decisions.length} decisions`);
  const missing = decisions.filter((text) => !de.reasons.some(([pattern]) => new RegExp(pattern, 's').test(`${text} (share 0.5)`)));
  assert.deepEqual(missing, []);
});
