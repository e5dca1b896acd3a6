//! AVX-512 (the level x86-64-v4) in vectors of 256 bits: masks, compression and merging of lanes
//! save instructions over AVX2; wider vectors would bring nothing to nodes of eight boxes.

use std::arch::x86_64::*;

use crate::{
    Boxes8, Isa, Kernel, Nearest, QuantizedNode8, ShearRay, SlabRay, TriangleHits, TriangleRows,
    Triangles4,
    isa::SLOT,
    x86::{self, EightBoxes, Node},
    x86_group::group_methods,
    x86_lanes::{self, F16},
};

/// Proof that the CPU has AVX-512 F, VL, BW, DQ and CD, and all of [`crate::Avx2`].
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Avx512(());

impl Avx512 {
    /// The token, if the CPU has every feature of the level.
    pub fn detect() -> Option<Self> {
        let found = crate::Avx2::detect().is_some()
            && is_x86_feature_detected!("avx512f")
            && is_x86_feature_detected!("avx512vl")
            && is_x86_feature_detected!("avx512bw")
            && is_x86_feature_detected!("avx512dq")
            && is_x86_feature_detected!("avx512cd");
        found.then_some(Self(()))
    }
}

impl Isa for Avx512 {
    const NAME: &'static str = "avx512";

    #[inline(always)]
    fn vectorize<K: Kernel>(self, kernel: K) -> K::Output {
        #[target_feature(
            enable = "avx2,fma,bmi1,bmi2,f16c,lzcnt,popcnt,avx512f,avx512vl,avx512bw,avx512dq,avx512cd"
        )]
        fn region<K: Kernel>(isa: Avx512, kernel: K) -> K::Output {
            kernel.run(isa)
        }
        // SAFETY: `self` exists, so `detect` saw every feature of the region on this CPU.
        unsafe { region(self, kernel) }
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
        // SAFETY: `self` exists, so `detect` saw every feature of the callee on this CPU.
        unsafe { slab8(boxes, ray, t_min, t_max, distances) }
    }

    #[inline(always)]
    fn sorted8(
        self,
        node: (&Boxes8, &[u32; 8]),
        ray: &SlabRay,
        span: [f32; 2],
        keys: &mut [u32; 8],
        found: &mut [u32; 8],
    ) -> usize {
        let [count] = self.sorted8_of([node], [ray], [span], [keys], [found]);
        count
    }

    #[inline(always)]
    fn sorted8_of<const N: usize>(
        self,
        nodes: [(&Boxes8, &[u32; 8]); N],
        rays: [&SlabRay; N],
        spans: [[f32; 2]; N],
        keys: [&mut [u32; 8]; N],
        found: [&mut [u32; 8]; N],
    ) -> [usize; N] {
        // SAFETY: `self` exists, so `detect` saw every feature of the callee on this CPU.
        unsafe { sorted8_of(nodes, rays, spans, keys, found) }
    }

    #[inline(always)]
    fn met8(
        self,
        node: (&Boxes8, &[u32; 8]),
        ray: &SlabRay,
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
        node: &QuantizedNode8,
        ray: &SlabRay,
        t_min: f32,
        t_max: f32,
        distances: &mut [f32; 8],
    ) -> u32 {
        // SAFETY: `self` exists, so `detect` saw every feature of the callee on this CPU.
        unsafe { slab8(node, ray, t_min, t_max, distances) }
    }

    #[inline(always)]
    fn quantized_sorted8_of<const N: usize>(
        self,
        nodes: [&QuantizedNode8; N],
        rays: [&SlabRay; N],
        spans: [[f32; 2]; N],
        keys: [&mut [u32; 8]; N],
        found: [&mut [u32; 8]; N],
    ) -> [usize; N] {
        // SAFETY: `self` exists, so `detect` saw every feature of the callee on this CPU.
        unsafe { sorted8_of(nodes, rays, spans, keys, found) }
    }

    #[inline(always)]
    fn quantized_met8(
        self,
        node: &QuantizedNode8,
        ray: &SlabRay,
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
        block: &Triangles4,
        ray: &ShearRay,
        t_min: f32,
        t_max: f32,
        hits: &mut TriangleHits,
    ) -> u32 {
        // SAFETY: `self` exists, so `detect` saw every feature of the callee on this CPU.
        unsafe { x86::triangles4(block, ray, t_min, t_max, hits) }
    }

    #[inline(always)]
    fn nearest4(
        self,
        block: &Triangles4,
        ray: &ShearRay,
        t_min: f32,
        t_max: f32,
        keep: [u32; 2],
    ) -> Nearest {
        // SAFETY: `self` exists, so `detect` saw every feature of the callee on this CPU.
        unsafe { x86::nearest4(block, ray, t_min, t_max, keep) }
    }

    #[inline(always)]
    fn nearest4_of4(
        self,
        blocks: [&Triangles4; 4],
        rays: [&ShearRay; 4],
        spans: [[f32; 2]; 4],
        keep: [[u32; 2]; 4],
    ) -> [Nearest; 4] {
        let mut all = [Nearest::NONE; 4];
        // SAFETY: `self` exists, so `detect` saw every feature of the callee on this CPU.
        unsafe {
            x86_lanes::nearest_of_quads::<F16>(0, &blocks, &rays, &spans, &keep, &mut all);
        }
        all
    }

    #[inline(always)]
    fn expand8(self, node: &QuantizedNode8) -> (Boxes8, [u32; 8]) {
        // SAFETY: `self` exists, so `detect` saw every feature of the callee on this CPU.
        unsafe { x86::expand8(node) }
    }

    #[inline(always)]
    fn expand4(self, rows: TriangleRows<'_>, unused: u32) -> Triangles4 {
        // SAFETY: `self` exists, so `detect` saw every feature of the callee on this CPU.
        unsafe { x86::expand4(rows, unused) }
    }

    #[inline(always)]
    fn rows_triangles4(
        self,
        rows: TriangleRows<'_>,
        ray: &ShearRay,
        t_min: f32,
        t_max: f32,
        hits: &mut TriangleHits,
    ) -> u32 {
        // SAFETY: `self` exists, so `detect` saw every feature of the callee on this CPU.
        unsafe { x86::triangles4(rows, ray, t_min, t_max, hits) }
    }

    #[inline(always)]
    fn rows_nearest4(
        self,
        rows: TriangleRows<'_>,
        ray: &ShearRay,
        t_min: f32,
        t_max: f32,
        keep: [u32; 2],
    ) -> Nearest {
        // SAFETY: `self` exists, so `detect` saw every feature of the callee on this CPU.
        unsafe { x86::nearest4(rows, ray, t_min, t_max, keep) }
    }

    group_methods!(F16);

    #[inline(always)]
    fn prefetch<T>(self, address: *const T) {
        // SAFETY: a prefetch neither faults nor changes memory, whatever the address.
        unsafe { _mm_prefetch::<_MM_HINT_T0>(address.cast()) }
    }
}

