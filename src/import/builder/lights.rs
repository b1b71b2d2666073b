//! A light of the sidecar or of the scene file.
//!
//! A new type of light is added here alone, but for its name in
//! [`LightType`](crate::import::sidecar::LightType): its keys in `keys_of`, its shape in
//! `LightReader::shape`.

use std::{f32::consts::PI, path::Path, sync::Arc};

use glam::{DVec3, Vec3};

use super::{
    emitters::Emitters,
    source::{MAX_LENGTH, MIN_LENGTH, Source, is_length},
};
use crate::{
    files::{
        number::{Number, Numbers},
        reach::MAX_PICTURE_BYTES,
    },
    import::{
        error::ImportError,
        imported::{ImportedLight, Punctual},
        radiance_map::{self, MAX_MAP_WIDTH, MapError},
        sidecar::{LightSpec, LightType},
    },
    light::{
        Cone, Distant, Environment, Light, LightColor, Outline, Planar, Point, RadianceMap, Shape, Sphere,
        Surroundings, look_frame,
    },
    lighting::MAX_RADIANCE,
    math::{
        Rgb,
        blackbody::{MAX_TINT, TEMPERATURES, glow},
        luminance,
    },
};

/// Share of a spot's half-angle that is soft edge where the sidecar does not say.
const DEFAULT_SOFTNESS: f64 = 0.2;
/// Least half-angle of a spot, degrees, as that of a glTF's: a narrower cone's solid angle drowns in rounding.
const MIN_ANGLE: f64 = 0.06;
/// The lights that have a size, in messages.
const SIZED: &str = "a light with a size: a rectangle, disk or sphere, or a spot with a radius";

/// The keys of `[[lights]]` that a light of a type and a radius takes besides those that all lights take.
fn keys_of(kind: LightType, radius: Option<f64>) -> &'static [&'static str] {
    match kind {
        LightType::Rectangle => {
            &["position", "look_at", "up", "half_extents", "size", "size_range", "occludes"]
        }
        LightType::Disk => &["position", "look_at", "radius", "size", "size_range", "occludes"],
        LightType::Sphere => &["position", "radius", "size", "size_range", "occludes"],
        LightType::Spot if radius == Some(0.0) => &["position", "look_at", "radius", "angle", "softness"],
        LightType::Spot => &["position", "look_at", "radius", "angle", "softness", "size", "size_range"],
        LightType::Point => &["position"],
        LightType::Distant => &["position", "look_at"],
        LightType::Environment => &["image", "rotation"],
        LightType::Mesh => &["material"],
    }
}

impl Source<'_> {
    /// Builds a light of the sidecar; `own` is that of the scene file of the same name. A mesh light
    /// claims its material of the `emitters`.
    pub fn light(
        &self,
        spec: &LightSpec,
        own: Option<&ImportedLight>,
        emitters: &mut Emitters,
        warnings: &mut Vec<String>,
    ) -> Result<Light, ImportError> {
        let reader = LightReader::new(self, spec, own)?;
        reader.check_keys()?;
        let (shape, emission) = reader.shape(emitters, warnings)?;
        let own = reader.own;
        let color = match (spec.color, reader.temperature()?) {
            (Some(color), _) => reader.color(color)?,
            (None, Some([kelvin, tint])) => {
                Rgb::from_array(glow(kelvin.into(), tint.into()).rgb.map(|v| v as f32))
            }
            (None, None) => emission.or(own.map(|l| l.color)).unwrap_or(Rgb::ONE),
        };
        let size = reader.size(&shape)?;
        let of_file =
            || emission.map(luminance).or_else(|| reader.own_radiance(&shape)).map_or(1.0, f64::from);
        let radiance = self.radiance(&reader.key("radiance"), spec.radiance.unwrap_or_else(of_file))?;
        Ok(Light {
            name: spec.name.clone(),
            shape,
            color: color / luminance(color),
            picture_color: LightColor::Recorded,
            temperature: reader.temperature()?,
            radiance,
            size,
            camera_visible: spec.camera_visible,
            occludes: spec.occludes,
        })
    }
}

