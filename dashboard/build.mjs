// Makes static/built/ from source/ and from the npm packages that package-lock.json names. Run it with `npm ci && npm run build`.
// static/built/ is kept in the repository, so neither the program nor its tests need node.
import { build } from "esbuild";
import { createHash } from "node:crypto";
import { existsSync, mkdirSync, readdirSync, readFileSync, rmSync, statSync, writeFileSync } from "node:fs";
import { dirname, join, relative } from "node:path";
import { fileURLToPath } from "node:url";

const HERE = dirname(fileURLToPath(import.meta.url));
const BUILT = join(HERE, "static", "built");

function filesBelow(directory) {
  return readdirSync(directory).flatMap((name) => {
    const path = join(directory, name);
    return statSync(path).isDirectory() ? filesBelow(path) : [path];
  });
}

// tests/dashboard/test_built.py computes the same digest, and fails where a source was changed and nobody built.
function digestOfSources() {
  const paths = [...filesBelow(join(HERE, "source")), ...["build.mjs", "package.json", "package-lock.json", "tsconfig.json"].map((name) => join(HERE, name))];
  const names = paths.map((path) => relative(HERE, path).replaceAll("\\", "/")).sort();
  const digest = createHash("sha256");
  for (const name of names) digest.update(`${name}\0`).update(readFileSync(join(HERE, name))).update("\0");
  return digest.digest("hex");
}

function packageOf(input) {
  const found = /node_modules\/((?:@[^/]+\/)?[^/]+)\//.exec(input);
  return found ? found[1] : null;
}

function licences(inputs) {
  const packages = [...new Set(inputs.map(packageOf).filter(Boolean))].sort();
  return packages.map((name) => {
    const directory = join(HERE, "node_modules", name);
    const file = ["LICENSE", "LICENSE.md", "LICENSE.txt"].map((text) => join(directory, text)).find(existsSync);
    if (!file) throw new Error(`${name} has no licence file`);
    const { version } = JSON.parse(readFileSync(join(directory, "package.json"), "utf8"));
    return `${name} ${version}\n\n${readFileSync(file, "utf8").trim()}\n`;
  }).join(`\n${"-".repeat(80)}\n\n`);
}

rmSync(BUILT, { recursive: true, force: true });
mkdirSync(BUILT, { recursive: true });
const OPTIONS = {
  absWorkingDir: HERE,
  outdir: BUILT,
  bundle: true,
  format: "esm",
  target: "es2022",
  minify: true,
  legalComments: "none",
  jsx: "automatic",
  jsxImportSource: "preact",
  metafile: true,
  logLevel: "info",
};
const result = await build({ ...OPTIONS, entryPoints: { main: "source/main.ts" }, splitting: true, chunkNames: "[name]-[hash]" });
// A page that is saved as one file has all of its program in it.
await build({ ...OPTIONS, entryPoints: { standalone: "source/standalone.tsx" } });
writeFileSync(join(BUILT, "licences.txt"), licences(Object.keys(result.metafile.inputs)));
writeFileSync(join(BUILT, "sources.sha256"), `${digestOfSources()}\n`);
