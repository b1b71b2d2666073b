// Pictures of any lighting from the small copy of the transport basis, with the light of each source apart.
// Every value is the logarithm of a luminance with the shares of red and blue in it; the program's module
// transport::compact says how they are coded.

const LUMINANCE = [0.2126, 0.7152, 0.0722];

async function inflate(base64) {
  const text = atob(base64), bytes = new Uint8Array(text.length);
  for (let i = 0; i < bytes.length; i++) bytes[i] = text.charCodeAt(i);
  const stream = new Blob([bytes]).stream().pipeThrough(new DecompressionStream("deflate"));
  return new Uint8Array(await new Response(stream).arrayBuffer());
}

// Codes from what is deflated: each is a difference from what its neighbours let expect.
function undo(high, low, nCells, nPixels) {
  const out = new Uint16Array(high.length), block = nCells * nPixels, none = new Uint16Array(nPixels);
  for (let first = 0; first < out.length; first += nPixels) {
    const hasCell = first % block > 0, hasNode = first >= block;
    const row = (has, back) => (has ? out.subarray(first - back, first - back + nPixels) : none);
    const cell = row(hasCell, nPixels), node = row(hasNode, block), both = row(hasCell && hasNode, block + nPixels);
    for (let p = 0; p < nPixels; p++) {
      const folded = (high[first + p] << 8) | low[first + p];
      out[first + p] = cell[p] + node[p] - both[p] + ((folded >> 1) ^ -(folded & 1));
    }
  }
  return out;
}

class Basis {
  static async open(data) {
    const basis = new Basis(data);
    basis.lights = await Promise.all(data.codes.map((codes, l) => basis.light(codes, data.copy.lights[l])));
    return basis;
  }

  constructor(data) {
    this.data = data;
    [this.width, this.height] = data.copy.size;
    this.pixels = this.width * this.height;
    this.names = data.names;
    this.mask = new Uint8Array(this.pixels);
    let at = 0;
    data.mask.forEach((run, i) => { this.mask.fill(i % 2, at, at + run); at += run; });
    // Share with which each pixel is the main object's.
    this.share = Float32Array.from(this.mask);
    if (data.weights) {
      const bytes = atob(data.weights);
      this.share.forEach((_, p) => { this.share[p] = (bytes.charCodeAt(2 * p) + 256 * bytes.charCodeAt(2 * p + 1)) / 65535; });
      this.share.forEach((share, p) => { this.mask[p] = share >= 0.5 ? 1 : 0; });
    }
    this.exp2 = new Float32Array(65536);
    for (let code = 1; code < 65536; code++) this.exp2[code] = 2 ** ((code - data.one) / data.steps);
    this.rgb = [0, 1, 2].map(() => new Float32Array(this.pixels));
    // Parts of a step by which the codes of the shares of red and blue are moved.
    this.moved = [0.754877666246693, 0.569840290998053].map((step) => Float32Array.from({ length: this.pixels }, (_, p) => ((p * step) % 1) - 0.5));
  }

  async light(codes, sizes) {
    const bytes = await inflate(codes), knots = sizes.free ? sizes.free.u : null;
    const planes = (n) => Array.from({ length: n }, () => new Float32Array(this.pixels));
    const nodes = this.data.copy.nodes.map(() => planes(3));
    return { bytes, knots, nCells: knots ? knots.length : 1, size: knots ? Math.sqrt(knots[knots.length - 1]) : sizes.fixed, nodes, unit: planes(3) };
  }

  // Codes of a light, which are made when it first shines.
  codes(light) {
    if (light.codes) return light.codes;
    const { bytes, nCells } = light, n = this.data.copy.nodes.length * nCells * this.pixels;
    const plane = (k) => undo(bytes.subarray(2 * k * n, (2 * k + 1) * n), bytes.subarray((2 * k + 1) * n, (2 * k + 2) * n), nCells, this.pixels);
    light.codes = [plane(0), plane(1), plane(2)];
    light.bytes = null;
    return light.codes;
  }

  // Weights of the nodes at a value of the background: Lagrange's.
  valueWeights(v) {
    const nodes = this.data.copy.nodes;
    return nodes.map((node, k) => nodes.reduce((w, other, j) => (j === k ? w : (w * (v - other)) / (node - other)), 1));
  }

