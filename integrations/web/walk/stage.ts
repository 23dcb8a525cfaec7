// The scene, its lights, the camera and the canvas.
import {
  AmbientLight,
  DataTexture,
  DirectionalLight,
  EquirectangularReflectionMapping,
  FloatType,
  HemisphereLight,
  LinearFilter,
  PerspectiveCamera,
  Scene,
  ShaderChunk,
  WebGLRenderer,
} from 'three';

// There is nothing for metals to mirror: they would be black, as would all that an exporter left at glTF's default, a metal.
ShaderChunk.metalnessmap_fragment += '\nmetalnessFactor = 0.0;';

// Panes show what is behind them, with a faint color of their own and a reflection of the sky, stronger the more obliquely one
// looks (Schlick, 1994); as the command draws them. What has a picture is cloth or leaves instead.
ShaderChunk.opaque_fragment += `
#if defined(STANDARD) && !defined(OPAQUE) && !defined(USE_MAP)
  float paneFacing = abs(dot(normalize(normal), normalize(vViewPosition)));
  float paneMirror = 0.08 + 0.92 * pow(1.0 - paneFacing, 5.0);
  float paneAlpha = 0.6 * diffuseColor.a;
  float paneSum = paneAlpha + (1.0 - paneAlpha) * paneMirror;
  vec3 paneColor = outgoingLight * paneAlpha * (1.0 - paneMirror) + vec3(0.80, 0.85, 0.91) * paneMirror;
  gl_FragColor = vec4(paneColor / paneSum, paneSum);
#endif`;

/** Haze at the horizon, the sky above it, and land below. Linear. */
const [HAZE, SKY, LAND] = [
  [0.8, 0.85, 0.91],
  [0.3, 0.48, 0.78],
  [0.4, 0.47, 0.33],
] as const;

/** Returns the sky and open land up to the horizon, seen through windows. */
function surroundings(): DataTexture {
  const rows = 256;
  const texels = new Float32Array(4 * rows);
  for (let row = 0; row < rows; row++) {
    const up = Math.sin(Math.PI * ((row + 0.5) / rows - 0.5));
    const [far, share] = up < 0 ? [LAND, Math.sqrt(Math.min(1, -up / 0.25))] : [SKY, Math.sqrt(up)];
    HAZE.forEach((haze, k) => (texels[4 * row + k] = haze + (far[k]! - haze) * share));
    texels[4 * row + 3] = 1;
  }
  const texture = new DataTexture(texels, 1, rows, undefined, FloatType, EquirectangularReflectionMapping);
  texture.magFilter = texture.minFilter = LinearFilter;
  texture.needsUpdate = true;
  return texture;
}

/** All that is drawn, and what draws it. */
export class Stage {
  readonly scene = new Scene();
  readonly camera = new PerspectiveCamera(70, 1, 0.05, 500);
  readonly renderer = new WebGLRenderer({ antialias: true });

  /** The pose that was drawn last. */
  private drawn = '';

  constructor() {
    const { scene, camera, renderer } = this;
    scene.background = surroundings();
    scene.add(new HemisphereLight(0xffffff, 0x8a7f72, 1.6), new AmbientLight(0xffffff, 0.4));
    const lamp = new DirectionalLight(0xffffff, 1.1);
    camera.add(lamp);
    lamp.position.set(0.3, 0.6, 1);
    scene.add(camera);
    document.body.prepend(renderer.domElement);
    const resize = (): void => {
      renderer.setPixelRatio(Math.min(2, devicePixelRatio));
      renderer.setSize(innerWidth, innerHeight);
      camera.aspect = innerWidth / innerHeight;
      camera.updateProjectionMatrix();
    };
    addEventListener('resize', resize);
    resize();
  }

  /** Places the camera. */
  aim(eye: readonly [number, number, number], yaw: number, pitch: number): void {
    this.camera.position.set(...eye);
    this.camera.rotation.set(pitch, yaw, 0, 'YXZ');
  }

  /** Draws what does not move by itself: the same picture again would take time from what is on its way. */
  drawIfMoved(): void {
    const { position, rotation } = this.camera;
    const pose = [...position, ...rotation, innerWidth, innerHeight].join();
    if (pose !== this.drawn) this.renderer.render(this.scene, this.camera);
    this.drawn = pose;
  }
}
