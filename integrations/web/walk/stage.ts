// The scene, its lights, the camera and the canvas.
import { AmbientLight, Color, DirectionalLight, HemisphereLight, PerspectiveCamera, Scene, ShaderChunk, WebGLRenderer } from 'three';

// There is nothing for metals to mirror: they would be black, as would all that an exporter left at glTF's default, a metal.
ShaderChunk.metalnessmap_fragment += '\nmetalnessFactor = 0.0;';

/** All that is drawn, and what draws it. */
export class Stage {
  readonly scene = new Scene();
  readonly camera = new PerspectiveCamera(70, 1, 0.05, 500);
  readonly renderer = new WebGLRenderer({ antialias: true });

  /** The pose that was drawn last. */
  private drawn = '';

  constructor() {
    const { scene, camera, renderer } = this;
    scene.background = new Color(0xcfd6dd);
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
