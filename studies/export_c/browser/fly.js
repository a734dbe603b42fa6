// Flies filter.wasm along the rows of flight.json; says status and the estimate's 19 numbers at each step.
const fs = require("fs");
const env = { sinf: Math.sin, cosf: Math.cos };
const module_ = new WebAssembly.Module(fs.readFileSync("filter.wasm"));
const filter = new WebAssembly.Instance(module_, { env }).exports;
const inputs = new Float32Array(filter.memory.buffer, filter.inputs(), 12);
const outputs = new Float32Array(filter.memory.buffer, filter.outputs(), 19);
const rows = JSON.parse(fs.readFileSync("flight.json", "utf8"));
const said = [];
rows.forEach((row, k) => {
  inputs.set(row.map((x) => (x === null ? NaN : x)));
  if (k === 0) {
    filter.start();
  } else {
    said.push([filter.step(), ...outputs]);
  }
});
console.log(JSON.stringify(said));
