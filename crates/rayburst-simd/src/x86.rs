//! What the x86 instruction sets share.
//!
//! The leaf operations are `#[inline(always)]` functions without features of their own: what has
//! features is inlined at the compiler's discretion, and a call per node would cost more than the
//! node. Their intrinsics become instructions once they are inlined into the region of a token, and
//! a token proves that the CPU has what all functions here ask for.

use std::arch::x86_64::*;

use crate::{
    Boxes8, LEAF_WORDS, Nearest, QuantizedNode8, ShearRay, SlabRay, TriangleHits, TriangleRows,
    Triangles4,
    triangles::{self, LARGE, SMALL, along, decide_exactly},
};

/// Eight boxes, in either form.
pub(crate) trait EightBoxes: Copy {
    /// The distances between which a ray is in each of eight boxes. The nearer ones are never −0 if
    /// `t_min` is not.
    ///
    /// # Safety
    /// The CPU must have AVX2 and FMA.
    unsafe fn interval8(self, ray: &SlabRay, t_min: f32, t_max: f32) -> (__m256, __m256);
}

/// Eight boxes and what is in them.
pub(crate) trait Node: EightBoxes {
    /// The children's words.
    ///
    /// # Safety
    /// The CPU must have AVX2 and FMA.
    unsafe fn children(self) -> __m256i;
}

impl EightBoxes for &Boxes8 {
    #[inline(always)]
    unsafe fn interval8(self, ray: &SlabRay, t_min: f32, t_max: f32) -> (__m256, __m256) {
        // SAFETY: the caller's promise; what is loaded and stored is said below.
        unsafe {
            let (inverse, rows) = (ray.inverse(), ray.near_row());
            let (near_offset, far_offset) = (ray.near_offset(), ray.far_offset());
            let plane = |row: usize, axis: usize, offset: f32| {
                debug_assert!(row + 32 <= size_of::<Boxes8>());
                // `SlabRay` holds starts of the six rows of `planes`, and flipping
                // `FAR_ROW` leads from one to the other of an axis; rows are 32 bytes of an array
                // of alignment 64.
                let planes = _mm256_load_ps(self.planes.as_ptr().byte_add(row).cast());
                _mm256_fmsub_ps(planes, _mm256_set1_ps(inverse[axis]), _mm256_set1_ps(offset))
            };
            // Not `map`: what it calls would be compiled for the baseline.
            let near = [
                plane(rows[0], 0, near_offset[0]),
                plane(rows[1], 1, near_offset[1]),
                plane(rows[2], 2, near_offset[2]),
            ];
            let far = [
                plane(rows[0] ^ SlabRay::FAR_ROW, 0, far_offset[0]),
                plane(rows[1] ^ SlabRay::FAR_ROW, 1, far_offset[1]),
                plane(rows[2] ^ SlabRay::FAR_ROW, 2, far_offset[2]),
            ];
            intersect(near, far, t_min, t_max)
        }
    }
}

impl EightBoxes for (&Boxes8, &[u32; 8]) {
    #[inline(always)]
    unsafe fn interval8(self, ray: &SlabRay, t_min: f32, t_max: f32) -> (__m256, __m256) {
        // SAFETY: the caller's promise.
        unsafe { self.0.interval8(ray, t_min, t_max) }
    }
}

impl Node for (&Boxes8, &[u32; 8]) {
    #[inline(always)]
    unsafe fn children(self) -> __m256i {
        // SAFETY: the caller's promise; the array has eight lanes, aligned or not.
        unsafe { _mm256_loadu_si256(self.1.as_ptr().cast()) }
    }
}