/// One `[[lights]]` table, and the files that its errors name.
struct LightReader<'a> {
    source: &'a Source<'a>,
    spec: &'a LightSpec,
    kind: LightType,
    /// The scene file's light of the same name, where the type can be laid over it.
    own: Option<&'a ImportedLight>,
}

impl<'a> LightReader<'a> {
    fn new(
        source: &'a Source<'a>,
        spec: &'a LightSpec,
        own: Option<&'a ImportedLight>,
    ) -> Result<Self, ImportError> {
        let of_file = own.map(|l| match l.kind {
            Punctual::Point if spec.radius.is_some() => LightType::Sphere,
            Punctual::Point => LightType::Point,
            Punctual::Spot(_) => LightType::Spot,
            Punctual::Directional => LightType::Distant,
        });
        let kind = spec.kind.or(of_file).ok_or_else(|| {
            let file = source.scene_path.display();
            let key = format!("lights.{}.type", spec.name);
            source.error(key, format!("is missing, and {file} has no light of this name"))
        })?;
        Ok(Self { source, spec, kind, own: own.filter(|l| is_laid_over(kind, l)) })
    }

    fn key(&self, key: &str) -> String {
        format!("lights.{}.{key}", self.spec.name)
    }

    fn error(&self, key: &str, message: impl Into<String>) -> ImportError {
        self.source.error(self.key(key), message)
    }

    fn missing(&self, key: &str) -> ImportError {
        self.error(key, format!("a {} light needs this key", self.kind.keyword()))
    }

    fn length(&self, key: &str, value: f64) -> Result<f32, ImportError> {
        self.source.length(&self.key(key), value)
    }

    /// A colour that the sidecar gives. It is scaled to luminance 1, so that its range is only what can be
    /// computed with, which is that of a radiance.
    fn color(&self, given: [f64; 3]) -> Result<Rgb, ImportError> {
        let color = DVec3::from_array(given).as_vec3();
        if luminance(color) > 0.0 && color.to_array().iter().all(|v| (0.0..=MAX_RADIANCE).contains(v)) {
            return Ok(color);
        }
        let got = Numbers(&given);
        let message = format!("channels must be >= 0 and not all 0, at most {MAX_RADIANCE:e}, got {got}");
        Err(self.error("color", message))
    }

    /// Temperature and tint of the colour, if the sidecar gives it so.
    fn temperature(&self) -> Result<Option<[f32; 2]>, ImportError> {
        let LightSpec { color, color_temperature, tint, .. } = *self.spec;
        let Some(kelvin) = color_temperature else {
            let without = "needs `color_temperature`, from which it is the distance of the colour";
            return if tint.is_some() { Err(self.error("tint", without)) } else { Ok(None) };
        };
        if color.is_some() {
            return Err(self.error("color_temperature", "give this or `color`, not both"));
        }
        let [least, most] = TEMPERATURES;
        if !(least..=most).contains(&kelvin) {
            let message = format!("must be from {least} to {most} K, got {}", Number(kelvin));
            return Err(self.error("color_temperature", message));
        }
        let tint = tint.unwrap_or(0.0);
        if !(-MAX_TINT..=MAX_TINT).contains(&tint) {
            let message = format!("must be from -{MAX_TINT} to {MAX_TINT}, got {}", Number(tint));
            return Err(self.error("tint", message));
        }
        Ok(Some([kelvin as f32, tint as f32]))
    }

