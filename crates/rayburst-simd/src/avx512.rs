//! AVX-512 (the level x86-64-v4) in vectors of 256 bits: masks, compression and merging of lanes
//! save instructions over AVX2; wider vectors would bring nothing to nodes of eight boxes.

use std::arch::x86_64::*;

use crate::{
    Isa, Kernel, SlabRay,
    isa::SLOT,
    x86::{EightBoxes, Node, box_and_triangle_methods, sort_descending, store_children},
    x86_group::group_methods,
    x86_lanes::F16,
    x86_raster::raster_methods,
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

    box_and_triangle_methods!(F16);
    group_methods!(F16);
    raster_methods!(cover_tile16);
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

/// # Safety
/// The CPU must have what [`Avx512`] proves.
#[inline(always)]
unsafe fn sorted8<const N: usize, B: Node>(
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
            most = most.max(counts[i]);
            i += 1;
        }
        sort_descending(&mut sorted, most);
        store_children(nodes, &sorted, keys, found);
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