/// Steps are counted in units of the ray's distances: one multiplication and addition a plane, as for
/// planes that are stored. What that is wrong by is one rounding of the distance to the corner.
impl EightBoxes for &QuantizedNode8 {
    #[inline(always)]
    unsafe fn interval8(self, ray: &SlabRay, t_min: f32, t_max: f32) -> (__m256, __m256) {
        // SAFETY: the caller's promise; what is loaded and stored is said below.
        unsafe {
            let rows = ray.near_row();
            let [inverse, near_offset, far_offset] = ray.fours();
            let inverse = _mm_loadu_ps(inverse.as_ptr());
            let near_offset = _mm_loadu_ps(near_offset.as_ptr());
            let far_offset = _mm_loadu_ps(far_offset.as_ptr());
            let corner = _mm_setr_ps(self.origin[0], self.origin[1], self.origin[2], 0.0);
            let [x, y, z] = self.exponents;
            let exponents = _mm_cvtepu8_epi32(_mm_cvtsi32_si128(i32::from_le_bytes([x, y, z, 0])));
            let scale = _mm_mul_ps(_mm_castsi128_ps(_mm_slli_epi32::<23>(exponents)), inverse);
            let near_base = _mm_fmsub_ps(corner, inverse, near_offset);
            let far_base = _mm_fmsub_ps(corner, inverse, far_offset);
            let plane = |row: usize, scale: __m256, base: __m256| {
                debug_assert!(row / 4 + 8 <= 48);
                // `SlabRay` holds starts of rows four times as long, and `FAR_ROW` is a bit of those.
                let steps = _mm_loadl_epi64(self.planes.as_ptr().byte_add(row / 4).cast());
                _mm256_fmadd_ps(_mm256_cvtepi32_ps(_mm256_cvtepu8_epi32(steps)), scale, base)
            };
            let (x, y, z) = spread3(scale);
            let (near_x, near_y, near_z) = spread3(near_base);
            let (far_x, far_y, far_z) = spread3(far_base);
            let near =
                [plane(rows[0], x, near_x), plane(rows[1], y, near_y), plane(rows[2], z, near_z)];
            let far = [
                plane(rows[0] ^ SlabRay::FAR_ROW, x, far_x),
                plane(rows[1] ^ SlabRay::FAR_ROW, y, far_y),
                plane(rows[2] ^ SlabRay::FAR_ROW, z, far_z),
            ];
            let (near, far) = intersect(near, far, t_min, t_max);
            let none = _mm256_set1_epi32(i32::from(QuantizedNode8::NO_CHILD));
            let bytes = _mm256_cvtepu8_epi32(_mm_loadl_epi64(self.children.as_ptr().cast()));
            let empty = _mm256_castsi256_ps(_mm256_cmpeq_epi32(bytes, none));
            (near, _mm256_blendv_ps(far, _mm256_set1_ps(f32::NEG_INFINITY), empty))
        }
    }
}

impl Node for &QuantizedNode8 {
    #[inline(always)]
    unsafe fn children(self) -> __m256i {
        // SAFETY: the caller's promise; the load is of eight bytes.
        unsafe {
            let bytes = _mm256_cvtepu8_epi32(_mm_loadl_epi64(self.children.as_ptr().cast()));
            _mm256_add_epi32(_mm256_set1_epi32(self.base as i32), bytes)
        }
    }
}

/// Each of the first three lanes in eight.
///
/// # Safety
/// The CPU must have AVX2 and FMA.
#[inline(always)]
unsafe fn spread3(four: __m128) -> (__m256, __m256, __m256) {
    // SAFETY: the caller's promise.
    unsafe {
        let (y, z) = (_mm_movehdup_ps(four), _mm_movehl_ps(four, four));
        (_mm256_broadcastss_ps(four), _mm256_broadcastss_ps(y), _mm256_broadcastss_ps(z))
    }
}

/// The intersection of the intervals of three axes and the ray's own.
///
/// # Safety
/// The CPU must have AVX2 and FMA.
#[inline(always)]
unsafe fn intersect(
    near: [__m256; 3],
    far: [__m256; 3],
    t_min: f32,
    t_max: f32,
) -> (__m256, __m256) {
    // SAFETY: the caller's promise.
    unsafe {
        // Of two zeros the instruction gives its second operand: `t_min`.
        let near = _mm256_max_ps(
            _mm256_max_ps(near[0], near[1]),
            _mm256_max_ps(near[2], _mm256_set1_ps(t_min)),
        );
        let far = _mm256_min_ps(
            _mm256_min_ps(far[0], far[1]),
            _mm256_min_ps(far[2], _mm256_set1_ps(t_max)),
        );
        (near, far)
    }
}

