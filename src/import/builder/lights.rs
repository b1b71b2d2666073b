//! The lights: those of the sidecar, and the materials that emit.

use std::{
    collections::{BTreeSet, HashSet},
    f32::consts::PI,
    sync::Arc,
};

use glam::{Vec2, Vec3};

use super::Builder;
use crate::import::{
    error::ImportError,
    imported::{ImportedLight, Punctual},
    sidecar::{LightSpec, LightType, Sidecar},
};
use crate::{
    film::image_file::read_image,
    light::{
        Cone, Distant, EmissionProfile, EmissiveTriangle, Environment, Light, MeshLight, Outline, Planar,
        Point, RadianceMap, Shape, Sphere, Surroundings, look_frame,
    },
    lighting::MAX_RADIANCE,
    math::{Rgb, luminance},
    scene::{Material, Mesh, interaction},
    variables::LightConstraints,
};

/// Widest picture of surroundings that is kept as it is, pixels.
const MAX_MAP_WIDTH: usize = 4096;

impl EmissionProfile for Material {
    fn emission(&self, uv: Vec2) -> Rgb {
        self.emission_texture().map_or(Rgb::ONE, |t| t.sample(uv))
    }

    fn opacity(&self, uv: Vec2) -> f32 {
        Self::opacity(self, uv)
    }
}

