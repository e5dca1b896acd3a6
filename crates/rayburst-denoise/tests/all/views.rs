//! Pictures of planes that a pinhole camera sees, and what tests ask of every filter.

use glam::{Mat4, Vec2, Vec3, Vec4};
use rayburst_denoise::{Guides, Surfaces};
use rayburst_image::{Plane, Plane3};
use rayburst_simd::IsaLevel;
use rayon::ThreadPoolBuilder;

/// A pinhole camera.
#[derive(Clone, Copy)]
pub(crate) struct Eye {
    pub(crate) position: Vec3,
    pub(crate) axes: [Vec3; 3],
    /// Tangent of half the vertical angle.
    pub(crate) half: f32,
    pub(crate) size: (u32, u32),
    /// Where rays go through pixels, relative to their centres.
    pub(crate) jitter: Vec2,
}

impl Eye {
    pub(crate) fn look(position: Vec3, target: Vec3, half: f32, size: (u32, u32)) -> Self {
        let forth = (target - position).normalize();
        let up = if forth.y.abs() > 0.99 { Vec3::NEG_Z } else { Vec3::Y };
        let right = forth.cross(up).normalize();
        Self { position, axes: [right, right.cross(forth), forth], half, size, jitter: Vec2::ZERO }
    }

    /// Direction through a pixel of length 1 along the view.
    pub(crate) fn direction(&self, x: u32, y: u32) -> Vec3 {
        let (w, h) = (self.size.0 as f32, self.size.1 as f32);
        let px = (x as f32 + 0.5 + self.jitter.x - 0.5 * w) * 2.0 * self.half / h;
        let py = (y as f32 + 0.5 + self.jitter.y - 0.5 * h) * 2.0 * self.half / h;
        let [right, up, forth] = self.axes;
        forth + px * right - py * up
    }

    /// World to pixels: X and Y over W; pixel centres are at halves.
    pub(crate) fn world_to_pixel(&self) -> Mat4 {
        let (w, h) = (self.size.0 as f32, self.size.1 as f32);
        let scale = h / (2.0 * self.half);
        let [right, up, forth] = self.axes;
        let row = |v: Vec3| v.extend(-v.dot(self.position));
        let z = row(forth);
        let x = row(right) * scale + z * (0.5 * w);
        let y = row(up) * -scale + z * (0.5 * h);
        Mat4::from_cols(x, y, Vec4::W, z).transpose()
    }

    pub(crate) fn project(&self, point: Vec3) -> Vec2 {
        let p = self.world_to_pixel() * point.extend(1.0);
        Vec2::new(p.x, p.y) / p.w
    }
}

/// A plane: a point, the normal, and what part of it there is.
pub(crate) type Part<'a> = (Vec3, Vec3, &'a dyn Fn(Vec3) -> bool);

/// What an eye sees of planes.
#[derive(Clone)]
pub(crate) struct View {
    pub(crate) eye: Eye,
    pub(crate) depth: Plane,
    pub(crate) normal: Plane3,
    pub(crate) object: Plane<u32>,
    pub(crate) motion: [Plane; 2],
    pub(crate) footprint: Plane,
    pub(crate) position: Plane3,
}

