// Builds the program of the page into one minified file of the Python package, licences first.
// `node build.mjs --check` builds in memory and compares with the committed file.
import { readFile, writeFile } from "node:fs/promises";
import { build } from "esbuild";

const target = new URL("../src/equimorph/explorer/explorer.min.js", import.meta.url);
const licence = await readFile(new URL("node_modules/three/LICENSE", import.meta.url), "utf8");
const banner = `/*! The page of equimorph's explorer, BSD-3-Clause, with three.js:\n\n${licence.trim()}\n*/`;

const result = await build({
  entryPoints: [new URL("src/main.ts", import.meta.url).pathname],
  bundle: true, minify: true, format: "iife", target: "es2022", charset: "utf8",
  loader: { ".css": "text" }, legalComments: "none", banner: { js: banner }, write: false,
});
// A closing script tag in the program would end the element that the page puts it in.
const program = result.outputFiles[0].text.replaceAll("</script", "<\\/script");

if (process.argv.includes("--check")) {
  const committed = await readFile(target, "utf8");
  if (committed !== program) {
    console.error("explorer.min.js is not what the sources give: run `make explorer`");
    process.exit(1);
  }
} else {
  await writeFile(target, program);
  console.log(`explorer.min.js: ${(program.length / 1000).toFixed(0)} kB`);
}
