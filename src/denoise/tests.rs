//! Properties of the denoiser on made-up pictures of which the truth is known.

use super::{Layer, denoise};
use crate::{integrator::aov::Features, math::hash::hash_words};

/// A picture that is neither square nor made of whole tiles.
const WIDTH: usize = 75;
const HEIGHT: usize = 41;

/// A standard normal number that belongs to `words` (sum of twelve uniform ones).
fn normal(words: &[u64]) -> f32 {
    let uniform = |k: u64| {
        let hash = hash_words(&[words, &[k]].concat());
        (hash >> 40) as f32 / (1_u64 << 24) as f32
    };
    (0..12).map(uniform).sum::<f32>() - 6.0
}

fn pixels() -> impl Iterator<Item = (usize, usize)> {
    (0..HEIGHT).flat_map(|y| (0..WIDTH).map(move |x| (x, y)))
}

/// A checkerboard floor below a slanted edge, a grey wall above it.
fn features() -> Features {
    let is_floor = |(x, y): (usize, usize)| 3 * y > x + 40;
    let albedo = |(x, y): (usize, usize)| match is_floor((x, y)) {
        true if (x / 4 + y / 4) % 2 == 0 => [0.8, 0.6, 0.4],
        true => [0.2, 0.2, 0.3],
        false => [0.5; 3],
    };
    Features {
        width: WIDTH,
        height: HEIGHT,
        albedo: pixels().map(albedo).collect(),
        normal: pixels().map(|p| if is_floor(p) { [0.0, 1.0, 0.0] } else { [0.0, 0.0, 1.0] }).collect(),
        disparity: pixels().map(|(_, y)| 0.2 + 0.01 * y as f32).collect(),
    }
}

/// Light that falls off to the right and shows the albedo.
fn lit(features: &Features) -> Layer {
    let light = |(x, _): (usize, usize)| 1.0 - 0.6 * x as f32 / WIDTH as f32;
    pixels().zip(&features.albedo).map(|(p, a)| a.map(|a| a * light(p))).collect()
}

/// A half of the samples: the truth with noise of the standard deviation `sigma` times its value.
fn noisy(truth: &Layer, sigma: f32, seed: u64) -> Layer {
    let noise = |i: usize, c: usize| (1.0 + sigma * normal(&[seed, i as u64, c as u64])).max(0.0);
    truth.iter().enumerate().map(|(i, v)| std::array::from_fn(|c| v[c] * noise(i, c))).collect()
}

fn mean_of(a: &Layer, b: &Layer) -> Layer {
    a.iter().zip(b).map(|(a, b)| std::array::from_fn(|c| 0.5 * (a[c] + b[c]))).collect()
}

fn mse(a: &Layer, b: &Layer) -> f64 {
    let square = |(a, b): (&f32, &f32)| f64::from(a - b).powi(2);
    a.as_flattened().iter().zip(b.as_flattened()).map(square).sum::<f64>() / a.len() as f64
}

fn total(layer: &Layer) -> f64 {
    layer.as_flattened().iter().map(|&v| f64::from(v)).sum()
}

#[test]
fn noise_goes_and_textures_and_edges_stay() {
    let features = features();
    let truth = lit(&features);
    let halves = [1, 2].map(|seed| noisy(&truth, 0.3, seed));
    let denoised = denoise(&features, [&halves[..1], &halves[1..]]).remove(0);
    let before = mse(&mean_of(&halves[0], &halves[1]), &truth);
    let after = mse(&denoised, &truth);
    assert!(after < before / 10.0, "{before} to {after}");
    // Contrast of the checkerboard, in one of its rows.
    let row = |l: &Layer| (20..60).map(|x| l[38 * WIDTH + x][0]).collect::<Vec<f32>>();
    for (got, want) in row(&denoised).into_iter().zip(row(&truth)) {
        assert!((got - want).abs() < 0.25 * want, "{got} {want}");
    }
}

#[test]
fn a_constant_stays_constant_up_to_the_border() {
    let flat: Layer = vec![[0.7, 0.2, 0.1]; WIDTH * HEIGHT];
    let denoised = denoise(&features(), [std::slice::from_ref(&flat); 2]).remove(0);
    for (got, want) in denoised.as_flattened().iter().zip(flat.as_flattened()) {
        assert!((got / want - 1.0).abs() < 1e-5, "{got} {want}");
    }
}

#[test]
fn what_is_linear_in_place_and_albedo_stays_up_to_the_border() {
    let features = features();
    let plane = |(x, y): (usize, usize)| 1.0 + 0.01 * x as f32 + 0.005 * y as f32;
    let truth: Layer = pixels().zip(&features.albedo).map(|(p, a)| a.map(|a| plane(p) + 0.3 * a)).collect();
    let halves = [3, 4].map(|seed| noisy(&truth, 0.002, seed));
    let denoised = denoise(&features, [&halves[..1], &halves[1..]]).remove(0);
    // The mean alone of a window that is cut by the border would be off by two pixels' slope.
    for (i, (got, want)) in denoised.iter().zip(&truth).enumerate() {
        assert!((got[1] - want[1]).abs() < 0.01, "pixel {i}: {got:?} {want:?}");
    }
}

