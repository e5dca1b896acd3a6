//! [`crate::group`] in vectors of eight and sixteen lanes, written once over [`Lanes`].

use std::arch::x86_64::*;

use crate::{
    Boxes8, Extent16, Frustum, Group16, GroupAxes, Preparation16, Question16, Rays16, SlabRay,
    Triangles4,
    triangles::{LARGE, SMALL},
    x86_lanes::{F8, Lanes, greatest_of_8, least_of_8},
};

/// Runs for the lanes from `$first` on, of as many as a vector has; collects masks.
macro_rules! groups_of_lanes {
    ($lanes:ident, |$first:ident| $body:expr) => {{
        let (mut one, mut two) = (0, 0);
        let mut $first = 0;
        while $first < 16 {
            let (a, b): (u32, u32) = $body;
            one |= a << $first;
            two |= b << $first;
            $first += $lanes::N;
        }
        (one, two)
    }};
}

/// [`crate::Isa::frustum8`].
///
/// # Safety
/// The CPU must have AVX2 and FMA.
#[inline(always)]
pub(crate) unsafe fn frustum8(
    boxes: &Boxes8,
    axes: &GroupAxes,
    frustum: &Frustum,
    t_min: f32,
    t_max: f32,
    distances: &mut [f32; 8],
) -> u32 {
    // SAFETY: the caller's promise; `GroupAxes` holds starts of rows of 32 bytes of `planes`.
    unsafe {
        let rows = axes.near_row();
        let plane = |row: usize| F8::load(boxes.planes.as_ptr().byte_add(row).cast());
        let near = |axis: usize| {
            let (p, scale, offset) =
                (plane(rows[axis]), frustum.scale[axis], frustum.near_offset[axis]);
            let a = p.mul_sub(F8::splat(scale[0]), F8::splat(offset[0]));
            a.min(p.mul_sub(F8::splat(scale[1]), F8::splat(offset[1])))
        };
        let far = |axis: usize| {
            let p = plane(rows[axis] ^ SlabRay::FAR_ROW);
            let (scale, offset) = (frustum.scale[axis], frustum.far_offset[axis]);
            let a = p.mul_sub(F8::splat(scale[0]), F8::splat(offset[0]));
            a.max(p.mul_sub(F8::splat(scale[1]), F8::splat(offset[1])))
        };
        let near = near(0).max(near(1)).max(near(2).max(F8::splat(t_min)));
        let far = far(0).min(far(1)).min(far(2).min(F8::splat(t_max)));
        _mm256_storeu_ps(distances.as_mut_ptr(), near.0);
        near.le(far)
    }
}

/// [`crate::Isa::box16`].
///
/// # Safety
/// The CPU must have the instructions of the lanes.
#[inline(always)]
pub(crate) unsafe fn box16<L: Lanes>(
    boxes: &Boxes8,
    slot: usize,
    axes: &GroupAxes,
    group: &Group16,
) -> u32 {
    // SAFETY: the caller's CPU has the instructions; `GroupAxes` holds starts of rows of `planes`,
    // each of eight slots; rows of a group have sixteen numbers, aligned to 64 bytes.
    unsafe {
        let rows = axes.near_row();
        let slot = slot % 8;
        let plane =
            |row: usize| L::splat(*boxes.planes.as_ptr().byte_add(row).cast::<f32>().add(slot));
        let planes = [plane(rows[0]), plane(rows[1]), plane(rows[2])];
        let far_planes = [
            plane(rows[0] ^ SlabRay::FAR_ROW),
            plane(rows[1] ^ SlabRay::FAR_ROW),
            plane(rows[2] ^ SlabRay::FAR_ROW),
        ];
        groups_of_lanes!(L, |first| {
            let row = |row: &[f32; 16]| L::load(row.as_ptr().add(first));
            let inverse = [row(&group.inverse[0]), row(&group.inverse[1]), row(&group.inverse[2])];
            let near = |k: usize| planes[k].mul_sub(inverse[k], row(&group.near_offset[k]));
            let far = |k: usize| far_planes[k].mul_sub(inverse[k], row(&group.far_offset[k]));
            let near = near(0).max(near(1)).max(near(2).max(row(&group.t_min)));
            let far = far(0).min(far(1)).min(far(2).min(row(&group.t_max)));
            (near.le(far), 0)
        })
        .0
    }
}

