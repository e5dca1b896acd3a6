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

/// Sixteen answers: words of ones or of zeros, as vector registers hold them.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[repr(C, align(64))]
pub struct Mask16([u32; LANES]);

/// Numbers of this size and more are cut off, or taken to be whole.
const WHOLE: f32 = 4_194_304.0;

/// 1.5 · 2²³: its sum with a smaller number has the bits of the nearest whole one.
const ROUNDING: f32 = 12_582_912.0;

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
lanewise!(U32x16, Sub, sub, a, b => a.wrapping_sub(b));
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

/// All bits set where something holds.
#[inline(always)]
const fn word(holds: bool) -> u32 {
    if holds { u32::MAX } else { 0 }
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
                        out.0[i] = word(self.0[i] $operator other.0[i]);
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

    /// The largest whole numbers that are not greater.
    #[inline(always)]
    pub fn floor(self) -> Self {
        let mut out = self;
        for i in 0..LANES {
            // Rounded to the nearest, by a sum without room for what is behind the point: casts of single
            // numbers cannot be done in vectors.
            let x = self.0[i];
            let nearest = (x + ROUNDING) - ROUNDING;
            let floor = if nearest > x { nearest - 1.0 } else { nearest };
            out.0[i] = if x.abs() < WHOLE { floor } else { x };
        }
        out
    }

    /// Whole numbers of at most 2²² in size; what is greater is cut off, and not-a-numbers are −2²².
    #[inline(always)]
    pub fn to_i32(self) -> I32x16 {
        let within = self.clamp(-WHOLE, WHOLE);
        let mut out = I32x16::default();
        for i in 0..LANES {
            out.0[i] = (within.0[i] + ROUNDING).to_bits() as i32 - ROUNDING.to_bits() as i32;
        }
        out
    }

    /// The next numbers upwards where `up` holds, downwards elsewhere; of finite numbers.
    #[inline(always)]
    pub fn next(self, up: Mask16) -> Self {
        let mut out = self;
        for i in 0..LANES {
            let bits = self.0[i].to_bits();
            let sign = bits & (1 << 31);
            // Away from zero or towards it.
            let away = (sign == 0) == up.lane(i);
            let moved = if away { bits.wrapping_add(1) } else { bits.wrapping_sub(1) };
            let from_zero = if up.lane(i) { 1 } else { 1 | 1 << 31 };
            out.0[i] = f32::from_bits(if bits == sign { from_zero } else { moved });
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

    /// Sines and cosines of angles in turns of 2π, wrong by less than 3·10⁻⁷; turns are less than 10⁶ in size.
    #[inline(always)]
    pub fn sin_cos_turns(self) -> (Self, Self) {
        let quarters = self * 4.0;
        let nearest = (quarters + 0.5).floor();
        let x = quarters - nearest;
        let z = x * x;
        let sine = x
            * (((z * -0.004_602_177 + 0.079_680_23) * z - 0.645_963_5) * z
                + std::f32::consts::FRAC_PI_2);
        let cosine = ((z * -0.020_408_353 + 0.253_598_64) * z - 1.233_697) * z + 1.0;
        let turned = nearest - 4.0 * (nearest * 0.25).floor();
        let odd = turned.is_equal(Self::ONE) | turned.is_equal(Self::splat(3.0));
        let (s, c) = (odd.select(cosine, sine), odd.select(sine, cosine));
        let minus_sine = turned.is_at_least(Self::splat(2.0));
        let minus_cosine = turned.is_equal(Self::ONE) | turned.is_equal(Self::splat(2.0));
        (minus_sine.select(-s, s), minus_cosine.select(-c, c))
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

    /// Bits moved upwards by fewer than 32 places.
    #[inline(always)]
    pub fn shifted_left(self, bits: u32) -> Self {
        let mut out = self;
        for i in 0..LANES {
            out.0[i] = self.0[i] << bits;
        }
        out
    }

    /// The bits in reverse order.
    #[inline(always)]
    pub fn reverse_bits(self) -> Self {
        let mut out = self;
        for i in 0..LANES {
            out.0[i] = self.0[i].reverse_bits();
        }
        out
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

// By bits, so that nothing tempts compilers to choose between addresses.
impl Select for U32x16 {
    #[inline(always)]
    fn select(mask: Mask16, a: Self, b: Self) -> Self {
        let mut out = b;
        for i in 0..LANES {
            out.0[i] = (a.0[i] & mask.0[i]) | (b.0[i] & !mask.0[i]);
        }
        out
    }
}

impl Select for I32x16 {
    #[inline(always)]
    fn select(mask: Mask16, a: Self, b: Self) -> Self {
        let mut out = b;
        for i in 0..LANES {
            let bits = (a.0[i] as u32 & mask.0[i]) | (b.0[i] as u32 & !mask.0[i]);
            out.0[i] = bits as i32;
        }
        out
    }
}

impl Select for F32x16 {
    #[inline(always)]
    fn select(mask: Mask16, a: Self, b: Self) -> Self {
        U32x16::select(mask, a.to_bits(), b.to_bits()).as_f32()
    }
}

impl Mask16 {
    /// Nowhere.
    pub const NONE: Self = Self([0; LANES]);
    /// Everywhere.
    pub const ALL: Self = Self([u32::MAX; LANES]);

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
            any |= self.0[i] != 0;
        }
        any
    }

    /// Whether it holds everywhere.
    #[inline(always)]
    pub fn all(self) -> bool {
        !(!self).any()
    }

    /// Whether it holds in a lane.
    #[inline(always)]
    pub fn lane(&self, i: usize) -> bool {
        self.0[i] != 0
    }

    /// Says whether it holds in a lane.
    #[inline(always)]
    pub fn set_lane(&mut self, i: usize, holds: bool) {
        self.0[i] = word(holds);
    }

    /// The lanes where it holds.
    pub fn lanes(self) -> impl Iterator<Item = usize> {
        (0..LANES).filter(move |&i| self.0[i] != 0)
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
            assert_eq!(a.floor().to_i32().0[i], x.floor() as i32);
            assert_eq!((a.min(b).0[i], a.max(b).0[i]), (x.min(y), x.max(y)));
            assert_eq!(a.is_less(b).select(a, b).0[i], x.min(y));
            assert_eq!(a.clamp(-1.0, 1.0).0[i], x.clamp(-1.0, 1.0));
        }
        let less = a.0.iter().zip(b.0).enumerate().filter(|(_, (a, b))| *a < b);
        assert!(a.is_less(b).lanes().eq(less.map(|(i, _)| i)));
        assert!(a.is_equal(a).all() && a.is_less(b).any() && !a.is_less(a).any());
    }

    #[test]
    fn neighbours_are_those_of_single_numbers() {
        let mut some = of(|i| (i - 7.5) * 0.3);
        some.0[..4].copy_from_slice(&[0.0, -0.0, f32::MIN_POSITIVE, -1.0]);
        let (up, down) = (some.next(!Mask16::NONE), some.next(Mask16::NONE));
        for i in 0..LANES {
            assert_eq!(up.0[i], some.0[i].next_up());
            assert_eq!(down.0[i], some.0[i].next_down());
        }
    }

    #[test]
    fn what_is_not_a_number_gives_way() {
        let bad = F32x16::splat(f32::NAN);
        assert_eq!(bad.min(F32x16::ONE), F32x16::ONE);
        assert!(bad.floor().0[3].is_nan() && bad.to_i32().0[3] == -1 << 22);
        let large = F32x16::splat(1e30);
        assert_eq!((large.floor(), large.to_i32().0[0]), (large, 1 << 22));
        assert_eq!(bad.clamp(0.0, 1.0), F32x16::ZERO);
        assert!(!bad.is_finite().any() && !F32x16::splat(f32::INFINITY).is_finite().any());
        assert!(F32x16::ONE.is_finite().all());
    }

    #[test]
    fn sines_and_cosines_are_near() {
        for step in -100..100 {
            let x = of(|i| 0.0137 * (16.0 * step as f32 + i));
            let (sine, cosine) = x.sin_cos_turns();
            for lane in 0..LANES {
                let (s, c) = (f64::from(x.0[lane]) * std::f64::consts::TAU).sin_cos();
                // The angle itself is rounded.
                let bound = 3e-7 + 1.2e-6 * f64::from(x.0[lane].abs());
                assert!((f64::from(sine.0[lane]) - s).abs() < bound, "{}", x.0[lane]);
                assert!((f64::from(cosine.0[lane]) - c).abs() < bound, "{}", x.0[lane]);
            }
        }
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
