//! The container: JSON, buffers, and the accessors into these.
//!
//! Every index and every range of bytes is checked where it is used; what does not fit is an error.

use std::{
    collections::{BTreeMap, HashMap},
    path::{Path, PathBuf},
    sync::Arc,
};

use data_url::{DataUrl, DataUrlError};
use gltf_json::{
    Accessor, Index, Root,
    accessor::{ComponentType, IndexComponentType},
    buffer::View,
    root::Get,
    validation::Checked,
};

use serde::de::{DeserializeOwned, IgnoredAny};
use serde_json::value::RawValue;

use super::animation::Animation;
use crate::{
    files::reach::{MAX_SCENE_BYTES, Reach, ReachError},
    import::{
        budget::{Budget, MAX_OBJECTS},
        error::ImportError,
    },
};

/// Extensions that a file may require because they are read, or change only
/// what is not rendered. Those of materials are known by their beginning.
const KNOWN: [&str; 9] = [
    "EXT_mesh_gpu_instancing",
    "EXT_texture_webp",
    "KHR_animation_pointer",
    "KHR_lights_punctual",
    "KHR_mesh_quantization",
    "KHR_node_visibility",
    "KHR_texture_transform",
    "KHR_xmp",
    "KHR_xmp_json_ld",
];

/// Part of `asset.generator` in files of Blender: `Khronos glTF Blender I/O v4.2.60`, before Blender 2.80
/// `Khronos Blender glTF 2.0 exporter`.
const BLENDER: &str = "Blender";

/// Extension of compressed meshes, which is not read but where a plain mesh stands beside it.
pub const DRACO: &str = "KHR_draco_mesh_compression";

/// Extensions that are not read, and how to export without them.
const ADVICE: [(&str, &str); 4] = [
    (DRACO, "export it again without mesh compression"),
    ("EXT_meshopt_compression", "export it again without mesh compression"),
    ("KHR_meshopt_compression", "export it again without mesh compression"),
    ("KHR_texture_basisu", "export it again with PNG, JPEG or WebP textures"),
];

/// A glTF with its buffers.
pub struct File {
    /// Path that the file was read from.
    pub path: PathBuf,
    /// Parsed JSON, without the animations.
    pub root: Root,
    /// Places of the nodes of `root` with all digits that the file has.
    pub places: Vec<Place>,
    /// What the file may read.
    pub reach: Reach,
    /// What the file has asked for so far.
    pub budget: Budget,
    /// The animations.
    pub animations: Vec<Animation>,
    /// Program that wrote the file, as it calls itself; empty where it does not.
    generator: String,
    /// Whether each material has the member `pbrMetallicRoughness`.
    has_pbr: Vec<bool>,
    /// Bytes of each buffer; `None` where the file holds no data for one.
    buffers: Vec<Option<Arc<Vec<u8>>>>,
}

/// The members that decide whether the rest can be understood, and what it means.
#[derive(serde::Deserialize)]
#[serde(rename_all = "camelCase")]
struct Head {
    asset: Asset,
    #[serde(default)]
    extensions_required: Vec<String>,
}

/// What is read of a glTF beside its [`Root`].
struct Rest {
    /// Place of each node in its parent, in the order of the nodes.
    places: Vec<Place>,
    /// What each material has that `gltf-json` does not tell from the default, in the order of the materials.
    materials: Vec<MaterialHead>,
    /// Animations, with targets of any kind.
    animations: Vec<Animation>,
}

/// Place of a node in its parent, glTF 2.0 section 3.5.3.
#[derive(serde::Deserialize)]
pub struct Place {
    /// Transformation, by columns; stands for the three others.
    pub matrix: Option<[f64; 16]>,
    /// Translation.
    pub translation: Option<[f64; 3]>,
    /// Rotation, a quaternion x, y, z, w.
    pub rotation: Option<[f64; 4]>,
    /// Scale.
    pub scale: Option<[f64; 3]>,
}

#[derive(serde::Deserialize)]
struct Asset {
    version: String,
    generator: Option<String>,
}

/// What `gltf-json` does not tell from the default.
#[derive(serde::Deserialize)]
#[serde(rename_all = "camelCase")]
struct MaterialHead {
    pbr_metallic_roughness: Option<IgnoredAny>,
}