/// Exchanges the lanes of each vector as said, and keeps the greater but in the lanes of `$lesser`.
macro_rules! stage {
    ($all:ident, |$keys:ident| $shuffled:expr, $lesser:literal) => {
        let mut i = 0;
        while i < $all.len() {
            let $keys = $all[i];
            let other = $shuffled;
            let (lesser, greater) =
                (_mm256_min_epu32($keys, other), _mm256_max_epu32($keys, other));
            $all[i] = _mm256_blend_epi32::<$lesser>(greater, lesser);
            i += 1;
        }
    };
}

/// Sorts the keys of each vector, greatest first; at most the first `most` are not zero.
///
/// Bitonic networks (Batcher, "Sorting networks and their applications", 1968), stage by stage: both
/// halves, then all.
///
/// # Safety
/// The CPU must have AVX2 and FMA.
#[inline(always)]
pub(crate) unsafe fn sort_descending<const N: usize>(all: &mut [__m256i; N], most: usize) {
    // SAFETY: the caller's promise.
    unsafe {
        stage!(all, |keys| _mm256_shuffle_epi32::<0b10_11_00_01>(keys), 0b1010_1010);
        stage!(all, |keys| _mm256_shuffle_epi32::<0b00_01_10_11>(keys), 0b1100_1100);
        stage!(all, |keys| _mm256_shuffle_epi32::<0b10_11_00_01>(keys), 0b1010_1010);
        if most > 4 {
            let reverse = _mm256_setr_epi32(7, 6, 5, 4, 3, 2, 1, 0);
            stage!(all, |keys| _mm256_permutevar8x32_epi32(keys, reverse), 0b1111_0000);
            stage!(all, |keys| _mm256_shuffle_epi32::<0b01_00_11_10>(keys), 0b1100_1100);
            stage!(all, |keys| _mm256_shuffle_epi32::<0b10_11_00_01>(keys), 0b1010_1010);
        }
    }
}

/// Stores sorted keys, and the children in their order.
///
/// # Safety
/// The CPU must have AVX2 and FMA.
#[inline(always)]
pub(crate) unsafe fn store_children<const N: usize, B: Node>(
    nodes: [B; N],
    sorted: &[__m256i; N],
    keys: [&mut [u32; 8]; N],
    found: [&mut [u32; 8]; N],
) {
    // SAFETY: the caller's promise; all arrays have eight lanes, aligned or not.
    unsafe {
        let mut i = 0;
        while i < N {
            // The permutation looks at the three bits that hold the slot.
            let children = _mm256_permutevar8x32_epi32(nodes[i].children(), sorted[i]);
            _mm256_storeu_si256(keys[i].as_mut_ptr().cast(), sorted[i]);
            _mm256_storeu_si256(found[i].as_mut_ptr().cast(), children);
            i += 1;
        }
    }
}

/// Up to four triangles, in either form.
pub(crate) trait FourTriangles: Copy {
    /// A coordinate of a corner in all lanes; `row` is sixteen times the axis.
    ///
    /// # Safety
    /// The CPU must have AVX2 and FMA; `corner` must be less than three and `row` at most 32.
    unsafe fn row(self, corner: usize, row: usize) -> __m128;

    /// Lanes that hold no triangle but something else.
    ///
    /// # Safety
    /// The CPU must have AVX2 and FMA.
    unsafe fn unused(self) -> __m128;

    /// The corners of the triangle in one lane.
    fn corners(self, lane: usize) -> [[f32; 3]; 3];
}

impl FourTriangles for &Triangles4 {
    #[inline(always)]
    unsafe fn row(self, corner: usize, row: usize) -> __m128 {
        debug_assert!(row <= 32);
        // SAFETY: the caller's promise; each row of four lanes starts at a multiple of 16 bytes of a
        // structure of alignment 32.
        unsafe { _mm_load_ps(self.vertices.as_ptr().add(corner).byte_add(row).cast()) }
    }

    #[inline(always)]
    unsafe fn unused(self) -> __m128 {
        // SAFETY: the caller's promise.
        unsafe { _mm_setzero_ps() }
    }

    #[inline(always)]
    fn corners(self, lane: usize) -> [[f32; 3]; 3] {
        triangles::corners(self, lane)
    }
}

