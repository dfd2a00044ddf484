// luxel-three in Chromium, on the stage that scene.py builds: what one sees when layers change.
import assert from 'node:assert/strict';
import { readFileSync } from 'node:fs';
import { after, before, test } from 'node:test';
import { Runtime } from '../luxel-three/runtime.js';
import { serve } from './server.mjs';
import { needsBaked, openStage } from './setting.mjs';

// Where things are in the picture of the scene's camera: [left, top, right, bottom] in fractions.
const PLACES = {
  leftWall: [0.02, 0.25, 0.15, 0.7],
  rightWall: [0.85, 0.25, 0.98, 0.7],
  ceiling: [0.35, 0.02, 0.65, 0.15],
  floor: [0.35, 0.85, 0.65, 0.98],
  back: [0.45, 0.58, 0.55, 0.68],
  neon: [0.64, 0.525, 0.71, 0.55],
  screenLeft: [0.4, 0.4, 0.48, 0.53],
  screenRight: [0.52, 0.4, 0.6, 0.53],
  screenTopLeft: [0.395, 0.39, 0.44, 0.45],
  pebbleLeft: [0.11, 0.905, 0.17, 0.95],
  pebbleRight: [0.83, 0.905, 0.89, 0.95],
  sign: [0.31, 0.28, 0.355, 0.305],
  ball: [0.47, 0.72, 0.53, 0.8],
  drone: [0.49, 0.235, 0.51, 0.265],
};

let stage;
before(async () => {
  if (needsBaked.skip) return;
  stage = await openStage();
  await stage.page.evaluate(async (places) => {
    const { stage } = window;
    await stage.load('/baked/');
    Object.assign(window, {
      places,
      room: stage.room,
      strengths: stage.room.monitors.map(({ strength }) => strength.clone()),
      /** What a call throws; empty if nothing. */
      why: (call) => {
        try {
          call();
          return '';
        } catch (error) {
          return error.message;
        }
      },
      /** Means of places, as the scene looks now. */
      look: (time) => {
        const pixels = stage.draw(time);
        return Object.fromEntries(Object.entries(places).map(([name, place]) => [name, stage.mean(pixels, place)]));
      },
      /** All layers off, but for some: { name: [color, intensity] }. */
      only: (lights) => {
        const room = window.room;
        for (const light of room.lights) {
          light.muted = light.solo = false;
          room.setLight(light.index, lights[light.name]?.[0] ?? light.authored.color, lights[light.name]?.[1] ?? 0);
        }
      },
      reset: () => {
        const room = window.room;
        room.setView('lit');
        for (const [i, monitor] of room.monitors.entries()) {
          monitor.strength.copy(window.strengths[i]);
          monitor.setVideo(null);
        }
        for (const light of room.lights) {
          light.muted = light.solo = false;
          room.resetLight(light.index);
        }
        stage.renderer.toneMappingExposure = 2 ** room.ev;
      },
    });
  }, PLACES);
});
after(() => stage?.close());

/** Runs in the page; `window` has room, look, only, reset. */
const inPage = (code, argument) => stage.page.evaluate(code, argument);
const sum = (rgb) => rgb[0] + rgb[1] + rgb[2];
const isBlack = (rgb) => sum(rgb) < 3;

test('a room has its layers, cameras, monitors and animations', needsBaked, async () => {
  const room = await inPage(() => ({
    lights: window.room.lights.map(({ name, kind, unit, mixed, intensity, monitor }) => ({ name, kind, unit, mixed, intensity, monitor: monitor?.name ?? null })),
    cameras: window.room.cameras.map(({ name }) => name),
    monitors: window.room.monitors.map(({ name, columns, rows, firstLayer, meshes }) => ({ name, columns, rows, firstLayer, meshes: meshes.length })),
    animations: window.room.animations.map(({ name, kind, duration, playing }) => ({ name, kind, duration, playing })),
    budget: window.room.budget,
    method: window.room.method,
    reason: window.room.methodReason,
  }));
  const byName = (name) => room.lights.find((light) => light.name === name);
  assert.deepEqual(byName('left lamp'), { name: 'left lamp', kind: 'point', unit: 'cd', mixed: false, intensity: 6, monitor: null });
  assert.equal(byName('mixed spot').mixed, true);
  assert.equal(byName('neon').unit, 'nt');
  assert.equal(byName('sky').kind, 'sky');
  assert.equal(room.lights.filter(({ monitor }) => monitor === 'screen').length, 8);
  assert.deepEqual(room.cameras, ['view']);
  assert.deepEqual(room.monitors.map(({ name, columns, rows, meshes }) => [name, columns, rows, meshes]), [['screen', 4, 2, 1]]);
  assert.deepEqual(room.animations.map(({ name, kind }) => [name, kind]), [['', 'blink'], ['sweep', 'keys'], ['fly', 'nodes']]);
  assert.ok(room.animations.every(({ playing, duration }) => playing && duration === 2));
  assert.ok(room.budget.pack > 0 && room.budget.gpuLayers > room.budget.gpuComposed);
  assert.equal(room.method, 'cpu', JSON.stringify(room.reason)); // two small pages are composed in no time
  assert.ok(room.reason.composeMs > 0);
});

test('a lamp that is set to red lights its side, in red', needsBaked, async () => {
  const seen = await inPage(() => {
    window.only({});
    const dark = window.look();
    window.room.setLight('left lamp', 'red', 10);
    const red = window.look();
    window.room.setLight('left lamp', 0x000000);
    window.room.setLight('right lamp', 'blue', 10);
    return { dark, red, blue: window.look() };
  });
  for (const [name, rgb] of Object.entries(seen.dark)) if (name !== 'sign') assert.ok(isBlack(rgb), `${name} is ${rgb} with all lights off`);
  // Tone mapping turns what is very bright towards white.
  assert.ok(seen.red.leftWall[0] > 60 && seen.red.leftWall[1] < seen.red.leftWall[0] / 5 && seen.red.leftWall[2] < seen.red.leftWall[0] / 5, `left wall ${seen.red.leftWall}`);
  assert.ok(seen.red.leftWall[0] > 1.1 * seen.red.rightWall[0], `left ${seen.red.leftWall}, right ${seen.red.rightWall}`);
  assert.ok(seen.blue.rightWall[2] > 1.1 * seen.blue.leftWall[2] && seen.blue.rightWall[0] < seen.blue.rightWall[2] / 5, `right wall ${seen.blue.rightWall}`);
});

