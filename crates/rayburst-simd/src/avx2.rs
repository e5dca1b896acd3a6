//! AVX2 with FMA (the level x86-64-v3): 8-wide boxes, 4-wide triangles.

use std::arch::x86_64::*;

use crate::{
    Isa, Kernel, SlabRay,
    isa::SLOT,
    x86::{EightBoxes, Node, box_and_triangle_methods, sort_descending, store_children},
    x86_group::group_methods,
    x86_lanes::F8,
    x86_raster::raster_methods,
};

/// Proof that the CPU has AVX2, FMA, BMI1, BMI2, F16C, LZCNT and POPCNT.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Avx2(());

impl Avx2 {
    /// The token, if the CPU has every feature of the level.
    pub fn detect() -> Option<Self> {
        let found = is_x86_feature_detected!("avx2")
            && is_x86_feature_detected!("fma")
            && is_x86_feature_detected!("bmi1")
            && is_x86_feature_detected!("bmi2")
            && is_x86_feature_detected!("f16c")
            && is_x86_feature_detected!("lzcnt")
            && is_x86_feature_detected!("popcnt");
        found.then_some(Self(()))
    }
}

impl Isa for Avx2 {
    const NAME: &'static str = "avx2";

    #[inline(always)]
    fn vectorize<K: Kernel>(self, kernel: K) -> K::Output {
        #[target_feature(enable = "avx2,fma,bmi1,bmi2,f16c,lzcnt,popcnt")]
        fn region<K: Kernel>(isa: Avx2, kernel: K) -> K::Output {
            kernel.run(isa)
        }
        // SAFETY: `self` exists, so `detect` saw every feature of the region on this CPU.
        unsafe { region(self, kernel) }
    }

    box_and_triangle_methods!(F8);
    group_methods!(F8);
    raster_methods!(cover_tile8);
}

/// # Safety
/// The CPU must have what [`Avx2`] proves.
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
        _mm256_movemask_ps(_mm256_cmp_ps::<_CMP_LE_OQ>(near, far)) as u32
    }
}

/// For each mask of eight lanes, the lanes that are set, then one that is not (if any).
static SET_LANES: [[u8; 8]; 256] = {
    let mut table = [[0; 8]; 256];
    let mut mask = 0;
    while mask < 256 {
        let (mut lane, mut count) = (0, 0);
        let mut unset = 0;
        while lane < 8 {
            if mask >> lane & 1 != 0 {
                table[mask][count] = lane as u8;
                count += 1;
            } else {
                unset = lane as u8;
            }
            lane += 1;
        }
        while count < 8 {
            table[mask][count] = unset;
            count += 1;
        }
        mask += 1;
    }
    table
};

/// # Safety
/// The CPU must have what [`Avx2`] proves.
#[inline(always)]
unsafe fn set_lanes(mask: u32) -> __m256i {
    debug_assert!(mask < 256);
    // SAFETY: the caller's promise; the mask is of eight lanes, the load of eight bytes.
    unsafe {
        let lanes = SET_LANES.get_unchecked(mask as usize);
        _mm256_cvtepu8_epi32(_mm_loadl_epi64(lanes.as_ptr().cast()))
    }
}

/// # Safety
/// The CPU must have what [`Avx2`] proves.
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
        let mut sorted = [_mm256_setzero_si256(); N];
        let (mut counts, mut most) = ([0; N], 0);
        let slots = _mm256_setr_epi32(0, 1, 2, 3, 4, 5, 6, 7);
        let slot_bits = _mm256_set1_epi32(SLOT as i32);
        let mut i = 0;
        while i < N {
            let (near, far) = nodes[i].interval8(rays[i], spans[i][0], spans[i][1]);
            let met = _mm256_cmp_ps::<_CMP_LE_OQ>(near, far);
            let mask = _mm256_movemask_ps(met) as u32;
            let distances = _mm256_andnot_si256(slot_bits, _mm256_castps_si256(near));
            let all = _mm256_or_si256(distances, slots);
            // Lanes that are not met become zero: the least key.
            let met = _mm256_and_si256(all, _mm256_castps_si256(met));
            sorted[i] = _mm256_permutevar8x32_epi32(met, set_lanes(mask));
            counts[i] = mask.count_ones() as usize;
            most = most.max(counts[i]);
            i += 1;
        }
        sort_descending(&mut sorted, most);
        store_children(nodes, &sorted, keys, found);
        counts
    }
}

/// # Safety
/// The CPU must have what [`Avx2`] proves.
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
        let mask = _mm256_movemask_ps(_mm256_cmp_ps::<_CMP_LE_OQ>(near, far)) as u32;
        let rest = set_lanes(mask & mask.wrapping_sub(1));
        let children = node.children();
        let rest = _mm256_permutevar8x32_epi32(children, rest);
        _mm256_storeu_si256(others.as_mut_ptr().cast(), rest);
        (mask.count_ones() as usize, mask.trailing_zeros() & SLOT)
    }
}

/// # Safety
/// The CPU must have what [`Avx2`] proves.
#[inline(always)]
unsafe fn last_within8(keys: &[u32; 8], limit: u32) -> usize {
    // SAFETY: the caller's promise; the array has eight lanes, aligned or not.
    unsafe {
        let keys = _mm256_loadu_si256(keys.as_ptr().cast());
        let beyond = _mm256_cmpgt_epi32(keys, _mm256_set1_epi32(limit as i32));
        let within = !_mm256_movemask_ps(_mm256_castsi256_ps(beyond)) as u32 & 0xFF;
        32 - within.leading_zeros() as usize
    }
}
