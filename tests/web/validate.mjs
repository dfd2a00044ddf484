// The Khronos glTF validator: as a function, and as a program: node validate.mjs FILE…
// Exit code 1 if a file has an error; warnings are counted only.
import { readFile } from "node:fs/promises";
import { dirname, resolve } from "node:path";
import { pathToFileURL } from "node:url";
import validator from "gltf-validator";

const ERROR = 0;

/** Validates a .glb or .gltf file; returns { errors: [text], warnings: count, report }. */
export async function validate(path) {
  const report = await validator.validateBytes(new Uint8Array(await readFile(path)), {
    uri: path,
    maxIssues: 1000,
    externalResourceFunction: async (uri) => new Uint8Array(await readFile(resolve(dirname(path), decodeURIComponent(uri)))),
  });
  const errors = report.issues.messages
    .filter((issue) => issue.severity === ERROR)
    .map((issue) => `${issue.code} at ${issue.pointer ?? `byte ${issue.offset ?? "?"}`}: ${issue.message}`);
  return { errors, warnings: report.issues.numWarnings, report };
}

async function main(paths) {
  if (paths.length === 0) {
    console.error("usage: node validate.mjs FILE…");
    return 2;
  }
  let failed = false;
  for (const path of paths) {
    const { errors, warnings } = await validate(path);
    for (const error of errors) console.log(`${path}: ${error}`);
    console.log(`${path}: ${errors.length} errors, ${warnings} warnings`);
    failed ||= errors.length > 0;
  }
  return failed ? 1 : 0;
}

if (process.argv[1] && import.meta.url === pathToFileURL(process.argv[1]).href) {
  process.exitCode = await main(process.argv.slice(2));
}