test('readPage gives the sum of layers, and colours are linear in it', needsBaked, async () => {
  const { once, twice, pure, unknown } = await inPage(() => {
    window.only({ 'left lamp': ['white', 1] });
    const once = Array.from(window.room.readPage(0));
    window.room.setLight('left lamp', 'white', 2);
    const twice = Array.from(window.room.readPage(0));
    window.room.setLight('left lamp', 'lime');
    const pure = Array.from(window.room.readPage(0));
    let unknown = '';
    try {
      window.room.setLight('left lmap', 'red');
    } catch (error) {
      unknown = error.message;
    }
    return { once, twice, pure, unknown };
  });
  assert.ok(once.filter((value) => value > 0).length > 1000);
  assert.ok(once.every((value, i) => twice[i] === 2 * value));
  assert.ok(pure.every((value, i) => value === (i % 3 === 1 ? twice[i] : 0)));
  assert.match(unknown, /no layer "left lmap".*left lamp/);
});

test('emitters look as their layers shine: off, and in colour', needsBaked, async () => {
  const { off, on, authored } = await inPage(() => {
    window.only({});
    const off = window.look();
    window.only({ neon: ['blue', 2] });
    const on = window.look();
    window.reset();
    return { off, on, authored: window.look() };
  });
  assert.ok(isBlack(off.neon), `neon is ${off.neon} when off`);
  assert.ok(on.neon[2] > 20 && on.neon[0] < on.neon[2] / 4, `neon is ${on.neon} in blue`);
  assert.ok(authored.neon[1] > 40, `neon is ${authored.neon} as authored`);
});

test('muted layers are dark, solo ones alone, and colours come back', needsBaked, async () => {
  const seen = await inPage(() => {
    window.reset();
    const { room } = window;
    const light = (name) => room.lights.find((candidate) => candidate.name === name);
    const mean = () => room.readPage(0).reduce((sum, value) => sum + value, 0);
    const all = mean();
    light('left lamp').muted = true;
    const without = mean();
    light('left lamp').muted = false;
    const again = mean();
    light('right lamp').solo = true;
    const right = mean();
    const shown = window.look();
    light('right lamp').solo = false;
    window.only({ 'right lamp': ['white', 6] });
    return { all, without, again, right, rightAlone: mean(), shown, kept: light('left lamp').authored.intensity };
  });
  assert.ok(seen.without < seen.all);
  assert.equal(seen.again, seen.all);
  assert.ok(Math.abs(seen.right - seen.rightAlone) < 1e-6 * seen.right, `${seen.right} and ${seen.rightAlone}`);
  assert.ok(isBlack(seen.shown.neon) && isBlack(seen.shown.screenLeft), 'what is not solo looks off');
});

test('instances have light of their own, on every node of a mesh', needsBaked, async () => {
  const { left, right, shared } = await inPage(() => {
    window.only({ 'left lamp': ['white', 60] });
    const left = window.look();
    window.only({ 'right lamp': ['white', 60] });
    const right = window.look();
    const pebbles = [];
    window.room.scene.traverse((object) => object.isInstancedMesh && pebbles.push(object));
    const [a, b] = pebbles.map(({ geometry }) => geometry);
    return { left, right, shared: { count: pebbles.length, position: a.attributes.position === b.attributes.position, rects: a.attributes.luxelRect === b.attributes.luxelRect } };
  });
  assert.deepEqual(shared, { count: 2, position: true, rects: false });
  assert.ok(sum(left.pebbleLeft) > 1.25 * sum(left.pebbleRight), `${left.pebbleLeft} and ${left.pebbleRight}`);
  assert.ok(sum(right.pebbleRight) > 1.25 * sum(right.pebbleLeft), `${right.pebbleRight} and ${right.pebbleLeft}`);
});

test('materials, textures and buffers stay shared', needsBaked, async () => {
  const shared = await inPage(() => {
    const of = (name) => window.room.scene.getObjectByName(name);
    const [left, right, floor, back, wall] = ['left_block', 'right_block', 'floor', 'back', 'left'].map(of);
    return {
      material: left.material === right.material && back.material === wall.material,
      buffers: left.geometry.attributes.position === right.geometry.attributes.position,
      texture: left.material.map === floor.material.map && left.material.map !== null,
      clearcoat: of('ball').material.isMeshPhysicalMaterial && of('ball').material.clearcoat === 1,
      unlit: of('sign').material.isMeshBasicMaterial,
    };
  });
  assert.deepEqual(shared, { material: true, buffers: true, texture: true, clearcoat: true, unlit: true });
});

test("a person's own hooks on a lit material run, after ours", needsBaked, async () => {
  const { plain, tinted, cloned } = await inPage(() => {
    window.reset();
    const plain = window.look();
    const back = window.room.scene.getObjectByName('back');
    const original = back.material;
    // Material.clone() leaves hooks behind; ours come along.
    back.material = original.clone();
    const cloned = window.look();
    back.material.onBeforeCompile = (shader) => {
      shader.fragmentShader = shader.fragmentShader.replace('#include <opaque_fragment>', 'outgoingLight.r = 0.0;\n#include <opaque_fragment>');
    };
    back.material.needsUpdate = true;
    const tinted = window.look();
    back.material.dispose();
    back.material = original;
    return { plain, cloned, tinted };
  });
  assert.deepEqual(cloned.back, plain.back);
  assert.ok(plain.back[0] > 20 && tinted.back[0] === 0, `${plain.back} and ${tinted.back}`);
  assert.ok(Math.abs(tinted.back[2] - plain.back[2]) < 40 && tinted.back[2] > 10, `${plain.back} and ${tinted.back}`);
  assert.deepEqual(tinted.leftWall, plain.leftWall);
});

