import assert from 'node:assert/strict';
import test from 'node:test';
import { autoMethod } from '../luxel-three/method.js';

const heavy = { composeMs: 12, layers: 12, gpuLayersBytes: 1e8, slices: 24, slicesLimit: 256 };

test('few layers that take long to compose are summed per pixel', () => assert.equal(autoMethod(heavy), 'gpu'));

test('what is composed in no time is composed', () => assert.equal(autoMethod({ ...heavy, composeMs: 2 }), 'cpu'));

test('many layers are composed', () => assert.equal(autoMethod({ ...heavy, layers: 17 }), 'cpu'));

test('what the GPU cannot hold is composed', () => {
  assert.equal(autoMethod({ ...heavy, gpuLayersBytes: 3e8 }), 'cpu');
  assert.equal(autoMethod({ ...heavy, gpuLayersBytes: 3e8, gpuMemoryLimit: 4e8 }), 'gpu');
  assert.equal(autoMethod({ ...heavy, slices: 257 }), 'cpu');
});