impl FourTriangles for TriangleRows<'_> {
    #[inline(always)]
    unsafe fn row(self, corner: usize, row: usize) -> __m128 {
        let byte = corner * (12 * self.count()) + (row / 4) * self.count();
        debug_assert!(byte + 16 <= 4 * LEAF_WORDS);
        // SAFETY: the caller's promise; row 8 of at most four words is followed by another.
        unsafe { _mm_loadu_ps(self.words().as_ptr().byte_add(byte).cast()) }
    }

    #[inline(always)]
    unsafe fn unused(self) -> __m128 {
        // SAFETY: the caller's promise.
        unsafe {
            let (count, lanes) = (self.count() as i32 - 1, _mm_setr_epi32(0, 1, 2, 3));
            _mm_castsi128_ps(_mm_cmpgt_epi32(lanes, _mm_set1_epi32(count)))
        }
    }

    #[inline(always)]
    fn corners(self, lane: usize) -> [[f32; 3]; 3] {
        TriangleRows::corners(self, lane)
    }
}

/// [`triangles::cross`] of each lane.
///
/// # Safety
/// The CPU must have AVX2 and FMA.
#[inline(always)]
unsafe fn cross4(p: __m128, q: __m128, r: __m128, s: __m128) -> __m128 {
    // SAFETY: the caller's promise.
    unsafe {
        let rounded = _mm_mul_ps(r, s);
        _mm_sub_ps(_mm_fmsub_ps(p, q, rounded), _mm_fmsub_ps(r, s, rounded))
    }
}

/// Edge functions and the scaled distance of each lane.
///
/// # Safety
/// The CPU must have AVX2 and FMA.
#[inline(always)]
pub(crate) unsafe fn edges4<T: FourTriangles>(triangles: T, ray: &ShearRay) -> [__m128; 4] {
    // SAFETY: the caller's promise; what is loaded and stored is said below.
    unsafe {
        let (origin, rows, shear) = (ray.origin(), ray.rows(), ray.shear());
        let relative = |corner: usize, k: usize| {
            // `ShearRay` holds starts of three rows.
            _mm_sub_ps(triangles.row(corner, rows[k]), _mm_set1_ps(origin[k]))
        };
        let sheared = |corner: usize| {
            let z = relative(corner, 2);
            let x = _mm_sub_ps(relative(corner, 0), _mm_mul_ps(_mm_set1_ps(shear[0]), z));
            let y = _mm_sub_ps(relative(corner, 1), _mm_mul_ps(_mm_set1_ps(shear[1]), z));
            (x, y, _mm_mul_ps(_mm_set1_ps(shear[2]), z))
        };
        let ((ax, ay, az), (bx, by, bz), (cx, cy, cz)) = (sheared(0), sheared(1), sheared(2));
        let u = cross4(cx, by, cy, bx);
        let v = cross4(ax, cy, ay, cx);
        let w = cross4(bx, ay, by, ax);
        let scaled =
            _mm_add_ps(_mm_add_ps(_mm_mul_ps(u, az), _mm_mul_ps(v, bz)), _mm_mul_ps(w, cz));
        [u, v, w, scaled]
    }
}

/// Of edge functions: determinants, lanes whose signs are mixed or that are `unused`, and of the others
/// those that must be decided exactly.
///
/// # Safety
/// The CPU must have AVX2 and FMA.
#[inline(always)]
pub(crate) unsafe fn decide4(
    [u, v, w, _]: [__m128; 4],
    unused: __m128,
) -> (__m128, __m128, __m128) {
    // SAFETY: the caller's promise; what is loaded and stored is said below.
    unsafe {
        let sign = _mm_set1_ps(-0.0);
        let least = _mm_min_ps(_mm_min_ps(u, v), w);
        let greatest = _mm_max_ps(_mm_max_ps(u, v), w);
        let margin = _mm_max_ps(least, _mm_xor_ps(sign, greatest));
        let mixed = _mm_or_ps(_mm_cmplt_ps(margin, _mm_set1_ps(-SMALL)), unused);
        let det = _mm_add_ps(_mm_add_ps(u, v), w);
        let size = _mm_andnot_ps(sign, det);
        let delicate = _mm_or_ps(
            _mm_cmple_ps(margin, _mm_set1_ps(SMALL)),
            _mm_cmpgt_ps(size, _mm_set1_ps(LARGE)),
        );
        (det, mixed, _mm_andnot_ps(mixed, delicate))
    }
}

