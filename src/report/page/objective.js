// The objective f_q of a picture, noise included, and its terms: as `evaluate` measures them. The definitions are
// those of the program's module objective::terms.

const BINS = 256;

// Mean and standard deviation of display luminance over the pixels whose mask is `which`; all without such.
function moments(l, mask, which) {
  let n = 0, sum = 0, square = 0;
  for (let p = 0; p < l.length; p++) if (mask[p] === which) { n++; sum += l[p]; }
  if (n === 0) return null;
  const mean = sum / n;
  for (let p = 0; p < l.length; p++) if (mask[p] === which) square += (l[p] - mean) ** 2;
  return { mean, deviation: Math.sqrt(square / n) };
}

// Root mean squared gradient of the plain Sobel pair over the object; borders repeat themselves.
function gradient(l, mask, width, height) {
  let n = 0, sum = 0;
  for (let y = 0; y < height; y++) {
    const above = Math.max(y - 1, 0) * width, row = y * width, below = Math.min(y + 1, height - 1) * width;
    for (let x = 0; x < width; x++) {
      if (!mask[row + x]) continue;
      const left = Math.max(x - 1, 0), right = Math.min(x + 1, width - 1);
      const gx = l[above + right] - l[above + left] + 2 * (l[row + right] - l[row + left]) + l[below + right] - l[below + left];
      const gy = l[below + left] - l[above + left] + 2 * (l[below + x] - l[above + x]) + l[below + right] - l[above + right];
      sum += gx * gx + gy * gy;
      n++;
    }
  }
  return n ? Math.sqrt(sum / n) : 0;
}

// Cumulated histogram: a pixel goes over from one bin to the next linearly.
function cumulated(l) {
  const mass = new Float64Array(BINS + 1), q = new Float64Array(BINS);
  for (let p = 0; p < l.length; p++) {
    const u = Math.min(Math.max(l[p], 0), 1) * BINS - 0.5, cell = Math.floor(u), t = u - cell;
    if (cell < 0) mass[0]++;
    else { mass[cell] += 1 - t; mass[cell + 1] += t; }
  }
  let sum = 0;
  for (let i = 0; i < BINS; i++) q[i] = Math.min((sum += mass[i]) / l.length, 1);
  q[BINS - 1] = 1;
  return q;
}

// Distance of a cumulated histogram from that of a signature, not symmetric: the picture's alone normalises.
function histogramDistance(p, q) {
  let numerator = 0, denominator = 0;
  for (let i = 0; i < BINS; i++) {
    numerator += (Math.sqrt(p[i]) - Math.sqrt(q[i])) ** 2;
    denominator += Math.max(q[i], 1 - q[i]);
  }
  return Math.sqrt(numerator / denominator);
}

function measure(l, basis, look) {
  const object = moments(l, basis.mask, 1), background = moments(l, basis.mask, 0) || object;
  const histogram = cumulated(l);
  const values = {
    meanObj: object ? object.mean : 0,
    meanBack: background.mean,
    varObj: object ? object.deviation : 0,
    varBack: background.deviation,
    grad: gradient(l, basis.mask, basis.width, basis.height),
    hist: look.signature ? histogramDistance(look.signature.cumulated, histogram) : 0,
  };
  const terms = {};
  let f_q = 0;
  for (const term of look.terms) {
    const value = values[term.name];
    const f = term.distance ? value : Math.abs(value - term.target) / term.miss;
    terms[term.name] = { value, f };
    f_q += term.weight * f;
  }
  return { f_q, terms, histogram };
}
