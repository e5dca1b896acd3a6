//! Vectors of eight and sixteen numbers under one name.
//!
//! Like [`crate::x86`], the functions have no features of their own: they become instructions where
//! they are inlined.

use std::arch::x86_64::*;

/// Vectors of numbers, with masks as bits. All are unsafe for one reason: the CPU must have the
/// instructions.
pub(crate) trait Lanes: Copy {
    const N: usize;
    const ALL: u32 = ((1u64 << Self::N) - 1) as u32;

    unsafe fn load(address: *const f32) -> Self;
    unsafe fn splat(number: f32) -> Self;
    unsafe fn add(self, other: Self) -> Self;
    unsafe fn sub(self, other: Self) -> Self;
    unsafe fn mul(self, other: Self) -> Self;
    unsafe fn div(self, other: Self) -> Self;
    unsafe fn mul_sub(self, factor: Self, subtrahend: Self) -> Self;
    unsafe fn min(self, other: Self) -> Self;
    unsafe fn max(self, other: Self) -> Self;
    unsafe fn abs(self) -> Self;
    unsafe fn negated(self) -> Self;
    /// Comparisons are false for NaN.
    unsafe fn lt(self, other: Self) -> u32;
    unsafe fn le(self, other: Self) -> u32;
    unsafe fn eq(self, other: Self) -> u32;
    /// Lanes whose bits, as signed integers, are less than those of `other`.
    unsafe fn bits_lt(self, other: Self) -> u32;
    /// Replaces the lanes of `mask`.
    unsafe fn store(self, address: *mut f32, mask: u32);
    unsafe fn store_all(self, address: *mut f32);
    /// The lanes of `mask` of `self`, the others of `other`.
    unsafe fn select(self, mask: u32, other: Self) -> Self;
    unsafe fn greatest(self) -> f32;

    // Quads: four lanes each, `N / 4` of them.

    /// Rows of four numbers beside each other; of four rows as many as there are quads.
    unsafe fn rows(addresses: [*const f32; 4]) -> Self;
    /// Numbers, each in all lanes of its quad; of four as many as there are quads.
    unsafe fn quads(numbers: [f32; 4]) -> Self;
    /// The lanes of each quad, permuted as `_mm_shuffle_ps` numbers them.
    unsafe fn permute<const LANES: i32>(self) -> Self;
    /// The first number of each quad.
    unsafe fn firsts(self) -> [f32; 4];
}

/// # Safety
/// The CPU must have AVX2.
#[inline(always)]
pub(crate) unsafe fn least_of_8(v: __m256) -> f32 {
    // SAFETY: the caller's promise.
    unsafe {
        let v = _mm_min_ps(_mm256_castps256_ps128(v), _mm256_extractf128_ps::<1>(v));
        let v = _mm_min_ps(v, _mm_movehl_ps(v, v));
        _mm_cvtss_f32(_mm_min_ss(v, _mm_movehdup_ps(v)))
    }
}

/// # Safety
/// The CPU must have AVX2.
#[inline(always)]
pub(crate) unsafe fn greatest_of_8(v: __m256) -> f32 {
    // SAFETY: the caller's promise.
    unsafe {
        let v = _mm_max_ps(_mm256_castps256_ps128(v), _mm256_extractf128_ps::<1>(v));
        let v = _mm_max_ps(v, _mm_movehl_ps(v, v));
        _mm_cvtss_f32(_mm_max_ss(v, _mm_movehdup_ps(v)))
    }
}

/// The lanes of `mask` as a vector.
///
/// # Safety
/// The CPU must have AVX2.
#[inline(always)]
pub(crate) unsafe fn lanes_of(mask: u32) -> __m256i {
    // SAFETY: the caller's promise.
    unsafe {
        let bits = _mm256_setr_epi32(1, 2, 4, 8, 16, 32, 64, 128);
        _mm256_cmpeq_epi32(_mm256_and_si256(_mm256_set1_epi32(mask as i32), bits), bits)
    }
}