test('baked lights do not shine again; mixed ones do, with the colour of their layer', needsBaked, async () => {
  const { lights, off, on, red } = await inPage(() => {
    const { room } = window;
    window.reset();
    window.look();
    const lights = [];
    room.scene.traverse((object) => object.isLight && lights.push([object.type, object.visible, object.intensity]));
    window.only({});
    const off = window.look();
    room.setLight('mixed spot', 'white', 300);
    const on = window.look();
    room.setLight('mixed spot', 'red', 300);
    return { lights, off, on, red: window.look() };
  });
  assert.deepEqual(lights.map(([type, visible]) => [type, visible]).sort(), [['PointLight', false], ['PointLight', false], ['PointLight', false], ['SpotLight', true]]);
  assert.ok(Math.abs(lights.find(([, visible]) => visible)[2] - 30) < 1e-3);
  assert.ok(isBlack(off.floor), `floor ${off.floor}`);
  assert.ok(sum(on.floor) > 100, `floor ${on.floor}`);
  assert.ok(red.floor[0] > 30 && red.floor[1] < red.floor[0] / 10, `floor ${red.floor}`);
});

test('ambient light and the diffuse light of the environment add nothing to lit materials', needsBaked, async () => {
  const seen = await inPage(() => {
    const { THREE } = window.stage;
    window.only({ 'left lamp': ['white', 60] });
    const before = window.look();
    const ambient = new THREE.AmbientLight(0xffffff, 100);
    window.room.scene.add(ambient);
    const after = window.look();
    ambient.removeFromParent();
    // The sky alone: its diffuse light is in the lightmap, its reflections are the environment's.
    window.only({ sky: ['white', 5] });
    const sky = window.look();
    window.room.scene.environmentIntensity = 0;
    const matt = window.look();
    // An environment that the lightmap knows nothing of: no light gets there, so nothing is reflected either.
    window.only({});
    window.look();
    window.room.scene.environmentIntensity = 3;
    const unknown = window.look();
    window.reset();
    return { before, after, sky, matt, unknown };
  });
  assert.ok(sum(seen.after.drone) > 300, 'what is not baked takes ambient light');
  assert.deepEqual({ ...seen.after, drone: null }, { ...seen.before, drone: null });
  assert.ok(sum(seen.sky.ball) > sum(seen.matt.ball) + 10, `the ball reflects the sky: ${seen.sky.ball}, without ${seen.matt.ball}`);
  // 4 % of what arrives, and more only at grazing angles.
  assert.ok(sum(seen.sky.back) > sum(seen.matt.back) && sum(seen.sky.back) < 1.3 * sum(seen.matt.back), `${seen.sky.back} and ${seen.matt.back}`);
  assert.ok(sum(seen.unknown.drone) > 200 && isBlack(seen.unknown.back), `${seen.unknown.drone} and ${seen.unknown.back}`);
});

test('lightmap and albedo views show data without tone mapping', needsBaked, async () => {
  const { one, two, albedo, exposure } = await inPage(() => {
    window.only({ 'left lamp': ['white', 20] });
    window.stage.renderer.toneMappingExposure = 0.02;
    window.room.setView('lightmap');
    const one = window.look();
    window.room.setLight('left lamp', 'white', 40);
    const two = window.look();
    window.stage.renderer.toneMappingExposure = 0.01;
    const exposure = window.look();
    window.room.setView('albedo');
    const albedo = window.look();
    window.reset();
    return { one, two, albedo, exposure };
  });
  const linear = (value) => (value / 255 <= 0.04045 ? value / 255 / 12.92 : ((value / 255 + 0.055) / 1.055) ** 2.4);
  for (const place of ['leftWall', 'rightWall', 'back']) {
    // Averaged bytes are not averaged light, so a percent or so is theirs.
    const ratio = linear(two[place][0]) / linear(one[place][0]);
    assert.ok(Math.abs(ratio - 2) < 0.06, `${place}: twice the light is ${ratio} times as bright`);
    for (let i = 0; i < 3; i++) assert.ok(Math.abs(exposure[place][i] - one[place][i]) < 0.5, `${place}: half the exposure of twice the light`);
  }
  const white = 255 * (1.055 * 0.7 ** (1 / 2.4) - 0.055);
  for (const place of ['leftWall', 'back', 'ceiling']) assert.ok(Math.abs(albedo[place][1] - white) < 1, `${place} ${albedo[place]}, not ${white}`);
});

test('a picture on the monitor lights the sides it shows, and is the right way up', needsBaked, async () => {
  const seen = await inPage(() => {
    const { room } = window;
    const canvas = document.createElement('canvas');
    canvas.width = 160;
    canvas.height = 90;
    const context = canvas.getContext('2d');
    const fill = (color, ...rect) => {
      context.fillStyle = color;
      context.fillRect(...rect);
    };
    window.only({});
    room.monitors[0].strength.setRGB(100, 100, 100);
    fill('#f00', 0, 0, 80, 90);
    fill('#00f', 80, 0, 80, 90);
    room.monitors[0].setImage(canvas);
    const sides = window.look();
    fill('#000', 0, 0, 160, 90);
    fill('#fff', 0, 0, 160, 45);
    room.monitors[0].setImage(canvas);
    const top = window.look();
    fill('#000', 0, 0, 160, 90);
    fill('#fff', 0, 0, 40, 45);
    room.monitors[0].setImage(canvas);
    const corner = window.look();
    const cells = room.lights.filter(({ monitor }) => monitor).map(({ intensity }) => intensity);
    // A live canvas is read again every frame.
    room.monitors[0].setImage(canvas, true);
    window.look();
    fill('#0f0', 0, 0, 160, 90);
    const live = window.look();
    room.monitors[0].setPixels(new Uint8Array(4 * 4 * 2).map((_, i) => (i < 16 && i % 4 === 0 ? 255 : 0)), 4, 2);
    const pixels = window.look();
    window.reset();
    return { sides, top, corner, cells, live, pixels };
  });
  const { sides, top, corner, live, pixels } = seen;
  assert.ok(sides.leftWall[0] > 1.05 * sides.leftWall[2], `left wall ${sides.leftWall}`);
  assert.ok(sides.rightWall[2] > 1.05 * sides.rightWall[0], `right wall ${sides.rightWall}`);
  assert.ok(sides.screenLeft[0] > 150 && sides.screenLeft[0] > sides.screenLeft[2], `the screen's left ${sides.screenLeft}`);
  assert.ok(sides.screenRight[2] > 150 && sides.screenRight[2] > sides.screenRight[0], `the screen's right ${sides.screenRight}`);
  assert.ok(sum(top.ceiling) > 1.1 * sum(top.floor), `ceiling ${top.ceiling}, floor ${top.floor}`);
  assert.ok(sum(corner.screenTopLeft) > 400, `top left ${corner.screenTopLeft}`);
  assert.ok(sum(corner.screenRight) < 60, `right ${corner.screenRight}`); // it reflects a little
  assert.ok(Math.abs(seen.cells[0] - 100) < 1 && seen.cells.slice(1).every((value) => value < 0.5), `${seen.cells}`);
  assert.ok(live.leftWall[1] > 30 && live.leftWall[0] < 1, `a live canvas: ${live.leftWall}`);
  assert.ok(pixels.ceiling[0] > 10 && pixels.ceiling[1] < 1 && pixels.screenTopLeft[0] > 100, `pixels: ${pixels.ceiling}, ${pixels.screenTopLeft}`);
});