    /// The factor on the extents of the shape, which give a length with it.
    fn size(&self, shape: &Shape) -> Result<f32, ImportError> {
        let size = self.source.positive(&self.key("size"), self.spec.size.unwrap_or(1.0))?;
        let extent = match shape {
            Shape::Planar(planar) => planar.outline.extent(),
            Shape::Sphere(sphere) => sphere.radius,
            Shape::Point(_) | Shape::Distant(_) | Shape::Environment(_) | Shape::Mesh(_) => return Ok(size),
        };
        let length = f64::from(size) * f64::from(extent);
        if !is_length(length) {
            let message = format!(
                "must give a length from {MIN_LENGTH:e} to {MAX_LENGTH:e} m, gives {}",
                Number(length as f32)
            );
            return Err(self.error("size", message));
        }
        Ok(size)
    }

    /// Checks that no key is given that the light's type does not have.
    fn check_keys(&self) -> Result<(), ImportError> {
        let l = self.spec;
        let known = keys_of(self.kind, self.radius_of_spot());
        for (key, is_given, owners) in [
            ("position", l.position.is_some(), "a rectangle, disk, sphere, spot, point or distant light"),
            ("up", l.up.is_some(), "a rectangle"),
            ("half_extents", l.half_extents.is_some(), "a rectangle"),
            ("look_at", l.look_at.is_some(), "a rectangle, disk, spot or distant light"),
            ("angle", l.angle.is_some(), "a spot"),
            ("softness", l.softness.is_some(), "a spot"),
            ("radius", l.radius.is_some(), "a disk, sphere or spot"),
            ("size", l.size.is_some(), SIZED),
            ("size_range", l.size_range.is_some(), SIZED),
            ("image", l.image.is_some(), "an environment"),
            ("rotation", l.rotation.is_some(), "an environment"),
            ("material", l.material.is_some(), "a mesh"),
            ("occludes", l.occludes, "a rectangle, disk or sphere (a mesh always does)"),
        ] {
            if is_given && !known.contains(&key) {
                return Err(self.error(key, format!("only for {owners}")));
            }
        }
        if l.free.as_ref().is_some_and(|f| f.contains("size")) && !known.contains(&"size_range") {
            return Err(self.error("free", format!("`size` is only for {SIZED}")));
        }
        Ok(())
    }

    /// The light's shape and, of a mesh whose material emits, the radiance of the material.
    fn shape(
        &self,
        emitters: &mut Emitters,
        warnings: &mut Vec<String>,
    ) -> Result<(Shape, Option<Rgb>), ImportError> {
        let shape = match self.kind {
            LightType::Rectangle => self.rectangle()?,
            LightType::Disk => {
                let center = self.position()?;
                let outline = Outline::Disk { r: self.radius()? };
                self.planar(center, Vec3::Y, outline, None)?
            }
            LightType::Sphere => Shape::Sphere(Sphere { center: self.position()?, radius: self.radius()? }),
            LightType::Spot => self.spot()?,
            LightType::Point => Shape::Point(Point::isotropic(self.position()?)),
            LightType::Distant => self.distant()?,
            LightType::Environment => Shape::Environment(self.environment(warnings)?),
            LightType::Mesh => return self.mesh(emitters),
        };
        Ok((shape, None))
    }

    fn position(&self) -> Result<Vec3, ImportError> {
        if let Some(position) = self.spec.position {
            return self.source.point(&self.key("position"), position);
        }
        let own = self.own.filter(|l| l.kind != Punctual::Directional);
        own.map(|l| l.position).ok_or_else(|| self.missing("position"))
    }

    fn radius(&self) -> Result<f32, ImportError> {
        self.length("radius", self.spec.radius.ok_or_else(|| self.missing("radius"))?)
    }

    /// Unit direction from `center` to `look_at`.
    fn direction(&self, center: Vec3) -> Result<Vec3, ImportError> {
        let own = self.own.filter(|l| l.kind != Punctual::Point).map(|l| l.direction);
        if let (None, Some(direction)) = (self.spec.look_at, own) {
            return Ok(direction);
        }
        let target = self.spec.look_at.ok_or_else(|| self.missing("look_at"))?;
        let target = self.source.point(&self.key("look_at"), target)?;
        (target - center).try_normalize().ok_or_else(|| {
            let default = if self.spec.position.is_none() { ", which is the origin" } else { "" };
            self.error("look_at", format!("must differ from `position`{default}"))
        })
    }

