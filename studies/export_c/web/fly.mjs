// node fly.mjs FILTER.wasm < rows: fly the filter along rows of numbers; print the estimates
import { readFileSync } from "node:fs";

const { instance } = await WebAssembly.instantiate(readFileSync(process.argv[2]), {
  env: { sinf: Math.sin, cosf: Math.cos },
});
const filter = instance.exports;
const given = new Float32Array(filter.memory.buffer, filter.inputs(), 12);
const estimate = new Float32Array(filter.memory.buffer, filter.outputs(), 19);
const rows = JSON.parse(readFileSync(0, "utf8"));
const estimates = rows.map((row, k) => {
  given.set(row.map((x) => x ?? NaN));
  const said = k === 0 ? filter.start() : filter.step();
  if (said < 0) throw new Error(`step ${k} ended with ${said}`);
  return Array.from(estimate);
});
console.log(JSON.stringify(estimates));