test('a video on the monitor lights the room frame by frame', needsBaked, async () => {
  const { green, screen, authored } = await inPage(async () => {
    const { room } = window;
    const canvas = document.createElement('canvas');
    canvas.width = 160;
    canvas.height = 90;
    const context = canvas.getContext('2d');
    const recorder = new MediaRecorder(canvas.captureStream(30), { mimeType: 'video/webm;codecs=vp8' });
    const parts = [];
    recorder.ondataavailable = ({ data }) => parts.push(data);
    const stopped = new Promise((resolve) => (recorder.onstop = resolve));
    recorder.start(100);
    // A busy machine takes its time until the first frames are in.
    for (let i = 0; i < 20 || (i < 400 && parts.reduce((sum, { size }) => sum + size, 0) < 1500); i++) {
      context.fillStyle = i % 2 ? '#00ff00' : '#00fe00';
      context.fillRect(0, 0, 160, 90);
      await new Promise((resolve) => setTimeout(resolve, 40));
    }
    recorder.stop();
    await stopped;
    const video = document.createElement('video');
    Object.assign(video, { muted: true, loop: true, src: URL.createObjectURL(new Blob(parts, { type: 'video/webm' })) });
    window.only({});
    const authoredCells = () => room.lights.filter(({ monitor }) => monitor).map(({ color, intensity }) => color.g * intensity);
    await video.play();
    room.monitors[0].strength.setRGB(20, 20, 20);
    room.monitors[0].setVideo(video);
    let seen;
    for (let i = 0; i < 100; i++) {
      await new Promise((resolve) => setTimeout(resolve, 50));
      seen = window.look();
      if (seen.leftWall[1] > 1) break;
    }
    const cells = room.lights.filter(({ monitor }) => monitor).map(({ color, intensity }) => [color.r * intensity, color.g * intensity]);
    video.pause();
    room.monitors[0].setVideo(null);
    URL.revokeObjectURL(video.src);
    const result = { green: seen, screen: cells, authored: authoredCells() };
    window.reset();
    return result;
  });
  assert.ok(green.leftWall[1] > 10 && green.leftWall[0] < green.leftWall[1] / 4, `left wall ${green.leftWall}`);
  for (const [red, light] of screen) assert.ok(light > 15 && red < 1, `cells ${screen}`); // a codec keeps colours nearly
  for (const cell of authored) assert.ok(Math.abs(cell - 20) < 1e-3, `without a picture: ${authored}`);
});

test('programs, animations of the file and bound lights drive layers', needsBaked, async () => {
  const seen = await inPage(() => {
    const { room } = window;
    const { THREE } = window.stage;
    window.reset();
    const light = (name) => room.lights.find((candidate) => candidate.name === name);
    const at = (name, time) => (room.update(time), light(name).color.r * light(name).intensity);
    const blue = (name, time) => (room.update(time), light(name).color.b * light(name).intensity);
    const ember = [at('ember', 0.5), at('ember', 1.5), at('ember', 2.5)];
    const sweep = [blue('sweep', 0), blue('sweep', 1), blue('sweep', 1.5)];
    room.stop('sweep');
    const stopped = [blue('sweep', 0), blue('sweep', 0.5)];
    room.play('sweep');
    const played = blue('sweep', 1);
    room.setProgram('left lamp', { kind: 'keys', keys: [0, 0, 0, 0, 2, 8, 0, 0], loop: false });
    const keys = [at('left lamp', 0), at('left lamp', 1), at('left lamp', 3)];
    const lamp = new THREE.PointLight(0xffffff, 5);
    const end = room.bind(lamp, 'right lamp');
    lamp.intensity = 11;
    const bound = at('right lamp', 0);
    end();
    lamp.intensity = 12;
    const ended = at('right lamp', 0);
    const drone = room.scene.getObjectByName('drone');
    room.update(0);
    const start = drone.position.x;
    room.update(1);
    const moved = drone.position.x;
    room.setLight('ember', 'white', 3);
    const own = [at('ember', 0.5), at('ember', 1.5)];
    window.reset();
    return { ember, sweep, stopped, played, keys, bound, ended, start, moved, own, again: [at('ember', 0.5), at('ember', 1.5)] };
  });
  const near = (values, wanted) => values.forEach((value, i) => assert.ok(Math.abs(value - wanted[i]) < 1e-4, `${values} and not ${wanted}`));
  near(seen.ember, [10, 0, 10]);
  near(seen.sweep, [0, 8, 4]);
  assert.equal(seen.stopped[0], seen.stopped[1]);
  near([seen.played], [8]);
  near(seen.keys, [0, 4, 8]);
  near([seen.bound, seen.ended], [11, 11]);
  near([seen.start, seen.moved], [0, 0.8]);
  near(seen.own, [3, 3]);
  near(seen.again, [10, 0]);
});

test('colours that did not change cost no upload', needsBaked, async () => {
  const changes = await inPage(() => {
    window.only({ 'left lamp': ['white', 3] });
    const { room } = window;
    room.update(0);
    const list = [room.update(0)];
    room.setLight('left lamp', 'white', 4);
    list.push(room.update(0), room.update(0));
    return list;
  });
  assert.deepEqual(changes, [false, true, false]);
});

