//! The leaf operations over vectors of four lanes, written once for the instruction sets that have
//! no wider ones (NEON, WebAssembly's SIMD): eight boxes are two vectors, a block of triangles is one.
//!
//! Products and sums are those of [`crate::Scalar`], in its order and without fusing, so hits have the
//! same bits; box tests may be fused. Children are sorted by a bitonic network over all eight slots
//! (Batcher, "Sorting networks and their applications", 1968): those that are not met have the least
//! key.

use crate::{
    Boxes8, Nearest, ShearRay, SlabRay, TriangleHits, Triangles4,
    isa::SLOT,
    triangles::{LARGE, SMALL, corners_along, decide_exactly},
};

/// Vectors of four lanes. Comparisons give lanes of ones or zeros, false for NaN.
///
/// # Safety
/// Whoever calls the functions must know that the CPU has the instructions: that is what a token
/// proves.
pub(crate) unsafe trait Lanes4: Copy {
    /// Four numbers.
    type F: Copy;
    /// Four words; also what comparisons give.
    type U: Copy;

    unsafe fn splat(x: f32) -> Self::F;
    unsafe fn splat_u(x: u32) -> Self::U;
    unsafe fn load(from: &[f32; 4]) -> Self::F;
    unsafe fn load_u(from: &[u32; 4]) -> Self::U;
    unsafe fn store(to: &mut [f32; 4], x: Self::F);
    unsafe fn store_u(to: &mut [u32; 4], x: Self::U);
    unsafe fn as_u(x: Self::F) -> Self::U;

    unsafe fn add(a: Self::F, b: Self::F) -> Self::F;
    unsafe fn sub(a: Self::F, b: Self::F) -> Self::F;
    unsafe fn mul(a: Self::F, b: Self::F) -> Self::F;
    unsafe fn div(a: Self::F, b: Self::F) -> Self::F;
    /// `a · b − c`, fused or not.
    unsafe fn mul_sub(a: Self::F, b: Self::F, c: Self::F) -> Self::F;
    /// `a · b − c`, rounded once.
    unsafe fn fused_sub(a: Self::F, b: Self::F, c: Self::F) -> Self::F;
    unsafe fn abs(a: Self::F) -> Self::F;
    /// Of equal numbers, and of zeros of either sign, either; of a NaN anything.
    unsafe fn min(a: Self::F, b: Self::F) -> Self::F;
    /// Like [`Lanes4::min`], but of zeros of either sign the first or 0.
    unsafe fn max(a: Self::F, b: Self::F) -> Self::F;
    unsafe fn less(a: Self::F, b: Self::F) -> Self::U;
    unsafe fn less_equal(a: Self::F, b: Self::F) -> Self::U;
    unsafe fn equal(a: Self::F, b: Self::F) -> Self::U;

    unsafe fn and(a: Self::U, b: Self::U) -> Self::U;
    unsafe fn or(a: Self::U, b: Self::U) -> Self::U;
    /// `a` without the bits of `b`.
    unsafe fn without(a: Self::U, b: Self::U) -> Self::U;
    unsafe fn min_u(a: Self::U, b: Self::U) -> Self::U;
    unsafe fn max_u(a: Self::U, b: Self::U) -> Self::U;
    unsafe fn less_equal_u(a: Self::U, b: Self::U) -> Self::U;
    /// Lanes of `a` where `mask` has ones, of `b` where it has zeros.
    unsafe fn select(mask: Self::U, a: Self::U, b: Self::U) -> Self::U;
    /// Lanes 1, 0, 3, 2.
    unsafe fn swap_pairs(a: Self::U) -> Self::U;
    /// Lanes 2, 3, 0, 1.
    unsafe fn swap_halves(a: Self::U) -> Self::U;
    /// The lanes of ones as bits.
    unsafe fn bits(a: Self::U) -> u32;
    /// The least lane of numbers, none of which is NaN.
    unsafe fn least_number(a: Self::F) -> f32;
    /// For each lane the one of eight that its lowest three bits name.
    unsafe fn pick8(from: [Self::U; 2], lanes: Self::U) -> Self::U;
}

/// Halves of eight.
#[inline(always)]
fn halves<T>(eight: &[T; 8]) -> [&[T; 4]; 2] {
    let (halves, _) = eight.as_chunks::<4>();
    [&halves[0], &halves[1]]
}

