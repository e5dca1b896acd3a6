//! A scanner for the text formats: words and numbers of a byte slice, a line at a time.
//!
//! Numbers take the fast path of Clinger, "How to Read Floating Point Numbers Accurately" (1990):
//! a decimal with at most 2⁵³ as digits and a power of ten up to 10²² is one exact product or
//! quotient in double precision. The rest goes to the standard library. The result is rounded to
//! `f32` last, so it may be off by one unit in the last place in the rarest of ties.

/// A position in a text.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Scanner<'a> {
    bytes: &'a [u8],
    at: usize,
    line: u32,
}

const EXACT_POWERS: [f64; 23] = [
    1e0, 1e1, 1e2, 1e3, 1e4, 1e5, 1e6, 1e7, 1e8, 1e9, 1e10, 1e11, 1e12, 1e13, 1e14, 1e15, 1e16,
    1e17, 1e18, 1e19, 1e20, 1e21, 1e22,
];

impl<'a> Scanner<'a> {
    /// At the beginning of a text, line 1.
    pub(crate) fn new(bytes: &'a [u8]) -> Self {
        let at = if bytes.starts_with(b"\xef\xbb\xbf") { 3 } else { 0 };
        Self { bytes, at, line: 1 }
    }

    /// Number of the current line, from 1.
    pub(crate) fn line(&self) -> u32 {
        self.line
    }

    /// Whether nothing is left.
    #[inline]
    pub(crate) fn is_at_end(&self) -> bool {
        self.at >= self.bytes.len()
    }

    /// Bytes that are left.
    pub(crate) fn remaining(&self) -> usize {
        self.bytes.len() - self.at
    }

    #[inline]
    fn peek(&self) -> u8 {
        self.bytes.get(self.at).copied().unwrap_or(b'\n')
    }

    /// Steps over blanks and over line breaks hidden by a backslash.
    #[inline]
    pub(crate) fn skip_blanks(&mut self) {
        loop {
            match self.peek() {
                b' ' | b'\t' | b'\r' => self.at += 1,
                b'\\' => {
                    let rest = &self.bytes[self.at + 1..];
                    let hidden = match rest {
                        [b'\n', ..] => 1,
                        [b'\r', b'\n', ..] => 2,
                        _ => return,
                    };
                    self.at += 1 + hidden;
                    self.line = self.line.saturating_add(1);
                }
                _ => return,
            }
        }
    }

    /// Steps over blanks and line breaks.
    #[inline]
    pub(crate) fn skip_white(&mut self) {
        while let Some(&byte) = self.bytes.get(self.at) {
            match byte {
                b'\n' => self.line = self.line.saturating_add(1),
                b' ' | b'\t' | b'\r' => {}
                _ => return,
            }
            self.at += 1;
        }
    }

    /// Goes to the beginning of the next line.
    #[inline]
    pub(crate) fn next_line(&mut self) {
        self.at = match self.bytes[self.at..].iter().position(|&b| b == b'\n') {
            Some(offset) => self.at + offset + 1,
            None => self.bytes.len(),
        };
        self.line = self.line.saturating_add(1);
    }

    /// Whether the line, after blanks, holds nothing more but perhaps a comment.
    #[inline]
    pub(crate) fn is_line_done(&mut self) -> bool {
        self.skip_blanks();
        matches!(self.peek(), b'\n' | b'#')
    }

    /// Whether a blank, a line's end or a comment comes next.
    pub(crate) fn is_at_blank(&self) -> bool {
        matches!(self.peek(), b' ' | b'\t' | b'\r' | b'\n' | b'#')
    }