test('very bright and very dark light is neither cut off nor lost', needsBaked, async () => {
  const ratios = await inPage(() => {
    const { renderer } = window.stage;
    window.room.setView('lightmap');
    const seen = [];
    for (const intensity of [1e-5, 1, 1e7]) {
      window.only({ 'left lamp': ['white', intensity] });
      renderer.toneMappingExposure = 3 / intensity;
      seen.push(window.look().leftWall[1]);
    }
    window.reset();
    return seen;
  });
  assert.ok(ratios[1] > 50 && ratios[1] < 250, `${ratios}`);
  for (const value of ratios) assert.ok(Math.abs(value - ratios[1]) < 1.5, `${ratios}`); // 1/512 of each texel
});

test('light that fades to nothing, or is taken away, is summed like any other', needsBaked, async () => {
  const { errors, rests } = await inPage(() => {
    const { room, why } = window;
    window.only({});
    const errors = [1e-30, 1e-36, 1e-40, -1, 0].map((intensity) => why(() => (room.setLight('left lamp', 'white', intensity), room.update(0))));
    room.setLight('right lamp', 'white', 1);
    room.setLight('left lamp', 'white', -1);
    errors.push(why(() => room.update(0)));
    room.setLight('right lamp', 'white', 0);
    room.setLight('left lamp', 'white', 1e-37);
    room.update(0);
    const rests = !room.update(0);
    window.reset();
    return { errors, rests };
  });
  assert.deepEqual(errors, ['', '', '', '', '', '']);
  assert.ok(rests, 'a scale that cannot grow composes everything every frame');
});

test('bright light is not cut off because other light is taken away', needsBaked, async () => {
  const { brightest, scale } = await inPage(() => {
    const { room } = window;
    window.only({ 'left lamp': ['white', 1000], 'right lamp': ['white', -999] });
    room.update(0);
    const { vertexShader, fragmentShader } = window.stage.THREE.ShaderLib.physical;
    const shader = { uniforms: {}, vertexShader, fragmentShader };
    room.scene.getObjectByName('back').material.onBeforeCompile(shader);
    const scale = shader.uniforms.luxelScale.value;
    let brightest = 0;
    for (let page = 0; page < room.pageCount; page++) for (const value of room.readPage(page)) brightest = Math.max(brightest, value);
    window.reset();
    return { brightest, scale };
  });
  assert.ok(brightest > 100 && brightest < 65408 * scale, `${brightest} lux of ${65408 * scale}`);
});

test('input that cannot be is refused by name, and nothing changes', needsBaked, async () => {
  const seen = await inPage(() => {
    const { room, why } = window;
    const { THREE } = window.stage;
    window.reset();
    const lamp = room.lights.find(({ name }) => name === 'left lamp');
    const at = (time) => (room.update(time), lamp.color.r * lamp.intensity);
    const ramp = { kind: 'keys', keys: [0, 0, 0, 0, 2, 8, 0, 0], loop: false };
    room.setProgram('left lamp', ramp);
    const messages = { set: why(() => room.setLight('left lamp', 'white', NaN)) };
    messages.program = why(() => room.setProgram('left lamp', { kind: 'keys', keys: [2, 5, 5, 5, 1, 5, 5, 5] }));
    const program = [at(0), at(1), at(2)];
    lamp.intensity = NaN;
    messages.field = why(() => room.update(1));
    messages.after = why(() => room.update(1));
    lamp.color.r = Infinity;
    messages.color = why(() => room.update(1));
    const kept = at(1);

    const bound = new THREE.PointLight(0xffffff, 5);
    room.bind(bound, 'left lamp');
    messages.noLight = why(() => room.bind({}, 'left lamp'));
    messages.boundProgram = why(() => room.setProgram('left lamp', { kind: 'blink', period: 0 }));
    messages.boundSet = why(() => room.setLight('left lamp', 'white', Infinity));
    bound.intensity = 7;
    const stillBound = at(0);
    bound.intensity = NaN;
    messages.bound = why(() => room.update(0));
    bound.intensity = 3;
    const again = at(0);

    const [monitor] = room.monitors;
    monitor.strength.setRGB(1, -1, 1);
    messages.strength = why(() => room.update(0));
    const strength = monitor.strength.equals(window.strengths[0]);
    const before = room.readPage(0);
    messages.page = why(() => room.readLayer(99, 'left lamp'));
    const same = room.readPage(0).every((value, i) => value === before[i]);
    window.reset();
    return { messages, program, kept, stillBound, again, strength, same };
  });
  const { messages } = seen;
  for (const what of ['set', 'field', 'color', 'boundSet', 'bound']) assert.match(messages[what], /layer "left lamp": a colour of .*(NaN|Infinity)/, what);
  assert.match(messages.noLight, /bound to layer "left lamp" is no light/);
  assert.match(messages.strength, /monitor "screen": a strength of 1, -1, 1/);
  for (const what of ['program', 'boundProgram', 'page']) assert.notEqual(messages[what], '', what);
  assert.equal(messages.after, '');
  assert.deepEqual(seen.program, [0, 4, 8]);
  assert.deepEqual([seen.kept, seen.stillBound, seen.again], [4, 7, 3]);
  assert.ok(seen.strength, 'the strength that was refused is put back');
  assert.ok(seen.same, 'a layer that cannot be read leaves the others alone');
});

