// Runs a job on the module: writes bytes, calls functions, reads back what `job.py` asks for.
// The same file serves node and a browser: it defines one function and starts nothing.
async function runJob(wasm, steps, blob) {
  const { instance } = await WebAssembly.instantiate(wasm, {});
  const { memory, ...functions } = instance.exports;
  const found = [];
  for (const [kind, ...what] of steps) {
    if (kind === "grow") {
      const short = what[0] - memory.buffer.byteLength;
      if (short > 0) memory.grow(Math.ceil(short / 65536));
    } else if (kind === "write") {
      const [at, from, bytes] = what;
      new Uint8Array(memory.buffer, at, bytes).set(blob.subarray(from, from + bytes));
    } else if (kind === "call") {
      functions[what[0]](...what.slice(1));
    } else if (kind === "read") {
      found.push(fingerprint(memory.buffer, ...what));
    } else if (kind === "take") {
      found.push(Array.from(new Uint8Array(memory.buffer, what[0], what[1])));
    } else if (kind === "time") {
      const [name, args, times] = what;
      const begun = performance.now();
      for (let k = 0; k < times; k += 1) functions[name](...args);
      found.push((performance.now() - begun) / 1000);
    }
  }
  return found;
}

// Two sums of weighted 32-bit words, rows of `bytes` bytes each `pitch` bytes apart.
function fingerprint(buffer, at, rows, bytes, pitch) {
  let a = 0;
  let b = 0;
  let k = 1;
  const view = new DataView(buffer);
  for (let row = 0; row < rows; row += 1) {
    for (let i = 0; i < bytes; i += 1) {
      const value = view.getUint8(at + row * pitch + i) + 1;
      a = (a + Math.imul(value, Math.imul(k, 0x9e3779b1))) | 0;
      b = (b + Math.imul(value, Math.imul(k, k) ^ 0x85ebca6b)) | 0;
      k += 1;
    }
  }
  return [a >>> 0, b >>> 0];
}

if (typeof module !== "undefined") module.exports = { runJob };
