// The page of `enfilade report`, as it stands in a browser on a telephone and on a desk: scale, letters, width.
import assert from 'node:assert/strict';
import { execFileSync } from 'node:child_process';
import { test } from 'node:test';
import { command, folder, worlds } from '../scripts/worlds.mjs';
import { browser } from './browser.mjs';
import { serve } from './server.mjs';

/** Widths of a telephone and of a window on a desk. [Units: pixels] */
const WIDTHS = [390, 1280];
/** Smallest letters that count as legible. Layouts round to 1/64 of a pixel. [Units: pixels] */
const LETTERS = 11 - 1 / 64;

/** Runs in the page: what a reader with a ruler finds. */
function measured() {
  const shown = (e) => e.getClientRects().length > 0 && e.checkVisibility();
  const placed = (e) => {
    const [box, at] = [e.getBBox(), e.getScreenCTM()];
    const corner = (x, y) => [at.a * x + at.c * y + at.e, at.b * x + at.d * y + at.f];
    return [corner(box.x, box.y), corner(box.x + box.width, box.y + box.height)];
  };
  const letters = [];
  const walk = document.createTreeWalker(document.body, NodeFilter.SHOW_TEXT);
  for (let node = walk.nextNode(); node; node = walk.nextNode()) {
    const e = node.parentElement;
    if (node.textContent.trim() === '' || !shown(e) || e.closest('script, style, title')) continue;
    const at = e instanceof SVGElement ? e.getScreenCTM() : undefined;
    const size = parseFloat(getComputedStyle(e).fontSize) * (at ? Math.hypot(at.a, at.b) : 1);
    letters.push({ size, text: node.textContent.trim().slice(0, 40) });
  }
  const plans = [...document.querySelectorAll('.drawing:not(.legend) > svg')].filter(shown).map((svg) => {
    const bars = [...svg.querySelectorAll('.bar, .gap')].map(placed);
    const bar = Math.max(...bars.map((b) => b[1][0])) - Math.min(...bars.map((b) => b[0][0]));
    const words = [...svg.querySelectorAll('text')].map((e) => /^([\d.]+) m$/.exec(e.textContent)?.[1]);
    const meters = Number(words.find((length) => length !== undefined));
    const marks = [...svg.querySelectorAll('path.door, path.window, path.open')];
    const openings = marks.map((e) => {
      const [a, b] = placed(e);
      return { id: Number(/portal-(\d+)/.exec(e.textContent)[1]), at: [(a[0] + b[0]) / 2, (a[1] + b[1]) / 2] };
    });
    return { bar, meters, openings };
  });
  return { letters, plans, width: document.scrollingElement.scrollWidth, window: innerWidth };
}

/** The two openings of a plan that are farthest apart: their distance on the screen and in the world. */
function farthest(openings, portals) {
  const middle = (id) => [0, 2].map((k) => {
    const all = portals[id].outline.map((p) => p[k]);
    return (Math.min(...all) + Math.max(...all)) / 2;
  });
  const pairs = openings.flatMap((a, i) => openings.slice(i + 1).map((b) => {
    const [p, q] = [middle(a.id), middle(b.id)];
    return { meters: Math.hypot(p[0] - q[0], p[1] - q[1]), pixels: Math.hypot(a.at[0] - b.at[0], a.at[1] - b.at[1]) };
  }));
  return pairs.reduce((most, pair) => (pair.meters > most.meters ? pair : most), { meters: 0, pixels: 0 });
}

// Only openings of one piece are drawn from end to end.
const whole = (portals) => (opening) => portals[opening.id].pieces === 1;

const names = worlds();
for (const name of names) {
  const page = `${name}-report.html`;
  execFileSync(command, ['-q', 'report', `${folder}/${name}.glb`, '-o', `${folder}/${page}`, '--no-pictures', '--views', '2']);
  const { portals } = JSON.parse(execFileSync(command, ['inspect', `${folder}/${name}.glb`, '--json'], { maxBuffer: 1 << 28 }));
  for (const width of WIDTHS) {
    test(`the report of ${name} at ${width} pixels: a true scale, legible letters, nothing beyond the window`, async () => {
      const server = await serve({ worlds: folder });
      const own = await browser();
      try {
        const tab = await own.newPage({ viewport: { width, height: 900 } });
        await tab.goto(`${server.address}/worlds/${page}`);
        for (const isOpen of [false, true]) {
          await tab.evaluate((isOpen) => document.querySelectorAll('details').forEach((e) => (e.open = isOpen)), isOpen);
          const found = await tab.evaluate(measured);
          assert.ok(found.letters.length > 20 && found.plans.length > 0, JSON.stringify(found));
          const small = found.letters.filter((label) => label.size < LETTERS);
          assert.deepEqual(small.slice(0, 5), [], `${small.length} small labels, ${isOpen ? 'unfolded' : 'folded'}`);
          assert.ok(found.width <= found.window, `${found.width} pixels wide`);
          let n = 0;
          for (const { bar, meters, openings } of found.plans) {
            const known = farthest(openings.filter(whole(portals)), portals);
            if (known.meters < 3) continue;
            n += 1;
            const wrong = (bar / meters) / (known.pixels / known.meters) - 1;
            assert.ok(Math.abs(wrong) < 0.01, `${bar} pixels for ${meters} m, ${known.pixels} for ${known.meters} m`);
          }
          assert.ok(n > 0, 'no plan with two openings');
        }
      } finally {
        await own.close();
        server.close();
      }
    });
  }
}