/// The distances between which a ray is in each of eight boxes.
///
/// # Safety
/// See [`Lanes4`].
#[inline(always)]
unsafe fn interval8<L: Lanes4>(
    boxes: &Boxes8,
    ray: &SlabRay,
    t_min: f32,
    t_max: f32,
) -> ([L::F; 2], [L::F; 2]) {
    let (inverse, near_offset) = (ray.inverse(), ray.near_offset());
    let (far_offset, rows) = (ray.far_offset(), ray.near_plane());
    // SAFETY: the caller's promise.
    unsafe {
        let (mut near, mut far) = ([L::splat(t_min); 2], [L::splat(t_max); 2]);
        let mut axis = 0;
        while axis < 3 {
            let row = rows[axis] % 6;
            let (near_planes, far_planes) =
                (halves(&boxes.planes[row]), halves(&boxes.planes[(row ^ 1) % 6]));
            let scale = L::splat(inverse[axis]);
            let (near_by, far_by) = (L::splat(near_offset[axis]), L::splat(far_offset[axis]));
            let mut half = 0;
            while half < 2 {
                let enter = L::mul_sub(L::load(near_planes[half]), scale, near_by);
                let leave = L::mul_sub(L::load(far_planes[half]), scale, far_by);
                // Of two zeros the first: `t_min`, never −0.
                near[half] = L::max(near[half], enter);
                far[half] = L::min(far[half], leave);
                half += 1;
            }
            axis += 1;
        }
        (near, far)
    }
}

/// [`crate::Isa::slab8`].
///
/// # Safety
/// See [`Lanes4`].
#[inline(always)]
pub(crate) unsafe fn slab8<L: Lanes4>(
    boxes: &Boxes8,
    ray: &SlabRay,
    t_min: f32,
    t_max: f32,
    distances: &mut [f32; 8],
) -> u32 {
    // SAFETY: the caller's promise.
    unsafe {
        let (near, far) = interval8::<L>(boxes, ray, t_min, t_max);
        let (parts, _) = distances.as_chunks_mut::<4>();
        L::store(&mut parts[0], near[0]);
        L::store(&mut parts[1], near[1]);
        L::bits(L::less_equal(near[0], far[0])) | L::bits(L::less_equal(near[1], far[1])) << 4
    }
}

/// Puts the greater of each lane of `a` and `shuffled` where `greater` has ones, else the lesser.
///
/// # Safety
/// See [`Lanes4`].
#[inline(always)]
unsafe fn exchange<L: Lanes4>(a: L::U, shuffled: L::U, greater: L::U) -> L::U {
    // SAFETY: the caller's promise.
    unsafe { L::select(greater, L::max_u(a, shuffled), L::min_u(a, shuffled)) }
}

