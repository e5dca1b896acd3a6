//! Numbers and masks.

use std::ops::{Add, AddAssign, BitAnd, BitOr, BitXor, Div, Mul, MulAssign, Neg, Not, Shr, Sub};

/// How many numbers there are in a vector.
pub const LANES: usize = 16;

/// Sixteen numbers.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
#[repr(C, align(64))]
pub struct F32x16(pub [f32; LANES]);

/// Sixteen whole numbers.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[repr(C, align(64))]
pub struct I32x16(pub [i32; LANES]);

/// Sixteen words of bits.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[repr(C, align(64))]
pub struct U32x16(pub [u32; LANES]);

/// Sixteen answers.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Mask16(pub [bool; LANES]);

macro_rules! lanewise {
    ($type:ident, $trait:ident, $method:ident, $a:ident, $b:ident => $result:expr) => {
        impl $trait for $type {
            type Output = Self;
            #[inline(always)]
            fn $method(self, other: Self) -> Self {
                let mut out = self;
                for i in 0..LANES {
                    let ($a, $b) = (self.0[i], other.0[i]);
                    out.0[i] = $result;
                }
                out
            }
        }
    };
}

lanewise!(F32x16, Add, add, a, b => a + b);
lanewise!(F32x16, Sub, sub, a, b => a - b);
lanewise!(F32x16, Mul, mul, a, b => a * b);
lanewise!(F32x16, Div, div, a, b => a / b);
lanewise!(I32x16, Add, add, a, b => a.wrapping_add(b));
lanewise!(I32x16, Sub, sub, a, b => a.wrapping_sub(b));
lanewise!(I32x16, Mul, mul, a, b => a.wrapping_mul(b));
lanewise!(U32x16, Add, add, a, b => a.wrapping_add(b));
lanewise!(U32x16, Mul, mul, a, b => a.wrapping_mul(b));
lanewise!(U32x16, BitAnd, bitand, a, b => a & b);
lanewise!(U32x16, BitOr, bitor, a, b => a | b);
lanewise!(U32x16, BitXor, bitxor, a, b => a ^ b);
lanewise!(Mask16, BitAnd, bitand, a, b => a & b);
lanewise!(Mask16, BitOr, bitor, a, b => a | b);

impl Mul<f32> for F32x16 {
    type Output = Self;
    #[inline(always)]
    fn mul(self, other: f32) -> Self {
        self * Self::splat(other)
    }
}

impl Mul<F32x16> for f32 {
    type Output = F32x16;
    #[inline(always)]
    fn mul(self, other: F32x16) -> F32x16 {
        F32x16::splat(self) * other
    }
}

impl Add<f32> for F32x16 {
    type Output = Self;
    #[inline(always)]
    fn add(self, other: f32) -> Self {
        self + Self::splat(other)
    }
}

impl Sub<f32> for F32x16 {
    type Output = Self;
    #[inline(always)]
    fn sub(self, other: f32) -> Self {
        self - Self::splat(other)
    }
}

impl Sub<F32x16> for f32 {
    type Output = F32x16;
    #[inline(always)]
    fn sub(self, other: F32x16) -> F32x16 {
        F32x16::splat(self) - other
    }
}

impl Div<F32x16> for f32 {
    type Output = F32x16;
    #[inline(always)]
    fn div(self, other: F32x16) -> F32x16 {
        F32x16::splat(self) / other
    }
}

impl AddAssign for F32x16 {
    #[inline(always)]
    fn add_assign(&mut self, other: Self) {
        *self = *self + other;
    }
}

impl MulAssign for F32x16 {
    #[inline(always)]
    fn mul_assign(&mut self, other: Self) {
        *self = *self * other;
    }
}

impl Neg for F32x16 {
    type Output = Self;
    #[inline(always)]
    fn neg(self) -> Self {
        let mut out = self;
        for i in 0..LANES {
            out.0[i] = -self.0[i];
        }
        out
    }
}

impl Not for Mask16 {
    type Output = Self;
    #[inline(always)]
    fn not(self) -> Self {
        let mut out = self;
        for i in 0..LANES {
            out.0[i] = !self.0[i];
        }
        out
    }
}

impl Shr<u32> for U32x16 {
    type Output = Self;
    #[inline(always)]
    fn shr(self, bits: u32) -> Self {
        let mut out = self;
        for i in 0..LANES {
            out.0[i] = self.0[i] >> bits;
        }
        out
    }
}

macro_rules! compare {
    ($type:ident, $($method:ident, $doc:literal, $operator:tt);+) => {
        impl $type {
            $(
                #[doc = $doc]
                #[inline(always)]
                pub fn $method(self, other: Self) -> Mask16 {
                    let mut out = Mask16::default();
                    for i in 0..LANES {
                        out.0[i] = self.0[i] $operator other.0[i];
                    }
                    out
                }
            )+
        }
    };
}

