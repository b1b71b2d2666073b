// Colours of lights and of what a display shows, as the program's modules math::blackbody, light::color and
// math::oklab have them.

const NEUTRAL = [1, 1, 1];
const FROM_XYZ = [[3.2409699419, -1.5373831776, -0.4986107603], [-0.9692436363, 1.8759675015, 0.0415550574], [0.0556300797, -0.2039769589, 1.0569715142]];
const TO_XYZ = [[0.4123907993, 0.3575843394, 0.1804807884], [0.2126390059, 0.7151686788, 0.0721923154], [0.0193308187, 0.1191947798, 0.9505321522]];
// Temperatures in kelvin between which the fit of the locus holds.
const COLDEST = 1000, HOTTEST = 15000;

const dot3 = (a, b) => a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
const times = (matrix, v) => matrix.map((row) => dot3(row, v));

// u and v of the Planckian locus in the CIE 1960 diagram, by Krystek's rational functions of the temperature (Color
// Research & Application 10, 1985).
function locus(t) {
  return [(0.860117757 + t * (1.54118254e-4 + t * 1.28641212e-7)) / (1 + t * (8.42420235e-4 + t * 7.08145163e-7)),
    (0.317398726 + t * (4.22806245e-5 + t * 4.20481691e-8)) / (1 - t * (2.89741816e-5 - t * 1.61456053e-7))];
}

// The locus at a temperature with the unit direction along it towards higher ones.
function along(kelvin) {
  const at = locus(kelvin), step = 1e-4 * kelvin, [below, above] = [locus(kelvin - step), locus(kelvin + step)];
  const slope = [above[0] - below[0], above[1] - below[1]], length = Math.hypot(...slope);
  return [at, slope.map((v) => v / length)];
}

// Linear Rec.709 of luminance 1 of a body of this temperature, `tint` (Duv) above the locus, clipped to the gamut.
function glow(kelvin, tint = 0) {
  const [at, slope] = along(kelvin), u = at[0] + tint * slope[1], v = at[1] - tint * slope[0];
  const kept = times(FROM_XYZ, [(1.5 * u) / v, 1, (2 - 0.5 * u) / v - 5]).map((c) => Math.max(c, 0));
  const luminance = dot3(kept, LUMINANCE);
  return kept.map((c) => c / luminance);
}

// Temperature of the point of the locus that is nearest to a linear colour, and its distance Duv from it.
function temperatureOf(rgb) {
  const [X, Y, Z] = times(TO_XYZ, rgb), sum = X + 15 * Y + 3 * Z, uv = [(4 * X) / sum, (6 * Y) / sum];
  let low = 1 / HOTTEST, high = 1 / COLDEST;
  for (let i = 0; i < 30; i++) {
    const middle = 0.5 * (low + high), [at, slope] = along(1 / middle);
    if ((uv[0] - at[0]) * slope[0] + (uv[1] - at[1]) * slope[1] > 0) high = middle; else low = middle;
  }
  const kelvin = 2 / (low + high), [at, slope] = along(kelvin);
  return [kelvin, (uv[0] - at[0]) * slope[1] - (uv[1] - at[1]) * slope[0]];
}

// Factor on each channel of a colour of the records: "recorded", or an object with `rgb` or `temperature`.
function factorOf(color) {
  if (color.temperature) return glow(color.temperature.kelvin, color.temperature.tint);
  if (!color.rgb) return NEUTRAL;
  const luminance = dot3(color.rgb, LUMINANCE);
  return color.rgb.map((v) => v / luminance);
}

// A linear colour as bytes of a display, as bright as it can be shown.
function hexOf(rgb) {
  const most = Math.max(...rgb);
  return `#${rgb.map((c) => Math.round(255 * encode(c / most)).toString(16).padStart(2, "0")).join("")}`;
}

// A colour in words: the temperature of one near the locus, else its bytes.
function colorWords(color, own) {
  if (color.temperature && !color.temperature.tint) return `${Math.round(color.temperature.kelvin)} K`;
  const rgb = color === "recorded" ? own : factorOf(color), [kelvin, duv] = temperatureOf(rgb);
  const isNear = Math.abs(duv) < 0.01 && kelvin > 1.01 * COLDEST && kelvin < 0.99 * HOTTEST;
  return isNear ? `≈ ${10 * Math.round(kelvin / 10)} K` : hexOf(rgb);
}

// Cube root of the bound below which the root of Oklab is continued along its tangent.
const TOE = 6 / 29;

function root(cone) {
  return cone > TOE * TOE * TOE ? Math.cbrt(cone) : cone / (3 * TOE * TOE) + (2 / 3) * TOE;
}

// a and b of Oklab of a display-linear colour in [0, 1], written to place `p` of two planes.
function chroma([r, g, b], planes, p) {
  const l = root(0.4122214708 * r + 0.5363325363 * g + 0.0514459929 * b);
  const m = root(0.2119034982 * r + 0.6806995451 * g + 0.1073969566 * b);
  const s = root(0.0883024619 * r + 0.2817188376 * g + 0.6299787005 * b);
  planes[0][p] = 1.9779984951 * l - 2.428592205 * m + 0.4505937099 * s;
  planes[1][p] = 0.0259040371 * l + 0.7827717662 * m - 0.808675766 * s;
}
