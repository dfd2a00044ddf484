// Lit materials: three's own, with irradiance from the lightmap, through three's own hooks.
//
// A patched material is a clone of its original, one for all meshes that share it, and shares its textures. Its onBeforeCompile and
// customProgramCacheKey may still be set by anyone: ours are called first, theirs after.
import { REVISION, ShaderChunk } from 'three';
import { lx_range_factor, lx_spot_factor, lxrt_compose, lxrt_lightmap_sample } from './shaders.js';

export const VIEWS = { lit: 0, lightmap: 1, albedo: 2 };

/** Values that all patched materials of a room share. */
export function createUniforms() {
  return {
    luxelPages: { value: null },
    luxelScale: { value: 1 }, // E = texel × this
    luxelFactors: { value: null },
    luxelFactorCount: { value: 0 },
    luxelLayerCount: { value: 1 },
    luxelSky: { value: [1, 1, 1] }, // colour of reflections of the sky
    luxelView: { value: VIEWS.lit },
    luxelExposure: { value: 1 },
  };
}

const vertexPars = /* glsl */ `
attribute vec2 luxelUv;
attribute vec4 luxelRect;
attribute float luxelPage;
varying vec2 vLuxelUv;
flat varying int vLuxelPage;
`;

const vertexMain = /* glsl */ `
vLuxelUv = luxelUv * luxelRect.xy + luxelRect.zw;
vLuxelPage = int(luxelPage + 0.5);
`;

const lightmapPars = /* glsl */ `
uniform sampler2DArray luxelPages;
varying vec2 vLuxelUv;
flat varying int vLuxelPage;
${lxrt_lightmap_sample}
`;

// Texels to a pixel: cubic filtering is for magnified lightmaps; where they are minified, mip levels are right.
const footprint = /* glsl */ `
float luxelFootprint() {
  vec2 texel = vLuxelUv * vec2(textureSize(luxelPages, 0).xy);
  return max(length(dFdx(texel)), length(dFdy(texel)));
}
`;

function irradiance(method, filter) {
  if (method === 'cpu') {
    return `${lightmapPars}
uniform float luxelScale;
${filter === 'bicubic' ? footprint : ''}
vec3 luxelIrradiance() {
  ${
    filter === 'bicubic'
      ? `float cubic = 1.0 - smoothstep(0.75, 1.25, luxelFootprint());
  vec3 linear = lxrt_lightmap_sample_bilinear(luxelPages, float(vLuxelPage), vLuxelUv);
  return luxelScale * (cubic > 0.0 ? mix(linear, lxrt_lightmap_sample_bicubic(luxelPages, float(vLuxelPage), vLuxelUv), cubic) : linear);`
      : 'return luxelScale * lxrt_lightmap_sample_bilinear(luxelPages, float(vLuxelPage), vLuxelUv);'
  }
}
`;
  }
  const sum = (kind) => `lxrt_compose_${kind}(luxelPages, luxelFactors, luxelFactorCount, vLuxelPage * luxelLayerCount, vLuxelUv)`;
  return `${lightmapPars}
uniform highp sampler2D luxelFactors;
uniform int luxelFactorCount;
uniform int luxelLayerCount;
${lxrt_compose}
${filter === 'bicubic' ? footprint : ''}
vec3 luxelIrradiance() {
  ${filter === 'bicubic' ? `return luxelFootprint() < 1.0 ? ${sum('bicubic')} : ${sum('bilinear')};` : `return ${sum('bilinear')};`}
}
`;
}

// Real-time lights as KHR_lights_punctual wants them. Our functions take the place of three's.
function lightsPars() {
  const ranged = replaceFunction(ShaderChunk.lights_pars_begin, 'getDistanceAttenuation', `${lx_range_factor}
float getDistanceAttenuation(const in float lightDistance, const in float cutoffDistance, const in float decayExponent) {
  return lx_range_factor(lightDistance, cutoffDistance) / max(pow(lightDistance, decayExponent), 1e-6);
}
`);
  return replaceFunction(ranged, 'getSpotAttenuation', `${lx_spot_factor}
float getSpotAttenuation(const in float coneCosine, const in float penumbraCosine, const in float angleCosine) {
  return lx_spot_factor(penumbraCosine, coneCosine, angleCosine);
}
`);
}