compare!(F32x16,
    is_less, "Where `self < other`.", <;
    is_at_most, "Where `self ≤ other`.", <=;
    is_greater, "Where `self > other`.", >;
    is_at_least, "Where `self ≥ other`.", >=;
    is_equal, "Where `self = other`.", ==);
compare!(I32x16,
    is_less, "Where `self < other`.", <;
    is_greater, "Where `self > other`.", >;
    is_equal, "Where `self = other`.", ==);
compare!(U32x16, is_equal, "Where `self = other`.", ==);

impl F32x16 {
    /// Zeros.
    pub const ZERO: Self = Self([0.0; LANES]);
    /// Ones.
    pub const ONE: Self = Self([1.0; LANES]);

    /// The same number sixteen times.
    #[inline(always)]
    pub const fn splat(value: f32) -> Self {
        Self([value; LANES])
    }

    /// The first sixteen numbers of a slice. Panics if there are fewer.
    #[inline(always)]
    pub fn load(values: &[f32]) -> Self {
        let mut out = Self::ZERO;
        out.0.copy_from_slice(&values[..LANES]);
        out
    }

    /// Writes the numbers to the beginning of a slice. Panics if it is shorter.
    #[inline(always)]
    pub fn store(self, values: &mut [f32]) {
        values[..LANES].copy_from_slice(&self.0);
    }

    /// Square roots.
    #[inline(always)]
    pub fn sqrt(self) -> Self {
        let mut out = self;
        for i in 0..LANES {
            out.0[i] = self.0[i].sqrt();
        }
        out
    }

    /// Absolute values.
    #[inline(always)]
    pub fn abs(self) -> Self {
        let mut out = self;
        for i in 0..LANES {
            out.0[i] = self.0[i].abs();
        }
        out
    }

    /// The lesser numbers; `other`'s where one is not a number.
    #[inline(always)]
    pub fn min(self, other: Self) -> Self {
        let mut out = self;
        for i in 0..LANES {
            out.0[i] = if self.0[i] < other.0[i] { self.0[i] } else { other.0[i] };
        }
        out
    }

    /// The greater numbers; `other`'s where one is not a number.
    #[inline(always)]
    pub fn max(self, other: Self) -> Self {
        let mut out = self;
        for i in 0..LANES {
            out.0[i] = if self.0[i] > other.0[i] { self.0[i] } else { other.0[i] };
        }
        out
    }

    /// Between two bounds; the lower one where something is not a number.
    #[inline(always)]
    pub fn clamp(self, least: f32, most: f32) -> Self {
        self.max(Self::splat(least)).min(Self::splat(most))
    }

    /// The largest whole numbers that are not greater, of numbers below 2³¹ in size; others are cut off there.
    #[inline(always)]
    pub fn floor(self) -> Self {
        let mut out = self;
        for i in 0..LANES {
            let truncated = (self.0[i] as i32) as f32;
            out.0[i] = if truncated > self.0[i] { truncated - 1.0 } else { truncated };
        }
        out
    }

    /// Numbers without what is behind the point; not-a-numbers are 0, and what is too large is cut off.
    #[inline(always)]
    pub fn to_i32(self) -> I32x16 {
        let mut out = I32x16::default();
        for i in 0..LANES {
            out.0[i] = self.0[i] as i32;
        }
        out
    }

    /// The bits of the numbers.
    #[inline(always)]
    pub fn to_bits(self) -> U32x16 {
        let mut out = U32x16::default();
        for i in 0..LANES {
            out.0[i] = self.0[i].to_bits();
        }
        out
    }

    /// Neither infinite nor not a number.
    #[inline(always)]
    pub fn is_finite(self) -> Mask16 {
        self.abs().is_less(Self::splat(f32::INFINITY))
    }

    /// Logarithms to base 2 of positive normal numbers, wrong by less than 4·10⁻⁶.
    #[inline(always)]
    pub fn log2(self) -> Self {
        // The mantissa in [√½, √2), and the logarithm of (1 + z)/(1 − z) as an odd series.
        let bits = self.to_bits() + U32x16::splat(0x3f80_0000 - 0x3f35_04f3);
        let exponent = (bits >> 23).to_f32() - 127.0;
        let mantissa = (bits & U32x16::splat(0x007f_ffff)) + U32x16::splat(0x3f35_04f3);
        let m = mantissa.as_f32();
        let z = (m - 1.0) / (m + 1.0);
        let z2 = z * z;
        let series = ((z2 * 0.412_198_6 + 0.577_078_0) * z2 + 0.961_796_7) * z2 + 2.885_390_1;
        exponent + z * series
    }
}

impl I32x16 {
    /// The same number sixteen times.
    #[inline(always)]
    pub const fn splat(value: i32) -> Self {
        Self([value; LANES])
    }

    /// As numbers with a point.
    #[inline(always)]
    pub fn to_f32(self) -> F32x16 {
        let mut out = F32x16::ZERO;
        for i in 0..LANES {
            out.0[i] = self.0[i] as f32;
        }
        out
    }