impl Builder<'_> {
    /// The lights of the scene file that the sidecar does not replace, the
    /// sidecar's in their order, then the materials that emit and that no light
    /// of the sidecar stands for.
    pub(super) fn lights(
        &self,
        sidecar: &Sidecar,
        imported: &[ImportedLight],
        mesh: &Mesh,
        materials: &[Material],
        warnings: &mut Vec<String>,
    ) -> Result<(Vec<Light>, Vec<LightConstraints>), ImportError> {
        let mut names = HashSet::new();
        for (i, l) in sidecar.lights.iter().enumerate() {
            // EXR parts bear the names.
            let is_plain = l.name.chars().all(|c| c == ' ' || c.is_ascii_graphic());
            if l.name.trim().is_empty() || l.name.len() > 200 || !is_plain {
                let message = format!("must be 1 to 200 ASCII characters, got {:?}", l.name);
                return Err(self.error(format!("lights[{}].name", i + 1), message));
            }
            if !names.insert(l.name.clone()) {
                return Err(self.error(format!("lights.{}", l.name), "two lights have this name"));
            }
        }
        let mut unlit: BTreeSet<usize> = (0..materials.len()).collect();
        let mut lights = Vec::new();
        let mut constraints = Vec::new();
        let from_file = || LightConstraints {
            free: sidecar.free.clone(),
            is_from_file: true,
            ..LightConstraints::default()
        };
        for l in imported {
            if names.contains(&l.name) {
                let file = self.scene_path.display();
                warnings.push(format!("{file}: light `{}` is replaced by that of the sidecar", l.name));
            } else {
                names.insert(l.name.clone());
                lights.push(punctual(l));
                constraints.push(from_file());
            }
        }
        for l in &sidecar.lights {
            lights.push(self.light(l, mesh, materials, &mut unlit, warnings)?);
            constraints.push(self.light_constraints(sidecar, l)?);
        }
        for m in unlit.into_iter().filter(|&m| materials[m].is_emissive()) {
            let material = &materials[m];
            let Some(shape) = mesh_light(material, triangles_of(mesh, m)) else { continue };
            let name = unused_name(&material.name, &names);
            names.insert(name.clone());
            lights.push(Light {
                name,
                shape: Shape::Mesh(shape),
                color: material.emission_tint() / luminance(material.emission_tint()),
                radiance: luminance(material.emission_tint()),
                size: 1.0,
                camera_visible: true,
                occludes: false,
            });
            constraints.push(from_file());
        }
        Ok((lights, constraints))
    }

    fn light_constraints(&self, sidecar: &Sidecar, l: &LightSpec) -> Result<LightConstraints, ImportError> {
        if let Some([lo, hi]) = l.size_range
            && !(lo > 0.0 && lo <= hi && hi.is_finite())
        {
            let key = format!("lights.{}.size_range", l.name);
            return Err(self.error(key, format!("must be 0 < min <= max, got [{lo}, {hi}]")));
        }
        if let Some(max) = l.radiance_max {
            self.positive(&format!("lights.{}.radiance_max", l.name), max)?;
        }
        if l.occludes && (l.size_range.is_some() || l.free.as_ref().is_some_and(|f| f.contains("size"))) {
            let key = format!("lights.{}.occludes", l.name);
            return Err(self.error(key, "a light that stops rays has no free size"));
        }
        let free = l.free.as_ref().map_or_else(|| sidecar.free.clone(), |f| sidecar.free.intersection(f));
        Ok(LightConstraints {
            free,
            size_range: l.size_range,
            radiance_max: l.radiance_max,
            is_from_file: false,
        })
    }

    fn check_keys(&self, l: &LightSpec) -> Result<(), ImportError> {
        use LightType::{Disk, Distant, Environment, Mesh, Point, Rectangle, Sphere, Spot};
        let has = |kinds: &[LightType]| kinds.contains(&l.kind);
        const SIZED: &str = "a light with a size: a rectangle, disk or sphere, or a spot with a radius";
        for (key, given, allowed, kinds) in [
            (
                "position",
                l.position.is_some(),
                !has(&[Environment, Mesh]),
                "a rectangle, disk, sphere, spot, point or distant light",
            ),
            ("up", l.up.is_some(), has(&[Rectangle]), "a rectangle"),
            ("half_extents", l.half_extents.is_some(), has(&[Rectangle]), "a rectangle"),
            (
                "look_at",
                l.look_at.is_some(),
                has(&[Rectangle, Disk, Spot, Distant]),
                "a rectangle, disk, spot or distant light",
            ),
            ("angle", l.angle.is_some(), has(&[Spot]), "a spot"),
            ("softness", l.softness.is_some(), has(&[Spot]), "a spot"),
            ("radius", l.radius.is_some(), has(&[Disk, Sphere, Spot]), "a disk, sphere or spot"),
            ("size", l.size.is_some(), has_size(l) || has(&[Point]), SIZED),
            ("size_range", l.size_range.is_some(), has_size(l), SIZED),
            ("image", l.image.is_some(), has(&[Environment]), "an environment"),
            ("rotation", l.rotation.is_some(), has(&[Environment]), "an environment"),
            ("material", l.material.is_some(), has(&[Mesh]), "a mesh"),
            (
                "occludes",
                l.occludes,
                has(&[Rectangle, Disk, Sphere]),
                "a rectangle, disk or sphere (a mesh always does)",
            ),
        ] {
            if given && !allowed {
                return Err(self.error(format!("lights.{}.{key}", l.name), format!("only for {kinds}")));
            }
        }
        if l.free.as_ref().is_some_and(|f| f.contains("size")) && !has_size(l) {
            let message = format!("`size` is only for {SIZED}");
            return Err(self.error(format!("lights.{}.free", l.name), message));
        }
        Ok(())
    }

    fn light(
        &self,
        l: &LightSpec,
        mesh: &Mesh,
        materials: &[Material],
        unlit: &mut BTreeSet<usize>,
        warnings: &mut Vec<String>,
    ) -> Result<Light, ImportError> {
        let key = |k: &str| format!("lights.{}.{k}", l.name);
        let mut own = None;
        self.check_keys(l)?;
        let shape = match l.kind {
            LightType::Environment => Shape::Environment(self.environment(l, warnings)?),
            LightType::Mesh => {
                let name = l
                    .material
                    .as_deref()
                    .ok_or_else(|| self.error(key("material"), "a mesh needs this key"))?;
                let Some(m) = materials.iter().position(|m| m.name == name) else {
                    let known = materials.iter().map(|m| m.name.as_str());
                    return Err(self.unknown_name(&key("material"), name, known));
                };
                if !unlit.remove(&m) {
                    let message = format!("another light has the material `{name}`");
                    return Err(self.error(key("material"), message));
                }
                own = materials[m].is_emissive().then(|| materials[m].emission_tint());
                let shape = mesh_light(&materials[m], triangles_of(mesh, m));
                Shape::Mesh(shape.ok_or_else(|| {
                    self.error(key("material"), format!("no triangle has the material `{name}`"))
                })?)
            }
            _ => self.placed_shape(l)?,
        };
        let color = l.color.map(Rgb::from_array).or(own).unwrap_or(Rgb::ONE);
        let y = luminance(color);
        if !(color.min_element() >= 0.0 && y > 0.0 && color.is_finite()) {
            return Err(self.error(key("color"), format!("channels must be >= 0 and not all 0, got {color}")));
        }
        let size = self.positive(&key("size"), l.size.unwrap_or(1.0))?;
        let radiance = l.radiance.unwrap_or_else(|| own.map_or(1.0, luminance));
        if !(0.0..=MAX_RADIANCE).contains(&radiance) {
            let message = format!("must be >= 0 and at most {MAX_RADIANCE:e}, got {radiance}");
            return Err(self.error(key("radiance"), message));
        }
        Ok(Light {
            name: l.name.clone(),
            shape,
            color: color / y,
            radiance,
            size,
            camera_visible: l.camera_visible,
            occludes: l.occludes,
        })
    }

    /// A light that the sidecar places by itself.
    fn placed_shape(&self, l: &LightSpec) -> Result<Shape, ImportError> {
        let key = |k: &str| format!("lights.{}.{k}", l.name);
        let missing = |k: &str, kind: &str| self.error(key(k), format!("a {kind} light needs this key"));
        let kind = match l.kind {
            LightType::Rectangle => "rectangle",
            LightType::Disk => "disk",
            LightType::Sphere => "sphere",
            LightType::Spot => "spot",
            LightType::Point => "point",
            LightType::Distant => "distant",
            LightType::Environment | LightType::Mesh => unreachable!("has no place"),
        };
        let position = match (l.position, l.kind) {
            (Some(p), _) => p,
            (None, LightType::Distant) => [0.0; 3],
            (None, _) => return Err(missing("position", kind)),
        };
        self.finite(&key("position"), position)?;
        let up = l.up.unwrap_or([0.0, 1.0, 0.0]);
        self.finite(&key("up"), up)?;
        let center = Vec3::from_array(position);
        let radius = || match l.radius {
            Some(r) => self.positive(&key("radius"), r),
            None => Err(missing("radius", kind)),
        };
        let normal = || {
            let target = l.look_at.ok_or_else(|| missing("look_at", kind))?;
            self.finite(&key("look_at"), target)?;
            (Vec3::from_array(target) - center).try_normalize().ok_or_else(|| {
                let default = if l.position.is_none() { ", which is the origin" } else { "" };
                self.error(key("look_at"), format!("must differ from `position`{default}"))
            })
        };
        let planar = |outline, cone| {
            Ok::<_, ImportError>(Shape::Planar(Planar {
                center,
                frame: look_frame(normal()?, up.into()),
                outline,
                cone,
            }))
        };
        match l.kind {
            LightType::Point => Ok(Shape::Point(Point::isotropic(center))),
            LightType::Distant => {
                Ok(Shape::Distant(Distant { direction: normal()?, scene: Surroundings::default() }))
            }
            LightType::Sphere => Ok(Shape::Sphere(Sphere { center, radius: radius()? })),
            LightType::Rectangle => {
                let [a, b] = l.half_extents.ok_or_else(|| missing("half_extents", kind))?;
                self.positive(&key("half_extents"), a)?;
                self.positive(&key("half_extents"), b)?;
                planar(Outline::Rectangle { a, b }, None)
            }
            LightType::Disk => planar(Outline::Disk { r: radius()? }, None),
            _ => {
                let angle = l.angle.ok_or_else(|| missing("angle", kind))?;
                if !(angle > 0.0 && angle <= 90.0) {
                    return Err(self.error(key("angle"), format!("must be in (0, 90] degrees, got {angle}")));
                }
                let softness = l.softness.unwrap_or(0.2);
                if !(0.0..=1.0).contains(&softness) {
                    return Err(self.error(key("softness"), format!("must be in [0, 1], got {softness}")));
                }
                let cone = cone(angle.to_radians(), softness);
                if let Some(r) = l.radius.filter(|&r| !(r >= 0.0 && r.is_finite())) {
                    return Err(self.error(key("radius"), format!("must be >= 0, got {r}")));
                }
                if l.radius == Some(0.0) {
                    return Ok(Shape::Point(Point { position: center, cone: Some((normal()?, cone)) }));
                }
                planar(Outline::Disk { r: radius()? }, Some(cone))
            }
        }
    }

    fn environment(&self, l: &LightSpec, warnings: &mut Vec<String>) -> Result<Environment, ImportError> {
        let key = |k: &str| format!("lights.{}.{k}", l.name);
        let rotation = l.rotation.unwrap_or(0.0);
        if !rotation.is_finite() {
            return Err(self.error(key("rotation"), format!("must be finite, got {rotation}")));
        }
        let map = match &l.image {
            None => None,
            Some(name) if name.is_empty() => return Err(self.error(key("image"), "must name a picture")),
            Some(name) => {
                let path = self.toml_path.parent().unwrap_or(std::path::Path::new("")).join(name);
                let picture = read_image(&path).map_err(|source| ImportError::Picture {
                    path: self.toml_path.into(),
                    key: key("image"),
                    source: Box::new(source),
                })?;
                let (mut width, mut height, mut texels) = (picture.width, picture.height, picture.rgb);
                let original = width;
                while width > MAX_MAP_WIDTH && width % 2 == 0 && height % 2 == 0 {
                    texels = halve(&texels, width);
                    (width, height) = (width / 2, height / 2);
                }
                if width != original {
                    warnings.push(format!("{}: reduced to {width} x {height} pixels", path.display()));
                }
                let map = RadianceMap::new(width, height, texels).ok_or_else(|| {
                    let message = format!("{}: needs values >= 0, not all 0", path.display());
                    self.error(key("image"), message)
                })?;
                Some(Arc::new(map))
            }
        };
        Ok(Environment { map, rotation: rotation.to_radians(), scene: Surroundings::default() })
    }
}