impl File {
    /// Reads a `.gltf` or `.glb` and its buffers.
    ///
    /// # Errors
    /// When it is not glTF 2.0, requires an extension that is not read, or a
    /// buffer cannot be read.
    pub fn read(path: &Path, reach: &Reach) -> Result<Self, ImportError> {
        let broken = |message: String| ImportError::Gltf { path: path.into(), message };
        let bytes = reach.read(path, MAX_SCENE_BYTES).map_err(ImportError::reading)?;
        let (json, bin) =
            if bytes.starts_with(b"glTF") { split_glb(&bytes).map_err(broken)? } else { (&bytes[..], None) };
        let json = json.strip_prefix(b"\xef\xbb\xbf").unwrap_or(json);
        let head: Head = serde_json::from_slice(json).map_err(|e| broken(not_understood(e)))?;
        if !head.asset.version.starts_with("2.") {
            return Err(broken(format!("is glTF {}; this program reads glTF 2.0", head.asset.version)));
        }
        for name in &head.extensions_required {
            if KNOWN.contains(&name.as_str()) || name.starts_with("KHR_materials_") {
                continue;
            }
            return Err(broken(format!("requires the extension {name}, {}", not_read(name))));
        }
        let (root, rest) = parse(json).map_err(broken)?;
        let budget = Budget::default();
        budget.extend(bytes.len());
        let mut file = Self {
            path: path.into(),
            root,
            places: rest.places,
            reach: reach.clone(),
            budget,
            animations: rest.animations,
            generator: head.asset.generator.unwrap_or_default(),
            has_pbr: rest.materials.iter().map(|m| m.pbr_metallic_roughness.is_some()).collect(),
            buffers: Vec::new(),
        };
        file.read_buffers(bin)?;
        Ok(file)
    }

    /// Reads the buffers; `bin` is the binary chunk of a GLB.
    fn read_buffers(&mut self, bin: Option<&[u8]>) -> Result<(), ImportError> {
        // Buffers of one name share their bytes.
        let mut read: HashMap<&str, Arc<Vec<u8>>> = HashMap::new();
        let mut buffers = Vec::new();
        for (i, buffer) in self.root.buffers.iter().enumerate() {
            let key = format!("buffers[{i}]");
            let data = match &buffer.uri {
                Some(uri) => Some(match read.get(uri.as_str()) {
                    Some(data) => data.clone(),
                    None => {
                        let data = Arc::new(self.read_uri(&key, uri)?);
                        self.budget.extend(data.len());
                        read.insert(uri, data.clone());
                        data
                    }
                }),
                None if i == 0 => bin.map(|bin| Arc::new(bin.to_vec())),
                None => None,
            };
            let needed = buffer.byte_length.0;
            if let Some(n) = data.as_ref().map(|d| d.len() as u64).filter(|&n| n < needed) {
                return Err(self.error(key, format!("must hold {needed} bytes, its data has {n}")));
            }
            buffers.push(data);
        }
        self.buffers = buffers;
        Ok(())
    }

    /// Whether Blender's exporter wrote the file.
    pub fn is_of_blender(&self) -> bool {
        self.generator.contains(BLENDER)
    }

    /// Whether the material of an index says what it is made of, by `pbrMetallicRoughness`.
    pub fn has_pbr(&self, material: usize) -> bool {
        self.has_pbr.get(material).copied().unwrap_or(false)
    }

    /// The error of a key of the file.
    pub fn error(&self, key: impl Into<String>, message: impl Into<String>) -> ImportError {
        ImportError::Key { path: self.path.clone(), key: key.into(), message: message.into() }
    }

    /// The error of a file that a key of this one names.
    pub fn unread(&self, key: &str, error: ReachError) -> ImportError {
        match error {
            ReachError::Io { path, source } => {
                self.error(key, format!("cannot read {}: {source}", path.display()))
            }
            source => ImportError::Reach { path: self.path.clone(), key: key.into(), source },
        }
    }

    /// The object that an index at `key` points to.
    ///
    /// # Errors
    /// When the index is out of range.
    pub fn get<T>(&self, key: &str, index: Index<T>) -> Result<&T, ImportError>
    where
        Root: Get<T>,
    {
        self.root.get(index).ok_or_else(|| {
            self.error(key, format!("points to number {}, which does not exist", index.value()))
        })
    }

