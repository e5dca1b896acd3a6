//! Rays from inside a closed scene, made to find cracks: at vertices and edges, along axes, in
//! bundles of every kind, of every length.

use glam::{Affine3A, Vec3};
use rayburst_math::{Ray, hash::Rng};

use crate::meshes::ClosedScene;

/// Kinds of groups of consecutive rays.
#[derive(Clone, Copy, Debug)]
enum Group {
    /// Anywhere, anyhow.
    Random,
    /// Exactly at vertices.
    Vertices,
    /// At points of edges.
    Edges,
    /// Along axes and in the planes of two.
    Axes,
    /// From one point in nearly one direction.
    Cone,
    /// From one point at the vertices of triangles that follow each other.
    Fan,
    /// Parallel from points near each other.
    Beam,
    /// From one point around an axis, so that signs of directions differ.
    Straddling,
    /// From near points at near points of one triangle.
    Pencil,
}

const GROUPS: [Group; 9] = [
    Group::Random,
    Group::Vertices,
    Group::Edges,
    Group::Axes,
    Group::Cone,
    Group::Fan,
    Group::Beam,
    Group::Straddling,
    Group::Pencil,
];

/// Lengths of directions; the shortest is subnormal.
const LENGTHS: [f32; 6] = [1.0, 1e-3, 1e9, 1e-20, 1e30, 1e-41];

/// A batch of rays, each of which must hit: the same for the same seed.
pub fn batch(scene: &ClosedScene, seed: u64, count: usize) -> Vec<Ray> {
    let mut maker = Maker { scene, extent: extent(scene), rng: Rng::new(seed) };
    let mut rays = Vec::with_capacity(count + 64);
    // Bundles are 64 consecutive rays; groups begin anywhere in them, and often with them.
    while rays.len() < count {
        let to_next = 64 - rays.len() % 64;
        let length = match maker.rng.below(4) {
            0 => 1 + maker.rng.below(64) as usize,
            1 => to_next + 64,
            _ => to_next,
        };
        maker.group(length, &mut rays);
    }
    rays.truncate(count);
    rays
}

/// The greatest coordinate.
fn extent(scene: &ClosedScene) -> f32 {
    let largest = |points: &mut dyn Iterator<Item = Vec3>| {
        points.fold(0.0, |largest: f32, p| largest.max(p.abs().max_element()))
    };
    let own = largest(&mut scene.mesh.positions.iter().copied());
    let corner = |i: &Affine3A| {
        Vec3::from(i.translation.abs())
            + own
                * i.matrix3
                    .to_cols_array_2d()
                    .iter()
                    .fold(Vec3::ZERO, |sum, &column| sum + Vec3::from(column).abs())
    };
    own.max(largest(&mut scene.instances.iter().map(corner)))
}

struct Maker<'a> {
    scene: &'a ClosedScene,
    extent: f32,
    rng: Rng,
}

