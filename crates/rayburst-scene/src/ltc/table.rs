//! The fitted lobes, and one of them put together for a direction.
//!
//! `table.bin` holds 16-bit integers, little endian: for each part of the lobe, each roughness and
//! each cosine the five numbers of [`Entry`], in units of 1/[`UNITS`]. Axes are those of the table of
//! albedos: √(cos θ), which spreads out grazing angles, and roughness √α. `cargo xtask ltc` makes it.
//!
//! A direction is first turned into the frame of the mirror direction (z there, x in the plane of
//! incidence on the normal's side: the normal is (sin θ, 0, cos θ)), then taken to a plain cosine
//! lobe by
//!
//! ```text
//! a/α    0          s·sin θ/g        g = √(α² + (1 − α²) cos² θ)
//! 0      b/(α g)    0
//! t·sin θ/α   0     k
//! ```
//!
//! The factors take out what makes the entries grow without bound or change quickly: for sharp lobes
//! a and b are ½, k is 1, s and t are 0 at any angle.

use std::sync::LazyLock;

use glam::{Mat3, Vec3};

/// Columns of the table.
pub const COSINES: usize = 64;
/// Rows of the table.
pub const ROUGHNESSES: usize = 64;
/// Integers of the file that stand for 1.
pub(super) const UNITS: f64 = 8192.0;

/// a, b, s, t, k.
pub(super) type Entry<T = f32> = [T; 5];

/// GGX reflection with Schlick's Fresnel term, cut into what is multiplied by the reflectance at
/// normal incidence and what by that at grazing angles; their albedos are [`crate::bsdf::albedo`]'s
/// a and b.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Part {
    /// The factor of F₀.
    Normal,
    /// The factor of F₉₀.
    Grazing,
}

impl Part {
    /// Both, in the order of the file.
    pub const ALL: [Self; 2] = [Self::Normal, Self::Grazing];
}

static BYTES: &[u8] = include_bytes!("table.bin");
static TABLE: LazyLock<Vec<Entry>> = LazyLock::new(|| {
    let value = |bytes: &[u8; 2]| f32::from(i16::from_le_bytes(*bytes)) / UNITS as f32;
    let (values, _) = BYTES.as_chunks::<2>();
    let (entries, _) = values.as_chunks::<5>();
    entries.iter().map(|entry| entry.each_ref().map(value)).collect()
});

/// The bytes of one roughness, as they are in the file.
pub fn row_bytes(part: Part, row: usize) -> &'static [u8] {
    let length = COSINES * size_of::<Entry<i16>>();
    &BYTES[(part as usize * ROUGHNESSES + row) * length..][..length]
}

/// One part of the lobe for one direction of view.
#[derive(Clone, Copy, Debug)]
pub(super) struct Lobe {
    /// From the local frame of the surface to where the lobe is a cosine lobe about z.
    pub(super) to_cosine: Mat3,
    /// 1 over the share of the lobe that is above the surface.
    pub(super) normalisation: f32,
}

impl Lobe {
    /// The lobe for a unit direction `wo` in the local frame, above the surface.
    pub(super) fn new(part: Part, wo: Vec3, alpha: f32) -> Self {
        let cos = wo.z.clamp(0.0, 1.0);
        let sin = (1.0 - cos * cos).max(0.0).sqrt();
        let [a, b, s, t, k] = interpolate(part, cos, alpha);
        let slope = (alpha * alpha + (1.0 - alpha * alpha) * cos * cos).sqrt();
        let (a, b, s, t) = (a / alpha, b / (alpha * slope), s * sin / slope, t * sin / alpha);
        let side = wo.truncate().try_normalize().unwrap_or(glam::Vec2::X);
        let mirror = Vec3::new(-wo.x, -wo.y, cos);
        let x = Vec3::new(cos * side.x, cos * side.y, sin);
        let y = Vec3::new(-side.y, side.x, 0.0);
        let rows = Mat3::from_cols(a * x + s * mirror, b * y, t * x + k * mirror);
        // The surface's plane where the lobe is a cosine lobe.
        let (nx, nz) = (k * sin - t * cos, a * cos - s * sin);
        let above = 0.5 + 0.5 * nz / nx.hypot(nz).max(f32::MIN_POSITIVE);
        Self { to_cosine: rows.transpose(), normalisation: 1.0 / above.max(1e-2) }
    }
}

fn interpolate(part: Part, cos: f32, alpha: f32) -> Entry {
    let cell = |x: f32, n: usize| {
        let x = x.clamp(0.0, 1.0) * (n - 1) as f32;
        let i = (x as usize).min(n - 2);
        (i, x - i as f32)
    };
    let (row, t) = cell(alpha.sqrt(), ROUGHNESSES);
    let (column, s) = cell(cos.sqrt(), COSINES);
    let at = (part as usize * ROUGHNESSES + row) * COSINES + column;
    let entries = &TABLE[at..at + COSINES + 2];
    std::array::from_fn(|i| {
        let mix = |first: usize| {
            let (e0, e1) = (entries[first][i], entries[first + 1][i]);
            e0 + (e1 - e0) * s
        };
        let (low, high) = (mix(0), mix(COSINES));
        low + (high - low) * t
    })
}