    /// The file that a relative URI names.
    ///
    /// # Errors
    /// When the URI has a scheme such as `http`.
    pub fn path_of(&self, key: &str, uri: &str) -> Result<PathBuf, ImportError> {
        if uri.contains("://") {
            let message = format!("must be a file beside the scene or a data URI, got `{uri}`");
            return Err(self.error(key, message));
        }
        let dir = self.path.parent().unwrap_or(Path::new(""));
        let decoded = dir.join(String::from_utf8_lossy(&percent_decoded(uri)).as_ref());
        let literal = dir.join(uri);
        let is_literal = !self.reach.has_file(&decoded) && self.reach.has_file(&literal);
        Ok(if is_literal { literal } else { decoded })
    }

    /// The bytes of a data URI, or of the file that a relative URI names.
    ///
    /// # Errors
    /// When the URI is malformed or the file cannot be read.
    fn read_uri(&self, key: &str, uri: &str) -> Result<Vec<u8>, ImportError> {
        if let Some(data) = self.data_uri(key, uri) {
            return data;
        }
        let path = self.path_of(key, uri)?;
        self.reach.read(&path, MAX_SCENE_BYTES).map_err(|e| self.unread(key, e))
    }

    /// The bytes of a data URI; `None` when it is not one.
    pub fn data_uri(&self, key: &str, uri: &str) -> Option<Result<Vec<u8>, ImportError>> {
        match DataUrl::process(uri) {
            Ok(data) => Some(match data.decode_to_vec() {
                Ok((bytes, _fragment)) => Ok(bytes),
                Err(e) => Err(self.error(key, format!("its data URI is not base64: {e}"))),
            }),
            Err(DataUrlError::NoComma) => Some(Err(self.error(key, "its data URI has no data"))),
            Err(DataUrlError::NotADataUrl) => None,
        }
    }

    /// The bytes of a buffer view.
    ///
    /// # Errors
    /// When the view or its buffer does not exist, or the view reaches beyond the buffer.
    pub fn view(&self, key: &str, index: Index<View>) -> Result<&[u8], ImportError> {
        let view = self.get(key, index)?;
        let key = format!("bufferViews[{}]", index.value());
        let data = match self.buffers.get(view.buffer.value()) {
            Some(Some(data)) => data,
            Some(None) => {
                let message = format!("buffers[{}] has no data in this file", view.buffer.value());
                return Err(self.error(key, message));
            }
            None => return Err(self.error(key, format!("buffers[{}] does not exist", view.buffer.value()))),
        };
        let (offset, length) = (view.byte_offset.unwrap_or_default().0, view.byte_length.0);
        slice(data, offset, length).ok_or_else(|| {
            let message =
                format!("{length} bytes from {offset} do not fit into the {} there are", data.len());
            self.error(key, message)
        })
    }

    /// The elements of an accessor of `N` components; normalised integers as fractions. `key` is that
    /// of the reference to the accessor.
    ///
    /// # Errors
    /// When the accessor does not exist, has another number of components, or lacks data.
    pub fn elements<const N: usize>(
        &self,
        key: &str,
        index: Index<Accessor>,
    ) -> Result<Vec<[f64; N]>, ImportError> {
        let accessor = self.get(key, index)?;
        let key = format!("accessors[{}]", index.value());
        let (Checked::Valid(component), Checked::Valid(kind)) = (&accessor.component_type, &accessor.type_)
        else {
            return Err(self.error(key, "has an unknown `componentType` or `type`"));
        };
        if kind.multiplicity() != N {
            let message =
                format!("must have {N} components where it is used, it has {}", kind.multiplicity());
            return Err(self.error(key, message));
        }
        let component = component.0;
        let size = component.size() * N;
        let count = usize::try_from(accessor.count.0).unwrap_or(usize::MAX);
        let is_backed = accessor.buffer_view.is_some();
        if !is_backed && count as u64 > self.budget.zeros() {
            let most = self.budget.zeros();
            return Err(
                self.error(key, format!("has no data for {count} elements; at most {most} may have none"))
            );
        }
        self.budget.decode(count).map_err(|e| self.error(&key, e))?;
        let decode = |bytes: &[u8]| {
            let mut out = [0.0; N];
            for (value, b) in out.iter_mut().zip(bytes.chunks_exact(component.size())) {
                *value = number(component, accessor.normalized, b);
            }
            out
        };
        let mut out: Vec<[f64; N]> = if let Some(view) = accessor.buffer_view {
            let offset = accessor.byte_offset.unwrap_or_default().0;
            self.strided(&key, view, offset, size, count)?.map(decode).collect()
        } else {
            vec![[0.0; N]; count]
        };
        if let Some(sparse) = &accessor.sparse {
            let n = usize::try_from(sparse.count.0).unwrap_or(usize::MAX);
            self.budget.decode(n).map_err(|e| self.error(&key, e))?;
            let Checked::Valid(IndexComponentType(kind)) = sparse.indices.component_type else {
                return Err(self.error(key, "has an unknown `sparse.indices.componentType`"));
            };
            let (at, of) = (&sparse.indices, &sparse.values);
            let places = self.strided(&key, at.buffer_view, at.byte_offset.0, kind.size(), n)?;
            let values = self.strided(&key, of.buffer_view, of.byte_offset.0, size, n)?;
            for (place, value) in places.zip(values) {
                let place = number(kind, false, place) as usize;
                let Some(element) = out.get_mut(place) else {
                    return Err(
                        self.error(key, format!("its sparse element {place} of {count} does not exist"))
                    );
                };
                *element = decode(value);
            }
        }
        Ok(out)
    }