// The lightmap is all the diffuse light that is not real-time: in place of ambient light, probes and the environment. Reflections of
// the environment stay, also those that bounced between facets, which three's function adds together with its diffuse light.
const litEnd = /* glsl */ `
RE_IndirectDiffuse(irradiance, geometryPosition, geometryNormal, geometryViewDir, geometryClearcoatNormal, material, reflectedLight);
vec3 luxelDiffuse = reflectedLight.indirectDiffuse;
#ifdef USE_SHEEN
  vec3 luxelSheen = sheenSpecularIndirect;
#endif
RE_IndirectSpecular(radiance, iblIrradiance, clearcoatRadiance, geometryPosition, geometryNormal, geometryViewDir, geometryClearcoatNormal, material, reflectedLight);
reflectedLight.indirectDiffuse = luxelDiffuse;
#ifdef USE_SHEEN
  sheenSpecularIndirect = luxelSheen;
#endif
`;

const skyTint = /* glsl */ `
#if defined(USE_ENVMAP)
  radiance *= luxelSky;
  iblIrradiance *= luxelSky;
  clearcoatRadiance *= luxelSky;
#endif
`;

// Straight through glass, tinted by it once: as `luxel render` sees it. What is behind is in three's own buffer, in this view's values.
const throughGlass = `
#ifdef USE_TRANSMISSION
  vec4 luxelPlace = projectionMatrix * viewMatrix * vec4(vWorldPosition, 1.0);
  vec3 luxelBehind = textureLod(transmissionSamplerMap, 0.5 + 0.5 * luxelPlace.xy / luxelPlace.w, 0.0).rgb;
  gl_FragColor = vec4(mix(gl_FragColor.rgb, luxelBehind * diffuseColor.rgb, material.transmission), diffuseColor.a);
#endif
`;

// There are no local reflections: three reflects the sky through walls. What arrives at a place compared with what would arrive under the
// open sky says how much of it is to be seen from there, roughly; without it, daylight would shine from every table of a closed room.
const skyOcclusion = /* glsl */ `
#if defined(USE_ENVMAP)
  float luxelOpen = min(1.0, luminance(irradiance) / max(luminance(iblIrradiance), 1e-6));
  radiance *= luxelOpen;
  iblIrradiance *= luxelOpen;
  clearcoatRadiance *= luxelOpen;
#endif
`;

// In the place of tone mapping, which views of the data go without. Albedo is the bake's: of metal a little is left to the lightmap.
function viewCode(lit, standard) {
  const lightmap = lit ? 'luxelIrradiance() * RECIPROCAL_PI * luxelExposure' : 'vec3(0.0)';
  const albedo = standard ? 'diffuseColor.rgb * mix(1.0, 0.5 * roughnessFactor * roughnessFactor, metalnessFactor)' : 'diffuseColor.rgb';
  return `
if (luxelView == ${VIEWS.lit}) {
  ${ShaderChunk.tonemapping_fragment}
} else {
  gl_FragColor.rgb = luxelView == ${VIEWS.lightmap} ? ${lightmap} : ${albedo};
  ${standard ? throughGlass : ''}
}
`;
}

function insert(source, where, text, before = false) {
  if (!source.includes(where)) throw new Error(`luxel: the shaders of three.js r${REVISION} have no "${where}"`);
  return source.replace(where, () => (before ? text + where : where + text));
}
function replace(source, where, text) {
  return insert(source, where, '', false).replace(where, () => text);
}

