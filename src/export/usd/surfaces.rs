//! Meshes with `UsdPreviewSurface` materials.

use std::fmt::Write as _;

use glam::{Affine2, DVec3, Vec2, Vec3};

use super::{Attributes, Layer, float, triple};
use crate::{
    bsdf::GlassTint,
    export::{ExportError, ply::Part, sheet::material_of},
    math::Rgb,
    scene::{
        Material,
        material::Model,
        texture::{Texture, Wrap},
    },
};

/// What follows values of which every vertex has one.
const PER_VERTEX: &str = " (\n            interpolation = \"vertex\"\n        )";

impl Layer<'_> {
    /// Adds the meshes and their materials, one of each for a material of the scene.
    pub(super) fn surfaces(&mut self) -> Result<(), ExportError> {
        for index in 0..self.job.scene().materials.len() {
            let part = Part::of_material(&self.job.scene().mesh, index as u32);
            if part.is_empty() {
                continue;
            }
            let material = self.job.material(index);
            let name = self.name(&material.name);
            self.material(index, &name)?;
            self.mesh(&part, &name, material);
        }
        Ok(())
    }

    fn mesh(&mut self, part: &Part, material: &str, of: &Material) {
        let name = self.name(&format!("{material}_mesh"));
        let v = part.vertices();
        let layout = of.texture().map_or(Affine2::IDENTITY, Texture::transform);
        let uv = |uv: Vec2| {
            let at = layout.transform_point2(uv);
            format!("({}, {})", at.x, at.y)
        };
        let listed = |items: Vec<String>| format!("[{}]", items.join(", "));
        let corners = |t: &[u32; 3]| format!("{}, {}, {}", t[0], t[1], t[2]);
        let vectors = |of: fn(&(Vec3, Vec3, Vec2)) -> Vec3| listed(v.iter().map(|v| triple(of(v))).collect());
        let mut mesh = Attributes::default()
            .put("int[]", "faceVertexCounts", listed(vec!["3".to_owned(); part.len()]))
            .put("int[]", "faceVertexIndices", listed(part.triangles().iter().map(corners).collect()))
            .put("point3f[]", "points", vectors(|v| v.0))
            .put("normal3f[]", "primvars:normals", vectors(|v| v.1) + PER_VERTEX)
            .put("texCoord2f[]", "primvars:st", listed(v.iter().map(|v| uv(v.2)).collect()) + PER_VERTEX)
            .put("uniform token", "subdivisionScheme", "\"none\"")
            .put("bool", "doubleSided", 1)
            .put("rel", "material:binding", format!("</World/{material}>"))
            .put("uniform token[]", "xformOpOrder", "[\"xformOp:translate\"]");
        let DVec3 { x, y, z } = self.job.scene().origin;
        mesh = mesh.put("double3", "xformOp:translate", format!("({x}, {y}, {z})"));
        self.prim("Mesh", &name, " (\n        prepend apiSchemas = [\"MaterialBindingAPI\"]\n    )", &mesh);
    }

    fn material(&mut self, index: usize, name: &str) -> Result<(), ExportError> {
        let m = self.job.material(index);
        let path = format!("/World/{name}");
        let tint = self.job.tint(index);
        let is_diffuse = m.model() == Model::Diffuse;
        let (mut inputs, mut nodes) = (Attributes::default(), String::new());
        match m.texture() {
            None => inputs = inputs.put("color3f", "inputs:diffuseColor", triple(tint)),
            Some(image) => {
                let stem = format!("{}_{name}", self.stem);
                let tinted = |[r, g, b, _]: [f32; 4]| (Rgb::new(r, g, b) * tint).to_array();
                let file = self.directory.color_texture(&stem, "color", image, tinted)?;
                let source = format!("<{path}/image.outputs:rgb>");
                inputs = inputs.put("color3f", "inputs:diffuseColor.connect", source);
                nodes = image_nodes(&path, &file, image);
            }
        }
        if m.model() == Model::Conductor && m.edge_tint() != Rgb::ONE {
            self.warnings.push(format!("material `{}`: the tint of its edge is lost", m.name));
        }
        if m.model() == Model::Dielectric && m.glass_tint() != GlassTint::CLEAR {
            self.warnings.push(format!("material `{}`: the tint of its glass is lost", m.name));
        }
        let metallic = if m.model() == Model::Conductor { 1.0 } else { m.metallic() };
        inputs = inputs
            .put("float", "inputs:roughness", if is_diffuse { 1.0 } else { m.roughness() })
            .put("float", "inputs:metallic", metallic)
            // Without a coat nothing is mirrored, as by an IOR of 1.
            .put("float", "inputs:ior", float(if is_diffuse { 1.0 } else { f64::from(m.ior()) }))
            .put("float", "inputs:opacity", if m.model().transmits() { 0.0 } else { m.opacity_factor() });
        let lit = self.job.lights().find(|l| material_of(self.job, l.light) == Some(index));
        if let Some(l) = lit.filter(|l| !l.is_dark()) {
            inputs = inputs.put("color3f", "inputs:emissiveColor", triple(l.rgb() * float(self.unit())));
        }
        if m.roughness_map().is_some() || m.metallic_map().is_some() || m.relief().is_some() {
            self.warnings
                .push(format!("material `{}`: of its images only that of the colour is written", m.name));
        }
        let surface = shader("surface", "UsdPreviewSurface", &inputs.0, "token outputs:surface");
        let _ = write!(
            self.text,
            "\n    def Material \"{name}\"\n    {{\n        token outputs:surface.connect = \
             <{path}/surface.outputs:surface>\n{surface}{nodes}    }}\n"
        );
        Ok(())
    }
}

/// A shader below a material, from its attributes.
fn shader(name: &str, id: &str, attributes: &str, output: &str) -> String {
    let inner: String = attributes.lines().map(|line| format!("    {line}\n")).collect();
    format!(
        "\n        def Shader \"{name}\"\n        {{\n            uniform token info:id = \"{id}\"\n{inner}            \
         {output}\n        }}\n"
    )
}

/// The shaders that read an image by the texture coordinates `st`.
fn image_nodes(path: &str, file: &str, image: &Texture) -> String {
    let wrap = |w: Wrap| match w {
        Wrap::Repeat => "\"repeat\"",
        Wrap::Mirror => "\"mirror\"",
        Wrap::Clamp => "\"clamp\"",
    };
    let [s, t] = image.wrap().map(wrap);
    let read = Attributes::default()
        .put("asset", "inputs:file", format!("@./{file}@"))
        .put("token", "inputs:sourceColorSpace", "\"raw\"")
        .put("token", "inputs:wrapS", s)
        .put("token", "inputs:wrapT", t)
        .put("float2", "inputs:st.connect", format!("<{path}/st.outputs:result>"));
    let st = Attributes::default().put("string", "inputs:varname", "\"st\"");
    shader("image", "UsdUVTexture", &read.0, "float3 outputs:rgb")
        + &shader("st", "UsdPrimvarReader_float2", &st.0, "float2 outputs:result")
}
