//! The portable instruction set: plain Rust, the oracle of all others.

use crate::{
    Boxes8, Isa, Kernel, ShearRay, SlabRay, TriangleHits, Triangles4,
    triangles::{LARGE, SMALL, corners_along, cross, decide_exactly, margin, sheared},
};

/// The token of plain Rust, for every CPU.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Scalar;

impl Isa for Scalar {
    const NAME: &'static str = "scalar";

    #[inline(always)]
    fn vectorize<K: Kernel>(self, kernel: K) -> K::Output {
        kernel.run(self)
    }

    #[inline(always)]
    fn slab8(
        self,
        boxes: &Boxes8,
        ray: &SlabRay,
        t_min: f32,
        t_max: f32,
        distances: &mut [f32; 8],
    ) -> u32 {
        let (mut near, mut far) = ([t_min; 8], [t_max; 8]);
        let (inverse, near_offset) = (ray.inverse(), ray.near_offset());
        let far_offset = ray.far_offset();
        for axis in 0..3 {
            let row = ray.near_plane()[axis];
            let (near_planes, far_planes) = (&boxes.planes[row], &boxes.planes[row ^ 1]);
            for slot in 0..8 {
                near[slot] = near[slot].max(near_planes[slot] * inverse[axis] - near_offset[axis]);
                far[slot] = far[slot].min(far_planes[slot] * inverse[axis] - far_offset[axis]);
            }
        }
        *distances = near;
        (0..8).fold(0, |mask, slot| mask | (u32::from(near[slot] <= far[slot]) << slot))
    }

    #[inline(always)]
    fn triangles4(
        self,
        block: &Triangles4,
        ray: &ShearRay,
        t_min: f32,
        t_max: f32,
        hits: &mut TriangleHits,
    ) -> u32 {
        let mut found = TriangleHits::NONE;
        for lane in 0..4 {
            let corners = corners_along(block, lane, ray);
            let (ax, ay, az) = sheared(&corners[0], ray);
            let (bx, by, bz) = sheared(&corners[1], ray);
            let (cx, cy, cz) = sheared(&corners[2], ray);
            let u = cross(cx, by, cy, bx);
            let v = cross(ax, cy, ay, cx);
            let w = cross(bx, ay, by, ax);
            let margin = margin(u, v, w);
            if margin < -SMALL {
                continue;
            }
            let det = u + v + w;
            if margin <= SMALL || det.abs() > LARGE {
                decide_exactly(&corners, ray, lane, t_min, t_max, &mut found);
                continue;
            }
            let t = (u * az + v * bz + w * cz) / det;
            if t >= t_min && t <= t_max {
                found.t[lane] = t;
                found.u[lane] = v / det;
                found.v[lane] = w / det;
                found.mask |= 1 << lane;
                found.front |= u32::from(det > 0.0) << lane;
            }
        }
        if found.mask != 0 {
            *hits = found;
        }
        found.mask
    }

    #[inline(always)]
    fn prefetch<T>(self, _: *const T) {}
}
