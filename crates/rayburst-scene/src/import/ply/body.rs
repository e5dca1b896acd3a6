//! The body of a PLY file: numbers one after the other, as text or binary, of the header's types.

use super::header::{Encoding, Scalar};
use crate::import::scan::Scanner;

/// Reads numbers.
#[derive(Clone, Debug)]
pub(super) enum Reader<'a> {
    Ascii(Scanner<'a>),
    Binary { bytes: &'a [u8], at: usize, big: bool },
}

impl<'a> Reader<'a> {
    pub(super) fn new(body: &'a [u8], encoding: Encoding) -> Self {
        match encoding {
            Encoding::Ascii => Self::Ascii(Scanner::new(body)),
            Encoding::Little => Self::Binary { bytes: body, at: 0, big: false },
            Encoding::Big => Self::Binary { bytes: body, at: 0, big: true },
        }
    }

    /// Bytes that are left.
    pub(super) fn remaining(&self) -> u64 {
        match self {
            Self::Ascii(scanner) => scanner.remaining() as u64,
            Self::Binary { bytes, at, .. } => (bytes.len() - at) as u64,
        }
    }

    /// The next number; `None` where the body ends or is not a number. Integers beyond 2⁵³ do not
    /// occur: the widest are of 32 bits.
    #[inline]
    pub(super) fn number(&mut self, scalar: Scalar) -> Option<f64> {
        match self {
            Self::Ascii(scanner) => {
                scanner.skip_white();
                match scalar {
                    Scalar::F32 | Scalar::F64 => scanner.number_here().map(f64::from),
                    // Integers may be written `3.0`.
                    _ => scanner.double_here(),
                }
            }
            Self::Binary { bytes, at, big } => {
                let number = bytes.get(*at..)?;
                let value = match scalar {
                    Scalar::I8 => f64::from(*number.first()? as i8),
                    Scalar::U8 => f64::from(*number.first()?),
                    Scalar::I16 => f64::from(u16_of(number, *big)? as i16),
                    Scalar::U16 => f64::from(u16_of(number, *big)?),
                    Scalar::I32 => f64::from(u32_of(number, *big)? as i32),
                    Scalar::U32 => f64::from(u32_of(number, *big)?),
                    Scalar::F32 => f64::from(f32::from_bits(u32_of(number, *big)?)),
                    Scalar::F64 => {
                        let eight = *number.first_chunk::<8>()?;
                        if *big { f64::from_be_bytes(eight) } else { f64::from_le_bytes(eight) }
                    }
                };
                *at += scalar.size();
                Some(value)
            }
        }
    }

    /// Steps over numbers of a type; `None` where the body ends first.
    pub(super) fn skip(&mut self, scalar: Scalar, count: u64) -> Option<()> {
        match self {
            Self::Ascii(_) => (0..count).try_for_each(|_| self.number(scalar).map(drop)),
            Self::Binary { bytes, at, .. } => {
                let end = (scalar.size() as u64).checked_mul(count)?.checked_add(*at as u64)?;
                *at = usize::try_from(end).ok().filter(|&end| end <= bytes.len())?;
                Some(())
            }
        }
    }

    /// A list's length, if the body can hold that many items.
    #[inline]
    pub(super) fn length(&mut self, length: Scalar, item: Scalar) -> Option<u64> {
        let value = self.number(length)?;
        let smallest = if matches!(self, Self::Ascii(_)) { 1 } else { item.size() as u64 };
        let is_length = value >= 0.0 && value.fract() == 0.0;
        let count = is_length.then_some(value as u64)?;
        (count.checked_mul(smallest)? <= self.remaining()).then_some(count)
    }

    /// Where the reader is, for messages.
    pub(super) fn place(&self, header_lines: u32, header_bytes: usize) -> String {
        match self {
            Self::Ascii(scanner) => format!("line {}", header_lines.saturating_add(scanner.line())),
            Self::Binary { at, .. } => format!("byte {}", header_bytes + at),
        }
    }
}

#[inline]
fn u16_of(bytes: &[u8], big: bool) -> Option<u16> {
    let two = *bytes.first_chunk::<2>()?;
    Some(if big { u16::from_be_bytes(two) } else { u16::from_le_bytes(two) })
}

#[inline]
fn u32_of(bytes: &[u8], big: bool) -> Option<u32> {
    let four = *bytes.first_chunk::<4>()?;
    Some(if big { u32::from_be_bytes(four) } else { u32::from_le_bytes(four) })
}
