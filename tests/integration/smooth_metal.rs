//! Metal whose interpolated normals lean away from the viewer.

use lightopt_embree::film::exr::read_exr;

use crate::room::Room;

/// A cylinder of gold, roughness 0.3, shaded smooth across its edges, below one softbox: mean of
/// R, G and B over the cylinder, and over the first four rows of pixels that show it, its top.
fn brightness(integrator: &str) -> [f64; 2] {
    let room = Room::new();
    room.write("smooth_metal.glb", include_bytes!("../data/smooth_metal/smooth_metal.glb"));
    room.write("smooth_metal.toml", include_str!("../data/smooth_metal/smooth_metal.toml"));
    room.succeed(&["render", "smooth_metal.glb", integrator, "--spp", "32", "-o", "a.exr"]);
    let exr = read_exr(&room.path("a.exr")).unwrap();
    let channels = ["R", "G", "B"].map(|c| exr.parts[0].channel(c).unwrap());
    let mask = exr.parts.iter().find(|p| p.name == "mask").unwrap().channels[0].1.clone();
    let covered: Vec<usize> = (0..mask.len()).filter(|&i| mask[i] > 0.5).collect();
    let top = covered[0] / exr.width;
    let mean = |pixels: &[usize]| {
        let sum = |&i: &usize| channels.iter().map(|c| f64::from(c[i])).sum::<f64>() / 3.0;
        pixels.iter().map(sum).sum::<f64>() / pixels.len() as f64
    };
    let n_top = covered.iter().take_while(|&&i| i / exr.width < top + 4).count();
    [mean(&covered), mean(&covered[..n_top])]
}

/// What Cycles 5.0.1 shows is 0.901 and 0.561; without bent normals it would be 0.825 and 0.144. At
/// grazing directions the light between facets is spread wider here than there, which makes the top
/// 0.05 brighter: Cycles scales the mirror lobe, at the cost of reciprocity.
#[test]
fn metal_shows_no_speckle_where_its_normals_lean_from_the_viewer() {
    for integrator in ["--path", "--bdpt"] {
        let [whole, top] = brightness(integrator);
        println!("{integrator}: {whole:.3} {top:.3}");
        assert!((whole / 0.901 - 1.0).abs() < 0.03, "{integrator}: {whole}");
        assert!((top - 0.561).abs() < 0.07, "{integrator}: {top}");
    }
}
