//! Random rays: inside, outside, far away, grazing, axis parallel, with directions of any length and
//! intervals of all kinds.

use glam::Vec3;
use rayburst_math::Ray;
use rayburst_math::hash::Rng;
use rayburst_procedural::ShapeHit;

pub(crate) struct Rays {
    pub(crate) rng: Rng,
    centre: Vec3,
    extent: Vec3,
    surface: Option<(Vec3, Vec3)>,
}

impl Rays {
    pub(crate) fn new(seed: u64, lower: Vec3, upper: Vec3) -> Self {
        Self {
            rng: Rng::new(seed),
            centre: 0.5 * (lower + upper),
            extent: upper - lower,
            surface: None,
        }
    }

    /// A point in the box grown by a factor.
    fn point(&mut self, factor: f32) -> Vec3 {
        self.centre + factor * self.extent * (self.rng.vec3() - 0.5)
    }

    fn direction(&mut self) -> Vec3 {
        loop {
            let v = 2.0 * self.rng.vec3() - 1.0;
            if v.length_squared() > 0.01 && v.length_squared() <= 1.0 {
                return v.normalize();
            }
        }
    }

    /// Remembers a point of the surface, that later rays may graze.
    pub(crate) fn remember(&mut self, ray: &Ray, hit: &ShapeHit) {
        self.surface = Some((ray.at(hit.t), hit.normal));
    }

    pub(crate) fn next(&mut self) -> Ray {
        let size = self.extent.max_element();
        let (origin, direction) = match self.rng.below(8) {
            0 | 1 => (self.point(1.0), self.direction()),
            2..=4 => {
                let (from, to) = (self.point(4.0), self.point(1.0));
                (from, to - from)
            }
            5 => {
                // Far enough for `f32` to hurt if nothing is done about it.
                let (away, to) = (self.direction(), self.point(1.0));
                let from = to + away * size * 10f32.powf(self.rng.range(1.0, 3.0));
                (from, to - from)
            }
            6 => {
                let axis = [Vec3::X, Vec3::Y, Vec3::Z][self.rng.below(3) as usize];
                let sign = if self.rng.below(2) == 0 { -1.0 } else { 1.0 };
                (self.point(1.5), sign * axis)
            }
            _ => {
                let (point, normal) = self.surface.unwrap_or((self.centre, Vec3::Y));
                let off = size * 10f32.powf(self.rng.range(-5.0, -1.0));
                let side = if self.rng.below(2) == 0 { -1.0 } else { 1.0 };
                let tangent = normal.cross(self.direction());
                let back = self.rng.range(0.0, 2.0) * size;
                (point + side * off * normal - back * tangent, tangent)
            }
        };
        let direction = if direction.length() > 0.0 { direction } else { Vec3::X };
        let scale = 10f32.powf(self.rng.range(-3.0, 3.0)) / direction.length();
        let direction = direction * scale;
        let reach = 4.0 * size / (direction.length());
        let (t_min, t_max) = match self.rng.below(5) {
            0 => (f32::NEG_INFINITY, f32::INFINITY),
            1 => {
                let (a, b) = (self.rng.range(-reach, reach), self.rng.range(-reach, reach));
                (a.min(b), a.max(b))
            }
            2 => (self.rng.range(-reach, 0.0), f32::INFINITY),
            _ => (0.0, f32::INFINITY),
        };
        Ray::with_interval(origin, direction, t_min, t_max)
    }
}
