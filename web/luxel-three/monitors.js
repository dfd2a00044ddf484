// Screens: a picture lights the room by its cells, and is shown on the mesh itself.
import { Color, DataTexture, FloatType, LinearFilter, NearestFilter, RGBAFormat, SRGBColorSpace, Texture, VideoTexture } from 'three';
import { PIXELS } from './runtime.js';

// A frame is drawn smaller before its pixels are fetched: 16 pixels to a cell are plenty for their mean, and a video at 1080p would
// take longer to fetch than to sum.
const PIXELS_PER_CELL = 16;
const LARGEST_STILL = 2048;

function sizeOf(picture) {
  return [picture.videoWidth || picture.naturalWidth || picture.width, picture.videoHeight || picture.naturalHeight || picture.height];
}

/** Monitor of index.d.ts. `screens`: patched materials of the meshes that show it. */
export class Monitor {
  #runtime;
  #record;
  #screens;
  #siblings; // monitors that share our layers, we among them
  #touched; // called when cells were set, or are to be as authored
  #strength;
  #smoothing = 0;
  #source = null; // { picture, texture, live, frame }
  #cells = null; // texture of the cells' own colours
  #canvas = null;
  #configured; // strength that the runtime knows, and that the cells were made with

  constructor(runtime, index, record, meshes, screens, touched) {
    this.#runtime = runtime;
    this.#record = record;
    this.#screens = screens;
    this.#touched = touched;
    this.#siblings = [this];
    this.index = index;
    this.meshes = meshes;
    this.#strength = new Color(...record.strength);
    this.#configured = record.strength.slice();
  }

  shareWith(siblings) {
    this.#siblings = siblings;
  }

  get name() {
    return this.#record.name;
  }
  get columns() {
    return this.#record.columns;
  }
  get rows() {
    return this.#record.rows;
  }
  get firstLayer() {
    return this.#record.firstLayer;
  }
  get layerCount() {
    return this.columns * this.rows;
  }
  get strength() {
    return this.#strength;
  }
  set strength(color) {
    this.#strength.set(color);
  }
  get smoothing() {
    return this.#smoothing;
  }
  set smoothing(share) {
    if (!(share >= 0 && share < 1)) throw new Error(`luxel: monitor "${this.name}": a smoothing of ${share} is not in [0, 1)`);
    this.#smoothing = share;
    this.#runtime.monitorConfigure(this.index, this.#configured, share);
  }