  // Weights of the cells of a light at a size: the light's edge is feathered by one bin between knots.
  sizeWeights(light, size) {
    const u = light.knots;
    if (!u) return [[0, 1]];
    const square = size * size, last = u.length - 2;
    let j = 0;
    while (j < last && u[j + 1] <= square) j++;
    const width = u[j + 1] - u[j];
    const t = Math.min(Math.max((square - u[j]) / width, 0), 1);
    const area = (i) => 0.5 * ((i ? u[i] - u[i - 1] : 0) + (i + 1 < u.length ? u[i + 1] - u[i] : 0));
    const below = j ? 0.5 * (u[j] - u[j - 1]) : 0;
    const here = (below + width * (t - 0.5 * t * t)) / area(j), next = (0.5 * width * t * t) / area(j + 1);
    const all = [[j - 1, 1 - here], [j, here - next], [j + 1, next]];
    return all.filter(([cell, weight]) => cell >= 0 && weight !== 0);
  }

  // Radiance of a light that follows another over that of its leader.
  ratio(tie, size) {
    if (!tie.brought) return tie.factor;
    const [leader, follower] = tie.brought.map(({ knots, means }, k) => {
      const weights = this.sizeWeights({ knots: knots && knots.u }, size[k ? tie.light : tie.leader]);
      return weights.reduce((sum, [cell, weight]) => sum + weight * (means[cell] ?? 0), 0);
    });
    return follower > 0 ? (tie.factor * leader) / follower : 0;
  }

  // Pictures of a light alone at radiance 1, at each node of the background's value.
  atNodes(light, size) {
    if (light.atSize === size) return light.nodes;
    light.atSize = size;
    const n = this.pixels, [y, red, blue] = this.codes(light), exp2 = this.exp2, [ofRed, ofBlue] = this.moved;
    const byRed = 1 / this.data.red_steps, byBlue = 1 / this.data.blue_steps;
    light.nodes.forEach((planes, node) => {
      const [R, G, B] = planes;
      planes.forEach((plane) => plane.fill(0));
      for (const [cell, weight] of this.sizeWeights(light, size)) {
        const first = (node * light.nCells + cell) * n;
        for (let p = 0; p < n; p++) {
          const i = first + p, v = weight * exp2[y[i]];
          const r = Math.max((red[i] + ofRed[p]) * byRed, 0), b = Math.max((blue[i] + ofBlue[p]) * byBlue, 0), g = 1 - r - b;
          R[p] += v * r;
          B[p] += v * b;
          if (g > 0) G[p] += v * g;
        }
      }
    });
    return light.nodes;
  }

  // The picture of a light alone at radiance 1: red, green and blue of each pixel.
  unit(l, size, value) {
    const light = this.lights[l], at = light.knots ? size : 0;
    if (light.atSize === at && light.atValue === value) return light.unit;
    const nodes = this.atNodes(light, at), weights = this.valueWeights(value);
    light.atValue = value;
    light.unit.forEach((plane, c) => {
      plane.fill(0);
      nodes.forEach((planes, node) => {
        const weight = weights[node] / LUMINANCE[c], from = planes[c];
        if (weight !== 0) for (let p = 0; p < plane.length; p++) plane[p] += weight * from[p];
      });
      // Weights of both signs may leave less than nothing.
      for (let p = 0; p < plane.length; p++) if (!(plane[p] > 0)) plane[p] = 0;
    });
    return light.unit;
  }

  // Factors on red, green and blue of a light in a lighting: none where it is dark.
  gain(x, l) {
    const shines = !x.off[l] && (x.solo === null || x.solo === l);
    if (!shines || !(x.radiance[l] > 0)) return null;
    return x.factor[l].map((factor) => factor * x.radiance[l]);
  }

  // The picture of a lighting: red, green and blue of each pixel, in memory that the next picture takes.
  picture(x) {
    this.rgb.forEach((plane) => plane.fill(0));
    this.lights.forEach((_, l) => {
      const gain = this.gain(x, l);
      if (!gain) return;
      this.unit(l, x.size[l], x.value).forEach((unit, c) => {
        const to = this.rgb[c], factor = gain[c];
        for (let p = 0; p < this.pixels; p++) to[p] += factor * unit[p];
      });
    });
    return this.rgb;
  }

  // Luminance that each light brings to a pixel.
  shares(x, p) {
    return this.lights.map((_, l) => {
      const gain = this.gain(x, l);
      if (!gain) return 0;
      const unit = this.unit(l, x.size[l], x.value);
      return LUMINANCE.reduce((sum, weight, c) => sum + weight * gain[c] * unit[c][p], 0);
    });
  }
}
