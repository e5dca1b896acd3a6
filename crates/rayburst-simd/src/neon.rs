//! NEON (every aarch64 CPU): two vectors of four lanes for eight boxes.

use std::arch::aarch64::*;

use crate::lanes4::Lanes4;

/// Proof that the CPU has NEON.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Neon(());

impl Neon {
    /// The token, if the CPU has NEON.
    pub fn detect() -> Option<Self> {
        std::arch::is_aarch64_feature_detected!("neon").then_some(Self(()))
    }
}

crate::lanes4::isa! { Neon, "neon", prefetch }

/// Asks for a cache line. (The intrinsic is not stable.)
#[inline(always)]
fn prefetch<T>(address: *const T) {
    #[cfg(not(miri))]
    // SAFETY: a prefetch neither faults nor changes memory, whatever the address.
    unsafe {
        std::arch::asm!(
            "prfm pldl1keep, [{address}]",
            address = in(reg) address,
            options(nostack, preserves_flags, readonly)
        );
    }
}

macro_rules! same {
    ($($name:ident($($argument:ident: $type:ty),*) -> $result:ty = $body:expr;)+) => {$(
        #[inline(always)]
        unsafe fn $name($($argument: $type),*) -> $result {
            // SAFETY: the caller's promise: the CPU has NEON.
            unsafe { $body }
        }
    )+};
}

// SAFETY: all are NEON, which the token proves.
unsafe impl Lanes4 for Neon {
    type F = float32x4_t;
    type U = uint32x4_t;

    same! {
        splat(x: f32) -> Self::F = vdupq_n_f32(x);
        splat_u(x: u32) -> Self::U = vdupq_n_u32(x);
        load(from: &[f32; 4]) -> Self::F = vld1q_f32(from.as_ptr());
        load_u(from: &[u32; 4]) -> Self::U = vld1q_u32(from.as_ptr());
        store(to: &mut [f32; 4], x: Self::F) -> () = vst1q_f32(to.as_mut_ptr(), x);
        store_u(to: &mut [u32; 4], x: Self::U) -> () = vst1q_u32(to.as_mut_ptr(), x);
        as_u(x: Self::F) -> Self::U = vreinterpretq_u32_f32(x);
        add(a: Self::F, b: Self::F) -> Self::F = vaddq_f32(a, b);
        sub(a: Self::F, b: Self::F) -> Self::F = vsubq_f32(a, b);
        mul(a: Self::F, b: Self::F) -> Self::F = vmulq_f32(a, b);
        div(a: Self::F, b: Self::F) -> Self::F = vdivq_f32(a, b);
        mul_sub(a: Self::F, b: Self::F, c: Self::F) -> Self::F = vfmaq_f32(vnegq_f32(c), a, b);
        fused_sub(a: Self::F, b: Self::F, c: Self::F) -> Self::F = vfmaq_f32(vnegq_f32(c), a, b);
        abs(a: Self::F) -> Self::F = vabsq_f32(a);
        min(a: Self::F, b: Self::F) -> Self::F = vminq_f32(a, b);
        max(a: Self::F, b: Self::F) -> Self::F = vmaxq_f32(a, b);
        less(a: Self::F, b: Self::F) -> Self::U = vcltq_f32(a, b);
        less_equal(a: Self::F, b: Self::F) -> Self::U = vcleq_f32(a, b);
        equal(a: Self::F, b: Self::F) -> Self::U = vceqq_f32(a, b);
        and(a: Self::U, b: Self::U) -> Self::U = vandq_u32(a, b);
        or(a: Self::U, b: Self::U) -> Self::U = vorrq_u32(a, b);
        without(a: Self::U, b: Self::U) -> Self::U = vbicq_u32(a, b);
        min_u(a: Self::U, b: Self::U) -> Self::U = vminq_u32(a, b);
        max_u(a: Self::U, b: Self::U) -> Self::U = vmaxq_u32(a, b);
        less_equal_u(a: Self::U, b: Self::U) -> Self::U = vcleq_u32(a, b);
        select(mask: Self::U, a: Self::U, b: Self::U) -> Self::U = vbslq_u32(mask, a, b);
        swap_pairs(a: Self::U) -> Self::U = vrev64q_u32(a);
        swap_halves(a: Self::U) -> Self::U = vextq_u32::<2>(a, a);
        bits(a: Self::U) -> u32 =
            vaddvq_u32(vandq_u32(a, Self::load_u(&[1, 2, 4, 8])));
        least_number(a: Self::F) -> f32 = vminvq_f32(a);
        pick8(from: [Self::U; 2], lanes: Self::U) -> Self::U = {
            // Bytes 4·lane to 4·lane + 3 of a table of 32.
            let slots = vandq_u32(lanes, vdupq_n_u32(crate::SLOT));
            let bytes = vmlaq_u32(vdupq_n_u32(0x0302_0100), slots, vdupq_n_u32(0x0404_0404));
            let table =
                uint8x16x2_t(vreinterpretq_u8_u32(from[0]), vreinterpretq_u8_u32(from[1]));
            vreinterpretq_u32_u8(vqtbl2q_u8(table, vreinterpretq_u8_u32(bytes)))
        };
    }
}
