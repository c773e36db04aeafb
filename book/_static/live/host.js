// The road's WebAssembly module: loads it when somebody asks, fills its memory, drives rides in it.
// `machinery` is self-contained: workers are made of its text, since a page from disk has no files.
(function () {
  "use strict";

  const HERE = document.currentScript.src;

  function machinery() {
    const KINDS = { f8: Float64Array, i8: BigInt64Array, u8: BigUint64Array, f4: Float32Array, b1: Uint8Array };

    function bytesOf(base64) {
      const text = atob(base64);
      const bytes = new Uint8Array(text.length);
      for (let k = 0; k < text.length; k += 1) bytes[k] = text.charCodeAt(k);
      return bytes;
    }

    // One instance of the module; memory is handed out once and never given back.
    class Machine {
      static async load(tab) {
        const { instance } = await WebAssembly.instantiate(bytesOf(tab.wasm), {});
        return new Machine(instance.exports, tab);
      }

      constructor(exports, tab) {
        Object.assign(this, { run: exports, tab, memory: exports.memory, top: exports.__heap_base.value });
        this.pairs = new Map();
      }

      room(bytes) {
        const at = Math.ceil(this.top / 16) * 16;
        this.top = at + bytes;
        const lacking = this.top - this.memory.buffer.byteLength;
        if (lacking > 0) this.memory.grow(Math.ceil(lacking / 65536));
        return at;
      }

      put(bytes) {
        const at = this.room(bytes.byteLength);
        new Uint8Array(this.memory.buffer, at, bytes.byteLength).set(bytes);
        return at;
      }

      words(values) {
        return this.put(new Uint8Array(Int32Array.from(values).buffer));
      }

      view(kind, at, count) {
        return new KINDS[kind](this.memory.buffer, at, count);
      }

      // Addresses of a pair's networks, as words of a ride's block.
      pair(number, data) {
        if (!this.pairs.has(number)) {
          const words = this.tab.networks.flatMap((name) => {
            const { sizes, numbers, output } = data[name];
            const at = this.put(new Uint8Array(BigInt64Array.from(sizes.map(BigInt)).buffer));
            const bytes = bytesOf(numbers);
            return [sizes.length, at, this.put(bytes), bytes.byteLength / 4, output];
          });
          this.pairs.set(number, { words, width: Math.max(...Object.values(data).flatMap((net) => net.sizes)) });
        }
        return this.pairs.get(number);
      }
    }

    // A road: the paper's, but for the car's speeds, the others' density, and the noise.
    class Road {
      constructor(machine) {
        const { tab } = machine;
        this.machine = machine;
        this.at = {};
        this.kinds = {};
        for (const { name, kind, size, data } of tab.arrays) {
          const bytes = data ? bytesOf(data) : new Uint8Array(size * KINDS[kind].BYTES_PER_ELEMENT);
          this.at[name] = machine.put(bytes);
          this.kinds[name] = [kind, size];
        }
        this.block = machine.words([...tab.words, ...tab.arrays.map(({ name }) => this.at[name])]);
      }

      array(name) {
        const [kind, size] = this.kinds[name];
        return this.machine.view(kind, this.at[name], size);
      }

      set({ low, top, density, noise }) {
        const { reals } = this.machine.tab;
        const levels = this.array("levels");
        for (let k = 0; k < levels.length; k += 1) levels[k] = low + k * ((top - low) / (levels.length - 1));
        const numbers = this.array("numbers");
        numbers[reals.other_gap] = 1 / density;
        numbers[reals.noise] = noise;
      }

      // Frames of a decision; 1 to look at each.
      slowly(frames) {
        this.array("counts")[this.machine.tab.settings.frames] = BigInt(frames);
      }

      copyFrom(other) {
        for (const name of ["cars", "codes", "time", "steps", "speed_index", "generator", "noise_generator", "ready", "levels", "integers"]) {
          this.array(name).set(other.array(name));
        }
        const numbers = this.array("numbers");
        numbers.set(other.array("numbers"));
      }

      step(action) {
        this.array("actions")[0] = BigInt(action);
        this.machine.run.road_step(this.block);
      }

      // Where the cars are: views into the module's memory, row by row.
      cars() {
        const { cars, words } = this.machine.tab;
        const stride = words[1];
        const all = this.array("cars");
        const codes = this.array("codes");
        const row = (k) => all.subarray(k * stride, k * stride + cars);
        return { x: row(0), y: row(1), heading: row(2), speed: row(3), crashed: codes.subarray(2 * stride, 2 * stride + cars) };
      }
    }

    // A driver on a road of its own, with forecast, tracker and sums.
    class Ride {
      constructor(machine, pair, settings) {
        const { tab } = machine;
        const delay = settings.delay;
        this.machine = machine;
        this.road = new Road(machine);
        this.road.set(settings);
        const f8 = (count) => machine.room(8 * count);
        this.counts = f8(tab.counts.length);
        this.numbers = f8(tab.numbers.length);
        const rings = f8(3 * (delay + 1));
        const history = machine.room(4 * 5 * tab.words[3] * tab.words[4]);
        const work = machine.room(8 * pair.width);
        const words = [this.road.block, this.counts, this.numbers, rings, history, work, pair.width, f8(1)];
        this.gate = {};
        const gate = tab.gate.map(({ name, kind, size, data }) => (this.gate[name] = machine.put(data ? bytesOf(data) : new Uint8Array(size * KINDS[kind].BYTES_PER_ELEMENT))));
        this.block = machine.words([...words, ...pair.words, machine.words(gate)]);
        this.set("driver", tab.drivers.indexOf(settings.driver));
        for (const [name, value] of Object.entries({ running: settings.running ? 1 : 0, length: 5, horizon: 3, delay })) this.set(name, value);
        for (const [name, value] of Object.entries({ alpha: settings.alpha, share: settings.step, q_safe: settings.q_safe })) this.set(name, value);
      }

      place(name) {
        const { counts, numbers } = this.machine.tab;
        const whole = counts.indexOf(name);
        return whole >= 0 ? ["i8", this.counts, counts.length, whole] : ["f8", this.numbers, numbers.length, numbers.indexOf(name)];
      }

      get(name) {
        const [kind, at, size, k] = this.place(name);
        return Number(this.machine.view(kind, at, size)[k]);
      }

      set(name, value) {
        const [kind, at, size, k] = this.place(name);
        this.machine.view(kind, at, size)[k] = kind === "i8" ? BigInt(value) : value;
      }

      begin(seed, forget = true) {
        this.road.array("seeds")[0] = BigInt(seed);
        this.machine.run.ride_begin(this.block, forget ? 1 : 0);
      }

      decide() {
        this.machine.run.ride_decide(this.block);
      }

      act() {
        this.machine.run.ride_act(this.block);
      }

      // The row of `Rides.episodes`.
      finish(seed) {
        this.machine.run.ride_run(this.block);
        return this.row(seed);
      }

      row(seed) {
        const found = { seed };
        for (const name of COLUMNS.slice(1)) found[name] = this.get(name);
        return found;
      }
    }

    const COLUMNS = ["seed", "steps", "crashed", "speed_sum", "last_speed", "distance_m", "overtaken", "safe_steps", "changes", "u_sum", "u_steps", "scored", "missed"];

    // A worker: told once what to load, then job by job.
    async function serve(port, tab, pairNumber, pairData) {
      const machine = await Machine.load(tab);
      const pair = machine.pair(pairNumber, pairData);
      const known = new Map();
      port.onmessage = ({ data: { key, settings, seeds, carry } }) => {
        const name = JSON.stringify(settings);
        if (!known.has(name)) known.set(name, new Ride(machine, pair, settings));
        const ride = known.get(name);
        const rows = seeds.map((seed, k) => {
          ride.begin(seed, !carry || k === 0);
          return ride.finish(seed);
        });
        port.postMessage({ key, rows });
      };
      port.postMessage({ ready: true });
    }

    return { Machine, Road, Ride, COLUMNS, serve };
  }

  // ---------------------------------------------------------------- what the page adds

  // Data lies in scripts of its own; pages from disk may load scripts, and nothing else.
  const loading = new Map();
  function data(name) {
    const store = () => (self.cplLive.data || {})[name];
    if (!loading.has(name)) {
      loading.set(
        name,
        new Promise((resolve, reject) => {
          if (store()) return resolve(store());
          const script = document.createElement("script");
          script.src = new URL(`data/${name}.js`, HERE).href;
          script.onload = () => resolve(store());
          script.onerror = () => reject(new Error(`${name}.js cannot be loaded`));
          document.head.append(script);
          return undefined;
        }),
      );
    }
    return loading.get(name);
  }

  const tab = () => data("tab");
  const pair = (number) => data(`tab-pair-${number}`);

  // Workers that share a list of jobs; `stop` ends them at once.
  function crew(size, tabData, pairNumber, pairData) {
    const first = `onmessage = ({ data: [tab, number, pair] }) => { (${machinery})().serve(self, tab, number, pair); };`;
    const url = URL.createObjectURL(new Blob([first], { type: "text/javascript" }));
    const workers = Array.from({ length: size }, () => new Worker(url));
    const stop = () => {
      for (const worker of workers) worker.terminate();
      URL.revokeObjectURL(url);
    };
    function run(jobs, told) {
      return new Promise((resolve, reject) => {
        const waiting = [...jobs.entries()];
        let left = jobs.length;
        for (const worker of workers) {
          const next = () => {
            const job = waiting.shift();
            if (job) worker.postMessage({ key: job[0], ...job[1] });
          };
          worker.onerror = (event) => reject(new Error(event.message || "a worker failed"));
          worker.onmessage = ({ data: { key, rows } }) => {
            if (rows) {
              told(jobs[key], rows);
              left -= 1;
            }
            if (left === 0) resolve();
            else next();
          };
          worker.postMessage([tabData, pairNumber, pairData]);
        }
      });
    }
    return { run, stop };
  }

  const { Machine, Road, Ride, COLUMNS } = machinery();
  self.cplLive = Object.assign(self.cplLive || {}, { host: { Machine, Road, Ride, COLUMNS, crew, pair, tab } });
})();