/// # Safety
/// The CPU must have what [`Avx512`] proves.
#[inline(always)]
unsafe fn slab8<B: EightBoxes>(
    boxes: B,
    ray: &SlabRay,
    t_min: f32,
    t_max: f32,
    distances: &mut [f32; 8],
) -> u32 {
    // SAFETY: the caller's promise; `distances` has room for eight lanes, aligned or not.
    unsafe {
        let (near, far) = boxes.interval8(ray, t_min, t_max);
        _mm256_storeu_ps(distances.as_mut_ptr(), near);
        u32::from(_mm256_cmp_ps_mask::<_CMP_LE_OQ>(near, far))
    }
}

/// Exchanges the lanes of each vector as said, and keeps the greater in the lanes of `$greater`.
macro_rules! stage {
    ($all:ident, |$keys:ident| $shuffled:expr, $greater:literal) => {
        let mut i = 0;
        while i < $all.len() {
            let $keys = $all[i];
            let other = $shuffled;
            let lesser = _mm256_min_epu32($keys, other);
            $all[i] = _mm256_mask_max_epu32(lesser, $greater, $keys, other);
            i += 1;
        }
    };
}

/// # Safety
/// The CPU must have what [`Avx512`] proves.
#[inline(always)]
unsafe fn sorted8_of<const N: usize, B: Node>(
    nodes: [B; N],
    rays: [&SlabRay; N],
    spans: [[f32; 2]; N],
    keys: [&mut [u32; 8]; N],
    found: [&mut [u32; 8]; N],
) -> [usize; N] {
    // SAFETY: the caller's promise; all arrays have eight lanes, aligned or not.
    unsafe {
        let (mut masks, mut sorted) = ([0; N], [_mm256_setzero_si256(); N]);
        let (mut counts, mut most) = ([0; N], 0);
        let slots = _mm256_setr_epi32(0, 1, 2, 3, 4, 5, 6, 7);
        let slot_bits = _mm256_set1_epi32(SLOT as i32);
        let mut i = 0;
        while i < N {
            let (near, far) = nodes[i].interval8(rays[i], spans[i][0], spans[i][1]);
            masks[i] = _mm256_cmp_ps_mask::<_CMP_LE_OQ>(near, far);
            // slots | (near & !SLOT) in one instruction.
            let near = _mm256_castps_si256(near);
            sorted[i] = _mm256_ternarylogic_epi32::<0b1111_0100>(slots, near, slot_bits);
            i += 1;
        }
        let mut i = 0;
        while i < N {
            // Lanes beyond become zero: the least key.
            sorted[i] = _mm256_maskz_compress_epi32(masks[i], sorted[i]);
            counts[i] = masks[i].count_ones() as usize;
            most |= counts[i] + 3;
            i += 1;
        }
        // Bitonic sorting networks (Batcher 1968), greatest first: both halves, then all.
        stage!(sorted, |keys| _mm256_shuffle_epi32::<0b10_11_00_01>(keys), 0b0101_0101);
        stage!(sorted, |keys| _mm256_shuffle_epi32::<0b00_01_10_11>(keys), 0b0011_0011);
        stage!(sorted, |keys| _mm256_shuffle_epi32::<0b10_11_00_01>(keys), 0b0101_0101);
        // Some count is greater than four.
        if most >= 8 {
            let reverse = _mm256_setr_epi32(7, 6, 5, 4, 3, 2, 1, 0);
            stage!(sorted, |keys| _mm256_permutexvar_epi32(reverse, keys), 0b0000_1111);
            stage!(sorted, |keys| _mm256_shuffle_epi32::<0b01_00_11_10>(keys), 0b0011_0011);
            stage!(sorted, |keys| _mm256_shuffle_epi32::<0b10_11_00_01>(keys), 0b0101_0101);
        }
        let mut i = 0;
        while i < N {
            // The permutation looks at the three bits that hold the slot.
            let children = _mm256_permutexvar_epi32(sorted[i], nodes[i].children());
            _mm256_storeu_si256(keys[i].as_mut_ptr().cast(), sorted[i]);
            _mm256_storeu_si256(found[i].as_mut_ptr().cast(), children);
            i += 1;
        }
        counts
    }
}