/// [`crate::Isa::sorted8`] of one ray.
///
/// # Safety
/// See [`Lanes4`].
#[inline(always)]
pub(crate) unsafe fn sorted8<L: Lanes4>(
    (boxes, children): (&Boxes8, &[u32; 8]),
    ray: &SlabRay,
    [t_min, t_max]: [f32; 2],
    keys: &mut [u32; 8],
    found: &mut [u32; 8],
) -> usize {
    const ONES: u32 = u32::MAX;
    // SAFETY: the caller's promise.
    unsafe {
        let (near, far) = interval8::<L>(boxes, ray, t_min, t_max);
        let met = [L::less_equal(near[0], far[0]), L::less_equal(near[1], far[1])];
        let mask = L::bits(met[0]) | L::bits(met[1]) << 4;
        let slot_bits = L::splat_u(SLOT);
        let key = |near: L::F, slots: &[u32; 4]| {
            L::or(L::without(L::as_u(near), slot_bits), L::load_u(slots))
        };
        let all = [key(near[0], &[0, 1, 2, 3]), key(near[1], &[4, 5, 6, 7])];
        // Lanes that are not met become zero: the least key.
        let (mut a, mut b) = (L::and(all[0], met[0]), L::and(all[1], met[1]));
        let first_of_pairs = L::load_u(&[ONES, 0, ONES, 0]);
        let outer = L::load_u(&[ONES, ONES, 0, 0]);
        let reversed = |x: L::U| L::swap_halves(L::swap_pairs(x));
        a = exchange::<L>(a, L::swap_pairs(a), first_of_pairs);
        b = exchange::<L>(b, L::swap_pairs(b), first_of_pairs);
        a = exchange::<L>(a, reversed(a), outer);
        b = exchange::<L>(b, reversed(b), outer);
        a = exchange::<L>(a, L::swap_pairs(a), first_of_pairs);
        b = exchange::<L>(b, L::swap_pairs(b), first_of_pairs);
        // Both halves are sorted, greatest first: now all.
        let other = reversed(b);
        (a, b) = (L::max_u(a, other), L::min_u(a, other));
        a = exchange::<L>(a, L::swap_halves(a), outer);
        b = exchange::<L>(b, L::swap_halves(b), outer);
        a = exchange::<L>(a, L::swap_pairs(a), first_of_pairs);
        b = exchange::<L>(b, L::swap_pairs(b), first_of_pairs);
        let (parts, _) = keys.as_chunks_mut::<4>();
        L::store_u(&mut parts[0], a);
        L::store_u(&mut parts[1], b);
        let children = halves(children);
        let children = [L::load_u(children[0]), L::load_u(children[1])];
        let (parts, _) = found.as_chunks_mut::<4>();
        L::store_u(&mut parts[0], L::pick8(children, a));
        L::store_u(&mut parts[1], L::pick8(children, b));
        mask.count_ones() as usize
    }
}

/// [`crate::Isa::met8`].
///
/// # Safety
/// See [`Lanes4`].
#[inline(always)]
pub(crate) unsafe fn met8<L: Lanes4>(
    (boxes, children): (&Boxes8, &[u32; 8]),
    ray: &SlabRay,
    t_min: f32,
    t_max: f32,
    others: &mut [u32; 8],
) -> (usize, u32) {
    // SAFETY: the caller's promise.
    let mask = unsafe { slab8::<L>(boxes, ray, t_min, t_max, &mut [0.0; 8]) };
    // Every slot is written where the next one goes, and stays if it is among the others.
    let rest = mask & mask.wrapping_sub(1);
    let mut count = 0;
    let mut slot = 0;
    while slot < 8 {
        others[count % 8] = children[slot];
        count += (rest >> slot & 1) as usize;
        slot += 1;
    }
    (mask.count_ones() as usize, mask.trailing_zeros() & SLOT)
}

/// [`crate::Isa::last_within8`].
///
/// # Safety
/// See [`Lanes4`].
#[inline(always)]
pub(crate) unsafe fn last_within8<L: Lanes4>(keys: &[u32; 8], limit: u32) -> usize {
    let [low, high] = halves(keys);
    // SAFETY: the caller's promise.
    unsafe {
        let limit = L::splat_u(limit);
        let within = L::bits(L::less_equal_u(L::load_u(low), limit))
            | L::bits(L::less_equal_u(L::load_u(high), limit)) << 4;
        32 - within.leading_zeros() as usize
    }
}

/// What is known of four triangles before any division.
struct Edges<L: Lanes4> {
    v: L::F,
    w: L::F,
    det: L::F,
    scaled: L::F,
    /// Lanes that are missed.
    mixed: L::U,
    /// Lanes, of the others, that must be decided exactly.
    exact: L::U,
}

/// [`crate::triangles::cross`] of each lane.
///
/// # Safety
/// See [`Lanes4`].
#[inline(always)]
unsafe fn cross4<L: Lanes4>(p: L::F, q: L::F, r: L::F, s: L::F) -> L::F {
    // SAFETY: the caller's promise.
    unsafe {
        let rounded = L::mul(r, s);
        L::sub(L::fused_sub(p, q, rounded), L::fused_sub(r, s, rounded))
    }
}