/// [`crate::Isa::end16`].
///
/// # Safety
/// The CPU must have the instructions of the lanes.
#[inline(always)]
pub(crate) unsafe fn end16<L: Lanes>(group: &Group16, active: u32) -> f32 {
    // SAFETY: the caller's CPU has the instructions; rows have sixteen numbers, aligned to 64 bytes.
    unsafe {
        let mut end = f32::NEG_INFINITY;
        let mut first = 0;
        while first < 16 {
            let t_max = L::load(group.t_max.as_ptr().add(first));
            let ends = t_max.sub(L::load(group.shift.as_ptr().add(first)));
            let ends = ends.select(active >> first & L::ALL, L::splat(f32::NEG_INFINITY));
            let part = ends.greatest();
            end = if part > end { part } else { end };
            first += L::N;
        }
        end
    }
}

/// [`crate::Isa::ends16`].
///
/// # Safety
/// The CPU must have AVX2.
#[inline(always)]
pub(crate) unsafe fn ends16([low, high]: &[[f32; 16]; 2]) -> [f32; 2] {
    // SAFETY: the caller's promise; rows have sixteen numbers, and the loads need no alignment.
    unsafe {
        let half = |row: &[f32; 16], half: usize| _mm256_loadu_ps(row.as_ptr().add(8 * half));
        [
            least_of_8(_mm256_min_ps(half(low, 0), half(low, 1))),
            greatest_of_8(_mm256_max_ps(half(high, 0), half(high, 1))),
        ]
    }
}

/// Turns eight rows of eight numbers into columns: column `k` goes to `to + stride·k`.
///
/// # Safety
/// The CPU must have AVX2; `to` must have room.
#[inline(always)]
unsafe fn transpose8(rows: &[[f32; 8]; 8], to: *mut f32, stride: usize) {
    // SAFETY: the caller's promise; rows are of eight numbers.
    unsafe {
        // Halves of the rows beside each other, so that what is left is four by four.
        let half = |row: usize, side: usize| {
            let low = _mm_loadu_ps(rows[row].as_ptr().add(4 * side));
            let high = _mm_loadu_ps(rows[row + 4].as_ptr().add(4 * side));
            _mm256_insertf128_ps::<1>(_mm256_castps128_ps256(low), high)
        };
        for side in 0..2 {
            let (a, b, c, d) = (half(0, side), half(1, side), half(2, side), half(3, side));
            let (ab_low, ab_high) = (_mm256_unpacklo_ps(a, b), _mm256_unpackhi_ps(a, b));
            let (cd_low, cd_high) = (_mm256_unpacklo_ps(c, d), _mm256_unpackhi_ps(c, d));
            let columns = [
                _mm256_shuffle_ps::<0b01_00_01_00>(ab_low, cd_low),
                _mm256_shuffle_ps::<0b11_10_11_10>(ab_low, cd_low),
                _mm256_shuffle_ps::<0b01_00_01_00>(ab_high, cd_high),
                _mm256_shuffle_ps::<0b11_10_11_10>(ab_high, cd_high),
            ];
            for (k, column) in columns.into_iter().enumerate() {
                _mm256_storeu_ps(to.add(stride * (4 * side + k)), column);
            }
        }
    }
}