test('a screen is as bright as the light of its cells, and shows cells that are not as authored', needsBaked, async () => {
  const seen = await inPage(() => {
    const { room } = window;
    const [monitor] = room.monitors;
    window.reset();
    const shown = (time = 0) => {
      room.update(time);
      const { material } = monitor.meshes[0];
      const cell = room.lights[monitor.firstLayer];
      return { cells: material.emissiveMap?.isDataTexture === true, screen: material.emissive.g, cell: cell.color.g * cell.intensity };
    };
    const list = { authored: shown() };
    monitor.strength.multiplyScalar(3);
    list.stronger = shown();
    room.setLight('left lamp', 'white', 2);
    list.unrelated = shown();
    room.setLight(monitor.firstLayer, 'lime', 5);
    list.own = shown();
    monitor.strength.copy(window.strengths[0]);
    list.ownStill = shown();
    room.resetLight(monitor.firstLayer);
    list.reset = shown();
    for (let k = 0; k < 8; k++) room.setProgram(monitor.firstLayer + k, { kind: 'blink', color: 'lime', intensity: 6, period: 2 });
    list.on = shown(0.5);
    list.off = shown(1.5);
    const { image } = monitor.meshes[0].material.emissiveMap;
    list.black = image.data.every((value, i) => i % 4 === 3 || value === 0);
    for (let k = 0; k < 7; k++) room.resetLight(monitor.firstLayer + k);
    list.oneLeft = shown(0.5).cells;
    room.resetLight(monitor.firstLayer + 7);
    list.last = shown(0.5);
    monitor.setPixels(new Uint8Array(32).fill(255), 4, 2);
    room.resetLight(monitor.firstLayer);
    list.pixels = shown().cells;
    window.reset();
    return list;
  });
  const { authored } = seen;
  assert.ok(authored.screen > 0 && authored.cell > 0 && !authored.cells, JSON.stringify(authored));
  const near = (value, wanted) => assert.ok(Math.abs(value - wanted) < 1e-5 * wanted, `${value} and not ${wanted}`);
  for (const stronger of [seen.stronger, seen.unrelated]) {
    near(stronger.screen, 3 * authored.screen);
    near(stronger.cell, 3 * authored.cell);
  }
  assert.ok(seen.own.cells && seen.ownStill.cells);
  assert.deepEqual([seen.own.cell, seen.ownStill.cell], [5, 5]);
  assert.deepEqual(seen.reset, authored);
  assert.deepEqual([seen.on.cells, seen.on.cell, seen.off.cells, seen.off.cell, seen.black], [true, 6, true, 0, true]);
  assert.equal(seen.oneLeft, true);
  assert.deepEqual(seen.last, authored);
  assert.equal(seen.pixels, true);
});

test('smoothing is for pictures that move: still ones and pixels are there at once', needsBaked, async () => {
  const seen = await inPage(() => {
    const { room } = window;
    const [monitor] = room.monitors;
    window.reset();
    const canvas = document.createElement('canvas');
    canvas.width = 8;
    canvas.height = 4;
    const context = canvas.getContext('2d');
    const fill = (color) => {
      context.fillStyle = color;
      context.fillRect(0, 0, 8, 4);
    };
    const cell = () => (room.update(0), room.lights[monitor.firstLayer].intensity);
    monitor.strength.setRGB(10, 10, 10);
    monitor.setPixels(new Uint8Array(32), 4, 2);
    monitor.smoothing = 0.5;
    fill('#fff');
    monitor.setImage(canvas);
    const still = cell();
    monitor.setPixels(new Uint8Array(32), 4, 2);
    const pixels = cell();
    monitor.setImage(canvas, true);
    const live = [cell(), cell()];
    // A video that is paused has the frame it has.
    const video = Object.assign(document.createElement('canvas'), { width: 8, height: 4, readyState: 2, paused: true, currentTime: 0 });
    video.getContext('2d').fillRect(0, 0, 8, 4);
    monitor.setVideo(video);
    for (let i = 0; i < 30; i++) cell();
    const paused = cell();
    monitor.smoothing = 0;
    window.reset();
    return { still, pixels, live, paused };
  });
  const near = (value, wanted) => assert.ok(Math.abs(value - wanted) < 1e-3, `${value} and not ${wanted}: ${JSON.stringify(seen)}`);
  near(seen.still, 10);
  near(seen.pixels, 0);
  near(seen.live[0], 7.5);
  near(seen.live[1], 8.75);
  near(seen.paused, 0);
});

test('a picture that may not be read brings back the authored one, and keeps no other from being shown', needsBaked, async () => {
  // A pixel of another site, which says nothing of who may read it.
  const png = Buffer.from('iVBORw0KGgoAAAANSUhEUgAAAAEAAAABCAYAAAAfFcSJAAAADUlEQVR42mNk+M9QDwADhgGAWjR9awAAAABJRU5ErkJggg==', 'base64');
  const foreign = await serve({ '/': (path, response) => response.writeHead(200, { 'Content-Type': 'image/png' }).end(png) });
  const seen = await inPage(async (url) => {
    const { room, why } = window;
    const [monitor] = room.monitors;
    window.reset();
    room.update(0);
    const { material } = monitor.meshes[0];
    const state = () => (room.update(0), [material.emissiveMap?.image?.width ?? null, material.emissive.g, room.lights[monitor.firstLayer].intensity]);
    const authored = state();
    const image = new Image();
    image.src = url;
    await image.decode();
    const refused = why(() => monitor.setImage(image));
    const after = state();
    const canvas = document.createElement('canvas');
    canvas.width = canvas.height = 1;
    canvas.getContext('2d').fillRect(0, 0, 1, 1);
    const good = why(() => monitor.setImage(canvas));
    window.reset();
    return { authored, refused, after, good };
  }, `${foreign.url}pixel.png`);
  await foreign.close();
  assert.match(seen.refused, /monitor "screen": .*\(CORS\)/);
  assert.deepEqual(seen.after, seen.authored);
  assert.equal(seen.good, '');
});

test('nodes that are stopped stay where they are, and go on at the time there is', needsBaked, async () => {
  const places = await inPage(() => {
    const { room } = window;
    window.reset();
    const drone = room.scene.getObjectByName('drone');
    const at = (time) => (room.update(time), drone.position.x);
    const list = [at(0.5)];
    room.stop('fly');
    list.push(at(0.5), at(1.3));
    room.stop();
    list.push(at(1.9));
    room.play();
    list.push(at(1));
    return list;
  });
  [0.4, 0.4, 0.4, 0.4, 0.8].forEach((wanted, i) => assert.ok(Math.abs(places[i] - wanted) < 1e-4, `${places}`));
});

test('uploads go to the lightmap, whatever texture unit was used last', needsBaked, async () => {
  const error = await inPage(() => {
    const { renderer } = window.stage;
    const gl = renderer.getContext();
    window.look();
    window.only({ 'left lamp': ['white', 5] });
    window.room.update(0);
    while (gl.getError() !== gl.NO_ERROR);
    renderer.state.activeTexture(gl.TEXTURE0 + 7);
    renderer.state.bindTexture(gl.TEXTURE_2D_ARRAY, null);
    gl.bindTexture(gl.TEXTURE_2D_ARRAY, null);
    window.room.setLight('left lamp', 'white', 6);
    window.room.update(0);
    const error = gl.getError();
    window.reset();
    return error;
  });
  assert.equal(error, 0);
});

