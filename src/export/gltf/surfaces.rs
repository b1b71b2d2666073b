//! Meshes and materials of a glTF.

use std::io::Write as _;

use gltf_json::{
    accessor::{FLOAT, UNSIGNED_INT},
    buffer::{ARRAY_BUFFER, ELEMENT_ARRAY_BUFFER},
};
use serde_json::{Value, json};

use crate::{
    export::{
        ExportError, ExportJob,
        directory::Directory,
        ply::Part,
        sheet::{material_of, scaled, short, short3},
    },
    math::Rgb,
    scene::{
        material::Model,
        texture::{Texture, Wrap},
    },
};

/// Meshes and materials under way.
pub(super) struct Surfaces<'a> {
    job: &'a ExportJob<'a>,
    directory: &'a mut Directory,
    stem: &'a str,
    bytes: Vec<u8>,
    views: Vec<Value>,
    accessors: Vec<Value>,
    meshes: Vec<Value>,
    materials: Vec<Value>,
    images: Vec<Value>,
    samplers: Vec<Value>,
    used: Vec<&'static str>,
    warnings: Vec<String>,
}

impl<'a> Surfaces<'a> {
    /// Nothing so far; files begin with `stem`.
    pub(super) fn new(job: &'a ExportJob<'a>, directory: &'a mut Directory, stem: &'a str) -> Self {
        Self {
            job,
            directory,
            stem,
            bytes: Vec::new(),
            views: Vec::new(),
            accessors: Vec::new(),
            meshes: Vec::new(),
            materials: Vec::new(),
            images: Vec::new(),
            samplers: Vec::new(),
            used: Vec::new(),
            warnings: Vec::new(),
        }
    }

    /// Adds a mesh and a material for each material of the scene.
    pub(super) fn write_all(&mut self) -> Result<(), ExportError> {
        for index in 0..self.job.scene().materials.len() {
            let part = Part::of_material(&self.job.scene().mesh, index as u32);
            if !part.is_empty() {
                self.material(index)?;
                self.mesh(&part, index);
            }
        }
        Ok(())
    }

    /// Adds numbers as an accessor, and returns its index.
    fn accessor(&mut self, bytes: &[u8], target: u32, mut about: Value) -> usize {
        self.views.push(json!({
            "buffer": 0, "byteOffset": self.bytes.len(), "byteLength": bytes.len(), "target": target,
        }));
        self.bytes.extend_from_slice(bytes);
        about["bufferView"] = json!(self.views.len() - 1);
        self.accessors.push(about);
        self.accessors.len() - 1
    }

    fn floats<const N: usize>(&mut self, kind: &str, values: &[[f32; N]], bounded: bool) -> usize {
        let bytes: Vec<u8> = values.iter().flatten().flat_map(|v| v.to_le_bytes()).collect();
        let mut about = json!({"componentType": FLOAT, "count": values.len(), "type": kind});
        if bounded {
            let over = |f: fn(f32, f32) -> f32, from: f32| -> Vec<Value> {
                (0..N).map(|i| short(values.iter().map(|v| v[i]).fold(from, f))).collect()
            };
            about["min"] = over(f32::min, f32::INFINITY).into();
            about["max"] = over(f32::max, f32::NEG_INFINITY).into();
        }
        self.accessor(&bytes, ARRAY_BUFFER, about)
    }

    fn mesh(&mut self, part: &Part, index: usize) {
        let layout = self.job.material(index).texture().map(Texture::transform);
        let v = part.vertices();
        let positions: Vec<_> = v.iter().map(|v| v.0.to_array()).collect();
        let normals: Vec<_> = v.iter().map(|v| v.1.to_array()).collect();
        let uvs: Vec<_> = v
            .iter()
            .map(|v| layout.map_or(v.2, |l| l.transform_point2(v.2)))
            // The format's v points down.
            .map(|uv| [uv.x, 1.0 - uv.y])
            .collect();
        let corners: Vec<u8> = part.triangles().iter().flatten().flat_map(|i| i.to_le_bytes()).collect();
        let about = json!({"componentType": UNSIGNED_INT, "count": 3 * part.len(), "type": "SCALAR"});
        let indices = self.accessor(&corners, ELEMENT_ARRAY_BUFFER, about);
        let position = self.floats("VEC3", &positions, true);
        let normal = self.floats("VEC3", &normals, false);
        let uv = self.floats("VEC2", &uvs, false);
        self.meshes.push(json!({
            "name": self.job.material(index).name,
            "primitives": [{
                "attributes": {"POSITION": position, "NORMAL": normal, "TEXCOORD_0": uv},
                "indices": indices,
                "material": self.materials.len() - 1,
            }],
        }));
    }

    fn uses(&mut self, extension: &'static str) {
        if !self.used.contains(&extension) {
            self.used.push(extension);
        }
    }