/// [`crate::Isa::load16`].
///
/// # Safety
/// The CPU must have AVX2.
#[inline(always)]
pub(crate) unsafe fn load16(rays: &[[f32; 8]; 16], to: &mut Rays16) {
    // SAFETY: the caller's promise; `Rays16` is eight rows of sixteen numbers.
    unsafe {
        let to = std::ptr::from_mut(to).cast::<f32>();
        for part in 0..2 {
            let rows = &*rays.as_ptr().add(8 * part).cast::<[[f32; 8]; 8]>();
            transpose8(rows, to.add(8 * part), 16);
        }
    }
}

/// [`crate::Isa::prepare16`].
///
/// # Safety
/// The CPU must have the instructions of the lanes.
#[inline(always)]
pub(crate) unsafe fn prepare16<L: Lanes>(
    rays: &Rays16,
    how: &Preparation16,
    axes: &GroupAxes,
    group: &mut Group16,
    extent: &mut Extent16,
) {
    // SAFETY: the caller's CPU has the instructions; all rows have sixteen numbers, aligned to 64
    // bytes.
    unsafe {
        let mut first = 0;
        while first < 16 {
            let lanes = how.lanes >> first & L::ALL;
            let row = |row: &[f32; 16]| L::load(row.as_ptr().add(first));
            let scale = L::splat(how.scale);
            let tiny = L::splat(f32::MIN_POSITIVE);
            let one = L::splat(1.0);
            let member = |r: &[f32; 16], spare: f32| row(r).select(lanes, L::splat(spare));
            let mut scaled = [one; 3];
            let mut origins = [one; 3];
            for axis in 0..3 {
                let origin = member(&rays.origin[axis], how.spare[0][axis]);
                let direction = member(&rays.direction[axis], how.spare[1][axis]).mul(scale);
                let size = direction.abs().max(L::splat(how.smallest));
                let inverse = one.div(size.mul(L::splat(how.sign[axis])));
                let centre = origin.mul(inverse);
                let margin = L::splat(how.error[axis]).mul(inverse.abs()).add(tiny);
                inverse.store_all(group.inverse[axis].as_mut_ptr().add(first));
                centre.add(margin).store_all(group.near_offset[axis].as_mut_ptr().add(first));
                centre.sub(margin).store_all(group.far_offset[axis].as_mut_ptr().add(first));
                let [low, high] = &mut extent.inverse[axis];
                row(low).min(inverse).store_all(low.as_mut_ptr().add(first));
                row(high).max(inverse).store_all(high.as_mut_ptr().add(first));
                (scaled[axis], origins[axis]) = (direction, origin);
            }
            let [kx, ky, kz] = axes.axes().map(|axis| axis % 3);
            let z = scaled[kz];
            let shear = [scaled[kx].div(z), scaled[ky].div(z), one.div(z)];
            let origins = [origins[kx], origins[ky], origins[kz]];
            for k in 0..3 {
                origins[k].store_all(group.origin[k].as_mut_ptr().add(first));
                shear[k].store_all(group.shear[k].as_mut_ptr().add(first));
            }
            let way = L::splat(how.waist).sub(origins[2]);
            let shift = way.mul(shear[2]);
            shift.store_all(group.shift.as_mut_ptr().add(first));
            let most = row(&extent.shift).max(shift.abs());
            most.store_all(extent.shift.as_mut_ptr().add(first));
            for (k, [low, high]) in extent.points.iter_mut().enumerate() {
                let point = origins[k].add(way.mul(shear[k]));
                row(low).min(point).store_all(low.as_mut_ptr().add(first));
                row(high).max(point).store_all(high.as_mut_ptr().add(first));
            }
            let most = L::splat(f32::MAX);
            let internal = |t: L| {
                // Adding zero makes −0 a 0.
                t.min(most).mul(L::splat(how.unscale)).min(most).add(L::splat(0.0))
            };
            let (start, end) = (internal(row(&rays.t_min)), internal(row(&rays.t_max)));
            let end = end.select(lanes, L::splat(-1.0));
            start.store_all(group.t_min.as_mut_ptr().add(first));
            end.store_all(group.t_max.as_mut_ptr().add(first));
            let start = start.sub(shift).select(lanes, L::splat(f32::INFINITY));
            row(&extent.t_min).min(start).store_all(extent.t_min.as_mut_ptr().add(first));
            first += L::N;
        }
    }
}

