//! Glass of a single sheet, which neither refracts nor holds anything inside.
//!
//! A surface is a sheet where it is open: where its connected component, welded by position whatever the
//! materials, has an edge that belongs to one triangle alone. A closed one bounds a body of glass.

use std::collections::{BTreeMap, HashMap};

use glam::Vec3;

use super::{imported::UniqueNames, warnings::Warnings};
use crate::{
    math::Bounds,
    scene::{
        Mesh,
        material::{MaterialParams, Model},
    },
};

/// Distance of vertices that are one where a component would else be open, in lengths of the diagonal of
/// its box: exporters round to six digits, and a sphere's pole may be many points that differ by less.
const WELD: f32 = 1e-5;
/// The box of nothing.
const EMPTY: Bounds = Bounds { lo: Vec3::INFINITY, hi: Vec3::NEG_INFINITY };

/// Makes the glass of the materials that `is_asked` thin where its component is open. A material of bodies
/// and sheets is split: its sheets get one of their own, called by its name and `_thin`. `tinted` gives a
/// thin material the colour of what it lets pass.
pub fn make_thin(
    mesh: &mut Mesh,
    materials: &mut Vec<(String, MaterialParams)>,
    is_asked: impl Fn(usize) -> bool,
    tinted: impl Fn(usize, &mut MaterialParams),
    warnings: &mut Warnings,
) {
    let is_glass: Vec<bool> =
        materials.iter().enumerate().map(|(m, (_, p))| p.model == Model::Dielectric && is_asked(m)).collect();
    if !is_glass.contains(&true) {
        return;
    }
    let is_open = open(mesh);
    // Whether each material has sheets, and bodies.
    let mut has = vec![[false; 2]; materials.len()];
    for (&m, &is_open) in mesh.materials.iter().zip(&is_open) {
        has[m as usize][usize::from(!is_open)] = true;
    }
    let mut names = UniqueNames::default();
    for (name, _) in materials.iter() {
        names.take(name.clone());
    }
    let mut thin_of: HashMap<u32, u32> = HashMap::new();
    for m in 0..is_glass.len() {
        let [has_sheets, has_bodies] = has[m];
        if !is_glass[m] || !has_sheets {
            continue;
        }
        let at = if has_bodies {
            let (name, params) = materials[m].clone();
            let thin = names.take(format!("{name}_thin"));
            warnings.about(
                "material",
                &name,
                format!("its glass is a body here, a single sheet there: `{thin}`"),
            );
            materials.push((thin, params));
            thin_of.insert(m as u32, materials.len() as u32 - 1);
            materials.len() - 1
        } else {
            m
        };
        let params = &mut materials[at].1;
        params.model = Model::Thin;
        tinted(m, params);
    }
    for (m, is_open) in mesh.materials.iter_mut().zip(is_open) {
        if let Some(&thin) = thin_of.get(m).filter(|_| is_open) {
            *m = thin;
        }
    }
}

/// An edge: its vertices, the lesser first.
type Edge = [u32; 2];

fn edge(i: u32, j: u32) -> Edge {
    [i.min(j), i.max(j)]
}

/// Whether the connected component of each triangle has an edge of one triangle alone.
fn open(mesh: &Mesh) -> Vec<bool> {
    let welded = welded(mesh);
    let mut components = Components::new(mesh.indices.len());
    // The first triangle of each edge, and how many there are.
    let mut edges: HashMap<Edge, (u32, u32)> = HashMap::new();
    for (t, corners) in mesh.indices.iter().enumerate() {
        let [a, b, c] = corners.map(|i| welded[i as usize]);
        for (i, j) in [(a, b), (b, c), (c, a)] {
            let (first, n) = edges.entry(edge(i, j)).or_insert((t as u32, 0));
            *n += 1;
            components.join(*first, t as u32);
        }
    }
    let mut rim: Vec<(Edge, u32)> =
        edges.into_iter().filter(|(_, (_, n))| *n == 1).map(|(edge, (t, _))| (edge, t)).collect();
    rim.sort_unstable();
    let twins = twins(mesh, &rim, &mut components);
    // The same once more, of vertices that rounding alone keeps apart.
    let mut seams: HashMap<Edge, (u32, u32)> = HashMap::new();
    for ([i, j], t) in rim.into_iter().map(|(e, t)| (e.map(|i| twins[&i]), t)).filter(|([i, j], _)| i != j) {
        let (first, n) = seams.entry(edge(i, j)).or_insert((t, 0));
        *n += 1;
        components.join(*first, t);
    }
    let mut is_open = vec![false; mesh.indices.len()];
    for (first, _) in seams.into_values().filter(|(_, n)| *n == 1) {
        is_open[components.root(first) as usize] = true;
    }
    (0..mesh.indices.len() as u32).map(|t| is_open[components.root(t) as usize]).collect()
}