    fn planar(
        &self,
        center: Vec3,
        up: Vec3,
        outline: Outline,
        cone: Option<Cone>,
    ) -> Result<Shape, ImportError> {
        let frame = look_frame(self.direction(center)?, up);
        Ok(Shape::Planar(Planar { center, frame, outline, cone }))
    }

    fn rectangle(&self) -> Result<Shape, ImportError> {
        let center = self.position()?;
        let up = self.spec.up.unwrap_or([0.0, 1.0, 0.0]);
        let up = self.source.finite(&self.key("up"), up)?;
        let [a, b] = self.spec.half_extents.ok_or_else(|| self.missing("half_extents"))?;
        let (a, b) = (self.length("half_extents", a)?, self.length("half_extents", b)?);
        self.planar(center, up, Outline::Rectangle { a, b }, None)
    }

    fn spot(&self) -> Result<Shape, ImportError> {
        let center = self.position()?;
        let cone = self.cone()?;
        if let Some(r) = self.spec.radius.filter(|r| r.is_nan() || *r < 0.0) {
            return Err(self.error("radius", format!("must be >= 0, got {}", Number(r))));
        }
        if self.radius_of_spot() == Some(0.0) {
            return Ok(Shape::Point(Point { position: center, cone: Some((self.direction(center)?, cone)) }));
        }
        let outline = Outline::Disk { r: self.radius()? };
        self.planar(center, Vec3::Y, outline, Some(cone))
    }

    /// Radius at size 1 of a spot, metres: that of the scene file's light is 0.
    fn radius_of_spot(&self) -> Option<f64> {
        self.spec.radius.or(self.own.map(|_| 0.0))
    }

    /// The cone of a spot; angle and softness that are not given are those of the scene file's spot.
    fn cone(&self) -> Result<Cone, ImportError> {
        let own = self.own.and_then(|l| match l.kind {
            Punctual::Spot(cone) => Some(cone),
            Punctual::Point | Punctual::Directional => None,
        });
        let l = self.spec;
        if let (None, None, Some(cone)) = (l.angle, l.softness, own) {
            return Ok(cone);
        }
        let own_angle = own.map(|c| c.cos_outer.acos().to_degrees());
        let own_softness = own.map(|c| 1.0 - c.cos_inner.acos() / c.cos_outer.acos());
        let angle = l.angle.or(own_angle.map(f64::from)).ok_or_else(|| self.missing("angle"))?;
        if !(MIN_ANGLE..=90.0).contains(&angle) {
            let message = format!("must be from {MIN_ANGLE} to 90 degrees, got {}", Number(angle));
            return Err(self.error("angle", message));
        }
        let softness = l.softness.or(own_softness.map(f64::from)).unwrap_or(DEFAULT_SOFTNESS);
        let softness = self.source.fraction(&self.key("softness"), softness)?;
        let cone = Cone::with_edge((angle as f32).to_radians(), softness);
        Ok(Cone { edge: own.map_or(cone.edge, |c| c.edge), ..cone })
    }

    /// Radiance per unit of colour with which a shape at size 1 sends as much ahead as the scene file's
    /// light; `None` without that.
    fn own_radiance(&self, shape: &Shape) -> Option<f32> {
        let own = self.own?;
        let area = match shape {
            Shape::Point(_) | Shape::Distant(_) => 1.0,
            Shape::Sphere(s) => PI * s.radius * s.radius,
            Shape::Planar(p) => match p.outline {
                Outline::Rectangle { a, b } => 4.0 * a * b,
                Outline::Disk { r } => PI * r * r,
            },
            Shape::Environment(_) | Shape::Mesh(_) => return None,
        };
        Some(own.intensity * luminance(own.color) / area)
    }

    fn distant(&self) -> Result<Shape, ImportError> {
        let position = match self.spec.position {
            Some(_) => self.position()?,
            None => self.source.point("position", [0.0; 3])?,
        };
        Ok(distant(self.direction(position)?))
    }