/// Functions of [`Lanes`], each an expression.
macro_rules! functions {
    ($($name:ident $(<const $lanes:ident: i32>)? ($($argument:tt)*) $(-> $result:ty)? = $body:expr;)+) => {$(
        #[inline(always)]
        unsafe fn $name $(<const $lanes: i32>)? ($($argument)*) $(-> $result)? {
            // SAFETY: the trait's contract: the CPU has the instructions, and addresses are those of
            // as many numbers as there are lanes, aligned like a vector.
            unsafe { $body }
        }
    )+};
}

/// Eight lanes of AVX2 and FMA.
#[derive(Clone, Copy)]
pub(crate) struct F8(pub(crate) __m256);

/// The bits of a comparison.
macro_rules! compare8 {
    ($a:ident, $b:ident, $how:ident) => {
        _mm256_movemask_ps(_mm256_cmp_ps::<$how>($a.0, $b.0)) as u32
    };
}

impl Lanes for F8 {
    const N: usize = 8;

    functions! {
        load(address: *const f32) -> Self = Self(_mm256_load_ps(address));
        splat(number: f32) -> Self = Self(_mm256_set1_ps(number));
        add(self, b: Self) -> Self = Self(_mm256_add_ps(self.0, b.0));
        sub(self, b: Self) -> Self = Self(_mm256_sub_ps(self.0, b.0));
        mul(self, b: Self) -> Self = Self(_mm256_mul_ps(self.0, b.0));
        div(self, b: Self) -> Self = Self(_mm256_div_ps(self.0, b.0));
        mul_sub(self, b: Self, c: Self) -> Self = Self(_mm256_fmsub_ps(self.0, b.0, c.0));
        min(self, b: Self) -> Self = Self(_mm256_min_ps(self.0, b.0));
        max(self, b: Self) -> Self = Self(_mm256_max_ps(self.0, b.0));
        abs(self) -> Self = Self(_mm256_andnot_ps(_mm256_set1_ps(-0.0), self.0));
        negated(self) -> Self = Self(_mm256_xor_ps(_mm256_set1_ps(-0.0), self.0));
        lt(self, b: Self) -> u32 = compare8!(self, b, _CMP_LT_OQ);
        le(self, b: Self) -> u32 = compare8!(self, b, _CMP_LE_OQ);
        eq(self, b: Self) -> u32 = compare8!(self, b, _CMP_EQ_OQ);
        bits_lt(self, b: Self) -> u32 = {
            let less = _mm256_cmpgt_epi32(_mm256_castps_si256(b.0), _mm256_castps_si256(self.0));
            _mm256_movemask_ps(_mm256_castsi256_ps(less)) as u32
        };
        store(self, address: *mut f32, mask: u32) =
            _mm256_maskstore_ps(address, lanes_of(mask), self.0);
        store_all(self, address: *mut f32) = _mm256_store_ps(address, self.0);
        select(self, mask: u32, other: Self) -> Self =
            Self(_mm256_blendv_ps(other.0, self.0, _mm256_castsi256_ps(lanes_of(mask))));
        greatest(self) -> f32 = greatest_of_8(self.0);
        rows(addresses: [*const f32; 4]) -> Self = {
            let first = _mm256_castps128_ps256(_mm_loadu_ps(addresses[0]));
            Self(_mm256_insertf128_ps::<1>(first, _mm_loadu_ps(addresses[1])))
        };
        quads(numbers: [f32; 4]) -> Self = {
            let first = _mm256_set1_ps(numbers[0]);
            Self(_mm256_blend_ps::<0b1111_0000>(first, _mm256_set1_ps(numbers[1])))
        };
        permute<const LANES: i32>(self) -> Self = Self(_mm256_permute_ps::<LANES>(self.0));
        firsts(self) -> [f32; 4] = {
            let second = _mm256_extractf128_ps::<1>(self.0);
            [_mm256_cvtss_f32(self.0), _mm_cvtss_f32(second), 0.0, 0.0]
        };
    }
}