/// The first vertex at the position of each.
fn welded(mesh: &Mesh) -> Vec<u32> {
    let mut first: HashMap<[u32; 3], u32> = HashMap::new();
    // −0 is 0.
    let key = |p: Vec3| p.to_array().map(|v| (v + 0.0).to_bits());
    mesh.positions.iter().zip(0..).map(|(&p, i)| *first.entry(key(p)).or_insert(i)).collect()
}

/// The vertex that stands for each of those of the edges `rim`, which come with their triangles: the first
/// one that is nearer than both components' boxes times [`WELD`], rounded down to a power of two.
fn twins(mesh: &Mesh, rim: &[(Edge, u32)], components: &mut Components) -> HashMap<u32, u32> {
    let mut boxes: HashMap<u32, Bounds> = rim.iter().map(|(_, t)| (components.root(*t), EMPTY)).collect();
    for t in 0..mesh.indices.len() {
        if let Some(known) = boxes.get_mut(&components.root(t as u32)) {
            *known = known.union(Bounds::of(mesh.corners(t)));
        }
    }
    let mut twins: HashMap<u32, u32> = HashMap::new();
    // Vertices by the exponent of their tolerance and their cell of that size.
    let mut grids: BTreeMap<i32, HashMap<[i64; 3], Vec<u32>>> = BTreeMap::new();
    for &(edge, t) in rim {
        let tolerance = WELD * boxes[&components.root(t)].diagonal();
        let level = tolerance.max(f32::MIN_POSITIVE).log2().floor() as i32;
        for i in edge {
            if twins.contains_key(&i) {
                continue;
            }
            let p = mesh.positions[i as usize];
            let near = |(&other, grid): (&i32, &HashMap<[i64; 3], Vec<u32>>)| {
                let reach = 2_f32.powi(level.min(other));
                let [x, y, z] = cell(p, other);
                let around = (0..27).map(|k| [x + k % 3 - 1, y + k / 3 % 3 - 1, z + k / 9 - 1]);
                let mut candidates = around.filter_map(|c| grid.get(&c)).flatten().copied();
                candidates.find(|&j| mesh.positions[j as usize].distance(p) <= reach)
            };
            let twin = grids.iter().find_map(near);
            twins.insert(i, twin.unwrap_or(i));
            if twin.is_none() {
                grids.entry(level).or_default().entry(cell(p, level)).or_default().push(i);
            }
        }
    }
    twins
}

/// The cell of a point in the grid of width 2 to the power of `level`, metres.
fn cell(p: Vec3, level: i32) -> [i64; 3] {
    (p.as_dvec3() / 2_f64.powi(level)).floor().to_array().map(|v| v as i64)
}

/// Sets of triangles: a forest in which each points toward the root of its set.
struct Components(Vec<u32>);

impl Components {
    fn new(n: usize) -> Self {
        Self((0..n as u32).collect())
    }

    fn root(&mut self, mut t: u32) -> u32 {
        while self.0[t as usize] != t {
            // Halves the path, so that it is short the next time.
            self.0[t as usize] = self.0[self.0[t as usize] as usize];
            t = self.0[t as usize];
        }
        t
    }

