//! WebAssembly's SIMD of 128 bits. A module has it or has not: the token exists where the target has
//! the feature `simd128`.

use std::arch::wasm32::*;

use crate::lanes4::Lanes4;

/// Proof that the module has vectors of 128 bits.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Simd128(());

impl Simd128 {
    /// The token; this code is only compiled where it exists.
    pub fn detect() -> Option<Self> {
        Some(Self(()))
    }
}

crate::lanes4::isa! { Simd128, "simd128", prefetch }

/// There is no such instruction.
#[inline(always)]
fn prefetch<T>(_: *const T) {}

macro_rules! same {
    ($($name:ident($($argument:ident: $type:ty),*) -> $result:ty = $body:expr;)+) => {$(
        #[inline(always)]
        unsafe fn $name($($argument: $type),*) -> $result {
            $body
        }
    )+};
}

// SAFETY: all are of the feature with which this is compiled.
unsafe impl Lanes4 for Simd128 {
    type F = v128;
    type U = v128;

    same! {
        splat(x: f32) -> Self::F = f32x4_splat(x);
        splat_u(x: u32) -> Self::U = u32x4_splat(x);
        load(from: &[f32; 4]) -> Self::F = f32x4(from[0], from[1], from[2], from[3]);
        load_u(from: &[u32; 4]) -> Self::U = u32x4(from[0], from[1], from[2], from[3]);
        store(to: &mut [f32; 4], x: Self::F) -> () = *to = [
            f32x4_extract_lane::<0>(x),
            f32x4_extract_lane::<1>(x),
            f32x4_extract_lane::<2>(x),
            f32x4_extract_lane::<3>(x),
        ];
        store_u(to: &mut [u32; 4], x: Self::U) -> () = *to = [
            u32x4_extract_lane::<0>(x),
            u32x4_extract_lane::<1>(x),
            u32x4_extract_lane::<2>(x),
            u32x4_extract_lane::<3>(x),
        ];
        as_u(x: Self::F) -> Self::U = x;
        add(a: Self::F, b: Self::F) -> Self::F = f32x4_add(a, b);
        sub(a: Self::F, b: Self::F) -> Self::F = f32x4_sub(a, b);
        mul(a: Self::F, b: Self::F) -> Self::F = f32x4_mul(a, b);
        div(a: Self::F, b: Self::F) -> Self::F = f32x4_div(a, b);
        mul_sub(a: Self::F, b: Self::F, c: Self::F) -> Self::F = f32x4_sub(f32x4_mul(a, b), c);
        fused_sub(a: Self::F, b: Self::F, c: Self::F) -> Self::F = {
            // There is no such instruction.
            f32x4(
                f32x4_extract_lane::<0>(a).mul_add(f32x4_extract_lane::<0>(b), -f32x4_extract_lane::<0>(c)),
                f32x4_extract_lane::<1>(a).mul_add(f32x4_extract_lane::<1>(b), -f32x4_extract_lane::<1>(c)),
                f32x4_extract_lane::<2>(a).mul_add(f32x4_extract_lane::<2>(b), -f32x4_extract_lane::<2>(c)),
                f32x4_extract_lane::<3>(a).mul_add(f32x4_extract_lane::<3>(b), -f32x4_extract_lane::<3>(c)),
            )
        };
        abs(a: Self::F) -> Self::F = f32x4_abs(a);
        min(a: Self::F, b: Self::F) -> Self::F = f32x4_pmin(a, b);
        max(a: Self::F, b: Self::F) -> Self::F = f32x4_pmax(a, b);
        less(a: Self::F, b: Self::F) -> Self::U = f32x4_lt(a, b);
        less_equal(a: Self::F, b: Self::F) -> Self::U = f32x4_le(a, b);
        equal(a: Self::F, b: Self::F) -> Self::U = f32x4_eq(a, b);
        and(a: Self::U, b: Self::U) -> Self::U = v128_and(a, b);
        or(a: Self::U, b: Self::U) -> Self::U = v128_or(a, b);
        without(a: Self::U, b: Self::U) -> Self::U = v128_andnot(a, b);
        min_u(a: Self::U, b: Self::U) -> Self::U = u32x4_min(a, b);
        max_u(a: Self::U, b: Self::U) -> Self::U = u32x4_max(a, b);
        less_equal_u(a: Self::U, b: Self::U) -> Self::U = u32x4_le(a, b);
        select(mask: Self::U, a: Self::U, b: Self::U) -> Self::U = v128_bitselect(a, b, mask);
        swap_pairs(a: Self::U) -> Self::U = u32x4_shuffle::<1, 0, 3, 2>(a, a);
        swap_halves(a: Self::U) -> Self::U = u32x4_shuffle::<2, 3, 0, 1>(a, a);
        bits(a: Self::U) -> u32 = u32::from(u32x4_bitmask(a));
        least_number(a: Self::F) -> f32 = {
            let pairs = f32x4_pmin(a, u32x4_shuffle::<1, 0, 3, 2>(a, a));
            f32x4_extract_lane::<0>(f32x4_pmin(pairs, u32x4_shuffle::<2, 3, 0, 1>(pairs, pairs)))
        };
        pick8(from: [Self::U; 2], lanes: Self::U) -> Self::U = {
            // Bytes 4·lane to 4·lane + 3; beyond the sixteen of a table there are zeros.
            let slots = v128_and(lanes, u32x4_splat(crate::SLOT));
            let bytes = u32x4_add(
                u32x4_mul(slots, u32x4_splat(0x0404_0404)),
                u32x4_splat(0x0302_0100),
            );
            v128_or(
                i8x16_swizzle(from[0], bytes),
                i8x16_swizzle(from[1], i8x16_sub(bytes, u8x16_splat(16))),
            )
        };
    }
}
