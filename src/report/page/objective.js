// The objective f_q of a picture, noise included, and its terms: as `evaluate` measures them. The definitions are
// those of the program's module objective::terms.

const BINS = 256;

// Mean and variance of a plane over the main object, or over the background, of which each pixel has a share; null
// where there is none.
function moments(plane, share, isObject) {
  let n = 0, sum = 0, square = 0;
  const of = (p) => (isObject ? share[p] : 1 - share[p]);
  for (let p = 0; p < plane.length; p++) { n += of(p); sum += of(p) * plane[p]; }
  if (!(n > 0)) return null;
  const mean = sum / n;
  for (let p = 0; p < plane.length; p++) square += of(p) * (plane[p] - mean) ** 2;
  return { mean, variance: square / n };
}

// Root mean squared gradient of the plain Sobel pair over the object; borders repeat themselves.
function gradient(l, share, width, height) {
  let n = 0, sum = 0;
  for (let y = 0; y < height; y++) {
    const above = Math.max(y - 1, 0) * width, row = y * width, below = Math.min(y + 1, height - 1) * width;
    for (let x = 0; x < width; x++) {
      const of = share[row + x];
      if (!(of > 0)) continue;
      const left = Math.max(x - 1, 0), right = Math.min(x + 1, width - 1);
      const gx = l[above + right] - l[above + left] + 2 * (l[row + right] - l[row + left]) + l[below + right] - l[below + left];
      const gy = l[below + left] - l[above + left] + 2 * (l[below + x] - l[above + x]) + l[below + right] - l[above + right];
      sum += of * (gx * gx + gy * gy);
      n += of;
    }
  }
  return n > 0 ? Math.sqrt(sum / n) : 0;
}

// Bins along each of a and b, and where the outermost end.
const SIDE = 16, EXTENT = 0.16;

// Joint histogram of chroma: a pixel enters the nine bins around it by a quadratic B-spline in each direction.
function chromaShares([a, b]) {
  const shares = new Float64Array(SIDE * SIDE), bin = (i) => Math.min(Math.max(i, 0), SIDE - 1);
  const spline = (value) => {
    const u = Math.min(Math.max(((value + EXTENT) * SIDE) / (2 * EXTENT), -0.5), SIDE + 0.5 - 1e-9), cell = Math.floor(u), t = u - cell;
    return [cell, [0.5 * (1 - t) * (1 - t), 0.75 - (t - 0.5) * (t - 0.5), 0.5 * t * t]];
  };
  for (let p = 0; p < a.length; p++) {
    const [column, across] = spline(a[p]), [row, along] = spline(b[p]);
    for (let i = 0; i < 3; i++) for (let j = 0; j < 3; j++) shares[bin(row + i - 1) * SIDE + bin(column + j - 1)] += along[i] * across[j];
  }
  return shares.map((share) => share / a.length);
}

// Hellinger's distance of two lists of shares.
function hellinger(p, q) {
  return Math.sqrt(p.reduce((sum, p, i) => sum + 0.5 * (Math.sqrt(p) - Math.sqrt(q[i])) ** 2, 0));
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

// What is measured of display luminance and, where `look` asks for colours, of the planes of chroma.
function measure(l, planes, basis, look) {
  const over = (plane, isObject) => moments(plane, basis.share, isObject);
  const object = over(l, true), background = over(l, false) || object;
  const histogram = cumulated(l);
  const values = {
    meanObj: object ? object.mean : 0,
    meanBack: background.mean,
    varObj: object ? Math.sqrt(object.variance) : 0,
    varBack: Math.sqrt(background.variance),
    grad: gradient(l, basis.share, basis.width, basis.height),
    hist: look.signature ? histogramDistance(look.signature.cumulated, histogram) : 0,
  };
  if (planes) {
    const [onObject, onBackground] = [true, false].map((isObject) => planes.map((plane) => over(plane, isObject) || over(plane, !isObject)));
    const spread = (axes) => Math.sqrt(axes[0].variance + axes[1].variance);
    Object.assign(values, {
      aObj: onObject[0].mean, bObj: onObject[1].mean, aBack: onBackground[0].mean, bBack: onBackground[1].mean,
      spreadObj: spread(onObject), spreadBack: spread(onBackground),
      chroma: look.palette ? hellinger(look.palette.shares, chromaShares(planes)) : 0,
    });
  }
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
