//! The planes of a triangle over the pixels of a bin.
//!
//! Edge functions are set up in homogeneous coordinates (Olano, Greer, "Triangle scan conversion using 2D
//! homogeneous coordinates", 1997): nothing is divided by depth, so triangles that reach behind the eye are
//! as exact as others and nothing is clipped. Products are taken in `f64`, where those of a shared edge's
//! corners are the same for both triangles but for the sign, and seen from the bin's first pixel, so that
//! rounding to `f32` moves an edge by about 10⁻⁵ pixels. Pixels nearer to an edge than that are decided in
//! `f64`, seen from their centres: on an edge, the triangle covers it whose left or top edge it is.

use glam::{DVec2, Vec4};
use rayburst_simd::{Isa, PixelEdges, PixelPlanes, PixelTriangle};

/// A triangle over the pixels of a bin.
pub(crate) struct Planes {
    pub(crate) pixels: PixelPlanes,
    edges: PixelEdges,
    corners: [[f32; 4]; 3],
    first: [f64; 2],
}

impl Planes {
    /// From corners as [`crate::project::Record`] has them and the first pixel's centre; `None` if the triangle
    /// is seen edge on.
    #[inline(always)]
    pub(crate) fn new<I: Isa, const PERSPECTIVE: bool>(
        isa: I,
        corners: &[Vec4; 3],
        first: DVec2,
    ) -> Option<Self> {
        let mut pixels = PixelPlanes::NONE;
        let corners = [corners[0].to_array(), corners[1].to_array(), corners[2].to_array()];
        let first = first.to_array();
        let edges = isa.pixel_planes::<PERSPECTIVE>(&corners, first, &mut pixels);
        // Of a sum of magnitudes one that is not finite is not, either.
        let size = pixels.x[3].abs() + pixels.y[3].abs() + pixels.at_origin[3].abs();
        let seen = edges.det != 0.0 && size < f32::INFINITY;
        seen.then_some(Self { pixels, edges, corners, first })
    }

    /// The triangle as it decides in doubt.
    #[inline(always)]
    pub(crate) fn triangle(&self) -> PixelTriangle<'_> {
        let turned = self.edges.det < 0.0;
        PixelTriangle { corners: &self.corners, first: self.first, turned }
    }

    /// Whether corners wind counter-clockwise as they are seen.
    #[inline]
    pub(crate) fn counter_clockwise(&self) -> bool {
        self.edges.det < 0.0
    }

    /// Barycentric coordinates of the second and third corner at a pixel of the bin.
    #[inline]
    pub(crate) fn barycentric(&self, x: f32, y: f32) -> (f32, f32) {
        let [ex, ey, e0] = &self.edges.edges;
        let (x, y) = (f64::from(x), f64::from(y));
        let e = [0, 1, 2].map(|i| (e0[i] + ey[i] * y) + ex[i] * x);
        let sum = e[0] + e[1] + e[2];
        ((e[1] / sum) as f32, (e[2] / sum) as f32)
    }
}
