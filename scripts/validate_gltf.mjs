// Runs the Khronos glTF validator on files and prints what it finds.
//
//   npm install gltf-validator        (once, anywhere above this file, or in the current folder)
//   node scripts/validate_gltf.mjs [--strict] FILE...
//
// Exit 0: no errors; 1: errors (with --strict, warnings too); 2: wrong usage or no validator.
import { readFile } from 'node:fs/promises';
import { createRequire } from 'node:module';
import { join } from 'node:path';

function loadValidator() {
  for (const from of [import.meta.url, join(process.cwd(), 'here.js')]) {
    try {
      return createRequire(from)('gltf-validator');
    } catch (error) {
      if (error.code !== 'MODULE_NOT_FOUND') throw error;
    }
  }
  console.error('gltf-validator is not installed; run `npm install gltf-validator` here first');
  process.exit(2);
}

const args = process.argv.slice(2);
const isStrict = args.includes('--strict');
const files = args.filter((a) => a !== '--strict');
if (files.length === 0) {
  console.error('usage: node scripts/validate_gltf.mjs [--strict] FILE...');
  process.exit(2);
}
const validator = loadValidator();
const severities = ['error', 'warning', 'info', 'hint'];
let failed = false;
for (const file of files) {
  const report = await validator.validateBytes(new Uint8Array(await readFile(file)), {
    uri: file,
    maxIssues: 1000,
  });
  const { numErrors, numWarnings, numInfos, numHints, messages } = report.issues;
  console.log(`${file}: ${numErrors} errors, ${numWarnings} warnings, ${numInfos} infos, ${numHints} hints`);
  const seen = new Map();
  for (const { code, severity, pointer, message } of messages) {
    const entry = seen.get(code) ?? { severity, message, pointer, count: 0 };
    entry.count += 1;
    seen.set(code, entry);
  }
  for (const [code, { severity, message, pointer, count }] of seen) {
    console.log(`  ${severities[severity]} ${code} ×${count}, first at ${pointer ?? '(file)'}: ${message}`);
  }
  failed ||= numErrors > 0 || (isStrict && numWarnings > 0);
}
process.exit(failed ? 1 : 0);
