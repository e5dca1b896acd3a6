//! From bytes to triangles and rays, and bytes worth trying.

use glam::{Affine3A, Vec3};
use rayburst_accel::{Cull, Instance, InstanceFlags, TraceOptions};
use rayburst_math::{Ray, hash::Rng};

use crate::builds::Build;

/// What some bytes mean. All bytes mean something; what is missing is zero.
#[derive(Clone, Debug)]
pub struct Input {
    /// How to build.
    pub build: Build,
    /// References of spatial splits for each triangle.
    pub budget: f32,
    /// Whether filters are not asked.
    pub opaque: bool,
    /// How to trace; every mode is.
    pub options: TraceOptions,
    /// The vertices.
    pub positions: Vec<Vec3>,
    /// The vertices to refit to.
    pub moved: Vec<Vec3>,
    /// The triangles.
    pub indices: Vec<[u32; 3]>,
    /// Instances of two BLASes; maybe none.
    pub instances: Vec<Instance>,
    /// The rays.
    pub rays: Vec<Ray>,
}

/// Reads bytes, and zeros after them.
struct Reader<'a> {
    bytes: std::slice::Iter<'a, u8>,
    /// Numbers so far, to be repeated.
    earlier: Vec<f32>,
}

impl Reader<'_> {
    fn byte(&mut self) -> u8 {
        self.bytes.next().copied().unwrap_or(0)
    }

    fn below(&mut self, limit: usize) -> usize {
        usize::from(self.byte()) % limit
    }

    /// Any `f32`: a third are small lattice numbers, repeated ones and the like, at which things meet.
    fn number(&mut self) -> f32 {
        const SPECIAL: [f32; 16] = [
            f32::NAN,
            f32::INFINITY,
            f32::NEG_INFINITY,
            -0.0,
            f32::MIN_POSITIVE,
            1e-40,
            f32::from_bits(1),
            f32::MAX,
            f32::MIN,
            (1u64 << 60) as f32,
            -((1u64 << 60) as f32),
            (1u128 << 90) as f32,
            1e-20,
            1e20,
            1.0 + f32::EPSILON,
            -1e-38,
        ];
        let kind = self.byte();
        let x = match kind % 8 {
            0 | 1 => f32::from(self.byte() as i8) / 16.0,
            2 => f32::from(kind as i8 / 8),
            3 => {
                let back = self.below(self.earlier.len().max(1));
                self.earlier.iter().rev().nth(back).copied().unwrap_or(0.0)
            }
            4 => f32::from(i16::from_le_bytes([self.byte(), self.byte()])) / 4096.0,
            5 => SPECIAL[usize::from(kind / 8) % 16],
            6 => {
                // A neighbour of an earlier number.
                let last = self.earlier.last().copied().unwrap_or(0.0);
                f32::from_bits(last.to_bits().wrapping_add_signed(i32::from(self.byte() as i8)))
            }
            _ => f32::from_le_bytes([self.byte(), self.byte(), self.byte(), self.byte()]),
        };
        self.earlier.push(x);
        x
    }

    fn vector(&mut self) -> Vec3 {
        Vec3::new(self.number(), self.number(), self.number())
    }
}

impl Input {
    /// What the bytes mean.
    pub fn new(bytes: &[u8]) -> Self {
        let mut r = Reader { bytes: bytes.iter(), earlier: vec![] };
        let builds = Build::all();
        let build = builds[r.below(builds.len())];
        let flags = r.byte();
        let options = TraceOptions {
            mask: if flags & 0x10 == 0 { 0xFF } else { 0x0F },
            cull: [Cull::None, Cull::Front, Cull::Back][r.below(5).saturating_sub(2)],
            ..TraceOptions::default()
        };
        let budget = if flags & 1 == 0 { 1.5 } else { r.number() };
        let vertices = 1 + r.below(80);
        let positions: Vec<Vec3> = (0..vertices).map(|_| r.vector()).collect();
        let triangles = r.below(100);
        let indices: Vec<[u32; 3]> =
            (0..triangles).map(|_| [(); 3].map(|()| r.below(vertices) as u32)).collect();
        let mut moved = positions.clone();
        for _ in 0..r.below(8) {
            let vertex = r.below(vertices);
            moved[vertex] = r.vector();
        }
        let instance = |r: &mut Reader<'_>| {
            let kind = r.byte();
            let mut map = Affine3A::IDENTITY;
            if kind & 1 != 0 {
                map.translation = r.vector().into();
            }
            if kind & 2 != 0 {
                map.matrix3.x_axis = r.vector().into();
                map.matrix3.y_axis = r.vector().into();
            }
            if kind & 4 != 0 {
                map.matrix3 *= r.number();
            }
            let flags = InstanceFlags {
                cull_disable: kind & 8 != 0,
                front_clockwise: kind & 16 != 0,
                force_opaque: [None, None, Some(true), Some(false)][usize::from(kind >> 5) % 4],
            };
            let mask = if kind & 128 == 0 { 0xFF } else { r.byte() };
            Instance { mask, flags, ..Instance::new(u32::from(kind >> 4 & 1), map) }
        };
        let count = if flags & 2 == 0 { 0 } else { r.below(12) };
        let instances = (0..count).map(|_| instance(&mut r)).collect();
        let rays = read_rays(&mut r, &positions, &indices);
        let opaque = flags & 4 == 0;
        Self { build, budget, opaque, options, positions, moved, indices, instances, rays }
    }
}

