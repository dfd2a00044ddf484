// luxel-three: baked light for three.js. `const room = await loadLuxel(renderer, 'room.baked/')`.
import type { Camera, Color, ColorRepresentation, Light, Mesh, Scene, WebGLRenderer } from 'three';
import type { GLTFLoader } from 'three/addons/loaders/GLTFLoader.js';

/** How the sum of layers is made. `cpu`: composed in WebAssembly when colours change, and uploaded. `gpu`: summed per pixel from an
 *  array texture of all layers. `auto`: by what this machine was measured to do (see {@link Room.methodReason}). */
export type Method = 'auto' | 'cpu' | 'gpu';

export interface LoadOptions {
  /** Default `auto`. */
  method?: Method;
  /** Largest array texture that `auto` may choose, in bytes. Default 256 MiB. */
  gpuMemoryLimit?: number;
  /** Default `bilinear`. */
  filter?: 'bilinear' | 'bicubic';
  /** Where luxel_rt.wasm is; default: beside the package's module. */
  wasmUrl?: string | URL;
  /** Called with 0…1 and with bytes while files arrive. */
  onProgress?: (fraction: number, loadedBytes: number, totalBytes: number) => void;
  signal?: AbortSignal;
  /** A loader that is set up already, e.g. with a KTX2Loader or a DRACOLoader. Meshopt needs none. */
  gltfLoader?: GLTFLoader;
}

export type Kind = 'point' | 'spot' | 'directional' | 'rect' | 'disk' | 'emissive' | 'sky' | 'combined';

/** One layer: what one colour drives. `color` and `intensity` may be set here as well as by {@link Room.setLight}; they show what is driven, too. */
export interface LayerLight {
  readonly name: string;
  readonly index: number;
  /** Of its first source. */
  readonly kind: Kind;
  /** Of intensity: candela, lux, nit. */
  readonly unit: 'cd' | 'lx' | 'nt';
  /** True: its direct light is not in the lightmap. */
  readonly mixed: boolean;
  /** As authored. */
  readonly authored: { readonly color: Color; readonly intensity: number };
  /** Linear colour: c = color × intensity. */
  readonly color: Color;
  intensity: number;
  /** Muted layers shine not at all; when any layer is solo, only solo layers shine. Colours are kept. */
  muted: boolean;
  solo: boolean;
  /** Monitor this layer is a cell of, or null. */
  readonly monitor: Monitor | null;
}

/** A screen whose cells are layers. */
export interface Monitor {
  readonly name: string;
  readonly index: number;
  readonly columns: number;
  readonly rows: number;
  readonly firstLayer: number;
  /** The meshes that show the picture. */
  readonly meshes: readonly Mesh[];
  /** Radiance (nit) of a white pixel, in the authored picture too. */
  strength: Color;
  /** Share of the old colour that the next frame of a video or of a live canvas keeps, [0, 1). Stills and pixels are there at once. */
  smoothing: number;
  /** Plays a video: its frames light the room. `null` brings back the authored picture. */
  setVideo(video: HTMLVideoElement | null): void;
  /** Shows a still picture, or a canvas that is read again each frame when `live`. */
  setImage(image: HTMLImageElement | HTMLCanvasElement | ImageBitmap | OffscreenCanvas, live?: boolean): void;
  /** Sets the cells from pixels (RGBA, sRGB bytes, row 0 at the top) without showing a picture. */
  setPixels(pixels: Uint8Array | Uint8ClampedArray, width: number, height: number): void;
}

export interface LuxelAnimation {
  /** The glTF animation's; empty: the program of a `luxel_animate` key. */
  readonly name: string;
  /** -1: it moves things, not light. */
  readonly layer: number;
  readonly kind: Program['kind'] | 'nodes';
  readonly duration: number;
  readonly playing: boolean;
}

/** Keyframes and simple programs, as lxrt_program in luxel_rt.h. */
export interface Program {
  kind: 'constant' | 'keys' | 'blink' | 'flicker' | 'pulse' | 'wheel' | 'schedule';
  color?: ColorRepresentation;
  intensity?: number;
  period?: number; phase?: number; duty?: number; low?: number; high?: number; fade?: number; seed?: number;
  /** `keys`, `schedule`: [time, r, g, b, time, r, g, b, …], linear c. */
  keys?: ArrayLike<number>;
  interpolation?: 'step' | 'linear' | 'cubic';
  loop?: boolean;
}

/** Bytes, see lxrt_budget in luxel_rt.h. */
export interface Budget { pack: number; handle: number; accumulator: number; gpuComposed: number; gpuLayers: number; dense: number; }

export interface Room {
  /** The scene with lit materials; add your own objects, lights and cameras. Baked lights are in it, invisible. */
  readonly scene: Scene;
  readonly cameras: readonly Camera[];
  readonly lights: readonly LayerLight[];
  readonly monitors: readonly Monitor[];
  readonly animations: readonly LuxelAnimation[];
  /** The parsed luxel.json. */
  readonly manifest: any;
  /** Exposure (EV) of the preview: `renderer.toneMappingExposure = 2 ** room.ev`. */
  readonly ev: number;
  readonly method: 'cpu' | 'gpu';
  /** Why: numbers that were measured. */
  readonly methodReason: { composeMs: number; layers: number; gpuLayersBytes: number };
  readonly budget: Budget;
  readonly pageCount: number;
  readonly pageSize: number;

  /** Sets a layer by name or index. `color` as three takes it; intensity in the layer's unit, default: as it is. What drove the layer (its
   *  program, an animation of the file, a bound light) does so no more, until {@link Room.resetLight}. */
  setLight(layer: string | number, color: ColorRepresentation, intensity?: number): void;
  /** Back to the authored colour (a monitor's cell: at the monitor's strength of now), and to the animations of the file. */
  resetLight(layer: string | number): void;
  /** Lets a three.js light drive a layer: its colour × intensity is read every frame, whatever animates it. Returns a function that ends it. */
  bind(light: Light, layer: string | number): () => void;
  /** Lets a program drive a layer; null ends it. */
  setProgram(layer: string | number, program: Program | null): void;
  /** Starts the animations of the file: layers' colours and moving nodes. Without a name: all. */
  play(name?: string): void;
  /** Stops them: colours and nodes stay as they are, until {@link Room.play} takes them to the time there is then. */
  stop(name?: string): void;

  /** Once a frame, before rendering: drivers, monitors, lightmap. `time` in seconds; default: since load. Returns true if a lightmap changed.
   *  Throws if a field of a light or monitor was set to what cannot be summed; the field is as before then. */
  update(time?: number): boolean;

  /** Composed irradiance of a page, RGB floats (for tests and tools). */
  readPage(page: number, level?: number): Float32Array;
  /** What one layer adds to it at its colour of now, whether muted or not. */
  readLayer(page: number, layer: string | number, level?: number): Float32Array;
  /** What is shown: lit; E/π without tone mapping; base colour alone. The viewer's view modes. */
  setView(view: 'lit' | 'lightmap' | 'albedo'): void;

  dispose(): void;
}

/** Loads a baked folder: `url` is the folder (with its final slash) or its luxel.json. Rejects with an Error that names the file. */
export function loadLuxel(renderer: WebGLRenderer, url: string | URL, options?: LoadOptions): Promise<Room>;
