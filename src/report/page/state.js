// The lighting that the user has made: its history, its place in the address, and its file.

const OFF = -10;
const MOST = 6;
const NEUTRAL = [1, 1, 1];

function lightingState(lighting) {
  const n = lighting.radiance.length;
  return {
    radiance: [...lighting.radiance], size: [...lighting.size], value: lighting.value, exposure: lighting.exposure,
    kelvin: Array(n).fill(null), off: Array(n).fill(false), solo: null,
  };
}

class State {
  constructor(basis, lights) {
    Object.assign(this, { basis, lights, past: [], future: [], listeners: [] });
  }

  // Radiances to which sliders are relative: those that the first lighting has, else others that shine.
  refer(...lightings) {
    this.reference = this.basis.names.map((_, l) => {
      const shining = lightings.map((x) => x.radiance[l]).find((radiance) => radiance > 0);
      return shining || 1;
    });
  }

  get x() {
    return { ...this.now, tint: this.now.kelvin.map((kelvin, l) => this.tint(kelvin, l)) };
  }

  // Factors that give a light the colour of a black body in the place of its own.
  tint(kelvin, l) {
    if (kelvin === null) return NEUTRAL;
    const own = (this.lights[l] && this.lights[l].color) || NEUTRAL;
    return blackBody(kelvin).map((c, i) => c / Math.max(own[i], 1e-4));
  }

  stops(l) {
    const radiance = this.now.radiance[l];
    return radiance > 0 ? Math.min(Math.max(Math.log2(radiance / this.reference[l]), OFF), MOST) : OFF;
  }

  setStops(l, stops) {
    this.edit((x) => { x.radiance[l] = stops <= OFF ? 0 : this.reference[l] * 2 ** stops; });
  }

  // Changes the lighting; what was before can come back once `settle` was called.
  edit(change) {
    if (!this.before) this.before = structuredClone(this.now);
    change(this.now);
    this.listeners.forEach((listener) => listener());
  }

  settle() {
    if (!this.before) return;
    if (JSON.stringify(this.before) !== JSON.stringify(this.now)) {
      this.past.push(this.before);
      this.future = [];
    }
    this.before = null;
    this.listeners.forEach((listener) => listener(true));
  }

  replace(lighting) {
    this.edit((x) => Object.assign(x, lightingState(lighting)));
    this.settle();
  }

  travel(from, to) {
    this.settle();
    const other = from.pop();
    if (!other) return;
    to.push(this.now);
    this.now = other;
    this.listeners.forEach((listener) => listener(true));
  }

  undo() { this.travel(this.past, this.future); }

  redo() { this.travel(this.future, this.past); }

  // The lighting as a part of an address.
  toHash(look) {
    const number = (v) => String(Number(v.toPrecision(9))), { radiance, size, value, exposure, kelvin, off, solo } = this.now;
    const parts = [["look", look], ["r", radiance.map(number).join()], ["s", size.map(number).join()], ["v", number(value)], ["e", number(exposure)]];
    if (kelvin.some((k) => k !== null)) parts.push(["k", kelvin.map((k) => k ?? "").join()]);
    if (off.some(Boolean)) parts.push(["off", off.flatMap((o, l) => (o ? [l] : [])).join()]);
    if (solo !== null) parts.push(["solo", solo]);
    return parts.map(([key, text]) => `${key}=${encodeURIComponent(text).replaceAll("%2C", ",")}`).join("&");
  }

  // The lighting of an address, laid over `fallback`; what is no number is left as it is.
  fromHash(hash, fallback) {
    const given = new URLSearchParams(hash), state = structuredClone(fallback);
    const list = (key, take) => {
      const values = given.get(key)?.split(",");
      if (values?.length === this.basis.names.length) values.forEach((text, l) => take(Number(text), l, text));
    };
    const one = (key, name) => {
      const value = Number(given.get(key));
      if (given.has(key) && value >= 0 && Number.isFinite(value)) state[name] = value;
    };
    list("r", (v, l) => { if (v >= 0 && Number.isFinite(v)) state.radiance[l] = v; });
    list("s", (v, l) => { if (v > 0 && Number.isFinite(v)) state.size[l] = Math.min(v, this.basis.lights[l].size); });
    list("k", (v, l, text) => { state.kelvin[l] = text && v >= 1000 && v <= 15000 ? v : null; });
    one("v", "value");
    one("e", "exposure");
    given.get("off")?.split(",").forEach((l) => { if (state.off[l] !== undefined) state.off[l] = true; });
    if (given.has("solo") && state.off[given.get("solo")] !== undefined) state.solo = Number(given.get("solo"));
    return state;
  }

  // The file of lights `text` with the numbers of this lighting: lights that are dark have radiance 0.
  toToml(text) {
    const number = (v) => {
      const digits = String(Number(Math.fround(v).toPrecision(8))).replace("e+", "e");
      return /[.e]/.test(digits) ? digits : `${digits}.0`;
    };
    let table = "", light = -1;
    return text.split("\n").flatMap((line) => {
      if (line.startsWith("[")) table = line.trim();
      const [, key, value] = line.match(/^(\w+) = (.*)$/) || [];
      if (table === "[[lights]]" && key === "name") light = this.basis.names.findIndex((name) => JSON.stringify(name) === value || `'${name}'` === value);
      const dark = this.now.off[light] || (this.now.solo !== null && this.now.solo !== light);
      const kelvin = this.now.kelvin[light] ?? null;
      if (table === "" && key === "exposure") return [`exposure = ${number(this.now.exposure)}`];
      if (table === "[background]" && key === "value") return [`value = ${number(this.now.value)}`];
      if (table !== "[[lights]]" || light < 0) return [line];
      if (key === "size") return [`size = ${number(this.now.size[light])}`];
      if (key !== "radiance") return [line];
      const note = kelvin === null ? [] : [`# ${kelvin} K in the report: linear Rec.709 ${blackBody(kelvin).map((c) => c.toFixed(4)).join(", ")}`];
      return [...note, `radiance = ${number(dark ? 0 : this.now.radiance[light])}`];
    }).join("\n");
  }
}
