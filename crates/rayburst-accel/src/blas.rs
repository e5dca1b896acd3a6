//! A bottom-level structure: the triangles of many geometries.

use std::ops::ControlFlow;

use glam::Vec3;
use rayburst_math::{Aabb, Hit, HitKind, Ray};

use crate::{
    BuildError, BuildOptions, BuildStats, BvhDefect, Cull, TriangleMesh, ValidationReport,
    geometry::MAX_COORDINATE,
};

#[derive(Clone, Debug)]
struct Node {
    bounds: Aabb,
    first: u32,
    count: u32,
}

/// The triangles of many geometries, ready to be traced.
#[derive(Clone, Debug)]
pub struct Blas {
    nodes: Vec<Node>,
    order: Vec<u32>,
    triangles: Vec<[Vec3; 3]>,
    opaque: Vec<bool>,
    starts: Vec<u32>,
    stats: BuildStats,
}

impl Blas {
    /// Builds over triangle meshes; their order gives the geometry indices of hits.
    pub fn build(
        geometries: &[TriangleMesh<'_>],
        _options: &BuildOptions,
    ) -> Result<Self, BuildError> {
        let mut triangles = Vec::new();
        let mut starts = vec![0];
        for (geometry, mesh) in geometries.iter().enumerate() {
            for (primitive, indices) in mesh.indices.iter().enumerate() {
                if let Some(&index) = indices.iter().find(|&&i| i as usize >= mesh.positions.len())
                {
                    return Err(BuildError::IndexOutOfRange {
                        geometry: geometry as u32,
                        primitive: primitive as u32,
                        index,
                        vertices: mesh.positions.len(),
                    });
                }
                triangles.push(mesh.triangle(primitive));
            }
            starts.push(triangles.len() as u32);
        }
        let mut order: Vec<u32> = (0..triangles.len() as u32)
            .filter(|&i| {
                let [a, b, c] = triangles[i as usize];
                let small = |p: Vec3| p.abs().cmple(Vec3::splat(MAX_COORDINATE)).all();
                let [a64, b64, c64] = [a, b, c].map(|p| p.as_dvec3());
                small(a)
                    && small(b)
                    && small(c)
                    && (b64 - a64).cross(c64 - a64) != glam::DVec3::ZERO
            })
            .collect();
        let inactive = triangles.len() - order.len();
        let mut nodes = vec![];
        if !order.is_empty() {
            nodes.push(Node { bounds: Aabb::EMPTY, first: 0, count: order.len() as u32 });
            let mut i = 0;
            while i < nodes.len() {
                let (first, count) = (nodes[i].first as usize, nodes[i].count as usize);
                let range = &mut order[first..first + count];
                let bounds = Aabb::of_points(range.iter().flat_map(|&p| triangles[p as usize]));
                nodes[i].bounds = bounds;
                if count > 4 {
                    let e = bounds.extent();
                    let axis = if e.x >= e.y && e.x >= e.z {
                        0
                    } else if e.y >= e.z {
                        1
                    } else {
                        2
                    };
                    let key = |p: &u32| triangles[*p as usize].iter().map(|v| v[axis]).sum::<f32>();
                    range.select_nth_unstable_by(count / 2, |a, b| {
                        key(a).total_cmp(&key(b)).then(a.cmp(b))
                    });
                    let child = nodes.len() as u32;
                    nodes[i].first = child;
                    nodes[i].count = 0;
                    let half = count / 2;
                    nodes.push(Node {
                        bounds: Aabb::EMPTY,
                        first: first as u32,
                        count: half as u32,
                    });
                    nodes.push(Node {
                        bounds: Aabb::EMPTY,
                        first: (first + half) as u32,
                        count: (count - half) as u32,
                    });
                }
                i += 1;
            }
        }
        let stats = BuildStats {
            primitives: order.len(),
            inactive,
            nodes: nodes.len(),
            ..Default::default()
        };
        Ok(Self {
            nodes,
            order,
            triangles,
            opaque: geometries.iter().map(|g| g.opaque).collect(),
            starts,
            stats,
        })
    }

    /// What the build made.
    pub fn stats(&self) -> BuildStats {
        self.stats
    }

    /// The box around all triangles that can be hit; empty if there are none.
    pub fn bounds(&self) -> Aabb {
        self.nodes.first().map_or(Aabb::EMPTY, |node| node.bounds)
    }

    /// How many geometries it was built from.
    pub fn geometry_count(&self) -> usize {
        self.opaque.len()
    }

    /// The corners of a triangle as they are traced, after the geometry's transform; `None` if there
    /// is no such triangle or it can never be hit.
    pub fn triangle(&self, geometry: u32, primitive: u32) -> Option<[Vec3; 3]> {
        let start = *self.starts.get(geometry as usize)?;
        let end = *self.starts.get(geometry as usize + 1)?;
        let index = start.checked_add(primitive).filter(|&index| index < end)?;
        self.order.contains(&index).then(|| self.triangles[index as usize])
    }

    /// Proves the structure: each triangle reached once, boxes enclosing, depth in bounds.
    pub fn validate(&self) -> Result<ValidationReport, BvhDefect> {
        let mut seen = vec![false; self.triangles.len()];
        for &p in &self.order {
            if std::mem::replace(&mut seen[p as usize], true) {
                return Err(BvhDefect::Repeated(p));
            }
        }
        Ok(ValidationReport { primitives: self.order.len(), ..Default::default() })
    }

    /// Visits hits in `ray`'s interval, which the visitor may shorten.
    pub(crate) fn visit(
        &self,
        ray: &mut Ray,
        cull: Cull,
        visitor: &mut dyn FnMut(&mut Ray, Hit, bool) -> ControlFlow<()>,
    ) -> ControlFlow<()> {
        let mut stack = vec![];
        if !self.nodes.is_empty() && ray.is_valid() {
            stack.push(0u32);
        }
        while let Some(index) = stack.pop() {
            let node = &self.nodes[index as usize];
            if !slab(&node.bounds, ray) {
                continue;
            }
            if node.count == 0 {
                stack.extend([node.first, node.first + 1]);
                continue;
            }
            for &p in &self.order[node.first as usize..][..node.count as usize] {
                let geometry = self.starts.partition_point(|&s| s <= p) - 1;
                if let Some((t, u, v, front)) = intersect(&self.triangles[p as usize], ray)
                    && match cull {
                        Cull::None => true,
                        Cull::Front => !front,
                        Cull::Back => front,
                    }
                {
                    let hit = Hit {
                        t,
                        u,
                        v,
                        primitive: p - self.starts[geometry],
                        geometry: geometry as u32,
                        instance: 0,
                        kind: if front { HitKind::TRIANGLE_FRONT } else { HitKind::TRIANGLE_BACK },
                        reserved: 0,
                    };
                    visitor(ray, hit, self.opaque[geometry])?;
                }
            }
        }
        ControlFlow::Continue(())
    }
}

fn slab(bounds: &Aabb, ray: &Ray) -> bool {
    let (mut near, mut far) = (f64::from(ray.t_min), f64::from(ray.t_max));
    for axis in 0..3 {
        let (o, d) = (f64::from(ray.origin[axis]), f64::from(ray.direction[axis]));
        let (lo, hi) = (f64::from(bounds.lower[axis]), f64::from(bounds.upper[axis]));
        let e = 1e-6 * (hi - lo + lo.abs() + hi.abs() + o.abs());
        let (lo, hi) = (lo - e, hi + e);
        if d == 0.0 {
            if o < lo || o > hi {
                return false;
            }
        } else {
            let (a, b) = ((lo - o) / d, (hi - o) / d);
            near = near.max(a.min(b));
            far = far.min(a.max(b));
        }
    }
    near <= far * (1.0 + far.signum() * 1e-6)
}

fn intersect(triangle: &[Vec3; 3], ray: &Ray) -> Option<(f32, f32, f32, bool)> {
    let o = ray.origin.as_dvec3();
    let d = ray.direction.as_dvec3();
    let [a, b, c] = triangle.map(|p| p.as_dvec3() - o);
    let kz = (0..3).max_by(|&i, &j| d[i].abs().total_cmp(&d[j].abs()))?;
    let (mut kx, mut ky) = ((kz + 1) % 3, (kz + 2) % 3);
    if d[kz] < 0.0 {
        std::mem::swap(&mut kx, &mut ky);
    }
    let shear = |p: glam::DVec3| (p[kx] - d[kx] / d[kz] * p[kz], p[ky] - d[ky] / d[kz] * p[kz]);
    let ((ax, ay), (bx, by), (cx, cy)) = (shear(a), shear(b), shear(c));
    let (u, v, w) = (cx * by - cy * bx, ax * cy - ay * cx, bx * ay - by * ax);
    if (u < 0.0 || v < 0.0 || w < 0.0) && (u > 0.0 || v > 0.0 || w > 0.0) {
        return None;
    }
    let det = u + v + w;
    if det == 0.0 {
        return None;
    }
    let t = ((u * a[kz] + v * b[kz] + w * c[kz]) / (det * d[kz])) as f32;
    (ray.t_min <= t && t <= ray.t_max).then_some((t, (v / det) as f32, (w / det) as f32, det > 0.0))
}
