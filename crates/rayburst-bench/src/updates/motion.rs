//! Meshes and points that move.

use glam::Vec3;
use rayburst_math::hash::Rng;

use crate::FlatMesh;

/// A sheet of about so many triangles in the plane y = 0, from (−1, −1) to (1, 1).
pub(super) fn sheet(triangles: usize) -> FlatMesh {
    let side = ((triangles as f64 / 2.0).sqrt() as u32).max(1);
    let place = |i: u32| i as f32 / side as f32 * 2.0 - 1.0;
    let row = |z: u32| (0..=side).map(move |x| Vec3::new(place(x), 0.0, place(z)));
    let corners = |z: u32| (0..side).map(move |x| z * (side + 1) + x);
    let quad = |a: u32| [[a, a + side + 1, a + 1], [a + 1, a + side + 1, a + side + 2]];
    FlatMesh {
        positions: (0..=side).flat_map(row).collect(),
        indices: (0..side).flat_map(corners).flat_map(quad).collect(),
        light: None,
    }
}

/// A square column of about so many triangles along y, from −1 to 1, a quarter as thick as it is high.
pub(super) fn column(triangles: usize) -> FlatMesh {
    let around = ((triangles as f64 / 8.0).sqrt() as u32).max(1) * 4;
    let along = (triangles as u32 / (2 * around)).max(1);
    let ring = |i: u32| {
        // Along the sides of a square.
        let at = i as f32 / around as f32 * 4.0;
        let (side, part) = (at as u32, at.fract() * 2.0 - 1.0);
        let (x, z) = match side {
            0 => (part, -1.0),
            1 => (1.0, part),
            2 => (-part, 1.0),
            _ => (-1.0, -part),
        };
        Vec3::new(0.25 * x, 0.0, 0.25 * z)
    };
    let height = |j: u32| Vec3::Y * (j as f32 / along as f32 * 2.0 - 1.0);
    let quad = |i: u32, j: u32| {
        let (next, low) = ((i + 1) % around, j * around);
        let up = low + around;
        [[low + i, up + i, low + next], [low + next, up + i, up + next]]
    };
    FlatMesh {
        positions: (0..=along)
            .flat_map(|j| (0..around).map(move |i| ring(i) + height(j)))
            .collect(),
        indices: (0..along).flat_map(|j| (0..around).flat_map(move |i| quad(i, j))).collect(),
        light: None,
    }
}

/// The places of a mesh's vertices when waves of a phase run through it.
pub(super) fn waved(mesh: &FlatMesh, phase: f32) -> Vec<Vec3> {
    let bounds = mesh.bounds();
    let (centre, size) = (bounds.centre(), 0.5 * bounds.diagonal());
    let wave = |p: &Vec3| {
        let q = (*p - centre) / size;
        let lift = (9.0 * q.x + phase).sin() * (7.0 * q.z - phase).cos();
        *p + size * 0.06 * lift * Vec3::new(0.3 * q.z, 1.0, 0.3 * q.x)
    };
    mesh.positions.iter().map(wave).collect()
}

/// The places of a mesh's vertices when it is twisted about the vertical through its centre: the
/// angle between bottom and top is given.
pub(super) fn twisted(mesh: &FlatMesh, angle: f32) -> Vec<Vec3> {
    let bounds = mesh.bounds();
    let (centre, height) = (bounds.centre(), bounds.upper.y - bounds.lower.y);
    let twist = |p: &Vec3| {
        let q = *p - centre;
        let (sin, cos) = (angle * q.y / height.max(f32::MIN_POSITIVE)).sin_cos();
        centre + Vec3::new(cos * q.x - sin * q.z, q.y, sin * q.x + cos * q.z)
    };
    mesh.positions.iter().map(twist).collect()
}

/// Points that fly to and fro in a cube, each its own way.
pub(super) struct Swarm {
    points: Vec<(Vec3, Vec3)>,
    /// Half the edge of the cube: about one in every unit cube.
    reach: f32,
}

impl Swarm {
    /// So many, the same ones every time.
    pub(super) fn new(count: usize) -> Self {
        let mut rng = Rng::new(7);
        let reach = 0.5 * (count as f32).cbrt().max(1.0);
        let mut vector = || rng.vec3() * 2.0 - 1.0;
        let points = (0..count).map(|_| (reach * vector(), vector())).collect();
        Self { points, reach }
    }

    /// Where they are at a frame: a few units further, and back from where the cube ends.
    pub(super) fn at(&self, frame: usize) -> impl Iterator<Item = Vec3> {
        let edge = 2.0 * self.reach;
        let reflect = move |x: f32| {
            let x = (x + self.reach).rem_euclid(2.0 * edge);
            (if x > edge { 2.0 * edge - x } else { x }) - self.reach
        };
        self.points.iter().map(move |&(start, velocity)| {
            let p = start + velocity * (0.4 * frame as f32);
            Vec3::new(reflect(p.x), reflect(p.y), reflect(p.z))
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn meshes_have_about_the_triangles_asked_for() {
        for (mesh, count) in
            [(sheet(20_000), 20_000), (column(20_000), 20_000), (sheet(1), 2), (column(1), 8)]
        {
            let off = mesh.indices.len().abs_diff(count);
            assert!(off * 50 <= count, "{} for {count}", mesh.indices.len());
            assert!(mesh.indices.iter().flatten().all(|&i| (i as usize) < mesh.positions.len()));
            let flat = |t: usize| mesh.normal(t as u32).length() < 0.9;
            assert!(!(0..mesh.indices.len()).any(flat));
        }
    }

    #[test]
    fn a_swarm_stays_in_its_cube_and_moves() {
        let swarm = Swarm::new(1000);
        let (first, later): (Vec<Vec3>, Vec<Vec3>) =
            (swarm.at(0).collect(), swarm.at(50).collect());
        assert!(later.iter().all(|p| p.abs().max_element() <= swarm.reach * 1.0001));
        let moved = first.iter().zip(&later).filter(|(a, b)| a.distance(**b) > 0.1).count();
        assert!(moved > 990, "{moved}");
    }
}