/// Edge functions and the scaled distance of each lane.
///
/// # Safety
/// See [`Lanes4`].
#[inline(always)]
unsafe fn edges4<L: Lanes4>(block: &Triangles4, ray: &ShearRay) -> Edges<L> {
    let (origin, axes, shear) = (ray.origin(), ray.axes(), ray.shear());
    // SAFETY: the caller's promise.
    unsafe {
        let relative = |corner: usize, k: usize| {
            L::sub(L::load(&block.vertices[corner][axes[k] % 3]), L::splat(origin[k]))
        };
        let sheared = |corner: usize| {
            let z = relative(corner, 2);
            let x = L::sub(relative(corner, 0), L::mul(L::splat(shear[0]), z));
            let y = L::sub(relative(corner, 1), L::mul(L::splat(shear[1]), z));
            (x, y, L::mul(L::splat(shear[2]), z))
        };
        let ((ax, ay, az), (bx, by, bz), (cx, cy, cz)) = (sheared(0), sheared(1), sheared(2));
        let u = cross4::<L>(cx, by, cy, bx);
        let v = cross4::<L>(ax, cy, ay, cx);
        let w = cross4::<L>(bx, ay, by, ax);
        let scaled = L::add(L::add(L::mul(u, az), L::mul(v, bz)), L::mul(w, cz));
        let least = L::min(L::min(u, v), w);
        let greatest = L::max(L::max(u, v), w);
        let margin = L::max(least, L::sub(L::splat(-0.0), greatest));
        let mixed = L::less(margin, L::splat(-SMALL));
        let det = L::add(L::add(u, v), w);
        let delicate =
            L::or(L::less_equal(margin, L::splat(SMALL)), L::less(L::splat(LARGE), L::abs(det)));
        Edges { v, w, det, scaled, mixed, exact: L::without(delicate, mixed) }
    }
}

/// Lanes within an interval.
///
/// # Safety
/// See [`Lanes4`].
#[inline(always)]
unsafe fn within4<L: Lanes4>(t: L::F, t_min: f32, t_max: f32) -> L::U {
    // SAFETY: the caller's promise.
    unsafe { L::and(L::less_equal(L::splat(t_min), t), L::less_equal(t, L::splat(t_max))) }
}

/// [`crate::Isa::triangles4`].
///
/// # Safety
/// See [`Lanes4`].
#[inline(always)]
pub(crate) unsafe fn triangles4<L: Lanes4>(
    block: &Triangles4,
    ray: &ShearRay,
    t_min: f32,
    t_max: f32,
    hits: &mut TriangleHits,
) -> u32 {
    // SAFETY: the caller's promise.
    unsafe {
        let Edges { v, w, det, scaled, mixed, exact } = edges4::<L>(block, ray);
        let t = L::div(scaled, det);
        let mask = L::bits(L::without(within4::<L>(t, t_min, t_max), mixed));
        let mut exact = L::bits(exact);
        if mask | exact == 0 {
            return 0;
        }
        // Zero determinants give no distance, and are among those decided exactly.
        let mut found = TriangleHits::NONE;
        L::store(&mut found.t, t);
        L::store(&mut found.u, L::div(v, det));
        L::store(&mut found.v, L::div(w, det));
        found.mask = mask;
        found.front = L::bits(L::less(L::splat(0.0), det));
        while exact != 0 {
            let lane = exact.trailing_zeros() as usize % 4;
            decide_exactly(&corners_along(block, lane, ray), ray, lane, t_min, t_max, &mut found);
            exact &= exact - 1;
        }
        if found.mask != 0 {
            *hits = found;
        }
        found.mask
    }
}

/// [`crate::Isa::nearest4`].
///
/// # Safety
/// See [`Lanes4`].
#[inline(always)]
pub(crate) unsafe fn nearest4<L: Lanes4>(
    block: &Triangles4,
    ray: &ShearRay,
    t_min: f32,
    t_max: f32,
    keep: [u32; 2],
) -> Nearest {
    // SAFETY: the caller's promise.
    unsafe {
        let Edges { det, scaled, mixed, exact, .. } = edges4::<L>(block, ray);
        let t = L::div(scaled, det);
        let counter_clockwise = L::bits(L::less(L::splat(0.0), det));
        let inside = L::without(within4::<L>(t, t_min, t_max), mixed);
        let sides = (counter_clockwise & keep[0]) | (!counter_clockwise & keep[1]);
        let mask = L::bits(inside) & sides & 15;
        let kept = L::load_u(&[lane(mask, 0), lane(mask, 1), lane(mask, 2), lane(mask, 3)]);
        let infinite = L::as_u(L::splat(f32::INFINITY));
        let mut distances = [0; 4];
        L::store_u(&mut distances, L::select(kept, L::as_u(t), infinite));
        let distances = L::load(&bytemuck::cast(distances));
        let least = L::least_number(distances);
        let nearest = L::bits(L::equal(distances, L::splat(least))) & mask;
        Nearest {
            t: least,
            // Four if there is none.
            lane: (nearest | 1 << 4).trailing_zeros() & 3,
            mask,
            doubtful: L::bits(exact) | (nearest & nearest.wrapping_sub(1)) != 0,
        }
    }
}