/// Sixteen lanes of AVX-512 (F and DQ).
#[derive(Clone, Copy)]
pub(crate) struct F16(__m512);

/// The bits of a comparison.
macro_rules! compare16 {
    ($a:ident, $b:ident, $how:ident) => {
        u32::from(_mm512_cmp_ps_mask::<$how>($a.0, $b.0))
    };
}

impl Lanes for F16 {
    const N: usize = 16;

    functions! {
        load(address: *const f32) -> Self = Self(_mm512_load_ps(address));
        splat(number: f32) -> Self = Self(_mm512_set1_ps(number));
        add(self, b: Self) -> Self = Self(_mm512_add_ps(self.0, b.0));
        sub(self, b: Self) -> Self = Self(_mm512_sub_ps(self.0, b.0));
        mul(self, b: Self) -> Self = Self(_mm512_mul_ps(self.0, b.0));
        div(self, b: Self) -> Self = Self(_mm512_div_ps(self.0, b.0));
        mul_sub(self, b: Self, c: Self) -> Self = Self(_mm512_fmsub_ps(self.0, b.0, c.0));
        min(self, b: Self) -> Self = Self(_mm512_min_ps(self.0, b.0));
        max(self, b: Self) -> Self = Self(_mm512_max_ps(self.0, b.0));
        abs(self) -> Self = Self(_mm512_abs_ps(self.0));
        negated(self) -> Self = Self(_mm512_xor_ps(_mm512_set1_ps(-0.0), self.0));
        lt(self, b: Self) -> u32 = compare16!(self, b, _CMP_LT_OQ);
        le(self, b: Self) -> u32 = compare16!(self, b, _CMP_LE_OQ);
        eq(self, b: Self) -> u32 = compare16!(self, b, _CMP_EQ_OQ);
        bits_lt(self, b: Self) -> u32 =
            u32::from(_mm512_cmplt_epi32_mask(_mm512_castps_si512(self.0), _mm512_castps_si512(b.0)));
        store(self, address: *mut f32, mask: u32) =
            _mm512_mask_storeu_ps(address, mask as u16, self.0);
        store_all(self, address: *mut f32) = _mm512_store_ps(address, self.0);
        select(self, mask: u32, other: Self) -> Self =
            Self(_mm512_mask_mov_ps(other.0, mask as u16, self.0));
        greatest(self) -> f32 = {
            let high = _mm512_extractf32x8_ps::<1>(self.0);
            greatest_of_8(_mm256_max_ps(_mm512_castps512_ps256(self.0), high))
        };
        rows(addresses: [*const f32; 4]) -> Self = {
            let rows = _mm512_castps128_ps512(_mm_loadu_ps(addresses[0]));
            let rows = _mm512_insertf32x4::<1>(rows, _mm_loadu_ps(addresses[1]));
            let rows = _mm512_insertf32x4::<2>(rows, _mm_loadu_ps(addresses[2]));
            Self(_mm512_insertf32x4::<3>(rows, _mm_loadu_ps(addresses[3])))
        };
        quads(numbers: [f32; 4]) -> Self = {
            let quads = _mm512_set1_ps(numbers[0]);
            let quads = _mm512_mask_mov_ps(quads, 0x00F0, _mm512_set1_ps(numbers[1]));
            let quads = _mm512_mask_mov_ps(quads, 0x0F00, _mm512_set1_ps(numbers[2]));
            Self(_mm512_mask_mov_ps(quads, 0xF000, _mm512_set1_ps(numbers[3])))
        };
        permute<const LANES: i32>(self) -> Self = Self(_mm512_permute_ps::<LANES>(self.0));
        firsts(self) -> [f32; 4] = [
            _mm512_cvtss_f32(self.0),
            _mm_cvtss_f32(_mm512_extractf32x4_ps::<1>(self.0)),
            _mm_cvtss_f32(_mm512_extractf32x4_ps::<2>(self.0)),
            _mm_cvtss_f32(_mm512_extractf32x4_ps::<3>(self.0)),
        ];
    }
}
