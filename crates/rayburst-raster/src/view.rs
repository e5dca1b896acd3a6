//! What a picture is taken from: a frame, a projection, a size.

use glam::{DMat3, DVec2, DVec3, Vec2, Vec3};

/// How the world maps to the picture.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Projection {
    /// Rays from one point. There is no near plane: whatever is in front of the eye is seen.
    Perspective {
        /// Half the picture's width and height at distance 1: tangents of half the angles.
        half: Vec2,
    },
    /// Parallel rays. What is behind the plane of the eye is not seen.
    Orthographic {
        /// Half the picture's width and height in the world.
        half: Vec2,
    },
}

/// A camera: the frame {**r**, **u**, **v**} (right, up, into the scene) of orthogonal unit vectors, as in
/// Eq. 26.2 of the chapter, and the picture. Pixel (0, 0) is in the top left corner, and what is seen of a
/// pixel is what is seen through its centre, (x, y) + ½ + jitter.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct View {
    /// Where the eye is; for parallel rays any point of the plane in which they begin.
    pub eye: Vec3,
    /// The frame.
    pub frame: [Vec3; 3],
    /// The projection.
    pub projection: Projection,
    /// Width and height in pixels, 65 535 at most.
    pub size: (u32, u32),
    /// What is added to pixel centres, in pixels.
    pub jitter: Vec2,
}

impl View {
    /// From the world, relative to the eye, to pixels right of and below the picture's centre, and the depth
    /// along **v**: for parallel rays as it is, else as the third homogeneous coordinate.
    pub(crate) fn matrix(&self) -> DMat3 {
        let [r, u, v] = self.frame.map(|axis| axis.as_dvec3());
        let half = match self.projection {
            Projection::Perspective { half } | Projection::Orthographic { half } => half.as_dvec2(),
        };
        let scale = 0.5 * self.extent().as_dvec2() / half;
        DMat3::from_cols(r * scale.x, -u * scale.y, v).transpose()
    }

    pub(crate) fn is_perspective(&self) -> bool {
        matches!(self.projection, Projection::Perspective { .. })
    }

    /// Width and height.
    pub(crate) fn extent(&self) -> Vec2 {
        Vec2::new(self.size.0 as f32, self.size.1 as f32)
    }

    /// The centre of pixel (0, 0) as seen from the picture's centre.
    pub(crate) fn first_centre(&self) -> DVec2 {
        0.5 + self.jitter.as_dvec2() - 0.5 * self.extent().as_dvec2()
    }

    /// From the eye towards what is seen at a pixel, one unit deep (perspective), or from the eye to where
    /// the pixel's ray begins.
    pub(crate) fn through(&self, x: u32, y: u32) -> DVec3 {
        let [r, u, v] = self.frame.map(|axis| axis.as_dvec3());
        let at = self.first_centre() + DVec2::new(f64::from(x), f64::from(y));
        let at = at / (0.5 * self.extent().as_dvec2());
        match self.projection {
            Projection::Perspective { half } => {
                let p = at * half.as_dvec2();
                p.x * r - p.y * u + v
            }
            Projection::Orthographic { half } => {
                let p = at * half.as_dvec2();
                p.x * r - p.y * u
            }
        }
    }
}
