//! The brute-force oracle: every triangle against every ray, in `f64`.
//!
//! A triangle test in `f32` may decide either way within rounding of an edge, and two triangles
//! within rounding of the same distance may win either way. The oracle therefore says what is
//! *certain* and what is *possible*: a result is wrong when it misses though a hit is certain, names
//! a triangle that cannot be hit, or one that lies surely behind another.

use glam::{DVec3, Vec3};
use rayburst_math::{Hit, Ray};

/// Triangles of one mesh, prepared for brute force.
#[derive(Clone, Debug)]
pub struct Oracle {
    triangles: Vec<[Vec3; 3]>,
    /// Bounding spheres in blocks of eight, for a conservative first reject.
    blocks: Vec<Block>,
}

#[derive(Clone, Copy, Debug)]
struct Block {
    x: [f32; 8],
    y: [f32; 8],
    z: [f32; 8],
    radius: [f32; 8],
}

/// What can and must be the answer for one ray.
#[derive(Clone, Debug, Default)]
pub struct Verdict {
    /// A hit is certain, no farther than this.
    pub certain: Option<f64>,
    /// All triangles that may be reported: index, distance, uncertainty of the distance.
    pub possible: Vec<(u32, f64, f64)>,
}

/// Rounding of the shear and edge functions, as a multiple of the distance to the corners.
const SLACK: f64 = 16.0 * f32::EPSILON as f64;

impl Oracle {
    /// Prepares a mesh. Triangles with non-finite corners are never hit.
    pub fn new(positions: &[Vec3], indices: &[[u32; 3]]) -> Self {
        let triangles: Vec<[Vec3; 3]> =
            indices.iter().map(|t| t.map(|i| positions[i as usize])).collect();
        let blocks = triangles
            .chunks(8)
            .map(|chunk| {
                let mut block =
                    Block { x: [0.0; 8], y: [0.0; 8], z: [0.0; 8], radius: [f32::NAN; 8] };
                for (lane, t) in chunk.iter().enumerate() {
                    let centre = (t[0] / 3.0) + (t[1] / 3.0) + (t[2] / 3.0);
                    let r = t.iter().map(|p| p.distance(centre)).fold(0.0, f32::max);
                    (block.x[lane], block.y[lane], block.z[lane]) = centre.into();
                    // A NaN radius fails the comparison below and rejects the lane.
                    block.radius[lane] = r;
                }
                block
            })
            .collect();
        Self { triangles, blocks }
    }

    /// Number of triangles.
    pub fn len(&self) -> usize {
        self.triangles.len()
    }

    /// Whether there is nothing to hit.
    pub fn is_empty(&self) -> bool {
        self.triangles.is_empty()
    }

    /// What a correct structure may answer for `ray`.
    pub fn verdict(&self, ray: &Ray) -> Verdict {
        let mut verdict = Verdict::default();
        if !ray.is_valid() {
            return verdict;
        }
        let d = ray.direction.as_dvec3().normalize().as_vec3();
        for (index, block) in self.blocks.iter().enumerate() {
            let mask = block.near_line(ray.origin, d);
            for lane in 0..8 {
                let triangle = index * 8 + lane;
                if mask[lane] && triangle < self.triangles.len() {
                    self.test(triangle as u32, ray, &mut verdict);
                }
            }
        }
        verdict
    }

    fn test(&self, index: u32, ray: &Ray, verdict: &mut Verdict) {
        let corners = self.triangles[index as usize];
        if !corners.iter().all(|p| p.is_finite()) {
            return;
        }
        let origin = ray.origin.as_dvec3();
        let direction = ray.direction.as_dvec3();
        let length = direction.length();
        let d = direction / length;
        let [a, b, c] = corners.map(|p| p.as_dvec3() - origin);
        let normal = (b - a).cross(c - a);
        let (area, cosine) = (normal.length(), normal.dot(d));
        if area == 0.0 {
            return;
        }
        let reach = a.length().max(b.length()).max(c.length());
        let tolerance = SLACK * reach;
        // Signed distances of the ray from the edges, seen along the ray, positive inside.
        let sign = cosine.signum();
        let inside = |p: DVec3, q: DVec3| {
            let edge = q - p;
            let across = (edge - d * edge.dot(d)).length();
            if across == 0.0 { 0.0 } else { sign * p.cross(q).dot(d) / across }
        };
        let least = inside(a, b).min(inside(b, c)).min(inside(c, a));
        let grazing = cosine.abs() / area;
        let flattened = [b - a, c - b, a - c].map(|e| (e - d * e.dot(d)).length());
        let height = cosine.abs() / flattened.into_iter().fold(f64::MIN_POSITIVE, f64::max);
        let depths = [a, b, c].map(|p| p.dot(d));
        let nearest = depths.into_iter().fold(f64::MAX, f64::min);
        let range = depths.into_iter().fold(f64::MIN, f64::max) - nearest;
        // Barycentric coordinates of a sliver, narrower than the rounding, are arbitrary, and so is
        // on which side of a triangle that is seen edge-on the ray passes.
        let edge_on = height <= tolerance;
        let touches = if edge_on {
            [(a, b), (b, c), (c, a)].into_iter().any(|(p, q)| beside(p, q, d) <= tolerance)
        } else {
            least >= -tolerance
        };
        if !touches {
            return;
        }
        let (t, uncertainty) = if edge_on {
            (nearest + 0.5 * range, 0.5 * range + tolerance)
        } else {
            let t = normal.dot(a) / cosine;
            let sliver = (2.0 * tolerance / height).min(1.0) * range;
            (t, tolerance / grazing + 1e-6 * t.abs() + sliver)
        };
        let uncertainty = uncertainty / length;
        let t = t / length;
        let (near, far) = (f64::from(ray.t_min), f64::from(ray.t_max));
        if t < near - uncertainty || t > far + uncertainty {
            return;
        }
        verdict.possible.push((index, t, uncertainty));
        let widest = [b - a, c - b, a - c].into_iter().map(|e| e.length()).fold(0.0, f64::max);
        let sure = least > tolerance
            && grazing * widest > 4.0 * tolerance
            && !edge_on
            && t > near + uncertainty
            && t < far - uncertainty;
        if sure && verdict.certain.is_none_or(|known| t + uncertainty < known) {
            verdict.certain = Some(t + uncertainty);
        }
    }
}

