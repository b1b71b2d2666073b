//! Adaptive quadrature over rectangles.

/// Gauss-Legendre nodes and weights of four points on [-1, 1].
const NODES: [(f64, f64); 4] = [
    (-0.861_136_311_594_052_6, 0.347_854_845_137_453_9),
    (-0.339_981_043_584_856_26, 0.652_145_154_862_546_1),
    (0.339_981_043_584_856_26, 0.652_145_154_862_546_1),
    (0.861_136_311_594_052_6, 0.347_854_845_137_453_9),
];

/// Rectangles are halved along both axes at most this often: at an edge of a
/// support, 2⁻⁹ of a rectangle is in doubt.
const MAX_DEPTH: u32 = 9;

/// Integrals of `N` functions over a rectangle, each within about `tolerance`
/// or 10⁻⁴ of itself.
pub fn integrate<const N: usize>(
    lo: [f64; 2],
    hi: [f64; 2],
    tolerance: f64,
    f: &impl Fn([f64; 2]) -> [f64; N],
) -> [f64; N] {
    refine(lo, hi, gauss(lo, hi, f), tolerance, 0, f)
}

fn refine<const N: usize>(
    lo: [f64; 2],
    hi: [f64; 2],
    whole: [f64; N],
    tolerance: f64,
    depth: u32,
    f: &impl Fn([f64; 2]) -> [f64; N],
) -> [f64; N] {
    let mid = [0.5 * (lo[0] + hi[0]), 0.5 * (lo[1] + hi[1])];
    let quarters =
        [(lo, mid), ([mid[0], lo[1]], [hi[0], mid[1]]), ([lo[0], mid[1]], [mid[0], hi[1]]), (mid, hi)];
    let parts = quarters.map(|(a, b)| gauss(a, b, f));
    let mut sum = [0.0; N];
    for p in &parts {
        for (s, x) in sum.iter_mut().zip(p) {
            *s += x;
        }
    }
    let converged = sum.iter().zip(&whole).all(|(s, w)| (s - w).abs() <= tolerance.max(1e-6 * s.abs()));
    if depth == MAX_DEPTH || (converged && depth > 0 && !peak_at_the_border(lo, hi, sum, tolerance, f)) {
        return sum;
    }
    let mut out = [0.0; N];
    for ((a, b), whole) in quarters.into_iter().zip(parts) {
        for (o, x) in out.iter_mut().zip(refine(a, b, whole, tolerance / 2.0, depth + 1, f)) {
            *o += x;
        }
    }
    out
}

/// Whether functions are far larger at the border than the nodes inside saw:
/// the foot of a peak next door.
fn peak_at_the_border<const N: usize>(
    lo: [f64; 2],
    hi: [f64; 2],
    sum: [f64; N],
    tolerance: f64,
    f: &impl Fn([f64; 2]) -> [f64; N],
) -> bool {
    // Just inside: supports end at borders.
    let inset = |k: usize, x: f64| lo[k] + (hi[k] - lo[k]) * x;
    let area = (hi[0] - lo[0]) * (hi[1] - lo[1]);
    const ENDS: [f64; 3] = [1e-3, 0.5, 1.0 - 1e-3];
    ENDS.iter().any(|&x| {
        ENDS.iter().any(|&y| {
            let v = f([inset(0, x), inset(1, y)]);
            v.iter().zip(sum).any(|(v, s)| v * area > 4.0 * s + 10.0 * tolerance)
        })
    })
}

fn gauss<const N: usize>(lo: [f64; 2], hi: [f64; 2], f: &impl Fn([f64; 2]) -> [f64; N]) -> [f64; N] {
    let half = [0.5 * (hi[0] - lo[0]), 0.5 * (hi[1] - lo[1])];
    let mid = [0.5 * (lo[0] + hi[0]), 0.5 * (lo[1] + hi[1])];
    let mut sum = [0.0; N];
    for (x, wx) in NODES {
        for (y, wy) in NODES {
            let v = f([mid[0] + half[0] * x, mid[1] + half[1] * y]);
            for (s, v) in sum.iter_mut().zip(v) {
                *s += v * wx * wy * half[0] * half[1];
            }
        }
    }
    sum
}

/// Integral over [lo, hi] by `n` panels of four points.
pub fn integrate_1d(lo: f64, hi: f64, n: u32, f: impl Fn(f64) -> f64) -> f64 {
    let half = 0.5 * (hi - lo) / f64::from(n);
    (0..n)
        .map(|i| {
            let mid = lo + half * f64::from(2 * i + 1);
            NODES.iter().map(|(x, w)| f(mid + half * x) * w * half).sum::<f64>()
        })
        .sum()
}

#[test]
fn a_disk_has_the_area_pi() {
    let inside = |x: [f64; 2]| [f64::from(u8::from(x[0] * x[0] + x[1] * x[1] < 1.0)), 1.0];
    let [disk, square] = integrate([-1.0; 2], [1.0; 2], 1e-6, &inside);
    // Along the edge, 2⁻¹⁰ of the side is in doubt.
    assert!((disk - std::f64::consts::PI).abs() < 1e-3, "{disk}");
    assert!((square - 4.0).abs() < 1e-12);
    let third = integrate_1d(0.0, 1.0, 3, |x| x * x);
    assert!((third - 1.0 / 3.0).abs() < 1e-14);
}