function replaceFunction(source, name, text) {
  const definition = new RegExp(`float ${name}\\([^]*?\\n}\\n`);
  if (!definition.test(source)) throw new Error(`luxel: the shaders of three.js r${REVISION} have no function ${name}`);
  return source.replace(definition, () => text);
}

/** Makes and keeps a room's materials. */
export class Materials {
  #uniforms;
  #method;
  #filter;
  #made = new Map(); // original -> { lit, plain }
  all = new Set();

  constructor(uniforms, method, filter) {
    this.#uniforms = uniforms;
    this.#method = method;
    this.#filter = filter;
  }

  /** The original with light from the lightmap. Unlit materials stay unlit. */
  lit(original) {
    return this.#get(original, original.isMeshStandardMaterial === true ? 'lit' : 'plain');
  }

  /** The original for what has no lightmap: as it is, but for real-time lights' falloff, the sky's colour and the views. */
  plain(original) {
    return this.#get(original, 'plain');
  }

  /** A further clone, for a mesh whose emission is its own. */
  variant(material) {
    const clone = material.clone();
    this.all.add(clone);
    return clone;
  }

  #get(original, kind) {
    if (!original.isMeshStandardMaterial && !original.isMeshBasicMaterial) return original;
    const made = this.#made.get(original) ?? {};
    this.#made.set(original, made);
    if (!made[kind]) {
      made[kind] = this.#patch(original.clone(), kind, original.onBeforeCompile, original.customProgramCacheKey);
      this.all.add(made[kind]);
    }
    return made[kind];
  }

  #patch(material, kind, theirCompile, theirKey) {
    const ours = (shader) => this.#compile(shader, kind, material.isMeshStandardMaterial === true);
    const ourKey = `luxel ${kind} ${this.#method} ${this.#filter}`;
    // three's own key function looks at onBeforeCompile, which is ours for whoever asks: theirs is asked for with their function.
    let key = theirKey;
    Object.defineProperty(material, 'onBeforeCompile', {
      configurable: true,
      get: () => (shader, renderer) => {
        ours(shader);
        theirCompile.call(material, shader, renderer);
      },
      set: (compile) => {
        theirCompile = compile;
      },
    });
    Object.defineProperty(material, 'customProgramCacheKey', {
      configurable: true,
      get: () => () => `${ourKey} ${key.call({ onBeforeCompile: theirCompile, __proto__: material })}`,
      set: (value) => {
        key = value;
      },
    });
    // Material.clone() leaves hooks behind.
    material.clone = () => this.#patch(Object.getPrototypeOf(material).clone.call(material), kind, theirCompile, key);
    return material;
  }

  #compile(shader, kind, standard) {
    Object.assign(shader.uniforms, this.#uniforms);
    const lit = kind === 'lit';
    let { vertexShader: vertex, fragmentShader: fragment } = shader;
    let pars = 'uniform int luxelView;\nuniform float luxelExposure;\n';
    if (standard) {
      pars += 'uniform vec3 luxelSky;\n';
      fragment = replace(fragment, '#include <lights_pars_begin>', lightsPars());
      fragment = insert(fragment, '#include <lights_fragment_maps>', lit ? skyTint + skyOcclusion : skyTint);
    }
    if (lit) {
      pars += irradiance(this.#method, this.#filter);
      vertex = insert(vertex, 'void main() {', vertexPars, true);
      vertex = insert(vertex, '#include <uv_vertex>', vertexMain);
      fragment = insert(fragment, '#include <lights_fragment_begin>', '\nirradiance = luxelIrradiance();\n');
      fragment = replace(fragment, '#include <lights_fragment_end>', litEnd);
    }
    fragment = insert(fragment, 'void main() {', pars, true);
    fragment = replace(fragment, '#include <tonemapping_fragment>', viewCode(lit, standard));
    shader.vertexShader = vertex;
    shader.fragmentShader = fragment;
  }

  dispose() {
    for (const material of this.all) material.dispose();
  }
}
