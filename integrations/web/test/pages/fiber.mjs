// A world in React Three Fiber.
import { Canvas } from '@react-three/fiber';
import { createElement, Suspense } from 'react';
import { createRoot } from 'react-dom/client';
import { EnfiladeWorld } from '../../dist/fiber.js';

const onCell = (cell, culler) => Object.assign(globalThis, { entered: cell, culler });
const world = createElement(EnfiladeWorld, { url: '/worlds/demo.glb', wasm: '/web/dist/enfilade.wasm', onCell });
const place = document.createElement('div');
place.style = 'width: 320px; height: 200px';
document.body.append(place);
const camera = { position: [2, 1.6, 2], near: 0.05 };
createRoot(place).render(createElement(Canvas, { camera }, createElement(Suspense, { fallback: null }, world)));