impl Maker<'_> {
    fn signed(&mut self) -> Vec3 {
        2.0 * self.rng.vec3() - 1.0
    }

    fn pick(&mut self, count: usize) -> usize {
        self.rng.below(count as u32) as usize
    }

    fn place(&mut self) -> Affine3A {
        match self.scene.instances.len() {
            0 => Affine3A::IDENTITY,
            count => self.scene.instances[self.pick(count)],
        }
    }

    /// A point inside of an instance; centres and lattice points of the inside among others.
    fn origin(&mut self, place: Affine3A) -> Vec3 {
        let cube = self.scene.mesh.inside[self.pick(self.scene.mesh.inside.len())];
        let p = match self.rng.below(8) {
            0 => Vec3::ZERO,
            1 => (2.0 * self.signed()).round() * 0.5,
            _ => self.signed(),
        };
        place.transform_point3(cube.transform_point3(p))
    }

    fn corner(&mut self, place: Affine3A, triangle: usize) -> [Vec3; 3] {
        let count = self.scene.mesh.indices.len();
        self.scene.mesh.corners(triangle % count).map(|p| place.transform_point3(p))
    }

    fn direction(&mut self) -> Vec3 {
        let direction = self.signed();
        if direction == Vec3::ZERO { Vec3::X } else { direction }
    }

    fn group(&mut self, length: usize, rays: &mut Vec<Ray>) {
        let group = GROUPS[self.pick(GROUPS.len())];
        let place = self.place();
        let (origin, axis) = (self.origin(place), self.direction());
        let count = self.scene.mesh.indices.len();
        let first = self.pick(count);
        let spread = [0.3, 0.05, 1e-3, 1e-6][self.pick(4)];
        let near = self.origin(place);
        // Backwards in time as well, now and then.
        let t_min = if self.rng.below(16) == 0 { -1e-3 } else { 0.0 };
        // Distances must be numbers: in units of the direction they grow as it shrinks.
        let lengths = LENGTHS.len() - usize::from(self.extent > 1e-6);
        let stretch = if self.rng.below(4) == 0 { LENGTHS[self.pick(lengths)] } else { 1.0 };
        for i in 0..length {
            let (origin, direction) = match group {
                Group::Random => (self.origin(place), self.direction()),
                Group::Vertices => {
                    let (o, triangle) = (self.origin(place), self.pick(count));
                    (o, self.corner(place, triangle)[0] - o)
                }
                Group::Edges => {
                    let (o, triangle) = (self.origin(place), self.pick(count));
                    let [a, b, _] = self.corner(place, triangle);
                    let at = [0.5, self.rng.f32()][self.pick(2)];
                    (o, a + (b - a) * at - o)
                }
                Group::Axes => {
                    let mut direction = self.direction();
                    let zero = [0.0, -0.0][self.pick(2)];
                    let keep = self.pick(3);
                    for other in (0..3).filter(|&other| other != keep) {
                        if self.rng.below(4) != 0 {
                            direction[other] = zero;
                        }
                    }
                    direction[keep] = [1.0, -1.0][self.pick(2)];
                    (self.origin(place), direction)
                }
                Group::Cone => (origin, axis + spread * self.signed()),
                Group::Fan => (origin, self.corner(place, first + i / 3)[i % 3] - origin),
                Group::Beam => (origin.lerp(near, self.rng.f32() * spread), axis),
                Group::Straddling => {
                    let mut direction = spread * self.signed();
                    direction[first % 3] = axis.x.signum();
                    (origin, direction)
                }
                Group::Pencil => {
                    let o = origin.lerp(near, self.rng.f32() * spread);
                    let [a, b, c] = self.corner(place, first);
                    let (u, v) = (self.rng.f32(), self.rng.f32());
                    (o, a + (b - a) * u + (c - a) * v * (1.0 - u) - o)
                }
            };
            // The size of far or large scenes stays within what `f32` can stretch.
            let unit = direction / direction.abs().max_element();
            let direction = if stretch == 1.0 { direction } else { unit * stretch };
            // What rounding or an origin at a vertex leaves of a direction may be nothing.
            let direction =
                if direction.is_finite() && direction != Vec3::ZERO { direction } else { Vec3::Y };
            rays.push(Ray::with_interval(origin, direction, t_min, f32::INFINITY));
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::meshes::scenes;

    #[test]
    fn rays_are_valid_and_the_same_for_the_same_seed() {
        for scene in scenes() {
            let rays = batch(&scene, 5, 5000);
            assert!(rays.iter().all(Ray::is_valid));
            assert_eq!(rays, batch(&scene, 5, 5000));
            assert_ne!(rays, batch(&scene, 6, 5000));
            // Groups with one origin, for bundles.
            let same = rays.windows(2).filter(|pair| pair[0].origin == pair[1].origin).count();
            assert!(same > 1000, "{}: {same}", scene.name);
        }
    }
}