    /// `count` pieces of `size` bytes of a view, `byteStride` apart, from `offset` on.
    fn strided<'a>(
        &'a self,
        key: &str,
        view: Index<View>,
        offset: u64,
        size: usize,
        count: usize,
    ) -> Result<impl Iterator<Item = &'a [u8]> + use<'a>, ImportError> {
        let bytes = self.view(key, view)?;
        let stride = self.get(key, view)?.byte_stride.map_or(0, |s| s.0);
        let stride = if stride == 0 { size } else { stride };
        let length = count.checked_sub(1).map_or(Some(0), |n| n.checked_mul(stride)?.checked_add(size));
        let data = length.filter(|_| stride >= size).and_then(|n| slice(bytes, offset, n as u64));
        let data = data.ok_or_else(|| {
            let view = view.value();
            let message = format!(
                "{count} elements of {size} bytes, {stride} apart from byte {offset}, do not fit into the {} \
                 bytes of bufferViews[{view}]",
                bytes.len()
            );
            self.error(key, message)
        })?;
        // The last piece may be shorter than the stride.
        Ok(data.chunks(stride).map(move |piece| &piece[..size]))
    }
}

/// Words that say that an extension is not read, and what to do.
pub fn not_read(extension: &str) -> String {
    let advice = ADVICE.iter().find(|(n, _)| *n == extension).map(|(_, a)| format!("; {a}"));
    format!("which this program does not read{}", advice.unwrap_or_default())
}

/// Parses the JSON. The root is without the animations: `gltf-json` refuses targets that extensions add to
/// these.
///
/// # Errors
/// In words, when it is no glTF or has too many objects.
fn parse(json: &[u8]) -> Result<(Root, Rest), String> {
    let mut members: BTreeMap<String, &RawValue> = serde_json::from_slice(json).map_err(not_understood)?;
    let animations = members.remove("animations");
    // Ignored values take no memory.
    let length = |v: &&RawValue| serde_json::from_str::<Vec<IgnoredAny>>(v.get()).map_or(0, |l| l.len());
    if members.values().map(length).sum::<usize>() > MAX_OBJECTS {
        return Err(format!("has more than {MAX_OBJECTS} objects in its lists"));
    }
    let others = serde_json::to_string(&members).map_err(not_understood)?;
    let root = serde_json::from_str(&others).map_err(not_understood)?;
    let member = |name: &str| members.get(name).copied();
    let rest = Rest {
        places: list(member("nodes"))?,
        materials: list(member("materials"))?,
        animations: list(animations)?,
    };
    Ok((root, rest))
}

/// The objects of a list of the JSON; none where the file does not have it.
///
/// # Errors
/// In words, when it is no such list.
fn list<T: DeserializeOwned>(member: Option<&RawValue>) -> Result<Vec<T>, String> {
    member.map_or(Ok(Vec::new()), |m| serde_json::from_str(m.get()).map_err(not_understood))
}

/// Words that say why JSON is no glTF.
fn not_understood(error: serde_json::Error) -> String {
    format!("cannot be understood as glTF: {error}")
}

