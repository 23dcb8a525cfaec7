/** Components for React Three Fiber: a world that culls itself, whole or streamed. */
import { useFrame, useLoader, useThree, type ThreeEvent } from '@react-three/fiber';
import { createElement, useEffect, useMemo, useRef, useState, type ReactElement } from 'react';
import { GLTFLoader } from 'three/addons/loaders/GLTFLoader.js';
import { StreamedWorld, type StreamCounts, type StreamedOptions } from './stream.js';
import { cullerOf, enfilade, type PluginOptions, type PortalCuller } from './three.js';

/** What both components tell and accept. */
export interface WorldProps extends PluginOptions {
  /** Where the world is. */
  url: string;
  /** Told when the camera enters a cell; -1 for solid matter. */
  onCell?: (cell: number, culler: PortalCuller) => void;
  /** False to leave doors alone when they are clicked. */
  clickDoors?: boolean;
}

function useCulling(culler: PortalCuller | undefined, props: WorldProps, update: (now: number) => void): void {
  const cell = useRef(-2);
  useFrame((_, seconds) => {
    if (!culler) return;
    culler.animate(seconds);
    update(performance.now());
    if (culler.counts.cell === cell.current) return;
    cell.current = culler.counts.cell;
    props.onCell?.(cell.current, culler);
  });
}

function clicks(culler: PortalCuller, props: WorldProps): object {
  if (props.clickDoors === false) return {};
  const onClick = (event: ThreeEvent<MouseEvent>): void => {
    const hit = culler.pick(event.ray.origin, event.ray.direction, 10);
    if (!hit || hit.portal < 0) return;
    event.stopPropagation();
    culler.toggle(hit.portal);
  };
  return { onClick };
}

/** A world file: `<EnfiladeWorld url="world.glb" />`. Suspends while it loads. */
export function EnfiladeWorld(props: WorldProps): ReactElement {
  const { url, wasm, oneSided } = props;
  const gltf = useLoader(GLTFLoader, url, (loader) => {
    loader.register(enfilade({ ...(wasm === undefined ? {} : { wasm }), ...(oneSided === undefined ? {} : { oneSided }) }));
  });
  const culler = useMemo(() => cullerOf(gltf), [gltf]);
  const camera = useThree((state) => state.camera);
  useCulling(culler, props, () => culler.update(camera));
  return createElement('primitive', { object: gltf.scene, ...clicks(culler, props) });
}

/** What the streamed component accepts in addition. */
export interface StreamedProps extends WorldProps {
  stream?: StreamedOptions;
  /** Told every frame what is in memory and on its way. */
  onCounts?: (counts: StreamCounts) => void;
}

/** A packed world that comes piece by piece: `<StreamedEnfiladeWorld url="world.enf" />`. */
export function StreamedEnfiladeWorld(props: StreamedProps): ReactElement | null {
  const { url, stream, wasm } = props;
  const [streamed, setStreamed] = useState<StreamedWorld>();
  const camera = useThree((state) => state.camera);
  useEffect(() => {
    let opened: StreamedWorld | undefined;
    let isGone = false;
    void StreamedWorld.open(url, { ...stream, ...(wasm === undefined ? {} : { wasm }) }).then((world) => {
      opened = world;
      if (isGone) world.dispose();
      else setStreamed(world);
    });
    return () => {
      isGone = true;
      opened?.dispose();
      setStreamed(undefined);
    };
    // Options are those of the first render, as for loaders.
  }, [url]);
  useCulling(streamed?.culler, props, (now) => {
    const counts = streamed!.update(camera, now);
    props.onCounts?.(counts);
  });
  if (!streamed) return null;
  return createElement('primitive', { object: streamed.scene, ...clicks(streamed.culler, props) });
}