test('shaders of three.js without the functions to replace are an error', needsBaked, async () => {
  const errors = await inPage(async () => {
    const { THREE } = window.stage;
    const { createUniforms, Materials } = await import('/luxel-three/materials.js');
    const compile = () => {
      const materials = new Materials(createUniforms(), 'cpu', 'bilinear');
      const material = materials.lit(new THREE.MeshStandardMaterial());
      const { vertexShader, fragmentShader } = THREE.ShaderLib.physical;
      material.onBeforeCompile({ uniforms: {}, vertexShader, fragmentShader });
    };
    const kept = THREE.ShaderChunk.lights_pars_begin;
    const list = [window.why(compile)];
    for (const name of ['getDistanceAttenuation', 'getSpotAttenuation']) {
      THREE.ShaderChunk.lights_pars_begin = kept.replaceAll(name, 'attenuation');
      list.push(window.why(compile));
    }
    THREE.ShaderChunk.lights_pars_begin = kept;
    return list;
  });
  assert.equal(errors[0], '');
  assert.match(errors[1], /three\.js r\d+ have no function getDistanceAttenuation/);
  assert.match(errors[2], /three\.js r\d+ have no function getSpotAttenuation/);
});

test('a pack that is longer than its response said arrives whole', needsBaked, async () => {
  const runtime = await Runtime.instantiate(readFileSync(process.env.LUXEL_WASM));
  const body = new Uint8Array(200000).map((_, i) => i * 7);
  const parts = [body.subarray(0, 900), body.subarray(900, 1300), body.subarray(1300)];
  for (const interrupted of [false, true]) {
    const stream = new ReadableStream({
      pull(controller) {
        controller.enqueue(parts.shift());
        if (parts.length === 0) controller.close();
        if (interrupted) runtime.allocate(64);
      },
    });
    const { at, size } = await runtime.receive({ headers: new Headers({ 'content-length': '1200' }), body: stream });
    assert.equal(size, body.length);
    assert.deepEqual(runtime.bytes(at, size), body);
    parts.push(body.subarray(0, 900), body.subarray(900, 1300), body.subarray(1300));
  }
});

test('who gives up loading does not keep others from the runtime', needsBaked, async () => {
  const wasm = readFileSync(process.env.LUXEL_WASM);
  const server = await serve({ '/': (path, response) => setTimeout(() => response.writeHead(200, { 'Content-Type': 'application/wasm' }).end(wasm), 100) });
  const controller = new AbortController();
  const first = Runtime.load(`${server.url}rt.wasm`, controller.signal).catch(({ name }) => name);
  const second = Runtime.load(`${server.url}rt.wasm`);
  controller.abort();
  assert.equal(await first, 'AbortError');
  assert.ok((await second).memoryBytes > 0);
  await server.close();
});

test('the sky is where the file has it, in the background and in reflections', needsBaked, async () => {
  const seen = await inPage(async () => {
    const { THREE, renderer } = window.stage;
    const { Sky } = await import('/luxel-three/sky.js');
    const { createUniforms } = await import('/luxel-three/materials.js');
    // Red towards +X (u = 1/2), green towards +Z (u = 3/4), blue towards -Z (u = 1/4), rows from the top on, upper half alone.
    const [width, height] = [64, 32];
    const data = new Uint16Array(4 * width * height);
    const one = THREE.DataUtils.toHalfFloat(1);
    for (let y = 0; y < height / 2; y++)
      for (let x = 0; x < width; x++) {
        const u = (x + 0.5) / width;
        const channel = Math.abs(u - 0.5) < 0.125 ? 0 : Math.abs(u - 0.75) < 0.125 ? 1 : Math.abs(u - 0.25) < 0.125 ? 2 : 3;
        data[4 * (y * width + x) + channel] = one;
      }
    const mirror = new THREE.Mesh(new THREE.SphereGeometry(1, 64, 32), new THREE.MeshStandardMaterial({ metalness: 1, roughness: 0 }));
    const results = {};
    renderer.toneMapping = THREE.NoToneMapping;
    for (const degrees of [0, 90]) {
      const sky = new Sky({ width, height, data, type: THREE.HalfFloatType, topFirst: true }, (degrees * Math.PI) / 180);
      const scene = new THREE.Scene();
      sky.addTo(scene);
      sky.setColor(scene, [1, 1, 1], createUniforms());
      const room = window.stage.room;
      window.stage.room = { update() {}, scene };
      const camera = window.stage.camera;
      const towards = (x, y, z) => {
        window.stage.look([0, 0, 0], [x, y, z], 30);
        return window.stage.mean(window.stage.draw(), [0.45, 0.45, 0.55, 0.55]);
      };
      results[degrees] = { x: towards(1, 0.3, 0), z: towards(0, 0.3, 1), down: towards(1, -0.5, 0) };
      // What a mirror shows to an eye at -X looking towards +X is behind the eye, unless it looks at its rim: seen from above at +X's side.
      scene.add(mirror);
      window.stage.look([4, 1.5, 0], [0, 0, 0], 8);
      results[degrees].mirrored = window.stage.mean(window.stage.draw(), [0.45, 0.4, 0.55, 0.5]);
      mirror.removeFromParent();
      window.stage.room = room;
      window.stage.camera = camera;
      sky.dispose();
    }
    mirror.geometry.dispose();
    mirror.material.dispose();
    renderer.toneMapping = THREE.NeutralToneMapping;
    return results;
  });
  const is = (rgb, channel) => rgb.forEach((value, i) => assert.ok(i === channel ? value > 200 : value < 40, `${rgb}: not channel ${channel}`));
  is(seen[0].x, 0);
  is(seen[0].z, 1);
  assert.ok(isBlack(seen[0].down));
  is(seen[0].mirrored, 0);
  // docs: a rotation turns about +Y, so what was towards +X is towards -Z, and towards +X is what was towards +Z.
  is(seen[90].x, 1);
  is(seen[90].mirrored, 1);
});