/// A bit as a lane of ones or zeros.
#[inline(always)]
fn lane(mask: u32, lane: u32) -> u32 {
    0u32.wrapping_sub(mask >> lane & 1)
}

/// A token of four lanes as an instruction set.
#[cfg_attr(
    not(any(target_arch = "aarch64", target_arch = "wasm32")),
    allow(unused_macros, reason = "for the tokens of other machines")
)]
macro_rules! isa {
    ($token:ident, $name:literal, $prefetch:ident) => {
        impl crate::Isa for $token {
            const NAME: &'static str = $name;

            // The feature is one of the target: there is no region to enter.
            #[inline(always)]
            fn vectorize<K: crate::Kernel>(self, kernel: K) -> K::Output {
                kernel.run(self)
            }

            #[inline(always)]
            fn slab8(
                self,
                boxes: &crate::Boxes8,
                ray: &crate::SlabRay,
                t_min: f32,
                t_max: f32,
                distances: &mut [f32; 8],
            ) -> u32 {
                // SAFETY: `self` exists, so the CPU has the instructions.
                unsafe { crate::lanes4::slab8::<Self>(boxes, ray, t_min, t_max, distances) }
            }

            #[inline(always)]
            fn sorted8<const N: usize>(
                self,
                nodes: [(&crate::Boxes8, &[u32; 8]); N],
                rays: [&crate::SlabRay; N],
                spans: [[f32; 2]; N],
                keys: [&mut [u32; 8]; N],
                found: [&mut [u32; 8]; N],
            ) -> [usize; N] {
                let mut counts = [0; N];
                let mut i = 0;
                while i < N {
                    let (keys, found) = (&mut *keys[i], &mut *found[i]);
                    // SAFETY: `self` exists, so the CPU has the instructions.
                    counts[i] = unsafe {
                        crate::lanes4::sorted8::<Self>(nodes[i], rays[i], spans[i], keys, found)
                    };
                    i += 1;
                }
                counts
            }

            #[inline(always)]
            fn met8(
                self,
                node: (&crate::Boxes8, &[u32; 8]),
                ray: &crate::SlabRay,
                t_min: f32,
                t_max: f32,
                others: &mut [u32; 8],
            ) -> (usize, u32) {
                // SAFETY: `self` exists, so the CPU has the instructions.
                unsafe { crate::lanes4::met8::<Self>(node, ray, t_min, t_max, others) }
            }

            #[inline(always)]
            fn last_within8(self, keys: &[u32; 8], limit: u32) -> usize {
                // SAFETY: `self` exists, so the CPU has the instructions.
                unsafe { crate::lanes4::last_within8::<Self>(keys, limit) }
            }

            #[inline(always)]
            fn triangles4(
                self,
                block: &crate::Triangles4,
                ray: &crate::ShearRay,
                t_min: f32,
                t_max: f32,
                hits: &mut crate::TriangleHits,
            ) -> u32 {
                // SAFETY: `self` exists, so the CPU has the instructions.
                unsafe { crate::lanes4::triangles4::<Self>(block, ray, t_min, t_max, hits) }
            }

            #[inline(always)]
            fn nearest4(
                self,
                block: &crate::Triangles4,
                ray: &crate::ShearRay,
                t_min: f32,
                t_max: f32,
                keep: [u32; 2],
            ) -> crate::Nearest {
                // SAFETY: `self` exists, so the CPU has the instructions.
                unsafe { crate::lanes4::nearest4::<Self>(block, ray, t_min, t_max, keep) }
            }

            #[inline(always)]
            fn prefetch<T>(self, address: *const T) {
                $prefetch(address);
            }
        }
    };
}
#[allow(unused_imports, reason = "for the tokens of other machines")]
pub(crate) use isa;