impl View {
    /// The nearest of some planes.
    pub(crate) fn new(eye: Eye, planes: &[Part<'_>]) -> Self {
        let (w, h) = eye.size;
        let plane = || Plane::new(w, h).unwrap();
        let vector = || Plane3::new(w, h).unwrap();
        let mut view = Self {
            eye,
            depth: plane(),
            normal: vector(),
            object: Plane::new(w, h).unwrap(),
            motion: [plane(), plane()],
            footprint: plane(),
            position: vector(),
        };
        view.depth.fill(f32::INFINITY);
        for y in 0..h {
            for x in 0..w {
                let direction = eye.direction(x, y);
                for (id, (point, normal, inside)) in (1..).zip(planes) {
                    let t = (*point - eye.position).dot(*normal) / direction.dot(*normal);
                    let at = eye.position + t * direction;
                    if t > 0.0 && t < view.depth.get(x, y) && inside(at) {
                        view.depth.set(x, y, t);
                        view.normal.set(x, y, *normal);
                        view.object.set(x, y, id);
                        view.footprint.set(x, y, 2.0 * t * eye.half / h as f32);
                        view.position.set(x, y, at);
                    }
                }
            }
        }
        view
    }

    /// A wall across the view.
    pub(crate) fn wall(width: u32, height: u32) -> Self {
        let eye = Eye::look(Vec3::new(0.0, 0.0, 10.0), Vec3::ZERO, 0.5, (width, height));
        Self::new(eye, &[(Vec3::ZERO, Vec3::Z, &|_| true)])
    }

    /// A floor at height 0, from straight above; a pixel is `1/scale` wide.
    pub(crate) fn floor(width: u32, height: u32, scale: f32) -> Self {
        let half = 0.5 * height as f32 / scale / 10.0;
        let eye = Eye::look(Vec3::new(0.0, 10.0, 0.0), Vec3::ZERO, half, (width, height));
        Self::new(eye, &[(Vec3::ZERO, Vec3::Y, &|_| true)])
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

    pub(crate) fn surfaces(&self, isa: IsaLevel) -> Surfaces {
        let mut surfaces = Surfaces::new(isa);
        surfaces.prepare(&self.guides(), &self.footprint).unwrap();
        surfaces
    }

    /// The same, with numbers that are none strewn in.
    pub(crate) fn spoilt(mut self) -> Self {
        for (i, bad) in BAD.into_iter().cycle().take(40).enumerate() {
            let (w, h) = self.eye.size;
            let (x, y) = (i as u32 * 7 % w, i as u32 * 5 % h);
            match i % 5 {
                0 => self.depth.set(x, y, bad),
                1 => self.normal.set(x, y, Vec3::splat(bad)),
                2 => self.motion[i % 2].set(x, y, bad),
                3 => self.footprint.set(x, y, bad),
                _ => self.position.set(x, y, Vec3::splat(bad)),
            }
        }
        self
    }
}

/// What no plane should hold.
pub(crate) const BAD: [f32; 8] =
    [f32::NAN, f32::INFINITY, f32::NEG_INFINITY, -1.0, 0.0, f32::MAX, f32::MIN_POSITIVE, -f32::MAX];

/// A plane with numbers that are none strewn in.
pub(crate) fn spoil(mut plane: Plane) -> Plane {
    let (w, h) = plane.size();
    for (i, bad) in BAD.into_iter().cycle().take(24).enumerate() {
        plane.set(i as u32 * 3 % w, i as u32 * 11 % h, bad);
    }
    plane
}

pub(crate) fn spoil3(mut planes: Plane3) -> Plane3 {
    planes.channels = planes.channels.map(spoil);
    planes
}

/// A plane of a function of the pixel.
pub(crate) fn fill(size: (u32, u32), mut f: impl FnMut(u32, u32) -> f32) -> Plane {
    let mut plane = Plane::new(size.0, size.1).unwrap();
    for y in 0..size.1 {
        for x in 0..size.0 {
            plane.set(x, y, f(x, y));
        }
    }
    plane
}

/// Three planes of a function of the pixel.
pub(crate) fn fill3(size: (u32, u32), mut f: impl FnMut(u32, u32) -> Vec3) -> Plane3 {
    let mut planes = Plane3::new(size.0, size.1).unwrap();
    for y in 0..size.1 {
        for x in 0..size.0 {
            planes.set(x, y, f(x, y));
        }
    }
    planes
}

/// The pixels of a plane without padding.
pub(crate) fn pixels(plane: &Plane) -> Vec<f32> {
    (0..plane.height()).flat_map(|y| plane.row(y).to_vec()).collect()
}

pub(crate) fn pixels3(planes: &Plane3) -> Vec<f32> {
    planes.channels.iter().flat_map(pixels).collect()
}

/// The instruction set that tests run under.
pub(crate) fn isa() -> IsaLevel {
    IsaLevel::detect()
}

pub(crate) fn mean(values: &[f32]) -> f64 {
    values.iter().map(|&v| f64::from(v)).sum::<f64>() / values.len() as f64
}

pub(crate) fn rmse(a: &[f32], b: &[f32]) -> f64 {
    assert_eq!(a.len(), b.len());
    let squares: f64 = a.iter().zip(b).map(|(a, b)| f64::from(a - b).powi(2)).sum();
    (squares / a.len() as f64).sqrt()
}

/// Sizes with and without whole vectors.
pub(crate) const SIZES: [(u32, u32); 6] = [(1, 1), (1, 9), (15, 2), (17, 33), (64, 8), (2, 70)];

#[track_caller]
pub(crate) fn assert_sane(values: &[f32]) {
    let bad = values.iter().position(|v| !v.is_finite() || *v < 0.0);
    assert_eq!(bad.map(|i| (i, values[i])), None);
}

#[track_caller]
pub(crate) fn assert_near(values: &[f32], expected: f32, tolerance: f32) {
    let off = values.iter().map(|v| (v - expected).abs()).fold(0.0, f32::max);
    assert!(off <= tolerance, "{off} off {expected}");
}

/// Runs a filter with every instruction set and with one, two and three threads: results differ by no more
/// than 1e-5 of 1, or by no bit.
#[track_caller]
pub(crate) fn assert_same_everywhere(run: impl Fn(IsaLevel) -> Vec<f32> + Sync) {
    let expected = run(isa());
    for threads in 1..=3 {
        let pool = ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
        let found = pool.install(|| run(isa()));
        let same = found.iter().zip(&expected).all(|(a, b)| a.to_bits() == b.to_bits());
        assert!(same && found.len() == expected.len(), "{threads} threads");
    }
    for level in IsaLevel::available() {
        let found = run(level);
        let off = found.iter().zip(&expected).map(|(a, b)| (a - b).abs()).fold(0.0, f32::max);
        assert!(off <= 1e-5, "{}: {off}", level.name());
    }
}

/// Where the rays of a frame go through pixels: the points of Roberts' R₂ sequence.
pub(crate) fn jitter(i: u32) -> Vec2 {
    let at = |step: f64| ((0.5 + f64::from(i) * step).fract() - 0.5) as f32;
    Vec2::new(at(0.754_877_666_246_692_7), at(0.569_840_290_998_053_3))
}

/// A picture with edges, lines and fine texture, as a function of the point in pixels.
pub(crate) fn pattern(p: Vec2) -> Vec3 {
    let edge = if 0.9 * p.x + 0.4 * p.y > 50.0 { 0.8 } else { 0.1 };
    let disc = if p.distance(Vec2::new(30.0, 30.0)) < 17.3 { 0.6 } else { 0.0 };
    let rings = 0.15 + 0.15 * (0.012 * p.distance_squared(Vec2::new(70.0, 20.0))).cos();
    let line = if (0.3 * p.x - p.y + 30.0).rem_euclid(16.0) < 1.7 { 0.3 } else { 0.0 };
    Vec3::new(0.5 * edge + 0.4 * disc, 0.6 * edge + line, rings + 0.3 * disc)
}

/// The pattern under a kernel of the distance in pixels, no wider than two to each side.
pub(crate) fn supersampled(size: (u32, u32), scale: Vec2, kernel: fn(Vec2) -> f32) -> Plane3 {
    const SIDE: i32 = 32;
    fill3(size, |x, y| {
        let centre = Vec2::new(x as f32 + 0.5, y as f32 + 0.5);
        let (mut sum, mut weights) = (Vec3::ZERO, 0.0);
        for j in 0..SIDE {
            for i in 0..SIDE {
                let d = (Vec2::new(i as f32, j as f32) + 0.5) * (2.0 / SIDE as f32) - 1.0;
                let weight = kernel(d);
                if weight > 0.0 {
                    sum += weight * pattern((centre + d) * scale);
                    weights += weight;
                }
            }
        }
        sum / weights
    })
}
