//! Where surfaces that are not opaque are seen.

/// A point of a surface that a pixel may show.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Candidate {
    /// Depth along the view.
    pub depth: f32,
    /// Perspective-correct barycentric coordinate of the second corner.
    pub u: f32,
    /// Barycentric coordinate of the third corner.
    pub v: f32,
    /// The mesh's place among those drawn.
    pub mesh: u32,
    /// The mesh's instance.
    pub instance: u32,
    /// The mesh's geometry.
    pub geometry: u32,
    /// The triangle.
    pub primitive: u32,
    /// Whether the side is seen on which the corners wind counter-clockwise in the mesh's own space.
    pub front: bool,
}

/// Tells where meshes that are not opaque are seen. Must be a function of its arguments alone: it is asked
/// once at most for a pixel and a triangle, in any order, and not at all for what is hidden already.
pub trait Coverage: Sync {
    /// Whether a pixel, numbered row by row from the top left, shows a candidate.
    fn covers(&self, pixel: u32, candidate: &Candidate) -> bool;
}

/// All surfaces are seen everywhere.
#[derive(Clone, Copy, Debug, Default)]
pub struct Solid;

impl Coverage for Solid {
    #[inline(always)]
    fn covers(&self, _: u32, _: &Candidate) -> bool {
        true
    }
}