    /// The lesser numbers.
    #[inline(always)]
    pub fn min(self, other: Self) -> Self {
        self.is_less(other).select(self, other)
    }

    /// The greater numbers.
    #[inline(always)]
    pub fn max(self, other: Self) -> Self {
        self.is_greater(other).select(self, other)
    }
}

impl U32x16 {
    /// The same number sixteen times.
    #[inline(always)]
    pub const fn splat(value: u32) -> Self {
        Self([value; LANES])
    }

    /// As numbers with a point, of numbers below 2³¹.
    #[inline(always)]
    pub fn to_f32(self) -> F32x16 {
        let mut out = F32x16::ZERO;
        for i in 0..LANES {
            out.0[i] = (self.0[i] as i32) as f32;
        }
        out
    }

    /// The numbers of which these are the bits.
    #[inline(always)]
    pub fn as_f32(self) -> F32x16 {
        let mut out = F32x16::ZERO;
        for i in 0..LANES {
            out.0[i] = f32::from_bits(self.0[i]);
        }
        out
    }
}

/// What a mask can choose between.
pub trait Select: Copy {
    /// `a` where the mask holds, `b` elsewhere.
    fn select(mask: Mask16, a: Self, b: Self) -> Self;
}

macro_rules! select {
    ($($type:ident),+) => {
        $(impl Select for $type {
            #[inline(always)]
            fn select(mask: Mask16, a: Self, b: Self) -> Self {
                let mut out = b;
                for i in 0..LANES {
                    out.0[i] = if mask.0[i] { a.0[i] } else { b.0[i] };
                }
                out
            }
        })+
    };
}
select!(F32x16, I32x16, U32x16);

impl Mask16 {
    /// Nowhere.
    pub const NONE: Self = Self([false; LANES]);

    /// `a` where the mask holds, `b` elsewhere.
    #[inline(always)]
    pub fn select<T: Select>(self, a: T, b: T) -> T {
        T::select(self, a, b)
    }

    /// Whether it holds anywhere.
    #[inline(always)]
    pub fn any(self) -> bool {
        let mut any = false;
        for i in 0..LANES {
            any |= self.0[i];
        }
        any
    }

    /// Whether it holds everywhere.
    #[inline(always)]
    pub fn all(self) -> bool {
        !(!self).any()
    }

    /// Where it holds, from the lowest bit on.
    #[inline(always)]
    pub fn bits(self) -> u32 {
        let mut bits = 0;
        for i in 0..LANES {
            bits |= u32::from(self.0[i]) << i;
        }
        bits
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn of(f: impl Fn(f32) -> f32) -> F32x16 {
        let mut out = F32x16::ZERO;
        for (i, value) in out.0.iter_mut().enumerate() {
            *value = f(i as f32);
        }
        out
    }

    #[test]
    fn operations_are_those_of_single_numbers() {
        let (a, b) = (of(|i| 0.37 * i - 2.5), of(|i| 1.9 - 0.21 * i));
        for i in 0..LANES {
            let (x, y) = (a.0[i], b.0[i]);
            assert_eq!((a + b).0[i], x + y);
            assert_eq!((a - b).0[i], x - y);
            assert_eq!((a * b).0[i], x * y);
            assert_eq!((a / b).0[i], x / y);
            assert_eq!((-a).0[i], -x);
            assert_eq!(a.abs().sqrt().0[i], x.abs().sqrt());
            assert_eq!(a.floor().0[i], x.floor());
            assert_eq!((a.min(b).0[i], a.max(b).0[i]), (x.min(y), x.max(y)));
            assert_eq!(a.is_less(b).select(a, b).0[i], x.min(y));
            assert_eq!(a.clamp(-1.0, 1.0).0[i], x.clamp(-1.0, 1.0));
        }
        assert_eq!(
            a.is_less(b).bits().count_ones(),
            a.0.iter().zip(b.0).filter(|(a, b)| *a < b).count() as u32
        );
        assert!(a.is_equal(a).all() && a.is_less(b).any() && !a.is_less(a).any());
    }

    #[test]
    fn what_is_not_a_number_gives_way() {
        let bad = F32x16::splat(f32::NAN);
        assert_eq!(bad.min(F32x16::ONE), F32x16::ONE);
        assert_eq!(bad.clamp(0.0, 1.0), F32x16::ZERO);
        assert!(!bad.is_finite().any() && !F32x16::splat(f32::INFINITY).is_finite().any());
        assert!(F32x16::ONE.is_finite().all());
    }

    #[test]
    fn logarithms_are_near() {
        let mut worst = 0.0f64;
        for step in 0..4000 {
            let x = of(|i| 1e-3 * (1.0 + 0.005 * (16.0 * step as f32 + i)).powi(3));
            for (x, log) in x.0.into_iter().zip(x.log2().0) {
                worst = worst.max((f64::from(log) - f64::from(x).log2()).abs());
            }
        }
        assert!(worst < 4e-6, "{worst}");
        assert_eq!(F32x16::ONE.log2(), F32x16::ZERO);
    }
}
