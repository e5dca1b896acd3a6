//! Sets of small numbers as bits.

/// Takes the lowest bit out of a set that is not empty. (Not an iterator or a closure: only what is
/// sure to be inlined is compiled for a kernel's region.)
#[inline(always)]
pub(crate) fn take_bit(set: &mut u32) -> u32 {
    let bit = set.trailing_zeros();
    *set &= set.wrapping_sub(1);
    bit
}