fn read_rays(r: &mut Reader<'_>, positions: &[Vec3], indices: &[[u32; 3]]) -> Vec<Ray> {
    let count = r.below(200);
    let mut rays = Vec::with_capacity(count);
    let mut ray = Ray::new(Vec3::ZERO, Vec3::X);
    for _ in 0..count {
        let kind = r.byte();
        // The origin of the ray before, and other parts of it, make bundles.
        if kind & 1 != 0 {
            ray.origin = r.vector();
        }
        match kind >> 1 & 7 {
            0 => ray.direction = r.vector(),
            1 | 2 => ray.direction = positions[r.below(positions.len())] - ray.origin,
            3 | 4 if !indices.is_empty() => {
                let [a, b, c] = indices[r.below(indices.len())].map(|i| positions[i as usize]);
                let (u, v) = (f32::from(r.byte()) / 256.0, f32::from(r.byte()) / 256.0);
                ray.direction = a + (b - a) * u + (c - a) * (v * (1.0 - u)) - ray.origin;
            }
            5 => ray.direction *= r.number(),
            _ => {
                let axis = r.below(3);
                ray.direction[axis] = r.number();
            }
        }
        match kind >> 4 {
            0 => ray.t_min = r.number(),
            1 => ray.t_max = r.number(),
            2 => (ray.t_min, ray.t_max) = (r.number(), r.number()),
            _ => (ray.t_min, ray.t_max) = (0.0, f32::INFINITY),
        }
        rays.push(ray);
    }
    rays
}

/// Makes inputs out of earlier ones: a fuzzer without coverage, but for any machine.
#[derive(Clone, Debug)]
pub struct Mutator {
    rng: Rng,
    pool: Vec<Vec<u8>>,
}

/// Inputs that are kept to be mutated.
const POOL: usize = 256;

impl Mutator {
    /// The same inputs for the same seed.
    pub fn new(seed: u64) -> Self {
        Self { rng: Rng::new(seed), pool: vec![] }
    }

    /// The next input.
    pub fn next_input(&mut self) -> Vec<u8> {
        let rng = &mut self.rng;
        let mut bytes = match self.pool.len() as u32 {
            count if count > 16 && rng.below(4) != 0 => {
                self.pool[rng.below(count) as usize].clone()
            }
            _ => {
                let length = 64 << rng.below(6);
                (0..length).map(|_| rng.u32() as u8).collect()
            }
        };
        for _ in 0..rng.below(8) {
            let at = rng.below(bytes.len().max(1) as u32) as usize;
            let length = 1 + rng.below(16) as usize;
            match rng.below(5) {
                0 if at < bytes.len() => bytes[at] = rng.u32() as u8,
                1 if at < bytes.len() => bytes[at] ^= 1 << rng.below(8),
                2 => {
                    bytes.splice(at..at, (0..length).map(|_| rng.u32() as u8));
                }
                3 => {
                    bytes.drain(at..(at + length).min(bytes.len()));
                }
                _ => {
                    // A part of itself, repeated.
                    let part = bytes[at..(at + 4 * length).min(bytes.len())].to_vec();
                    let to = rng.below(bytes.len() as u32 + 1) as usize;
                    bytes.splice(to..to, part);
                }
            }
        }
        bytes.truncate(1 << 13);
        if self.pool.len() < POOL {
            self.pool.push(bytes.clone());
        } else {
            self.pool[rng.below(POOL as u32) as usize].clone_from(&bytes);
        }
        bytes
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn inputs_are_many_sided_and_the_same_for_the_same_seed() {
        let (mut mutator, mut again) = (Mutator::new(1), Mutator::new(1));
        let (mut special, mut plain, mut instanced) = (0, 0, 0);
        for _ in 0..500 {
            let bytes = mutator.next_input();
            assert_eq!(bytes, again.next_input());
            let input = Input::new(&bytes);
            let of_triangles = input.indices.iter().flatten();
            for p in of_triangles.map(|&i| input.positions[i as usize]) {
                if p.is_finite() && p.length() < 100.0 { plain += 1 } else { special += 1 }
            }
            instanced += input.instances.len();
        }
        assert!(special > 1000 && plain > 1000 && instanced > 100, "{special} {plain} {instanced}");
    }
}