    fn join(&mut self, a: u32, b: u32) {
        let (a, b) = (self.root(a), self.root(b));
        self.0[a.max(b) as usize] = a.min(b);
    }
}

#[cfg(test)]
mod tests {
    use glam::Vec2;

    use super::*;
    use crate::scene::mesh::face_normal;

    /// A mesh of triangles with vertices of their own, each with its material.
    fn mesh(triangles: &[([Vec3; 3], u32)]) -> Mesh {
        let mut mesh = Mesh::default();
        for (corners, material) in triangles {
            let base = mesh.positions.len() as u32;
            mesh.positions.extend(corners);
            mesh.normals.extend([face_normal(*corners).normalize(); 3]);
            mesh.uvs.extend([Vec2::ZERO; 3]);
            mesh.indices.push([base, base + 1, base + 2]);
            mesh.materials.push(*material);
            mesh.objects.push(0);
        }
        mesh
    }

    fn tetrahedron(at: Vec3, materials: [u32; 4]) -> Vec<([Vec3; 3], u32)> {
        let p = [Vec3::ZERO, Vec3::X, Vec3::Y, Vec3::Z].map(|p| p + at);
        [[0, 2, 1], [0, 1, 3], [0, 3, 2], [1, 2, 3]]
            .map(|t| t.map(|i| p[i]))
            .into_iter()
            .zip(materials)
            .collect()
    }

    fn glass(n: usize) -> Vec<(String, MaterialParams)> {
        let params = MaterialParams { model: Model::Dielectric, ..MaterialParams::default() };
        (0..n).map(|i| (format!("glass{i}"), params.clone())).collect()
    }

    fn thin(mesh: &mut Mesh, materials: &mut Vec<(String, MaterialParams)>) -> Vec<Model> {
        make_thin(mesh, materials, |_| true, |_, _| {}, &mut Warnings::default());
        mesh.materials.iter().map(|&m| materials[m as usize].1.model).collect()
    }

    #[test]
    fn a_body_is_closed_whatever_the_materials_of_its_faces() {
        let mut closed = mesh(&tetrahedron(Vec3::ZERO, [0, 1, 0, 1]));
        assert_eq!(thin(&mut closed, &mut glass(2)), [Model::Dielectric; 4]);
        let mut open = mesh(&tetrahedron(Vec3::ZERO, [0, 1, 0, 1])[..3]);
        assert_eq!(thin(&mut open, &mut glass(2)), [Model::Thin; 3]);
    }

    #[test]
    fn a_material_of_bodies_and_sheets_is_split() {
        let far = tetrahedron(Vec3::splat(5.0), [0; 4]);
        let all = [tetrahedron(Vec3::ZERO, [0; 4]), far[..2].to_vec()].concat();
        let (mut mesh, mut materials) = (mesh(&all), glass(1));
        let models = thin(&mut mesh, &mut materials);
        assert_eq!(models[..4], [Model::Dielectric; 4]);
        assert_eq!(models[4..], [Model::Thin; 2]);
        assert_eq!(materials[1].0, "glass0_thin");
    }

    #[test]
    fn rounding_does_not_open_a_body() {
        let mut triangles = tetrahedron(Vec3::ZERO, [0; 4]);
        // The last face is off by a rounding of six digits.
        triangles[3].0 = triangles[3].0.map(|p| p + Vec3::splat(1e-6));
        assert_eq!(thin(&mut mesh(&triangles), &mut glass(1)), [Model::Dielectric; 4]);
        triangles[3].0 = triangles[3].0.map(|p| p + Vec3::splat(1e-3));
        assert_eq!(thin(&mut mesh(&triangles), &mut glass(1)), [Model::Thin; 4]);
    }

    #[test]
    fn opaque_sheets_stay() {
        let mut wall = mesh(&tetrahedron(Vec3::ZERO, [0; 4])[..1]);
        let mut materials = vec![("wall".to_owned(), MaterialParams::default())];
        assert_eq!(thin(&mut wall, &mut materials), [Model::Diffuse]);
    }
}
