// The live picture with the detail of the final one. What the final picture shows beyond the live picture of the
// same lights (edges, textures, and no noise) is laid over the live picture of others, weaker where that is darker.
// It is for the eye alone: nothing is measured of it.

// Pixels across at most: as many as take less than a slider may.
const WIDEST = 720;
// How much stronger than in the final picture detail may get where the live one is brighter.
const STRONGEST = 1.5;
// Code values added to both sides of a ratio, so that noise in the dark does not decide it.
const FLOOR = 8;

class Detail {
  // From the final picture, and the bytes of the live picture of the same lights.
  static async open(src, live, width, height) {
    const image = new Image();
    image.src = src;
    await image.decode();
    const wide = Math.min(image.naturalWidth, WIDEST), high = Math.max(Math.round((wide * image.naturalHeight) / image.naturalWidth), 1);
    const canvas = h("canvas", { width: wide, height: high }), context = canvas.getContext("2d", { willReadFrequently: true });
    context.drawImage(image, 0, 0, wide, high);
    return new Detail(context.getImageData(0, 0, wide, high), live, width, height);
  }

  constructor(final, live, width, height) {
    Object.assign(this, { width: final.width, height: final.height, from: [width, height], image: new ImageData(final.width, final.height) });
    this.columns = this.places(final.width, width);
    this.rows = this.places(final.height, height);
    this.base = new Uint8ClampedArray(final.data.length);
    this.enlarge(live, this.base);
    this.difference = Int16Array.from(final.data, (v, i) => v - this.base[i]);
  }

  // Of each pixel of a side of `n` the two of a side of `m` between which it lies, and how far.
  places(n, m) {
    return Array.from({ length: n }, (_, i) => {
      const at = Math.min(Math.max(((i + 0.5) * m) / n - 0.5, 0), m - 1), low = Math.min(Math.floor(at), Math.max(m - 2, 0));
      return [low, Math.min(low + 1, m - 1), at - low];
    });
  }

  // The live picture in the size of this one, interpolated bilinearly.
  enlarge(live, out) {
    const [width] = this.from;
    let to = 0;
    for (const [above, below, down] of this.rows) {
      const a = 4 * width * above, b = 4 * width * below;
      for (const [left, right, across] of this.columns) {
        const l = 4 * left, r = 4 * right;
        for (let c = 0; c < 3; c++) {
          const top = live[a + l + c] + across * (live[a + r + c] - live[a + l + c]);
          const bottom = live[b + l + c] + across * (live[b + r + c] - live[b + l + c]);
          out[to + c] = top + down * (bottom - top);
        }
        out[to + 3] = 255;
        to += 4;
      }
    }
  }

  // The live picture `live` with the detail.
  over(live) {
    const out = this.image.data, { base, difference } = this;
    this.enlarge(live, out);
    for (let i = 0; i < out.length; i++) {
      if (difference[i] !== 0) out[i] += difference[i] * Math.min((out[i] + FLOOR) / (base[i] + FLOOR), STRONGEST);
    }
    return this.image;
  }
}