/// How far from the line through the origin along the unit vector `d` the segment `p q` passes, seen
/// along the line.
fn beside(p: DVec3, q: DVec3, d: DVec3) -> f64 {
    let (p, q) = (p - d * p.dot(d), q - d * q.dot(d));
    let edge = q - p;
    let squared = edge.length_squared();
    let along = if squared > 0.0 { (-p.dot(edge) / squared).clamp(0.0, 1.0) } else { 0.0 };
    (p + along * edge).length()
}

impl Block {
    /// Which of the eight spheres the line through `origin` along the unit vector `d` may touch.
    fn near_line(&self, origin: Vec3, d: Vec3) -> [bool; 8] {
        let mut mask = [false; 8];
        for lane in 0..8 {
            let (x, y, z) =
                (self.x[lane] - origin.x, self.y[lane] - origin.y, self.z[lane] - origin.z);
            let (cx, cy, cz) = (y * d.z - z * d.y, z * d.x - x * d.z, x * d.y - y * d.x);
            // Scaled slack: cross products of f32 vectors lose a few ulp of the distance.
            let reach = x.abs() + y.abs() + z.abs();
            let limit = self.radius[lane] * 1.001 + 1e-5 * reach;
            mask[lane] = cx * cx + cy * cy + cz * cz <= limit * limit;
        }
        mask
    }
}

impl Verdict {
    /// Says what is wrong with the triangle and distance that a structure reported, if anything.
    /// `triangle` is `None` for a miss.
    pub fn check(&self, triangle: Option<u32>, t: f32) -> Result<(), String> {
        let Some(triangle) = triangle else {
            return match self.certain {
                Some(t) => Err(format!("missed a certain hit at t ≤ {t}")),
                None => Ok(()),
            };
        };
        let Some(&(_, exact, uncertainty)) = self.possible.iter().find(|p| p.0 == triangle) else {
            return Err(format!("triangle {triangle} cannot be hit (t = {t})"));
        };
        if (f64::from(t) - exact).abs() > 2.0 * uncertainty + 1e-6 * exact.abs() {
            return Err(format!("triangle {triangle}: t = {t}, exactly {exact} ± {uncertainty}"));
        }
        match self.certain {
            Some(nearest) if exact - uncertainty > nearest => {
                Err(format!("triangle {triangle} at {exact} lies behind a hit at t ≤ {nearest}"))
            }
            _ => Ok(()),
        }
    }

    /// [`Verdict::check`] of a hit in a mesh that is one geometry of one BLAS.
    pub fn check_hit(&self, hit: &Hit) -> Result<(), String> {
        self.check(hit.is_hit().then_some(hit.primitive), hit.t)
    }

    /// Whether more than one answer would be right.
    pub fn is_ambiguous(&self) -> bool {
        match self.certain {
            None => !self.possible.is_empty(),
            Some(limit) => self.possible.iter().filter(|p| p.1 - p.2 <= limit).count() > 1,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::meshes;

    #[test]
    fn the_oracle_knows_a_cube() {
        let cube = meshes::cube();
        let oracle = Oracle::new(&cube.positions, &cube.indices);
        let ray = Ray::new(Vec3::new(0.3, 0.2, 5.0), Vec3::new(0.0, 0.0, -2.0));
        let verdict = oracle.verdict(&ray);
        assert!((verdict.certain.expect("a hit") - 2.0).abs() < 1e-5);
        assert_eq!(verdict.possible.len(), 2);
        let (nearest, ..) = *verdict.possible.iter().min_by(|a, b| a.1.total_cmp(&b.1)).unwrap();
        let (farthest, ..) = *verdict.possible.iter().max_by(|a, b| a.1.total_cmp(&b.1)).unwrap();
        assert!(verdict.check(Some(nearest), 2.0).is_ok());
        assert!(verdict.check(Some(nearest), 2.01).is_err());
        assert!(verdict.check(Some(farthest), 3.0).is_err());
        assert!(verdict.check(None, 0.0).is_err());
        let beside = oracle.verdict(&Ray::new(Vec3::new(3.0, 0.0, 5.0), -Vec3::Z));
        assert!(beside.check(None, 0.0).is_ok() && beside.check(Some(0), 1.0).is_err());
    }
}
