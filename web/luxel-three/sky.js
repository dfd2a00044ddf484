// The sky: what one sees behind everything and what shines in reflections. Its layer drives both; its diffuse light is in the lightmap.
import {
  BackSide, Box3, BoxGeometry, DataTexture, DataUtils, EquirectangularReflectionMapping, FloatType, HalfFloatType, LinearFilter, Matrix3,
  Matrix4, Mesh, RepeatWrapping, RGBAFormat, ShaderMaterial, Vector3,
} from 'three';

const vertexShader = /* glsl */ `
varying vec3 vDirection;
uniform mat3 turn;
void main() {
  vDirection = turn * position;
  vec4 eye = viewMatrix * vec4(position, 0.0); // far away: the camera turns, but does not move
  gl_Position = projectionMatrix * vec4(eye.xyz, 1.0);
  gl_Position.z = gl_Position.w;
}
`;

const fragmentShader = /* glsl */ `
uniform sampler2D picture;
uniform vec3 color;
varying vec3 vDirection;
#include <common>
void main() {
  gl_FragColor = vec4(textureLod(picture, equirectUv(normalize(vDirection)), 0.0).rgb * color, 1.0);
  #include <tonemapping_fragment>
  #include <colorspace_fragment>
}
`;

// Prefiltering for reflections wants 64 texels or more; the picture of a plain sky has one.
function enlarged({ width, height, data, type, topFirst }) {
  const across = Math.ceil(64 / width);
  const down = Math.ceil(32 / height);
  const bigWidth = width * across;
  const bigHeight = height * down;
  const big = new data.constructor(4 * bigWidth * bigHeight);
  for (let y = 0; y < bigHeight; y++) {
    for (let x = 0; x < bigWidth; x++) {
      const from = 4 * (Math.floor(y / down) * width + Math.floor(x / across));
      for (let i = 0; i < 4; i++) big[4 * (y * bigWidth + x) + i] = data[from + i];
    }
  }
  return { width: bigWidth, height: bigHeight, data: big, type, topFirst };
}

// Half floats end at 65504, and the sun does not.
function clamped({ width, height, data, type, topFirst }) {
  if (type === HalfFloatType) {
    const largest = DataUtils.toHalfFloat(65504);
    for (let i = 0; i < data.length; i++) if ((data[i] & 0x7c00) === 0x7c00) data[i] = largest;
  }
  return { width, height, data, type, topFirst };
}

async function decode(file, bytes) {
  if (/\.exr$/i.test(file)) {
    const { EXRLoader } = await import('three/addons/loaders/EXRLoader.js');
    return { ...new EXRLoader().setDataType(HalfFloatType).parse(bytes), topFirst: false };
  }
  const { HDRLoader } = await import('three/addons/loaders/HDRLoader.js');
  return { ...new HDRLoader().setDataType(HalfFloatType).parse(bytes), topFirst: true };
}

// A box around the camera. Not scene.background: three can dim that, but not colour it.
class Dome extends Mesh {
  raycast() {}
}

export class Sky {
  static async load(file, bytes, rotationDegrees) {
    let picture = clamped(await decode(file, bytes));
    if (picture.width < 64 || picture.height < 32) picture = enlarged(picture);
    return new Sky(picture, (rotationDegrees * Math.PI) / 180);
  }

  constructor({ width, height, data, type, topFirst }, rotation) {
    this.texture = new DataTexture(data, width, height, RGBAFormat, type ?? FloatType, EquirectangularReflectionMapping, RepeatWrapping);
    this.texture.minFilter = this.texture.magFilter = LinearFilter;
    this.texture.flipY = topFirst; // equirectUv has v = 1 at the top
    this.texture.needsUpdate = true;
    this.texture.name = 'luxel sky';
    this.rotation = rotation;

    const geometry = new BoxGeometry(1, 1, 1);
    geometry.boundingBox = new Box3(); // empty: it is nowhere, and who asks for the size of the scene does not mean it
    const turn = new Matrix3().setFromMatrix4(new Matrix4().makeRotationY(-rotation));
    const material = new ShaderMaterial({
      name: 'luxel sky',
      uniforms: { picture: { value: this.texture }, color: { value: new Vector3(1, 1, 1) }, turn: { value: turn } },
      vertexShader,
      fragmentShader,
      side: BackSide,
      depthWrite: false,
      fog: false,
    });
    this.dome = new Dome(geometry, material);
    this.dome.name = 'luxel sky';
    this.dome.frustumCulled = false;
    this.dome.renderOrder = -1e6;
  }

  addTo(scene) {
    scene.environment = this.texture;
    scene.environmentRotation.set(0, this.rotation, 0);
    scene.add(this.dome);
  }

  /** Radiance of a white pixel. `uniforms`: reflections take their hue there, for three's environment has none. */
  setColor(scene, rgb, uniforms) {
    this.dome.material.uniforms.color.value.fromArray(rgb);
    if (scene.environment !== this.texture) {
      uniforms.luxelSky.value = [1, 1, 1];
      return;
    }
    const most = Math.max(...rgb, 0);
    scene.environmentIntensity = most;
    uniforms.luxelSky.value = most > 0 ? rgb.map((value) => value / most) : [1, 1, 1];
  }

  dispose() {
    this.dome.removeFromParent();
    this.dome.geometry.dispose();
    this.dome.material.dispose();
    this.texture.dispose();
  }
}