/// [`crate::triangles::cross`] of each lane.
///
/// # Safety
/// The CPU must have the instructions of the lanes.
#[inline(always)]
unsafe fn cross<L: Lanes>(p: L, q: L, r: L, s: L) -> L {
    // SAFETY: the caller's promise.
    unsafe {
        let rounded = r.mul(s);
        p.mul_sub(q, rounded).sub(r.mul_sub(s, rounded))
    }
}

/// The edge functions of sheared corners, and their [`crate::triangles::margin`].
///
/// # Safety
/// The CPU must have the instructions of the lanes.
#[inline(always)]
pub(crate) unsafe fn edges<L: Lanes>(
    [ax, ay]: [L; 2],
    [bx, by]: [L; 2],
    [cx, cy]: [L; 2],
) -> [L; 4] {
    // SAFETY: the caller's promise.
    unsafe {
        let u = cross(cx, by, cy, bx);
        let v = cross(ax, cy, ay, cx);
        let w = cross(bx, ay, by, ax);
        [u, v, w, u.min(v).min(w).max(u.max(v).max(w).negated())]
    }
}

/// Lanes that must be decided exactly unless signs are mixed.
///
/// # Safety
/// The CPU must have the instructions of the lanes.
#[inline(always)]
pub(crate) unsafe fn delicate<L: Lanes>(margin: L, det: L) -> u32 {
    // SAFETY: the caller's promise.
    unsafe { margin.le(L::splat(SMALL)) | L::splat(LARGE).lt(det.abs()) }
}

/// [`crate::Isa::triangle16`].
///
/// # Safety
/// The CPU must have the instructions of the lanes.
#[inline(always)]
pub(crate) unsafe fn triangle16<L: Lanes, const NEAREST: bool>(
    block: &Triangles4,
    lane: usize,
    axes: &GroupAxes,
    group: &mut Group16,
    question: &Question16,
) -> (u32, u32) {
    // SAFETY: the caller's CPU has the instructions; `GroupAxes` holds starts of rows of a corner,
    // each of four lanes; rows of a group have sixteen numbers, aligned to 64 bytes.
    unsafe {
        let rows = axes.rows();
        let lane = lane % 4;
        let vertex = |corner: usize, k: usize| {
            let row = block.vertices.as_ptr().add(corner).byte_add(rows[k]).cast::<f32>();
            L::splat(*row.add(lane))
        };
        groups_of_lanes!(L, |first| {
            let active = question.active >> first & L::ALL;
            let row = |row: &[f32; 16]| L::load(row.as_ptr().add(first));
            let origin = [row(&group.origin[0]), row(&group.origin[1]), row(&group.origin[2])];
            let shear = [row(&group.shear[0]), row(&group.shear[1])];
            let sheared = |corner: usize| {
                let z = vertex(corner, 2).sub(origin[2]);
                let x = vertex(corner, 0).sub(origin[0]).sub(shear[0].mul(z));
                let y = vertex(corner, 1).sub(origin[1]).sub(shear[1].mul(z));
                (x, y, z)
            };
            let ((ax, ay, az), (bx, by, bz), (cx, cy, cz)) = (sheared(0), sheared(1), sheared(2));
            let [u, v, w, margin] = edges([ax, ay], [bx, by], [cx, cy]);
            let zero = L::splat(0.0);
            let alive = active & !margin.lt(L::splat(-SMALL));
            if alive == 0 {
                (0, 0)
            } else {
                let det = u.add(v).add(w);
                let delicate = delicate(margin, det);
                let scale = row(&group.shear[2]);
                let (az, bz, cz) = (scale.mul(az), scale.mul(bz), scale.mul(cz));
                let t = u.mul(az).add(v.mul(bz)).add(w.mul(cz)).div(det);
                let (t_min, t_max) = (row(&group.t_min), row(&group.t_max));
                let within = alive & t_min.le(t) & t.le(t_max);
                let tiny = t.abs().lt(L::splat(question.smallest));
                let doubtful = (alive & delicate) | (within & tiny);
                // Of two at the same distance the lesser id wins.
                let wins = if NEAREST {
                    let ids = L::load(group.id.as_ptr().add(first).cast());
                    t.lt(t_max) | L::splat(f32::from_bits(question.id)).bits_lt(ids)
                } else {
                    L::ALL
                };
                let front = zero.lt(det);
                let kept = (front & question.keep[0]) | (!front & question.keep[1]);
                let met = within & kept & wins & !doubtful;
                if NEAREST && met != 0 {
                    // Adding zero makes −0 a 0.
                    t.add(zero).store(group.t_max.as_mut_ptr().add(first), met);
                    v.div(det).store(group.u.as_mut_ptr().add(first), met);
                    w.div(det).store(group.v.as_mut_ptr().add(first), met);
                    let id = L::splat(f32::from_bits(question.id));
                    id.store(group.id.as_mut_ptr().add(first).cast(), met);
                    group.front = (group.front & !(met << first)) | (front & met) << first;
                }
                (met, doubtful)
            }
        })
    }
}