    fn environment(&self, warnings: &mut Vec<String>) -> Result<Environment, ImportError> {
        let rotation = self.source.turn(&self.key("rotation"), self.spec.rotation.unwrap_or(0.0))?;
        let map = match self.spec.image.as_deref() {
            None => None,
            Some("") => return Err(self.error("image", "must name a picture")),
            Some(name) => Some(Arc::new(self.radiance_map(name, warnings)?)),
        };
        Ok(Environment { map, rotation: rotation.to_radians(), scene: Surroundings::default() })
    }

    /// Reads a picture of the surroundings beside the sidecar.
    fn radiance_map(&self, name: &str, warnings: &mut Vec<String>) -> Result<RadianceMap, ImportError> {
        let sidecar = self.source.sidecar_path;
        let path = sidecar.parent().unwrap_or(Path::new("")).join(name);
        if let Err(source) = self.source.reach.check(&path, MAX_PICTURE_BYTES)
            && !source.is_missing()
        {
            return Err(ImportError::Reach { path: sidecar.into(), key: self.key("image"), source });
        }
        match radiance_map::read(&path, MAX_MAP_WIDTH) {
            Ok((map, noted)) => {
                warnings.extend(noted);
                Ok(map)
            }
            Err(MapError::Picture(source)) => Err(ImportError::Picture {
                path: sidecar.into(),
                key: self.key("image"),
                source: Box::new(source),
            }),
            Err(wrong @ MapError::Values { .. }) => Err(self.error("image", wrong.to_string())),
        }
    }

    fn mesh(&self, emitters: &mut Emitters) -> Result<(Shape, Option<Rgb>), ImportError> {
        let materials = emitters.materials();
        let name =
            self.spec.material.as_deref().ok_or_else(|| self.error("material", "a mesh needs this key"))?;
        let Some(m) = materials.iter().position(|m| m.name == name) else {
            let known = materials.iter().map(|m| m.name.as_str());
            return Err(self.source.unknown_name(&self.key("material"), name, known));
        };
        if !emitters.claim(m) {
            return Err(self.error("material", format!("another light has the material `{name}`")));
        }
        let shape = emitters
            .mesh_light(m)
            .ok_or_else(|| self.error("material", format!("no triangle has the material `{name}`")))?;
        let emission = materials[m].is_emissive().then(|| materials[m].emission_tint());
        Ok((Shape::Mesh(shape), emission))
    }
}

/// Whether a light of the sidecar of a type takes what it does not say from a light of the scene file.
pub fn is_laid_over(kind: LightType, own: &ImportedLight) -> bool {
    match kind {
        LightType::Distant => own.kind == Punctual::Directional,
        LightType::Environment | LightType::Mesh => false,
        LightType::Rectangle | LightType::Disk | LightType::Sphere | LightType::Spot | LightType::Point => {
            own.kind != Punctual::Directional
        }
    }
}

/// The light that a punctual light of a scene file stands for.
pub fn punctual(l: &ImportedLight) -> Light {
    let shape = match l.kind {
        Punctual::Point => Shape::Point(Point::isotropic(l.position)),
        Punctual::Spot(cone) => Shape::Point(Point { position: l.position, cone: Some((l.direction, cone)) }),
        Punctual::Directional => distant(l.direction),
    };
    let y = luminance(l.color);
    Light {
        name: l.name.clone(),
        shape,
        // A black light is off, of whatever colour.
        color: if y > 0.0 { l.color / y } else { Rgb::ONE },
        picture_color: LightColor::Recorded,
        temperature: None,
        radiance: l.intensity * y,
        size: 1.0,
        camera_visible: true,
        occludes: false,
    }
}

/// Parallel light along a unit direction; the scene gives it its surroundings.
fn distant(direction: Vec3) -> Shape {
    Shape::Distant(Distant { direction, scene: Surroundings::default() })
}
