// From linear light to a display: the views of the program's module math::view.

function encode(v) {
  if (!(v > 0)) return 0;
  if (v >= 1) return 1;
  return v <= 0.0031308 ? 12.92 * v : 1.055 * v ** (1 / 2.4) - 0.055;
}

function decode(code) {
  return code <= 0.04045 ? code / 12.92 : ((code + 0.055) / 1.055) ** 2.4;
}

// PBR Neutral of the Khronos group, into `out`.
function neutral(rgb, out) {
  const least = Math.min(rgb[0], rgb[1], rgb[2]);
  const offset = least < 0.08 ? least - 6.25 * least * least : 0.04;
  const peak = Math.max(rgb[0], rgb[1], rgb[2]) - offset, start = 0.8 - 0.04;
  for (let c = 0; c < 3; c++) out[c] = rgb[c] - offset;
  if (peak < start) return;
  const room = 1 - start, shown = 1 - (room * room) / (peak + room - start);
  const kept = 1 / (0.15 * (peak - shown) + 1);
  for (let c = 0; c < 3; c++) out[c] = kept * ((out[c] * shown) / peak) + (1 - kept) * shown;
}

// A view that is given by tables: a matrix, a lattice of logarithms, and a curve.
class Lattice {
  static async open(tables) {
    const bytes = await inflate(tables.lattice), n = bytes.length / 2;
    const values = new Float32Array(n);
    let code = 0;
    for (let i = 0; i < n; i++) {
      code = (code + ((bytes[i] << 8) | bytes[n + i])) & 65535;
      values[i] = code / 65535;
    }
    return new Lattice(tables, values);
  }

  constructor(tables, values) {
    Object.assign(this, tables);
    this.values = values;
    this.count = this.side ** 3;
  }

  coordinate(linear) {
    const [grey, below, stops] = this.scale;
    const at = (Math.log2(Math.max(linear, 0) / grey) + below) / stops;
    return Math.min(Math.max(at, 0), 1) * (this.side - 1);
  }

  light(value) {
    const at = Math.min(Math.max(value, 0), 1) * (this.curve.length - 1);
    const i = Math.min(at | 0, this.curve.length - 2);
    return this.curve[i] + (at - i) * (this.curve[i + 1] - this.curve[i]);
  }

  // Display-linear light of a linear colour, into `out`: tetrahedral interpolation.
  display(rgb, out) {
    const m = this.matrix, most = this.side - 1, step = [1, this.side, this.side * this.side];
    const within = [0, 0, 0], order = [0, 1, 2];
    let corner = 0;
    for (let c = 0; c < 3; c++) {
      const place = this.coordinate(m[c][0] * rgb[0] + m[c][1] * rgb[1] + m[c][2] * rgb[2]);
      const cell = Math.min(place | 0, most - 1);
      within[c] = place - cell;
      corner += cell * step[c];
    }
    order.sort((a, b) => within[b] - within[a]);
    const corners = [corner];
    for (const axis of order) corners.push((corner += step[axis]));
    for (let c = 0; c < 3; c++) {
      const first = c * this.count;
      let sum = this.values[first + corners[0]];
      for (let k = 0; k < 3; k++) sum += within[order[k]] * (this.values[first + corners[k + 1]] - this.values[first + corners[k]]);
      out[c] = this.light(sum);
    }
  }
}

class View {
  static async open(data, luminance) {
    const lattice = data.tables ? await Lattice.open(data.tables) : null;
    return new View(data.name, lattice, luminance);
  }

  constructor(name, lattice, luminance) {
    Object.assign(this, { name, lattice, luminance });
  }

  // Code values and display-linear light in [0, 1] of an exposed linear colour, into `codes` and `light`.
  display(rgb, codes, light) {
    if (this.name === "linear") {
      for (let c = 0; c < 3; c++) {
        codes[c] = Math.min(Math.max(rgb[c], 0), 1);
        light[c] = decode(codes[c]);
      }
      return;
    }
    if (this.lattice) this.lattice.display(rgb, light);
    else if (this.name === "pbr-neutral") neutral(rgb, light);
    else for (let c = 0; c < 3; c++) light[c] = rgb[c];
    for (let c = 0; c < 3; c++) {
      light[c] = Math.min(Math.max(light[c], 0), 1);
      codes[c] = encode(light[c]);
    }
  }

  // The bytes that a display shows of a picture, the display luminance that is measured, and where `planes` are given
  // the chroma.
  show([R, G, B], exposure, bytes, l, planes) {
    const rgb = [0, 0, 0], codes = [0, 0, 0], light = [0, 0, 0], plain = this.name === "srgb", linear = this.luminance === "linear";
    for (let p = 0; p < R.length; p++) {
      rgb[0] = exposure * R[p];
      rgb[1] = exposure * G[p];
      rgb[2] = exposure * B[p];
      this.display(rgb, codes, light);
      for (let c = 0; c < 3; c++) bytes[4 * p + c] = Math.round(255 * codes[c]);
      bytes[4 * p + 3] = 255;
      if (planes) chroma(light, planes, p);
      // The view srgb clips luminance, every other one channels.
      const shown = plain ? rgb : light;
      const y = LUMINANCE[0] * shown[0] + LUMINANCE[1] * shown[1] + LUMINANCE[2] * shown[2];
      l[p] = linear ? Math.min(Math.max(y, 0), 1) : encode(y);
    }
  }
}