/// A light of the scene file.
fn punctual(l: &ImportedLight) -> Light {
    let shape = match l.kind {
        Punctual::Point => Shape::Point(Point::isotropic(l.position)),
        Punctual::Spot { inner, outer } => {
            let cone = Cone { cos_inner: inner.cos(), cos_outer: outer.cos().max(0.0) };
            Shape::Point(Point { position: l.position, cone: Some((l.direction, cone)) })
        }
        Punctual::Directional => {
            Shape::Distant(Distant { direction: l.direction, scene: Surroundings::default() })
        }
    };
    let y = luminance(l.color);
    Light {
        name: l.name.clone(),
        shape,
        // A black light is off, of whatever colour.
        color: if y > 0.0 { l.color / y } else { Rgb::ONE },
        radiance: l.intensity * y,
        size: 1.0,
        camera_visible: true,
        occludes: false,
    }
}

/// A cone of half-angle `angle`, radians, of which the share `softness` is soft edge.
fn cone(angle: f32, softness: f32) -> Cone {
    let cos = |a: f32| a.min(0.5 * PI).cos().max(0.0);
    Cone { cos_inner: cos(angle * (1.0 - softness)), cos_outer: cos(angle) }
}

fn has_size(l: &LightSpec) -> bool {
    match l.kind {
        LightType::Rectangle | LightType::Disk | LightType::Sphere => true,
        LightType::Spot => l.radius != Some(0.0),
        _ => false,
    }
}

