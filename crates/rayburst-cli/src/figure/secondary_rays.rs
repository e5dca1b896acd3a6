//! What the coherence of secondary rays is worth: eye rays that three kinds of surface send on into
//! the same land.

use std::time::Instant;

use rayburst::{
    accel::{AcceptAll, Blas, BuildOptions, BuildQuality, Counters, TraceMode, TraceOptions},
    glam::{Vec2, Vec3},
    math::{Frame, Hit, Ray, hash::Rng, warp::cosine_hemisphere},
    prelude::TriangleMesh,
    scene::builtin,
};
use rayburst_bench::FlatMesh;

use crate::error::{CliError, Result};

/// What eye rays meet.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Reflector {
    Plane,
    Balls,
    Diffuse,
}

impl Reflector {
    pub(super) const ALL: [Self; 3] = [Self::Plane, Self::Balls, Self::Diffuse];
}

/// What was measured of the rays of a reflector.
#[derive(Clone, Copy, Debug)]
pub(super) struct Coherence {
    /// Mean angle between a ray and the one beside it, degrees.
    pub(super) angle: f64,
    /// The share of node visits that bundles made where the engine chose itself (`TraceMode::Auto`).
    pub(super) packet_share: f64,
    /// Rays that make a visit of a node or leaf together, where all are bundled that can be.
    pub(super) together: f64,
    /// Nodes that a ray visits by itself.
    pub(super) nodes: f64,
    /// Mrays/s in bundles and interleaved.
    pub(super) rates: [f64; 2],
}

/// Rays across and down; bundles are tiles of 8 × 8.
pub(super) const SIDE: usize = 256;
const TILE: usize = 8;
const BUNDLE: usize = TILE * TILE;

/// Balls of the curved mirrors are so many rays across.
const BALL: usize = 16;

/// Measures the rays that each reflector sends on.
pub(super) fn measure() -> Result<[Coherence; 3]> {
    let scene = builtin::build("terrain:100000").map_err(|e| CliError::failed(e.to_string()))?;
    let mesh = FlatMesh::new(&scene).ok_or_else(|| CliError::failed("too many vertices"))?;
    let options = BuildOptions { quality: BuildQuality::Best, ..BuildOptions::default() };
    let land = Blas::build(&[TriangleMesh::new(&mesh.positions, &mesh.indices)], &options)?;
    Ok(Reflector::ALL.map(|reflector| coherence(&land, &reflected(&land, reflector))))
}

/// The eye is above the land and looks up at the reflector, which sends its rays down again.
fn reflected(land: &Blas, reflector: Reflector) -> Vec<Ray> {
    let bounds = land.bounds();
    let size = (bounds.upper - bounds.lower).with_y(0.0).length();
    let eye = (0.5 * (bounds.lower + bounds.upper)).with_y(bounds.upper.y + 0.05 * size);
    let mut rng = Rng::new(26);
    let mut rays = Vec::with_capacity(SIDE * SIDE);
    for index in 0..SIDE * SIDE {
        let (tile, within) = (index / BUNDLE, index % BUNDLE);
        let column = tile % (SIDE / TILE) * TILE + within % TILE;
        let row = tile / (SIDE / TILE) * TILE + within / TILE;
        let at = |i: usize| 0.5 * ((i as f32 + 0.5) / (SIDE as f32 / 2.0) - 1.0);
        let up = Vec3::new(at(column), 2.0, at(row));
        let direction = up.normalize();
        let onwards = match reflector {
            Reflector::Plane => direction.reflect(Vec3::NEG_Y),
            Reflector::Balls => {
                // From the middle of the ball, in units of its radius.
                let across = |i: usize| ((i % BALL) as f32 + 0.5) / BALL as f32 - 0.5;
                let aside = 0.8 * Vec3::new(across(column), 0.0, across(row));
                direction.reflect(aside - Vec3::Y * (1.0 - aside.length_squared()).sqrt())
            }
            Reflector::Diffuse => {
                let random = Vec2::new(rng.f32(), rng.f32());
                Frame::from_normal(Vec3::NEG_Y).to_world(cosine_hemisphere(random))
            }
        };
        rays.push(Ray::new(eye + up * (0.05 * size), onwards));
    }
    rays
}

fn coherence(land: &Blas, rays: &[Ray]) -> Coherence {
    let beside = rays.chunks_exact(TILE).flat_map(|row| row.windows(2));
    let angles = beside.map(|pair| f64::from(pair[0].direction.angle_between(pair[1].direction)));
    let [auto, packet, interleaved] = [TraceMode::Auto, TraceMode::Packet, TraceMode::Interleaved]
        .map(|mode| {
            let mut hits = vec![Hit::MISS; rays.len()];
            let mut counts = vec![Counters::default(); rays.len()];
            let options = TraceOptions { mode, ..TraceOptions::default() };
            land.closest_hits_counted(rays, &mut hits, &mut counts, &options, &AcceptAll);
            counts
        });
    let sum = |counts: &[Counters], part: fn(&Counters) -> u32| -> f64 {
        counts.iter().map(|c| f64::from(part(c))).sum()
    };
    let visits = sum(&packet, |c| c.nodes + c.leaves);
    // Of rays in bundles; those left over are in flight beside others, but share nothing.
    let bundled = |c: &Counters| c.packet_nodes == c.nodes;
    let shared = packet.iter().map(|c| if bundled(c) { c.in_flight } else { c.nodes + c.leaves });
    let shared: f64 = shared.map(f64::from).sum();
    Coherence {
        angle: (angles.sum::<f64>() / (rays.len() / TILE * (TILE - 1)) as f64).to_degrees(),
        packet_share: sum(&auto, |c| c.packet_nodes) / sum(&auto, |c| c.nodes).max(1.0),
        together: shared / visits.max(1.0),
        nodes: sum(&interleaved, |c| c.nodes) / rays.len() as f64,
        rates: [TraceMode::Packet, TraceMode::Interleaved].map(|mode| rate(land, rays, mode)),
    }
}

/// Mrays/s on this thread: the fastest of a few passes.
fn rate(land: &Blas, rays: &[Ray], mode: TraceMode) -> f64 {
    let mut hits = vec![Hit::MISS; rays.len()];
    let options = TraceOptions { mode, ..TraceOptions::default() };
    let mut fastest = f64::INFINITY;
    for _ in 0..10 {
        let begin = Instant::now();
        land.closest_hits(rays, &mut hits, &options, &AcceptAll);
        fastest = fastest.min(begin.elapsed().as_secs_f64());
    }
    rays.len() as f64 / fastest.max(1e-9) / 1e6
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_plane_keeps_rays_together_and_a_rough_surface_does_not() {
        let [plane, ball, diffuse] = measure().unwrap();
        assert!(plane.angle < 0.3 && ball.angle > 10.0 * plane.angle && diffuse.angle > 30.0);
        assert!(plane.packet_share > 0.9 && ball.packet_share < 0.2 && diffuse.packet_share < 0.2);
        assert!(plane.together > 3.0 * ball.together && ball.together > 2.0 * diffuse.together);
        assert!([plane, ball, diffuse].iter().all(|c| c.nodes > 1.0 && c.rates[0] > 0.0));
    }
}
