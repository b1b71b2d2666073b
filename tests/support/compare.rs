//! Pictures as statistics: per-pixel means with their variance.

use std::{fs, path::PathBuf};

use glam::UVec2;
use lightopt_embree::{
    film::{Picture, RgbFilm},
    integrator::{Integrator, Samples, View},
    lighting::{Lighting, SampleCounts, SamplingPlan},
    math::stats::{Moments, normal_deviate, sidak_z},
    sampler::SamplerKind,
    scene::Scene,
};

/// The author's view of a scene in a lighting, and where its samples go.
#[derive(Clone)]
pub struct Subject<'a> {
    pub view: View<'a>,
    pub lighting: Lighting,
    pub plan: SamplingPlan,
}

impl<'a> Subject<'a> {
    /// A scene as its author lit it.
    pub fn new(scene: &'a Scene) -> Self {
        Self::lit(scene, Lighting::authored(scene))
    }

    /// A scene in a lighting, its lights sampled alike.
    pub fn lit(scene: &'a Scene, lighting: Lighting) -> Self {
        let plan = SamplingPlan::uniform(&lighting);
        Self { view: View { scene, camera: &scene.camera }, lighting, plan }
    }

    /// The same with one light subpath for so many camera subpaths.
    pub fn with_camera_subpaths(mut self, camera_subpaths: u32) -> Self {
        self.plan.counts = SampleCounts { camera_subpaths, ..self.plan.counts };
        self
    }

    pub fn render(&self, integrator: &Integrator, samples: Samples) -> Picture {
        let Self { view, lighting, plan } = self;
        let mut film = RgbFilm::by_light(view.camera.size(), lighting);
        integrator.render(*view, lighting, plan, &mut film, samples, &()).unwrap();
        film.develop(lighting, samples.count)
    }

    /// `n` independent renders of `spp` samples.
    pub fn measure(
        &self,
        integrator: &Integrator,
        sampler: SamplerKind,
        seed: u64,
        n: u32,
        spp: u32,
    ) -> Measured {
        let size = self.view.camera.size();
        let mut out = Measured {
            size,
            pixels: vec![[Moments::default(); 3]; size.element_product() as usize],
            total: Moments::default(),
        };
        for i in 0..n {
            let samples = Samples { sampler, seed: seed * 1_000_003 + u64::from(i), first: 0, count: spp };
            let picture = self.render(integrator, samples);
            let mut sum = 0.0;
            for (m, rgb) in out.pixels.iter_mut().zip(&picture.rgb) {
                for c in 0..3 {
                    m[c].push(f64::from(rgb[c]));
                    sum += f64::from(rgb[c]);
                }
            }
            out.total.push(sum / (3.0 * picture.rgb.len() as f64));
        }
        out
    }
}

/// A render of a scene as its author lit it.
pub fn render(scene: &Scene, integrator: &Integrator, samples: Samples) -> Picture {
    Subject::new(scene).render(integrator, samples)
}

/// Per-pixel statistics over independent renders.
pub struct Measured {
    pub size: UVec2,
    /// [pixel][channel]
    pub pixels: Vec<[Moments; 3]>,
    /// Mean of the picture's luminance-like channel sum.
    pub total: Moments,
}

/// `n` independent renders of a scene as its author lit it, of `spp` samples.
pub fn measure(
    scene: &Scene,
    integrator: &Integrator,
    sampler: SamplerKind,
    seed: u64,
    n: u32,
    spp: u32,
) -> Measured {
    Subject::new(scene).measure(integrator, sampler, seed, n, spp)
}

/// Degrees of freedom of a difference of means whose variance is `variance`,
/// `va` and `vb` being estimated from `na` and `nb` renders. \[Welch47\]
fn welch(variance: f64, va: f64, na: u64, vb: f64, nb: u64) -> f64 {
    let spread = va * va / (na - 1) as f64 + vb * vb / (nb - 1) as f64;
    (variance * variance / spread.max(1e-300)).min(1e6)
}

/// Relative error of a pixel that is summed in f32.
const ROUNDING: f64 = 1e-5;

/// How two measurements differ.
pub struct Comparison {
    /// Normal deviate of each pixel.
    pub z: Vec<f64>,
    /// The largest of them, in magnitude.
    pub worst: f64,
    /// Normal deviate of the picture's mean.
    pub total: f64,
    /// What none of them exceeds by chance, at level 0.01 with Šidák correction.
    pub threshold: f64,
    /// Difference of the pictures' means over the second's, and its standard error.
    pub relative: [f64; 2],
}

