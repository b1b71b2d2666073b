// The lighting that the user has made: its history, its place in the address, and its file.

const OFF = -10;
const MOST = 6;

function lightingState(lighting) {
  const n = lighting.radiance.length;
  return {
    radiance: [...lighting.radiance], size: [...lighting.size], value: lighting.value, exposure: lighting.exposure,
    color: lighting.color?.length ? structuredClone(lighting.color) : Array(n).fill("recorded"), off: Array(n).fill(false), solo: null,
  };
}

// Factors on the channels of each light that bring it from the colour with which the basis has it to that of a
// lighting.
function colorFactors(color, basis, lights) {
  return color.map((color, l) => {
    if (color === "recorded") return NEUTRAL;
    if (basis.data.white[l]) return factorOf(color);
    const own = (lights[l] && lights[l].color) || NEUTRAL;
    return factorOf(color).map((c, i) => c / Math.max(own[i], 1e-4));
  });
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
    return { ...this.now, factor: colorFactors(this.now.color, this.basis, this.lights) };
  }

  // Whether a light has the colour of its own, which no record names.
  isOwn(l) {
    return this.now.color[l] === "recorded";
  }

  // Linear colour of a light now.
  rgb(l) {
    return this.isOwn(l) ? (this.lights[l] && this.lights[l].color) || NEUTRAL : factorOf(this.now.color[l]);
  }

  // Lights whose radiances are tied to that of a light.
  mates(l) {
    const { ties } = this.basis.data, all = new Set([l]);
    for (let n = 0; n < all.size;) {
      n = all.size;
      ties.forEach(({ light, leader }) => { if (all.has(light) || all.has(leader)) all.add(light).add(leader); });
    }
    all.delete(l);
    return [...all].sort((a, b) => a - b);
  }

  // Gives the lights that follow others the radiances which that asks for.
  follow(x) {
    this.basis.data.ties.forEach((tie) => { x.radiance[tie.light] = this.basis.ratio(tie, x.size) * x.radiance[tie.leader]; });
  }

  // Sets the radiance of a light and of all that are tied to it.
  setRadiance(l, radiance) {
    this.edit((x) => {
      let at = l, value = radiance;
      for (let tie; (tie = this.basis.data.ties.find(({ light }) => light === at));) {
        const ratio = this.basis.ratio(tie, x.size);
        value = ratio > 0 ? value / ratio : 0;
        at = tie.leader;
      }
      x.radiance[at] = value;
      this.follow(x);
    });
  }

  setSize(l, size) {
    this.edit((x) => {
      x.size[l] = size;
      if (this.mates(l).length) this.follow(x);
    });
  }

  stops(l) {
    const radiance = this.now.radiance[l];
    return radiance > 0 ? Math.min(Math.max(Math.log2(radiance / this.reference[l]), OFF), MOST) : OFF;
  }

  setStops(l, stops) {
    this.setRadiance(l, stops <= OFF ? 0 : this.reference[l] * 2 ** stops);
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
    const number = (v) => String(Number(v.toPrecision(9))), { radiance, size, value, exposure, color, off, solo } = this.now;
    const colorText = ({ temperature, rgb }) => (temperature ? [temperature.kelvin, ...(temperature.tint ? [temperature.tint] : [])] : rgb || []).map(number).join("_");
    const parts = [["look", look], ["r", radiance.map(number).join()], ["s", size.map(number).join()], ["v", number(value)], ["e", number(exposure)]];
    if (color.some((c) => c !== "recorded")) parts.push(["k", color.map(colorText).join()]);
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
    const isKelvin = (v) => v >= COLDEST && v <= HOTTEST, isTint = (v) => Math.abs(v) <= 0.05;
    // A temperature, perhaps with its tint, or three channels.
    const colorOf = (v) => {
      if (v.length === 3) return v.every((c) => c >= 0 && c < 1e6) && v.some((c) => c > 0) ? { rgb: v } : "recorded";
      const [kelvin, tint = 0] = v;
      return isKelvin(kelvin) && isTint(tint) ? { temperature: { kelvin, tint } } : "recorded";
    };
    if (given.has("r")) state.color.fill("recorded");
    list("k", (_, l, text) => { state.color[l] = text ? colorOf(text.split("_").map(Number)) : "recorded"; });
    one("v", "value");
    one("e", "exposure");
    given.get("off")?.split(",").forEach((l) => { if (state.off[l] !== undefined) state.off[l] = true; });
    if (given.has("solo") && state.off[given.get("solo")] !== undefined) state.solo = Number(given.get("solo"));
    return state;
  }

  // The file of lights `text` with the numbers of this lighting: lights that are dark have radiance 0.
  toToml(text) {
    const number = (v, digits = 8) => {
      const written = String(Number(Math.fround(v).toPrecision(digits))).replace("e+", "e");
      return /[.e]/.test(written) ? written : `${written}.0`;
    };
    const list = (values, digits) => `[${values.map((v) => number(v, digits)).join(", ")}]`;
    const { now } = this, isDark = (l) => now.off[l] || (now.solo !== null && now.solo !== l);
    // Colours of lights whose own is not kept; a temperature alone can be changed by hand.
    const colorLines = (l) => {
      const { temperature, rgb } = now.color[l];
      // Recorded white is a colour like others; one of the scene's own is kept by saying nothing.
      if (rgb || (!temperature && this.basis.data.white[l])) return [`color = ${list(factorOf(now.color[l]))}`];
      if (!temperature) return [];
      return [`color_temperature = ${number(temperature.kelvin)}`, ...(temperature.tint ? [`tint = ${number(temperature.tint)}`] : [])];
    };
    let table = "", light = -1;
    return text.split("\n").flatMap((line) => {
      if (line.startsWith("[")) table = line.trim();
      const [, key, value] = line.match(/^(\w+) = (.*)$/) || [];
      if (table === "[[lights]]" && key === "name") light = this.basis.names.findIndex((name) => JSON.stringify(name) === value || `'${name}'` === value);
      if (table === "" && key === "exposure") return [`exposure = ${number(now.exposure)}`];
      if (table === "[background]" && key === "value") return [`value = ${number(now.value)}`];
      if (light < 0) return [line];
      if (table === "[lights.setup]") return [this.setupLine(line, key, light, isDark(light), list, number)];
      if (table !== "[[lights]]") return [line];
      if (key === "size") return [`size = ${number(now.size[light])}`];
      if (["color", "color_temperature", "tint"].includes(key)) return [];
      if (key !== "radiance") return [line];
      return [`radiance = ${number(isDark(light) ? 0 : now.radiance[light])}`, ...colorLines(light)];
    }).join("\n");
  }

  // A line of what a photographer sets up, which follows from the rest.
  setupLine(line, key, l, isDark, list, number) {
    const facts = this.lights[l], lit = isDark ? 0 : watts(facts, this.now.radiance[l], this.now.size[l]);
    if (key === "watts") return `watts = ${number(lit, 5)}`;
    if (key === "lumens") return `lumens = ${number(683 * lit, 5)}`;
    if (key === "extent" && facts.extent) return `extent = ${list(facts.extent.map((e) => e * this.now.size[l]), 3)}`;
    return line;
  }
}
