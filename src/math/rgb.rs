//! Linear Rec.709 colour.

/// A linear Rec.709 triple: a reflectance (dimensionless) or a radiance
/// (W·m⁻²·sr⁻¹ per channel), as the context says.
pub type Rgb = glam::Vec3;

/// Luminance of a linear Rec.709 triple.
#[must_use]
pub fn luminance(c: Rgb) -> f32 {
    0.2126 * c.x + 0.7152 * c.y + 0.0722 * c.z
}