test('both methods give the same picture', needsBaked, async () => {
  const { worst, mean, method, change } = await inPage(async () => {
    const { stage } = window;
    const setting = () => {
      for (const light of stage.room.lights) stage.room.setLight(light.index, new stage.THREE.Color().setRGB(1, light.index % 3, light.index % 2), 1 + light.index);
    };
    setting();
    const cpu = stage.draw();
    const kept = stage.room;
    await stage.load('/baked/', { method: 'gpu' });
    stage.camera = kept.cameras[0];
    setting();
    const gpu = stage.draw();
    let worst = 0;
    let total = 0;
    for (let i = 0; i < cpu.length; i++) {
      worst = Math.max(worst, Math.abs(cpu[i] - gpu[i]));
      total += Math.abs(cpu[i] - gpu[i]);
    }
    const { method } = stage.room;
    stage.room.setLight('left lamp', 'white', 1000);
    const change = [stage.room.update(0), stage.room.update(0)];
    stage.room.dispose();
    stage.room = kept;
    return { worst, mean: total / cpu.length, method, change };
  });
  assert.equal(method, 'gpu');
  assert.deepEqual(change, [true, false]);
  // Composed texels are rounded to 1/512 of their largest channel.
  assert.ok(worst <= 3, `worst ${worst}`);
  assert.ok(mean < 0.5, `mean ${mean}`);
});

test('bicubic filtering is smoother than bilinear, and as bright', needsBaked, async () => {
  const { bilinear, bicubic } = await inPage(async () => {
    const { stage } = window;
    const kept = stage.room;
    const roughness = (pixels) => {
      let sum = 0;
      for (let y = 70; y < 160; y++)
        for (let x = 5; x < 45; x++) {
          const at = 4 * (y * 320 + x) + 1;
          sum += Math.abs(2 * pixels[at] - pixels[at - 4] - pixels[at + 4]);
        }
      return sum;
    };
    const see = () => {
      stage.room.setView('lightmap');
      const pixels = stage.draw();
      stage.room.setView('lit');
      return { rough: roughness(pixels), mean: stage.mean(pixels, window.places.leftWall) };
    };
    window.reset();
    const bilinear = see();
    await stage.load('/baked/', { filter: 'bicubic' });
    stage.camera = kept.cameras[0];
    const bicubic = see();
    stage.room.dispose();
    stage.room = kept;
    return { bilinear, bicubic };
  });
  assert.ok(bicubic.rough < 0.8 * bilinear.rough, `${bicubic.rough} and ${bilinear.rough}`);
  bicubic.mean.forEach((value, i) => assert.ok(Math.abs(value - bilinear.mean[i]) < 2, `${bicubic.mean} and ${bilinear.mean}`));
});

test('dispose gives back all that a room took', needsBaked, async () => {
  const counts = await inPage(async () => {
    const { stage } = window;
    const gl = stage.renderer.getContext();
    const live = { textures: 0, buffers: 0 };
    for (const [create, remove, kind] of [['createTexture', 'deleteTexture', 'textures'], ['createBuffer', 'deleteBuffer', 'buffers']]) {
      const [made, gone] = [gl[create].bind(gl), gl[remove].bind(gl)];
      gl[create] = () => (live[kind]++, made());
      gl[remove] = (object) => (object && live[kind]--, gone(object));
    }
    window.room.dispose();
    const camera = window.room.cameras[0];
    const list = [];
    for (const method of ['cpu', 'gpu', 'cpu', 'gpu']) {
      await stage.load('/baked/', { method });
      stage.camera = camera;
      stage.room.monitors[0].setPixels(new Uint8Array(32).fill(255), 4, 2);
      stage.draw();
      stage.room.dispose();
      stage.room.dispose(); // twice is once
      list.push({ ...stage.renderer.info.memory, programs: stage.renderer.info.programs.length, ...live });
    }
    return list;
  });
  for (const count of counts.slice(1)) assert.deepEqual(count, counts[0]);
});

test('what is wrong with a folder is said', needsBaked, async () => {
  const messages = await inPage(async () => {
    const { stage } = window;
    const originalFetch = window.fetch;
    const why = async (edit, options = {}) => {
      window.fetch = async (url, init) => {
        const response = await originalFetch(url, init);
        const changed = await edit(String(url), response);
        return changed ?? response;
      };
      try {
        await stage.load('/baked/', options);
        return 'loaded';
      } catch (error) {
        return error.message;
      } finally {
        window.fetch = originalFetch;
      }
    };
    const limited = async (limit, value) => {
      const gl = stage.renderer.getContext();
      gl.getParameter = (name) => (name === gl[limit] ? value : WebGL2RenderingContext.prototype.getParameter.call(gl, name));
      const message = await why(() => null);
      delete gl.getParameter;
      return message;
    };
    const manifest = async (response, change) => new Response(JSON.stringify({ ...(await response.json()), ...change }));
    const of = (name, make) => async (url, response) => (url.endsWith(name) ? make(response) : null);
    return {
      version: await why(of('luxel.json', (response) => manifest(response, { version: 7 }))),
      outside: await why(of('luxel.json', (response) => manifest(response, { pack: '../secret' }))),
      pack: await why(of('luxel.pack', () => new Response('no such thing'))),
      cut: await why(of('luxel.pack', async (response) => new Response((await response.arrayBuffer()).slice(0, 5000)))),
      scene: await why(of('scene.glb', () => new Response('no such thing at all'))),
      method: await why(() => null, { method: 'magic' }),
      pages: await limited('MAX_TEXTURE_SIZE', 64),
      slices: await limited('MAX_ARRAY_TEXTURE_LAYERS', 1),
      aborted: await why(() => null, { signal: AbortSignal.abort(new Error('enough')) }),
    };
  });
  assert.match(messages.version, /luxel\.json: version 7/);
  assert.match(messages.outside, /bad path of pack/);
  assert.match(messages.pack, /luxel\.pack: not a pack/);
  assert.match(messages.cut, /luxel\.pack: truncated/);
  assert.match(messages.scene, /scene\.glb: not a GLB/);
  assert.match(messages.method, /"magic" is no method/);
  assert.match(messages.pages, /128 x 128 texels are more than the 64 x 64 .*--page-size/);
  assert.match(messages.slices, /2 pages are more than the 1 .*--max-pages/);
  assert.match(messages.aborted, /enough/);
});

test('no complaint, nothing asked of others', needsBaked, () => stage.assertClean());