/// Compares two measurements: each pixel's mean over the channels, and the picture's mean.
///
/// A variance floor of the median pixel's, and of rounding, keeps a pixel that
/// happened to see no noise from deciding; with few renders a ratio follows Student's t, so it is
/// first turned into the normal deviate of the same probability.
pub fn compare(a: &Measured, b: &Measured) -> Comparison {
    let n = a.pixels.len();
    assert_eq!((a.size, n), (b.size, b.pixels.len()));
    let gray = |p: &[Moments; 3]| {
        let mean = p.iter().map(Moments::mean).sum::<f64>() / 3.0;
        // Channels of one pixel are fully dependent: add deviations, not variances.
        let sd = p.iter().map(|m| m.variance_of_mean().sqrt()).sum::<f64>() / 3.0;
        (mean, sd * sd)
    };
    let mut variances: Vec<f64> =
        a.pixels.iter().zip(&b.pixels).map(|(p, q)| gray(p).1 + gray(q).1).collect();
    variances.sort_by(f64::total_cmp);
    let floor = variances[n / 2];
    let z: Vec<f64> = a
        .pixels
        .iter()
        .zip(&b.pixels)
        .map(|(p, q)| {
            let ((ma, va), (mb, vb)) = (gray(p), gray(q));
            let rounding = (ROUNDING * mb).powi(2);
            let variance = (va + vb).max(floor).max(rounding).max(1e-30);
            normal_deviate((ma - mb) / variance.sqrt(), welch(variance, va, p[0].n(), vb, q[0].n()))
        })
        .collect();
    let (va, vb) = (a.total.variance_of_mean(), b.total.variance_of_mean());
    let variance = (va + vb).max(1e-30);
    let difference = a.total.mean() - b.total.mean();
    let dof = welch(variance, va, a.total.n(), vb, b.total.n());
    Comparison {
        worst: z.iter().fold(0.0_f64, |m, v| m.max(v.abs())),
        z,
        total: normal_deviate(difference / variance.sqrt(), dof),
        threshold: sidak_z(0.01, n + 1),
        relative: [difference / b.total.mean(), variance.sqrt() / b.total.mean()],
    }
}

/// Fails unless two measurements agree, pixel by pixel and on the whole.
pub fn assert_same(name: &str, a: &Measured, b: &Measured) {
    let c = compare(a, b);
    println!(
        "{name}: worst pixel z {:.2}, picture z {:.2}, means {:.5} {:.5} ({:+.3} %), threshold {:.2}",
        c.worst,
        c.total,
        a.total.mean(),
        b.total.mean(),
        100.0 * c.relative[0],
        c.threshold
    );
    if c.worst > c.threshold || c.total.abs() > c.threshold {
        let dir = write_failure(name, a, b, &c);
        panic!("{name}: pictures differ; see {}", dir.display());
    }
}

/// Writes both pictures and the map of z; returns where.
pub fn write_failure(name: &str, a: &Measured, b: &Measured, c: &Comparison) -> PathBuf {
    let dir = PathBuf::from(env!("CARGO_TARGET_TMPDIR")).join("../test-out");
    fs::create_dir_all(&dir).unwrap();
    let map = |f: &dyn Fn(usize) -> [f32; 3]| -> image::Rgb32FImage {
        image::Rgb32FImage::from_fn(a.size.x, a.size.y, |x, y| image::Rgb(f((y * a.size.x + x) as usize)))
    };
    let mean = |m: &Measured, i: usize| {
        std::array::from_fn(|c| (m.pixels[i][c].mean().max(0.0) as f32).powf(1.0 / 2.2))
    };
    let z = |i: usize| {
        [
            (c.z[i] / 10.0).max(0.0) as f32,
            (c.z[i].abs() - c.threshold).max(0.0) as f32,
            (-c.z[i] / 10.0).max(0.0) as f32,
        ]
    };
    for (suffix, picture) in [("a", map(&|i| mean(a, i))), ("b", map(&|i| mean(b, i))), ("z", map(&z))] {
        let path = dir.join(format!("{name}-{suffix}.png"));
        image::DynamicImage::ImageRgb32F(picture).into_rgb8().save(&path).unwrap();
    }
    dir
}