    /// The next word of the line; empty at its end.
    #[inline]
    pub(crate) fn word(&mut self) -> &'a [u8] {
        self.skip_blanks();
        let start = self.at;
        while !matches!(self.peek(), b' ' | b'\t' | b'\r' | b'\n') {
            self.at += 1;
        }
        &self.bytes[start..self.at]
    }

    /// The rest of the line without blanks around it; names and paths, which may hold `#` and
    /// blanks, are read so.
    pub(crate) fn rest_of_line(&mut self) -> &'a [u8] {
        let rest = &self.bytes[self.at..];
        let end = rest.iter().position(|&b| b == b'\n').unwrap_or(rest.len());
        self.at += end;
        rest[..end].trim_ascii()
    }

    /// Steps over one byte if it is next.
    #[inline]
    pub(crate) fn eat(&mut self, byte: u8) -> bool {
        let found = self.bytes.get(self.at) == Some(&byte);
        self.at += usize::from(found);
        found
    }

    /// A signed integer; saturates.
    #[inline]
    pub(crate) fn integer(&mut self) -> Option<i64> {
        let start = self.at;
        let negative = self.peek() == b'-';
        if negative || self.peek() == b'+' {
            self.at += 1;
        }
        let first_digit = self.at;
        let mut value = 0_i64;
        while let digit @ b'0'..=b'9' = self.peek() {
            value = value.saturating_mul(10).saturating_add(i64::from(digit - b'0'));
            self.at += 1;
        }
        if self.at == first_digit {
            self.at = start;
            return None;
        }
        Some(if negative { -value } else { value })
    }

    /// The next number of the line, or `None` where there is none. Words of infinities and NaNs are
    /// numbers; what overflows is infinite.
    #[inline]
    pub(crate) fn number(&mut self) -> Option<f32> {
        self.skip_blanks();
        self.number_here()
    }

    /// The number that begins here.
    #[inline]
    pub(crate) fn number_here(&mut self) -> Option<f32> {
        self.double_here().map(|x| x as f32)
    }

    /// The number that begins here, in double precision.
    #[inline]
    pub(crate) fn double_here(&mut self) -> Option<f64> {
        let start = self.at;
        let negative = self.peek() == b'-';
        if negative || self.peek() == b'+' {
            self.at += 1;
        }
        let mut mantissa = 0_u64;
        let mut digits = 0_u32;
        let mut exponent = 0_i32;
        let mut any = false;
        let mut point = false;
        loop {
            match self.peek() {
                digit @ b'0'..=b'9' => {
                    any = true;
                    if mantissa != 0 || digit != b'0' {
                        digits += 1;
                    }
                    // Beyond 19 digits the slow path reads the text again.
                    mantissa = mantissa.wrapping_mul(10).wrapping_add(u64::from(digit - b'0'));
                    exponent = exponent.saturating_sub(i32::from(point));
                }
                b'.' if !point => point = true,
                _ => break,
            }
            self.at += 1;
        }
        if !any {
            self.at = start;
            return self.number_word();
        }
        if matches!(self.peek(), b'e' | b'E') {
            let mark = self.at;
            self.at += 1;
            match self.integer() {
                Some(e) => exponent = exponent.saturating_add(e.clamp(-99_999, 99_999) as i32),
                None => self.at = mark,
            }
        }
        let value = if digits <= 19 && mantissa <= 1 << 53 && exponent.unsigned_abs() <= 22 {
            let power = EXACT_POWERS[exponent.unsigned_abs() as usize];
            let mantissa = mantissa as f64;
            if exponent < 0 { mantissa / power } else { mantissa * power }
        } else {
            self.slow_number(start).abs()
        };
        Some(if negative { -value } else { value })
    }

    #[cold]
    fn slow_number(&self, start: usize) -> f64 {
        let text = std::str::from_utf8(&self.bytes[start..self.at]).unwrap_or("nan");
        text.parse().unwrap_or(f64::NAN)
    }

    /// `inf`, `-nan(ind)` and their like.
    #[cold]
    fn number_word(&mut self) -> Option<f64> {
        let start = self.at;
        let word = self.word();
        let (negative, name) = match word {
            [b'-', name @ ..] => (true, name),
            [b'+', name @ ..] => (false, name),
            name => (false, name),
        };
        let starts = |prefix: &[u8]| {
            name.get(..prefix.len()).is_some_and(|head| head.eq_ignore_ascii_case(prefix))
        };
        if starts(b"nan") {
            Some(f64::NAN)
        } else if starts(b"inf") {
            Some(if negative { f64::NEG_INFINITY } else { f64::INFINITY })
        } else {
            self.at = start;
            None
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn number(text: &str) -> Option<f32> {
        Scanner::new(text.as_bytes()).number()
    }

    #[test]
    fn numbers_are_those_of_the_standard_library() {
        for text in [
            "0",
            "-0",
            "1",
            "+1.5",
            "-.5",
            "5.",
            "650.292542",
            "1e3",
            "1E-3",
            "-2.5e+2",
            "1e22",
            "123456789012345678901234567890",
            "0.00000000000000000000000000000012345",
            "3.4028235e38",
            "1e39",
            "1e999",
            "-1e999",
            "1e-999",
            "9007199254740993",
            "0.1000000000000000055511151231257827",
            "1e99999999999999999999",
        ] {
            let expected: f32 = text.parse().expect(text);
            assert_eq!(number(text).expect(text), expected, "{text}");
        }
        assert!(number("nan").expect("nan").is_nan());
        assert!(number("-nan(ind)").expect("nan").is_nan());
        assert_eq!(number("-inf"), Some(f32::NEG_INFINITY));
        for text in ["", "x", "-", ".", "e5", "/", "# 3"] {
            assert_eq!(number(text), None, "{text}");
        }
    }

    #[test]
    fn a_number_ends_where_its_digits_end() {
        let mut scanner = Scanner::new(b" 1e 2ex 3/4");
        assert_eq!(scanner.number(), Some(1.0));
        assert_eq!(scanner.word(), b"e");
        assert_eq!(scanner.number(), Some(2.0));
        assert_eq!(scanner.word(), b"ex");
        assert_eq!(scanner.number(), Some(3.0));
        assert!(scanner.eat(b'/'));
        assert_eq!(scanner.integer(), Some(4));
        assert!(scanner.is_at_end());
    }

    #[test]
    fn lines_are_counted_across_continuations() {
        let mut scanner = Scanner::new(b"\xef\xbb\xbf1 \\\n 2 \\\r\n3\r\nname with # sign  \r\nx");
        assert_eq!(
            [scanner.number(), scanner.number(), scanner.number()].map(Option::unwrap),
            [1.0, 2.0, 3.0]
        );
        assert_eq!(scanner.line(), 3);
        assert!(scanner.is_line_done());
        scanner.next_line();
        assert_eq!(scanner.rest_of_line(), b"name with # sign");
        scanner.next_line();
        assert_eq!((scanner.line(), scanner.word()), (5, &b"x"[..]));
    }

    #[test]
    fn integers_saturate() {
        assert_eq!(Scanner::new(b"99999999999999999999").integer(), Some(i64::MAX));
        assert_eq!(Scanner::new(b"-12x").integer(), Some(-12));
        assert_eq!(Scanner::new(b"-").integer(), None);
    }
}