  setVideo(video) {
    this.#release();
    if (!video) {
      this.#applyStrength();
      this.#touched(this, 'authored');
      return;
    }
    const texture = new VideoTexture(video);
    this.#show(texture);
    const source = { picture: video, texture, live: true, fresh: video.readyState >= 2, next: null };
    this.#source = source;
    if (video.requestVideoFrameCallback) {
      const arrived = () => {
        source.fresh = true;
        if (this.#source === source) source.next = video.requestVideoFrameCallback(arrived);
      };
      source.next = video.requestVideoFrameCallback(arrived);
    } else {
      source.byTime = true;
    }
  }

  setImage(image, live = false) {
    this.#release();
    const texture = new Texture(image);
    texture.needsUpdate = true;
    this.#show(texture);
    this.#source = { picture: image, texture, live, fresh: true };
    this.#fetch();
  }

  setPixels(pixels, width, height) {
    if (!(width > 0 && height > 0) || pixels.length !== 4 * width * height)
      throw new Error(`luxel: monitor "${this.name}": ${pixels.length} bytes are no picture of ${width} x ${height}`);
    this.#release();
    this.#applyStrength();
    this.#setCells(pixels, width, height, 0);
    this.#touched(this, 'cells');
  }

  /** How much stronger than authored the screen is, by channel. What is authored dark has no picture that could become brighter. */
  get gain() {
    return this.#record.strength.map((authored, i) => (authored > 0 ? this.#configured[i] / authored : 1));
  }

  /** Once a frame. Returns whether the strength changed of what is no picture of ours. */
  update() {
    const source = this.#source;
    const moved = this.#applyStrength();
    if (!source) return moved;
    if (source.byTime && source.picture.currentTime !== source.seen) source.fresh = source.picture.readyState >= 2;
    if (!source.picture.requestVideoFrameCallback && source.live && !source.byTime) {
      source.fresh = true;
      source.texture.needsUpdate = true;
    }
    // A paused video has no next frame that would bring its cells the rest of the way.
    if (source.fresh || moved || (source.settling && source.picture.paused)) this.#fetch();
    return false;
  }

  /** What the screen shows: its picture at `share` of its brightness, or the cells' colours where no picture set them. */
  display(mode, colorOf) {
    const { screens } = this;
    if (mode === 'cells' && !this.#source) {
      if (!this.#cells) {
        this.#cells = new DataTexture(new Float32Array(4 * this.layerCount), this.columns, this.rows, RGBAFormat, FloatType);
        this.#cells.minFilter = this.#cells.magFilter = NearestFilter;
      }
      const data = this.#cells.image.data;
      const rgb = [0, 0, 0];
      for (let k = 0; k < this.layerCount; k++) {
        colorOf(this.firstLayer + k, rgb);
        data.set(rgb, 4 * k);
        data[4 * k + 3] = 1;
      }
      this.#cells.needsUpdate = true;
      for (const screen of screens) screen.show(this.#cells, 1, 1, 1);
      return;
    }
    const [r, g, b] = this.#source ? this.#configured : this.gain.map((gain, i) => gain * this.#record.strength[i]);
    for (const screen of screens) screen.show(this.#source ? this.#source.texture : undefined, r, g, b);
  }

  /** Dark, e.g. because all its cells are muted. */
  darken() {
    for (const screen of this.screens) screen.show(undefined, 0, 0, 0);
  }

  get screens() {
    return this.#siblings.flatMap((monitor) => monitor.#screens);
  }
  get showsPicture() {
    return this.#source !== null;
  }

  #show(texture) {
    texture.colorSpace = SRGBColorSpace;
    texture.flipY = false; // glTF: v = 0 is the top
    texture.generateMipmaps = false;
    texture.minFilter = texture.magFilter = LinearFilter;
  }

  // True if the strength was changed since.
  #applyStrength() {
    const { r, g, b } = this.#strength;
    if (r === this.#configured[0] && g === this.#configured[1] && b === this.#configured[2]) return false;
    try {
      this.#runtime.monitorConfigure(this.index, [r, g, b], this.#smoothing);
    } catch (cause) {
      this.#strength.setRGB(...this.#configured);
      throw new Error(`luxel: monitor "${this.name}": a strength of ${r}, ${g}, ${b} is negative, not finite or too large`, { cause });
    }
    this.#configured = [r, g, b];
    return true;
  }

  #setCells(pixels, width, height, smoothing) {
    this.#runtime.monitorConfigure(this.index, this.#configured, smoothing);
    this.#runtime.monitorUpdate(this.index, pixels, width, height, PIXELS.rgba8);
    this.#runtime.monitorConfigure(this.index, this.#configured, this.#smoothing);
  }

  #colors() {
    return Array.from({ length: this.layerCount }, (_, k) => this.#runtime.color(this.firstLayer + k, [0, 0, 0])).flat();
  }

  #fetch() {
    const source = this.#source;
    const [width, height] = sizeOf(source.picture);
    if (!width || !height) return;
    source.fresh = false;
    source.seen = source.picture.currentTime;
    // Stills are fetched once, so all of their pixels may count.
    const most = source.live ? [PIXELS_PER_CELL * this.columns, PIXELS_PER_CELL * this.rows] : [LARGEST_STILL, LARGEST_STILL];
    const across = Math.min(width, most[0]);
    const down = Math.min(height, most[1]);
    if (!this.#canvas || this.#canvas.canvas.width !== across || this.#canvas.canvas.height !== down) {
      const canvas = document.createElement('canvas');
      canvas.width = across;
      canvas.height = down;
      this.#canvas = canvas.getContext('2d', { willReadFrequently: true, alpha: false });
      this.#canvas.imageSmoothingQuality = 'medium';
    }
    let pixels;
    try {
      this.#canvas.drawImage(source.picture, 0, 0, across, down);
      pixels = this.#canvas.getImageData(0, 0, across, down).data;
    } catch (cause) {
      this.#canvas = null; // what it has drawn keeps it from being read ever again
      this.setVideo(null);
      const why = cause.name === 'SecurityError' ? 'comes from elsewhere and may not be read (CORS)' : 'cannot be drawn';
      throw new Error(`luxel: monitor "${this.name}": the picture ${why}`, { cause });
    }
    // A still picture is there at once: no next frame would bring the rest.
    const smoothing = source.live ? this.#smoothing : 0;
    const before = smoothing > 0 ? this.#colors() : [];
    this.#setCells(pixels, across, down, smoothing);
    source.settling = smoothing > 0 && this.#colors().some((value, i) => value !== before[i]);
    this.#touched(this, 'picture');
  }

  #release() {
    for (const monitor of this.#siblings) {
      const source = monitor.#source;
      if (!source) continue;
      if (source.next !== null && source.next !== undefined) source.picture.cancelVideoFrameCallback?.(source.next);
      monitor.#source = null;
      for (const screen of this.screens) screen.show(undefined, 0, 0, 0);
      source.texture.dispose();
    }
  }

  dispose() {
    this.#release();
    this.#cells?.dispose();
    this.#canvas = null;
  }
}

/** A patched material that shows a monitor's picture, or its own. */
export class Screen {
  constructor(material) {
    this.material = material;
    this.authored = material.emissiveMap;
    material.emissiveIntensity = 1;
  }

  /** `texture` undefined: the material's own. */
  show(texture, r, g, b) {
    const { material } = this;
    const map = texture === undefined ? this.authored : texture;
    if (material.emissiveMap !== map) {
      material.emissiveMap = map;
      material.needsUpdate = true;
    }
    material.emissive.setRGB(r, g, b);
  }
}