/// # Safety
/// The CPU must have what [`Avx512`] proves.
#[inline(always)]
unsafe fn met8<N: Node>(
    node: N,
    ray: &SlabRay,
    t_min: f32,
    t_max: f32,
    others: &mut [u32; 8],
) -> (usize, u32) {
    // SAFETY: the caller's promise; both arrays have eight lanes, aligned or not.
    unsafe {
        let (near, far) = node.interval8(ray, t_min, t_max);
        let mask = _mm256_cmp_ps_mask::<_CMP_LE_OQ>(near, far);
        let children = node.children();
        let rest = _mm256_maskz_compress_epi32(mask & mask.wrapping_sub(1), children);
        _mm256_storeu_si256(others.as_mut_ptr().cast(), rest);
        (mask.count_ones() as usize, u32::from(mask).trailing_zeros() & SLOT)
    }
}

/// # Safety
/// The CPU must have what [`Avx512`] proves.
#[inline(always)]
unsafe fn last_within8(keys: &[u32; 8], limit: u32) -> usize {
    // SAFETY: the caller's promise; the array has eight lanes, aligned or not.
    unsafe {
        let keys = _mm256_loadu_si256(keys.as_ptr().cast());
        let within = _mm256_cmple_epu32_mask(keys, _mm256_set1_epi32(limit as i32));
        32 - u32::from(within).leading_zeros() as usize
    }
}