#[test]
fn twice_the_light_gives_twice_the_picture() {
    let features = features();
    let truth = lit(&features);
    let halves = [5, 6].map(|seed| vec![noisy(&truth, 0.4, seed), noisy(&truth, 0.2, 9 * seed)]);
    let one = denoise(&features, [&halves[0], &halves[1]]);
    // Not a power of two: rounding differs.
    let scaled = halves.map(|half| {
        half.iter().map(|l| l.iter().map(|v| v.map(|v| 3.7e6 * v)).collect()).collect::<Vec<Layer>>()
    });
    let more = denoise(&features, [&scaled[0], &scaled[1]]);
    for (a, b) in one.iter().flatten().flatten().zip(more.iter().flatten().flatten()) {
        assert!((b / 3.7e6 - a).abs() <= 1e-4 * a + 1e-6, "{a} {b}");
    }
}

#[test]
fn a_mirrored_picture_gives_the_mirrored_result() {
    let mirror = |l: &Layer| pixels().map(|(x, y)| l[y * WIDTH + WIDTH - 1 - x]).collect::<Layer>();
    let there = features();
    let back = Features {
        albedo: mirror(&there.albedo),
        normal: mirror(&there.normal),
        disparity: pixels().map(|(x, y)| there.disparity[y * WIDTH + WIDTH - 1 - x]).collect(),
        ..there.clone()
    };
    let truth = lit(&there);
    let halves = [7, 8].map(|seed| vec![noisy(&truth, 0.4, seed), noisy(&truth, 0.2, 9 * seed)]);
    let mirrored = halves.clone().map(|half| half.iter().map(mirror).collect::<Vec<Layer>>());
    let one = denoise(&there, [&halves[0], &halves[1]]);
    let other = denoise(&back, [&mirrored[0], &mirrored[1]]);
    for (a, b) in one.iter().map(mirror).zip(&other).flat_map(|(a, b)| a.into_iter().zip(b.clone())) {
        for c in 0..3 {
            assert!((a[c] - b[c]).abs() <= 1e-4 * a[c] + 1e-6, "{a:?} {b:?}");
        }
    }
}

#[test]
fn the_edge_of_one_light_stays_where_the_sum_is_flat() {
    let features = Features {
        albedo: vec![[0.5; 3]; WIDTH * HEIGHT],
        normal: vec![[0.0, 1.0, 0.0]; WIDTH * HEIGHT],
        ..features()
    };
    let side = |left: f32, right: f32| -> Layer {
        pixels().map(|(x, _)| [if x < WIDTH / 2 { left } else { right }; 3]).collect()
    };
    let truths = [side(0.9, 0.1), side(0.1, 0.9)];
    let half = |seed: u64| vec![noisy(&truths[0], 0.2, seed), noisy(&truths[1], 0.2, 9 * seed)];
    let denoised = denoise(&features, [&half(11), &half(12)]);
    for (light, truth) in denoised.iter().zip(&truths) {
        for x in [WIDTH / 2 - 2, WIDTH / 2 + 1] {
            let column = |l: &Layer| (0..HEIGHT).map(|y| l[y * WIDTH + x][0]).sum::<f32>() / HEIGHT as f32;
            let (got, want) = (column(light), column(truth));
            assert!((got - want).abs() < 0.05, "column {x}: {got} {want}");
        }
    }
}

#[test]
fn fireflies_are_spread_and_no_light_is_lost() {
    let features = features();
    let truth = lit(&features);
    let mut halves = [13, 14].map(|seed| vec![noisy(&truth, 0.3, seed), noisy(&truth, 0.1, 9 * seed)]);
    for (i, p) in [700, 1500, 2222].into_iter().enumerate() {
        halves[i % 2][0][p] = [500.0; 3];
    }
    let denoised = denoise(&features, [&halves[0], &halves[1]]);
    for (l, layer) in denoised.iter().enumerate() {
        let (is, was) = (total(layer), 0.5 * (total(&halves[0][l]) + total(&halves[1][l])));
        assert!((is / was - 1.0).abs() < 1e-5, "light {l}: {is} {was}");
    }
    let brightest = denoised[0].as_flattened().iter().fold(0.0, |m: f32, &v| m.max(v));
    assert!(brightest < 250.0 / 4.0, "{brightest}, of 250 before");
}

#[test]
fn the_number_of_threads_changes_nothing() {
    let features = features();
    let truth = lit(&features);
    let halves = [15, 16].map(|seed| vec![noisy(&truth, 0.3, seed), noisy(&truth, 0.1, 9 * seed)]);
    let [one, three] = [1, 3].map(|n| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(n).build().unwrap();
        pool.install(|| denoise(&features, [&halves[0], &halves[1]]))
    });
    assert_eq!(one, three);
}

#[test]
fn odd_pictures_are_no_trouble() {
    let one = |v: f32| vec![vec![[v; 3]]];
    let features = Features {
        width: 1,
        height: 1,
        albedo: vec![[0.0; 3]],
        normal: vec![[0.0; 3]],
        disparity: vec![0.0],
    };
    let [value] = denoise(&features, [&one(1.0), &one(3.0)])[0][0..1] else { panic!("one pixel") };
    assert!((value[0] - 2.0).abs() < 1e-6, "{value:?}");
    assert_eq!(denoise(&features, [&one(0.0), &one(0.0)]), one(0.0));
    assert_eq!(denoise(&features, [&[], &[]]), Vec::<Layer>::new());
    let bright = denoise(&features, [&one(1e15), &one(1e-20)]);
    assert!((bright[0][0][0] / 5e14 - 1.0).abs() < 1e-5);
}