/// Lanes within an interval.
///
/// # Safety
/// The CPU must have AVX2 and FMA.
#[inline(always)]
pub(crate) unsafe fn within4(t: __m128, t_min: f32, t_max: f32) -> __m128 {
    // SAFETY: the caller's promise; what is loaded and stored is said below.
    unsafe { _mm_and_ps(_mm_cmpge_ps(t, _mm_set1_ps(t_min)), _mm_cmple_ps(t, _mm_set1_ps(t_max))) }
}

/// [`crate::Isa::triangles4`].
///
/// # Safety
/// The CPU must have AVX2 and FMA.
#[inline(always)]
pub(crate) unsafe fn triangles4<T: FourTriangles>(
    triangles: T,
    ray: &ShearRay,
    t_min: f32,
    t_max: f32,
    hits: &mut TriangleHits,
) -> u32 {
    // SAFETY: the caller's promise; what is loaded and stored is said below.
    unsafe {
        let edges = edges4(triangles, ray);
        let (det, mixed, exact) = decide4(edges, triangles.unused());
        let [_, v, w, scaled] = edges;
        let t = _mm_div_ps(scaled, det);
        let inside = within4(t, t_min, t_max);
        let mask = _mm_movemask_ps(_mm_andnot_ps(mixed, inside)) as u32;
        let mut exact = _mm_movemask_ps(exact) as u32;
        if mask | exact == 0 {
            return 0;
        }
        // The arrays have room for four lanes each; the stores need no alignment.
        _mm_storeu_ps(hits.t.as_mut_ptr(), t);
        _mm_storeu_ps(hits.u.as_mut_ptr(), _mm_div_ps(v, det));
        _mm_storeu_ps(hits.v.as_mut_ptr(), _mm_div_ps(w, det));
        hits.mask = mask;
        hits.front = _mm_movemask_ps(_mm_cmpgt_ps(det, _mm_setzero_ps())) as u32;
        while exact != 0 {
            let lane = exact.trailing_zeros() as usize;
            decide_exactly(&along(&triangles.corners(lane), ray), ray, lane, t_min, t_max, hits);
            exact &= exact - 1;
        }
        hits.mask
    }
}

/// [`crate::Isa::nearest4`].
///
/// # Safety
/// The CPU must have AVX2 and FMA.
#[inline(always)]
pub(crate) unsafe fn nearest4<T: FourTriangles>(
    triangles: T,
    ray: &ShearRay,
    t_min: f32,
    t_max: f32,
    keep: [u32; 2],
) -> Nearest {
    // SAFETY: the caller's promise; what is loaded and stored is said below.
    unsafe {
        let edges = edges4(triangles, ray);
        let (det, mixed, exact) = decide4(edges, triangles.unused());
        let t = _mm_div_ps(edges[3], det);
        let lanes = |keep: u32| _mm_castsi128_ps(_mm_set1_epi32(keep as i32));
        let counter_clockwise = _mm_cmpgt_ps(det, _mm_setzero_ps());
        let kept = _mm_blendv_ps(lanes(keep[1]), lanes(keep[0]), counter_clockwise);
        let met = _mm_andnot_ps(mixed, _mm_and_ps(within4(t, t_min, t_max), kept));
        let distances = _mm_blendv_ps(_mm_set1_ps(f32::INFINITY), t, met);
        let pairs = _mm_min_ps(distances, _mm_shuffle_ps::<0b10_11_00_01>(distances, distances));
        let least = _mm_min_ps(pairs, _mm_shuffle_ps::<0b01_00_11_10>(pairs, pairs));
        let mask = _mm_movemask_ps(met) as u32;
        let nearest = _mm_movemask_ps(_mm_cmpeq_ps(distances, least)) as u32 & mask;
        let exact = _mm_movemask_ps(exact) as u32;
        Nearest {
            t: _mm_cvtss_f32(least),
            // Four if there is none.
            lane: (nearest | 1 << 4).trailing_zeros() & 3,
            mask,
            doubtful: exact | (nearest & nearest.wrapping_sub(1)) != 0,
        }
    }
}

