//! Small frames that tests filter.

use glam::Vec3;
use rayburst_denoise::Guides;
use rayburst_image::{Plane, Plane3};
use rayburst_math::hash::Rng;

/// The guides of a frame, owned.
#[derive(Clone)]
pub(crate) struct Frame {
    pub(crate) depth: Plane,
    pub(crate) normal: Plane3,
    pub(crate) object: Plane<u32>,
    pub(crate) motion: [Plane; 2],
}

impl Frame {
    /// A wall that faces the eye, ten units away, at rest.
    pub(crate) fn wall(width: u32, height: u32) -> Self {
        let plane = || Plane::new(width, height).unwrap();
        let mut frame = Self {
            depth: plane(),
            normal: Plane3::new(width, height).unwrap(),
            object: Plane::new(width, height).unwrap(),
            motion: [plane(), plane()],
        };
        frame.depth.fill(10.0);
        frame.normal.fill(Vec3::Z);
        frame.object.fill(1);
        frame
    }

    pub(crate) fn guides(&self) -> Guides<'_> {
        Guides {
            depth: &self.depth,
            normal: &self.normal,
            object: &self.object,
            motion: &self.motion,
            depth_motion: None,
        }
    }
}

/// A plane of a function of the pixel.
pub(crate) fn plane(width: u32, height: u32, mut f: impl FnMut(u32, u32) -> f32) -> Plane {
    let mut plane = Plane::new(width, height).unwrap();
    for y in 0..height {
        for x in 0..width {
            plane.set(x, y, f(x, y));
        }
    }
    plane
}

/// Three planes of a function of the pixel.
pub(crate) fn colours(width: u32, height: u32, mut f: impl FnMut(u32, u32) -> Vec3) -> Plane3 {
    let mut planes = Plane3::new(width, height).unwrap();
    for y in 0..height {
        for x in 0..width {
            planes.set(x, y, f(x, y));
        }
    }
    planes
}

/// A source of random numbers.
pub(crate) fn random(seed: u32) -> Rng {
    Rng::new(u64::from(seed))
}

/// The root of the mean squared difference.
pub(crate) fn rmse(a: &Plane3, b: &Plane3) -> f32 {
    let (w, h) = a.size();
    let mut sum = 0.0;
    for y in 0..h {
        for x in 0..w {
            sum += f64::from((a.get(x, y) - b.get(x, y)).length_squared());
        }
    }
    (sum / f64::from(3 * w * h)).sqrt() as f32
}