/// The triangles of a material, in their order.
fn triangles_of(mesh: &Mesh, material: usize) -> Vec<EmissiveTriangle> {
    let its = (0..mesh.indices.len()).filter(|&prim| mesh.materials[prim] as usize == material);
    its.map(|prim| EmissiveTriangle {
        prim: prim as u32,
        corners: mesh.corners(prim),
        uvs: mesh.indices[prim].map(|i| mesh.uvs[i as usize]),
        clearance: interaction::clearance_of(mesh.corners(prim)),
    })
    .collect()
}

fn mesh_light(material: &Material, triangles: Vec<EmissiveTriangle>) -> Option<MeshLight> {
    let varies = material.emission_texture().is_some() || material.is_translucent();
    let profile = varies.then(|| Arc::new(material.clone()) as Arc<dyn EmissionProfile>);
    MeshLight::new(triangles, profile, material.emits_from_both_sides())
}

/// A light's name for a material: plain, and different from the names in use.
fn unused_name(material: &str, used: &HashSet<String>) -> String {
    let plain: String =
        material.chars().take(180).map(|c| if c == ' ' || c.is_ascii_graphic() { c } else { '_' }).collect();
    let plain = if plain.trim().is_empty() { "emitter".to_owned() } else { plain };
    let mut name = plain.clone();
    let mut n = 1;
    while used.contains(&name) {
        n += 1;
        name = format!("{plain} {n}");
    }
    name
}

/// Means over 2 × 2 pixels.
fn halve(texels: &[[f32; 3]], width: usize) -> Vec<[f32; 3]> {
    let height = texels.len() / width;
    let at = |x: usize, y: usize| Vec3::from_array(texels[y * width + x]);
    (0..height / 2 * (width / 2))
        .map(|i| {
            let (x, y) = (2 * (i % (width / 2)), 2 * (i / (width / 2)));
            ((at(x, y) + at(x + 1, y) + at(x, y + 1) + at(x + 1, y + 1)) / 4.0).to_array()
        })
        .collect()
}
