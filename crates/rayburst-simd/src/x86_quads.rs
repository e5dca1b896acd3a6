//! Four rays, each with a leaf of its own: the arithmetic of [`crate::x86::nearest4`], rays beside each
//! other, one a quad of lanes.

use crate::{
    Nearest, ShearRay, Triangles4,
    triangles::SMALL,
    x86_group::{delicate, edges},
    x86_lanes::Lanes,
};

/// [`crate::Isa::nearest4_of4`].
///
/// # Safety
/// The CPU must have the instructions of the lanes.
#[inline(always)]
pub(crate) unsafe fn nearest4_of4<L: Lanes>(
    blocks: [&Triangles4; 4],
    rays: [&ShearRay; 4],
    spans: [[f32; 2]; 4],
    keep: [[u32; 2]; 4],
) -> [Nearest; 4] {
    let mut all = [Nearest::NONE; 4];
    let mut from = 0;
    while from < 4 {
        // SAFETY: the caller's promise.
        unsafe { nearest_from::<L>(from, &blocks, &rays, &spans, &keep, &mut all) };
        from += L::N / 4;
    }
    all
}

/// The same for the rays from `from` on, one a quad.
///
/// # Safety
/// The CPU must have the instructions of the lanes.
#[inline(always)]
unsafe fn nearest_from<L: Lanes>(
    from: usize,
    blocks: &[&Triangles4; 4],
    rays: &[&ShearRay; 4],
    spans: &[[f32; 2]; 4],
    keep: &[[u32; 2]; 4],
    all: &mut [Nearest; 4],
) {
    const X: i32 = 0b00_00_00_00;
    const Y: i32 = 0b01_01_01_01;
    const Z: i32 = 0b10_10_10_10;
    // SAFETY: the caller's CPU has the instructions; a ray's parts are of four numbers, and it holds
    // starts of three rows of a corner, each of four lanes.
    unsafe {
        let (mut origins, mut shears) = ([std::ptr::null(); 4], [std::ptr::null(); 4]);
        let (mut t_min, mut t_max) = ([0.0; 4], [0.0; 4]);
        let (mut kept_front, mut kept_back) = (0, 0);
        let mut i = 0;
        while i < L::N / 4 {
            let ray = (from + i) % 4;
            let [origin, shear] = rays[ray].fours();
            (origins[i], shears[i]) = (origin.as_ptr(), shear.as_ptr());
            [t_min[i], t_max[i]] = spans[ray];
            kept_front |= (keep[ray][0] & 15) << (4 * i);
            kept_back |= (keep[ray][1] & 15) << (4 * i);
            i += 1;
        }
        let (origins, shears) = (L::rows(origins), L::rows(shears));
        let (ox, oy, oz) = (origins.permute::<X>(), origins.permute::<Y>(), origins.permute::<Z>());
        let (sx, sy, sz) = (shears.permute::<X>(), shears.permute::<Y>(), shears.permute::<Z>());
        // Not closures: called more than once, they would be compiled for the baseline.
        let mut corners = [[L::splat(0.0); 3]; 3];
        let mut corner = 0;
        while corner < 3 {
            let mut along = [L::splat(0.0); 3];
            let mut axis = 0;
            while axis < 3 {
                let mut addresses = [std::ptr::null(); 4];
                let mut i = 0;
                while i < L::N / 4 {
                    let ray = (from + i) % 4;
                    let start = blocks[ray].vertices.as_ptr().add(corner);
                    addresses[i] = start.byte_add(rays[ray].rows()[axis]).cast();
                    i += 1;
                }
                along[axis] = L::rows(addresses);
                axis += 1;
            }
            let z = along[2].sub(oz);
            let x = along[0].sub(ox).sub(sx.mul(z));
            let y = along[1].sub(oy).sub(sy.mul(z));
            corners[corner] = [x, y, sz.mul(z)];
            corner += 1;
        }
        let [[ax, ay, az], [bx, by, bz], [cx, cy, cz]] = corners;
        let [u, v, w, margin] = edges([ax, ay], [bx, by], [cx, cy]);
        let scaled = u.mul(az).add(v.mul(bz)).add(w.mul(cz));
        let zero = L::splat(0.0);
        let det = u.add(v).add(w);
        let t = scaled.div(det);
        let mixed = margin.lt(L::splat(-SMALL));
        let exact = delicate(margin, det) & !mixed;
        let front = zero.lt(det);
        let kept = (front & kept_front) | (!front & kept_back);
        let met = L::quads(t_min).le(t) & t.le(L::quads(t_max)) & kept & !mixed;
        let distances = t.select(met, L::splat(f32::INFINITY));
        let pairs = distances.min(distances.permute::<0b10_11_00_01>());
        let least = pairs.min(pairs.permute::<0b01_00_11_10>());
        let nearest = distances.eq(least) & met;
        let least = least.firsts();
        let mut i = 0;
        while i < L::N / 4 {
            let nearest = nearest >> (4 * i) & 15;
            let several = nearest & nearest.wrapping_sub(1);
            all[(from + i) % 4] = Nearest {
                t: least[i],
                // Four if there is none.
                lane: (nearest | 1 << 4).trailing_zeros() & 3,
                mask: met >> (4 * i) & 15,
                doubtful: (exact >> (4 * i) & 15) | several != 0,
            };
            i += 1;
        }
    }
}