/// The operations on groups as methods of a token, in vectors of some lanes.
macro_rules! group_methods {
    ($lanes:ty) => {
        #[inline(always)]
        fn load16(self, rays: &[[f32; 8]; 16], to: &mut crate::Rays16) {
            // SAFETY: `self` exists, so `detect` saw every feature of the callee on this CPU.
            unsafe { crate::x86_group::load16(rays, to) }
        }

        #[inline(always)]
        fn prepare16(
            self,
            rays: &crate::Rays16,
            how: &crate::Preparation16,
            axes: &crate::GroupAxes,
            group: &mut crate::Group16,
            extent: &mut crate::Extent16,
        ) {
            // SAFETY: as above.
            unsafe { crate::x86_group::prepare16::<$lanes>(rays, how, axes, group, extent) }
        }

        #[inline(always)]
        fn end16(self, group: &crate::Group16, active: u32) -> f32 {
            // SAFETY: as above.
            unsafe { crate::x86_group::end16::<$lanes>(group, active) }
        }

        #[inline(always)]
        fn ends16(self, rows: &[crate::Row16; 2]) -> [f32; 2] {
            // SAFETY: as above.
            unsafe { crate::x86_group::ends16(rows) }
        }

        #[inline(always)]
        fn frustum8(
            self,
            boxes: &crate::Boxes8,
            axes: &crate::GroupAxes,
            frustum: &crate::Frustum,
            t_min: f32,
            t_max: f32,
            distances: &mut [f32; 8],
        ) -> u32 {
            // SAFETY: as above.
            unsafe { crate::x86_group::frustum8(boxes, axes, frustum, t_min, t_max, distances) }
        }

        #[inline(always)]
        fn box16(
            self,
            boxes: &crate::Boxes8,
            slot: usize,
            axes: &crate::GroupAxes,
            group: &crate::Group16,
        ) -> u32 {
            // SAFETY: as above.
            unsafe { crate::x86_group::box16::<$lanes>(boxes, slot, axes, group) }
        }

        #[inline(always)]
        fn triangle16<const NEAREST: bool>(
            self,
            block: &crate::Triangles4,
            lane: usize,
            axes: &crate::GroupAxes,
            group: &mut crate::Group16,
            question: &crate::Question16,
        ) -> (u32, u32) {
            // SAFETY: as above.
            unsafe {
                crate::x86_group::triangle16::<$lanes, NEAREST>(block, lane, axes, group, question)
            }
        }
    };
}
pub(crate) use group_methods;