/// [`crate::Isa::expand8`].
///
/// # Safety
/// The CPU must have AVX2 and FMA.
#[inline(always)]
pub(crate) unsafe fn expand8(node: &QuantizedNode8) -> (Boxes8, [u32; 8]) {
    // SAFETY: the caller's promise; rows are of eight bytes, and arrays have eight lanes.
    unsafe {
        let wide = |row: &[u8; 8]| _mm256_cvtepu8_epi32(_mm_loadl_epi64(row.as_ptr().cast()));
        let row = |row: usize, axis: usize| {
            let steps = _mm256_cvtepi32_ps(wide(&node.planes[row]));
            let (step, origin) = (_mm256_set1_ps(node.step(axis)), node.origin[axis]);
            _mm256_fmadd_ps(steps, step, _mm256_set1_ps(origin))
        };
        let children = wide(&node.children);
        let none = _mm256_set1_epi32(i32::from(QuantizedNode8::NO_CHILD));
        let empty = _mm256_castsi256_ps(_mm256_cmpeq_epi32(children, none));
        let (beyond, before) = (_mm256_set1_ps(f32::INFINITY), _mm256_set1_ps(f32::NEG_INFINITY));
        let mut boxes = Boxes8::EMPTY;
        let mut put = |row: usize, x: __m256| {
            _mm256_store_ps(boxes.planes[row].as_mut_ptr(), x);
        };
        put(0, _mm256_blendv_ps(row(0, 0), beyond, empty));
        put(1, _mm256_blendv_ps(row(1, 0), before, empty));
        put(2, row(2, 1));
        put(3, row(3, 1));
        put(4, row(4, 2));
        put(5, row(5, 2));
        let mut words = [0; 8];
        let base = _mm256_set1_epi32(node.base as i32);
        _mm256_storeu_si256(words.as_mut_ptr().cast(), _mm256_add_epi32(base, children));
        (boxes, words)
    }
}

/// [`crate::Isa::expand4`].
///
/// # Safety
/// The CPU must have AVX2 and FMA.
#[inline(always)]
pub(crate) unsafe fn expand4(rows: TriangleRows<'_>, unused: u32) -> Triangles4 {
    // SAFETY: the caller's promise; the last row starts at word `9 · count`, at most 36, and four
    // words from there are in the leaf. The arrays have four lanes.
    unsafe {
        let empty = _mm_castps_si128(rows.unused());
        let start = rows.words().as_ptr();
        let row = |row: usize| _mm_loadu_si128(start.add(row * rows.count()).cast());
        let mut block = Triangles4 { vertices: [[[0.0; 4]; 3]; 3], ids: [0; 4] };
        let to: *mut [f32; 4] = block.vertices.as_mut_ptr().cast();
        let mut i = 0;
        while i < 9 {
            // Unused lanes become the NaN of all bits.
            _mm_store_si128(to.add(i).cast(), _mm_or_si128(row(i), empty));
            i += 1;
        }
        let ids = _mm_blendv_epi8(row(9), _mm_set1_epi32(unused as i32), empty);
        _mm_storeu_si128(block.ids.as_mut_ptr().cast(), ids);
        block
    }
}