    fn material(&mut self, index: usize) -> Result<(), ExportError> {
        let m = self.job.material(index);
        let tint = self.job.tint(index);
        let is_diffuse = m.model() == Model::Diffuse;
        let metallic = if m.model() == Model::Conductor { 1.0 } else { m.metallic() };
        let mut surface = json!({
            "metallicFactor": short(metallic),
            "roughnessFactor": short(if is_diffuse { 1.0 } else { m.roughness() }),
        });
        let opacity = short(m.opacity_factor());
        // What goes through a body of glass passes two faces.
        let tint = if m.model() == Model::Dielectric { m.glass_tint().transmitted.powf(2.0) } else { tint };
        match m.texture().filter(|_| m.model() != Model::Dielectric) {
            None => {
                surface["baseColorFactor"] = json!([short(tint.x), short(tint.y), short(tint.z), opacity]);
            }
            Some(image) => {
                let stem = format!("{}_{index:02}", self.stem);
                let file = self.directory.shown_texture(&stem, image, tint)?;
                let wrap = |w: Wrap| match w {
                    Wrap::Repeat => 10497,
                    Wrap::Mirror => 33648,
                    Wrap::Clamp => 33071,
                };
                let [s, t] = image.wrap().map(wrap);
                self.samplers.push(json!({"wrapS": s, "wrapT": t}));
                self.images.push(json!({"uri": file}));
                surface["baseColorTexture"] = json!({"index": self.images.len() - 1});
                surface["baseColorFactor"] = json!([1.0, 1.0, 1.0, opacity]);
            }
        }
        let mut material = json!({
            "name": m.name, "pbrMetallicRoughness": surface, "doubleSided": true, "extensions": {},
        });
        let mut extend = |this: &mut Self, name: &'static str, value: Value| {
            material["extensions"][name] = value;
            this.uses(name);
        };
        if is_diffuse {
            extend(self, "KHR_materials_specular", json!({"specularFactor": 0.0}));
        } else if metallic < 1.0 {
            extend(self, "KHR_materials_ior", json!({"ior": short(m.ior())}));
        }
        if m.model() == Model::Conductor && m.edge_tint() != Rgb::ONE {
            self.warnings.push(format!("material `{}`: the tint of its edge is lost", m.name));
        }
        if m.model().transmits() {
            extend(self, "KHR_materials_transmission", json!({"transmissionFactor": 1.0}));
        }
        if m.model() == Model::Dielectric {
            extend(self, "KHR_materials_volume", json!({"thicknessFactor": 1.0}));
            if m.glass_tint().reflected != Rgb::ONE {
                self.warnings
                    .push(format!("material `{}`: the tint of what its glass reflects is lost", m.name));
            }
        }
        let lit = self.job.lights().find(|l| material_of(self.job, l.light) == Some(index));
        if let Some(l) = lit.filter(|l| !l.is_dark()) {
            let (color, most) = scaled(l.rgb());
            extend(self, "KHR_materials_emissive_strength", json!({"emissiveStrength": most}));
            material["emissiveFactor"] = short3(color);
            material["doubleSided"] = json!(m.emits_from_both_sides());
        }
        if m.opacity_factor() < 1.0 {
            material["alphaMode"] = json!("BLEND");
        }
        if m.roughness_map().is_some() || m.metallic_map().is_some() || m.relief().is_some() {
            self.warnings
                .push(format!("material `{}`: of its images only that of the colour is written", m.name));
        }
        self.materials.push(material);
        Ok(())
    }

    /// Writes the buffer, and adds all to the file's `root` and `nodes`.
    pub(super) fn finish(
        self,
        root: &mut Value,
        nodes: &mut Vec<Value>,
        warnings: &mut Vec<String>,
    ) -> Result<(), ExportError> {
        let file = format!("{}.bin", self.stem);
        self.directory.write(&file, |out| out.write_all(&self.bytes))?;
        let origin = self.job.scene().origin.to_array();
        for (i, mesh) in self.meshes.iter().enumerate() {
            nodes.push(json!({"name": mesh["name"], "mesh": i, "translation": origin}));
        }
        root["buffers"] = json!([{"uri": file, "byteLength": self.bytes.len()}]);
        root["bufferViews"] = self.views.into();
        root["accessors"] = self.accessors.into();
        root["meshes"] = self.meshes.into();
        root["materials"] = self.materials.into();
        if !self.images.is_empty() {
            let textures = (0..self.images.len()).map(|i| json!({"source": i, "sampler": i}));
            root["textures"] = textures.collect::<Vec<_>>().into();
            root["images"] = self.images.into();
            root["samplers"] = self.samplers.into();
        }
        if let Some(used) = root["extensionsUsed"].as_array_mut() {
            used.extend(self.used.into_iter().map(Value::from));
        }
        warnings.extend(self.warnings);
        Ok(())
    }
}

impl Directory {
    /// Writes the texels of an image times a colour as `{stem}.png`, encoded for display, and returns this name.
    fn shown_texture(&mut self, stem: &str, image: &Texture, tint: Rgb) -> Result<String, ExportError> {
        use image::{ExtendedColorType, ImageEncoder as _, codecs::png::PngEncoder};

        let [width, height] = image.size();
        let mut bytes = Vec::with_capacity(3 * width * height);
        for i in 0..width * height {
            let [r, g, b, _] = image.texel(i % width, i / width);
            for v in (Rgb::new(r, g, b) * tint).to_array() {
                let shown = crate::math::display::oetf_srgb(f64::from(v.clamp(0.0, 1.0)));
                bytes.push((255.0 * shown).round() as u8);
            }
        }
        let name = format!("{stem}.png");
        self.write(&name, |out| {
            let encoder = PngEncoder::new(out);
            encoder
                .write_image(&bytes, width as u32, height as u32, ExtendedColorType::Rgb8)
                .map_err(std::io::Error::other)
        })?;
        Ok(name)
    }
}