/// `length` bytes of `data` from `offset` on; `None` where it has fewer.
fn slice(data: &[u8], offset: u64, length: u64) -> Option<&[u8]> {
    let start = usize::try_from(offset).ok()?;
    data.get(start..start.checked_add(usize::try_from(length).ok()?)?)
}

/// A little-endian number; glTF 2.0 section 3.11 for normalised ones.
fn number(component: ComponentType, normalized: bool, b: &[u8]) -> f64 {
    let (value, largest) = match (component, b) {
        (ComponentType::I8, &[a]) => (f64::from(a as i8), 127.0),
        (ComponentType::U8, &[a]) => (f64::from(a), 255.0),
        (ComponentType::I16, &[a, b]) => (f64::from(i16::from_le_bytes([a, b])), 32767.0),
        (ComponentType::U16, &[a, b]) => (f64::from(u16::from_le_bytes([a, b])), 65535.0),
        (ComponentType::U32, &[a, b, c, d]) => (f64::from(u32::from_le_bytes([a, b, c, d])), 4_294_967_295.0),
        (ComponentType::F32, &[a, b, c, d]) => return f64::from(f32::from_le_bytes([a, b, c, d])),
        _ => (0.0, 1.0),
    };
    if normalized { (value / largest).max(-1.0) } else { value }
}

/// JSON and binary chunk of a GLB, glTF 2.0 section 4.4.
fn split_glb(bytes: &[u8]) -> Result<(&[u8], Option<&[u8]>), String> {
    let word = |at: usize| -> Option<usize> {
        let b = bytes.get(at..at + 4)?;
        Some(u32::from_le_bytes([b[0], b[1], b[2], b[3]]) as usize)
    };
    let has = bytes.len();
    let (Some(version), Some(length)) = (word(4), word(8)) else {
        return Err(format!("is cut short: it has {has} bytes, fewer than its header"));
    };
    if version != 2 {
        return Err(format!("is a GLB of version {version}; this program reads version 2"));
    }
    if length > has {
        return Err(format!("is cut short: its header says {length} bytes, it has {has}"));
    }
    let mut chunks = Vec::new();
    let mut at = 12;
    while at + 8 <= length {
        let (Some(n), Some(kind)) = (word(at), bytes.get(at + 4..at + 8)) else { break };
        let data = bytes.get(at + 8..at + 8 + n);
        chunks.push((kind, data.ok_or_else(|| format!("is cut short: a chunk of {n} bytes ends outside"))?));
        // Chunks begin at multiples of 4.
        at += 8 + n.next_multiple_of(4);
    }
    match chunks[..] {
        [(b"JSON", json), (b"BIN\0", bin), ..] => Ok((json, Some(bin))),
        [(b"JSON", json), ..] => Ok((json, None)),
        _ => Err("is a GLB without JSON".into()),
    }
}

/// A URI with its `%20` and the like decoded.
fn percent_decoded(uri: &str) -> Vec<u8> {
    let hex = |b: Option<&u8>| b.and_then(|&b| char::from(b).to_digit(16));
    let bytes = uri.as_bytes();
    let mut out = Vec::with_capacity(bytes.len());
    let mut i = 0;
    while i < bytes.len() {
        match (bytes[i], hex(bytes.get(i + 1)), hex(bytes.get(i + 2))) {
            (b'%', Some(high), Some(low)) => {
                out.push((high * 16 + low) as u8);
                i += 3;
            }
            (b, ..) => {
                out.push(b);
                i += 1;
            }
        }
    }
    out
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn percent_signs_of_uris_are_decoded() {
        assert_eq!(percent_decoded("a%20b%C3%A9.png"), "a b\u{e9}.png".as_bytes());
        assert_eq!(percent_decoded("100%.png"), b"100%.png");
    }

    #[test]
    fn normalised_integers_stand_for_fractions() {
        assert_eq!(number(ComponentType::U8, true, &[255]), 1.0);
        assert_eq!(number(ComponentType::I8, true, &[0x80]), -1.0);
        assert_eq!(number(ComponentType::U32, false, &u32::MAX.to_le_bytes()), 4_294_967_295.0);
        assert_eq!(number(ComponentType::I16, false, &(-3_i16).to_le_bytes()), -3.0);
    }
}