/// What tokens do with boxes and triangles as methods. The functions `slab8`, `sorted8`, `met8` and
/// `last_within8` are those of the module that calls this; triangles are beside each other in `$lanes`.
macro_rules! box_and_triangle_methods {
    ($lanes:ty) => {
        #[inline(always)]
        fn slab8(
            self,
            boxes: &crate::Boxes8,
            ray: &crate::SlabRay,
            t_min: f32,
            t_max: f32,
            distances: &mut [f32; 8],
        ) -> u32 {
            // SAFETY: `self` exists, so `detect` saw every feature of the callee on this CPU.
            unsafe { slab8(boxes, ray, t_min, t_max, distances) }
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
            // SAFETY: `self` exists, so `detect` saw every feature of the callee on this CPU.
            unsafe { sorted8(nodes, rays, spans, keys, found) }
        }

        #[inline(always)]
        fn met8(
            self,
            node: (&crate::Boxes8, &[u32; 8]),
            ray: &crate::SlabRay,
            t_min: f32,
            t_max: f32,
            found: &mut [u32; 8],
        ) -> (usize, u32) {
            // SAFETY: `self` exists, so `detect` saw every feature of the callee on this CPU.
            unsafe { met8(node, ray, t_min, t_max, found) }
        }

        #[inline(always)]
        fn quantized_slab8(
            self,
            node: &crate::QuantizedNode8,
            ray: &crate::SlabRay,
            t_min: f32,
            t_max: f32,
            distances: &mut [f32; 8],
        ) -> u32 {
            // SAFETY: `self` exists, so `detect` saw every feature of the callee on this CPU.
            unsafe { slab8(node, ray, t_min, t_max, distances) }
        }

        #[inline(always)]
        fn quantized_sorted8<const N: usize>(
            self,
            nodes: [&crate::QuantizedNode8; N],
            rays: [&crate::SlabRay; N],
            spans: [[f32; 2]; N],
            keys: [&mut [u32; 8]; N],
            found: [&mut [u32; 8]; N],
        ) -> [usize; N] {
            // SAFETY: `self` exists, so `detect` saw every feature of the callee on this CPU.
            unsafe { sorted8(nodes, rays, spans, keys, found) }
        }

        #[inline(always)]
        fn quantized_met8(
            self,
            node: &crate::QuantizedNode8,
            ray: &crate::SlabRay,
            t_min: f32,
            t_max: f32,
            found: &mut [u32; 8],
        ) -> (usize, u32) {
            // SAFETY: `self` exists, so `detect` saw every feature of the callee on this CPU.
            unsafe { met8(node, ray, t_min, t_max, found) }
        }

        #[inline(always)]
        fn last_within8(self, keys: &[u32; 8], limit: u32) -> usize {
            // SAFETY: `self` exists, so `detect` saw every feature of the callee on this CPU.
            unsafe { last_within8(keys, limit) }
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
            // SAFETY: `self` exists, so `detect` saw every feature of the callee on this CPU.
            unsafe { crate::x86::triangles4(block, ray, t_min, t_max, hits) }
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
            // SAFETY: `self` exists, so `detect` saw every feature of the callee on this CPU.
            unsafe { crate::x86::nearest4(block, ray, t_min, t_max, keep) }
        }

        #[inline(always)]
        fn nearest4_of4(
            self,
            blocks: [&crate::Triangles4; 4],
            rays: [&crate::ShearRay; 4],
            spans: [[f32; 2]; 4],
            keep: [[u32; 2]; 4],
        ) -> [crate::Nearest; 4] {
            // SAFETY: `self` exists, so `detect` saw every feature of the callee on this CPU.
            unsafe { crate::x86_quads::nearest4_of4::<$lanes>(blocks, rays, spans, keep) }
        }

        #[inline(always)]
        fn expand8(self, node: &crate::QuantizedNode8) -> (crate::Boxes8, [u32; 8]) {
            // SAFETY: `self` exists, so `detect` saw every feature of the callee on this CPU.
            unsafe { crate::x86::expand8(node) }
        }

        #[inline(always)]
        fn expand4(self, rows: crate::TriangleRows<'_>, unused: u32) -> crate::Triangles4 {
            // SAFETY: `self` exists, so `detect` saw every feature of the callee on this CPU.
            unsafe { crate::x86::expand4(rows, unused) }
        }

        #[inline(always)]
        fn rows_triangles4(
            self,
            rows: crate::TriangleRows<'_>,
            ray: &crate::ShearRay,
            t_min: f32,
            t_max: f32,
            hits: &mut crate::TriangleHits,
        ) -> u32 {
            // SAFETY: `self` exists, so `detect` saw every feature of the callee on this CPU.
            unsafe { crate::x86::triangles4(rows, ray, t_min, t_max, hits) }
        }

        #[inline(always)]
        fn rows_nearest4(
            self,
            rows: crate::TriangleRows<'_>,
            ray: &crate::ShearRay,
            t_min: f32,
            t_max: f32,
            keep: [u32; 2],
        ) -> crate::Nearest {
            // SAFETY: `self` exists, so `detect` saw every feature of the callee on this CPU.
            unsafe { crate::x86::nearest4(rows, ray, t_min, t_max, keep) }
        }

        #[inline(always)]
        fn prefetch<T>(self, address: *const T) {
            // SAFETY: a prefetch neither faults nor changes memory, whatever the address.
            unsafe {
                std::arch::x86_64::_mm_prefetch::<{ std::arch::x86_64::_MM_HINT_T0 }>(
                    address.cast(),
                )
            }
        }
    };
}
pub(crate) use box_and_triangle_methods;
