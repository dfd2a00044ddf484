// shaders/*.glsl as a JavaScript module: node make-shaders.mjs [--check]
// The package has to work without a build step, and browsers import no text. --check fails if shaders.js is not what it would write.
import { readFileSync, readdirSync, writeFileSync } from 'node:fs';

const folder = new URL('../../shaders/', import.meta.url);
const out = new URL('shaders.js', import.meta.url);

let text = '// Written by make-shaders.mjs from shaders/*.glsl: change those.\n';
for (const file of readdirSync(folder).filter((name) => name.endsWith('.glsl')).sort()) {
  const source = readFileSync(new URL(file, folder), 'utf8');
  if (/[`\\]|\$\{/.test(source)) throw new Error(`${file}: has characters that a template string takes for its own`);
  text += `\nexport const ${file.slice(0, -5)} = /* glsl */ \`\n${source}\`;\n`;
}
if (!process.argv.includes('--check')) {
  writeFileSync(out, text);
} else if (readFileSync(out, 'utf8') !== text) {
  console.error('web/luxel-three/shaders.js is not what shaders/*.glsl say: node web/luxel-three/make-shaders.mjs');
  process.exitCode = 1;
}
