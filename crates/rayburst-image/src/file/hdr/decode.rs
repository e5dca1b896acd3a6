//! Reading Radiance pictures, including headers with lines that no one needs.

use glam::Vec3;

use crate::limits::check_size;
use crate::{ImageError, Result, RgbImage};

/// Decodes a Radiance picture in memory; `name` is what messages call it.
///
/// `EXPOSURE` and `COLORCORR` lines are undone; `GAMMA`, `PRIMARIES` and other lines are ignored,
/// as Radiance does. All eight orders of rows and columns are turned upright.
pub fn decode_hdr(bytes: &[u8], name: &str) -> Result<RgbImage> {
    let malformed = |reason: String| ImageError::malformed(name, "Radiance HDR", reason);
    let header = Header::parse(bytes, name)?;
    let pixels = check_size(name, header.columns.into(), header.rows.into())?;
    let data = &bytes[header.end..];
    // The densest files hold one colour only; longer old runs than this occur nowhere.
    if pixels / 1024 > data.len() {
        return Err(malformed(format!(
            "the header promises {pixels} pixels, more than {} bytes can hold",
            data.len()
        )));
    }
    let mut reader = Reader { data, at: 0 };
    let mut stored = Vec::with_capacity(pixels.min(data.len().saturating_mul(64)));
    let mut row = vec![[0u8; 4]; header.columns as usize];
    for y in 0..header.rows {
        reader
            .row(&mut row)
            .map_err(|reason| malformed(format!("row {y} of {}: {reason}", header.rows)))?;
        stored.extend(row.iter().map(|&p| to_linear(p) * header.scale));
    }
    Ok(header.upright(stored))
}

struct Header {
    /// Pixels in a stored row, and stored rows.
    columns: u32,
    rows: u32,
    /// Rows run along X, or in the opposite direction than upright.
    transposed: bool,
    flip_x: bool,
    flip_y: bool,
    scale: Vec3,
    end: usize,
}

impl Header {
    fn parse(bytes: &[u8], name: &str) -> Result<Self> {
        let malformed = |reason: &str| ImageError::malformed(name, "Radiance HDR", reason);
        if !bytes.starts_with(b"#?") {
            return Err(malformed("the file does not begin with '#?'"));
        }
        let mut scale = Vec3::ONE;
        let mut at = 0;
        let mut next_line = || {
            let length = bytes[at..].iter().take(4096).position(|&b| b == b'\n')?;
            let line = String::from_utf8_lossy(&bytes[at..at + length]).trim().to_owned();
            at += length + 1;
            Some((line, at))
        };
        loop {
            let (line, _) = next_line().ok_or_else(|| malformed("the header does not end"))?;
            if line.is_empty() {
                break;
            }
            let Some((key, value)) = line.split_once('=') else { continue };
            let numbers: Vec<f32> =
                value.split_whitespace().map_while(|v| v.parse().ok()).collect();
            match key.trim() {
                "FORMAT" if value.trim() == "32-bit_rle_xyze" => {
                    let reason = "XYZE colours are not read; convert it with 'ra_xyze -r'";
                    return Err(ImageError::unsupported(name, reason));
                }
                "FORMAT" if value.trim() != "32-bit_rle_rgbe" => {
                    return Err(malformed("FORMAT is not 32-bit_rle_rgbe"));
                }
                "EXPOSURE" => scale *= numbers.first().copied().unwrap_or(1.0),
                "COLORCORR" if numbers.len() == 3 => scale *= Vec3::from_slice(&numbers),
                _ => {}
            }
        }
        if !scale.recip().is_finite() || scale.min_element() <= 0.0 {
            return Err(malformed("EXPOSURE or COLORCORR is not a positive number"));
        }
        let resolution = || malformed("the line after the header is not like '-Y 512 +X 1024'");
        let (line, end) = next_line().ok_or_else(resolution)?;
        let words: Vec<&str> = line.split_whitespace().collect();
        let [axis_a, a, axis_b, b] = words[..] else { return Err(resolution()) };
        let number = |text: &str| text.parse::<u32>().map_err(|_| resolution());
        let (rows, columns) = (number(a)?, number(b)?);
        let (transposed, flip_x, flip_y) = match (axis_a, axis_b) {
            ("-Y" | "+Y", "+X" | "-X") => (false, axis_b == "-X", axis_a == "+Y"),
            ("-X" | "+X", "+Y" | "-Y") => (true, axis_a == "-X", axis_b == "+Y"),
            _ => return Err(resolution()),
        };
        Ok(Self { columns, rows, transposed, flip_x, flip_y, scale: scale.recip(), end })
    }

    fn upright(&self, stored: Vec<Vec3>) -> RgbImage {
        let (width, height) = match self.transposed {
            true => (self.rows, self.columns),
            false => (self.columns, self.rows),
        };
        if !self.transposed && !self.flip_x && !self.flip_y {
            return RgbImage { width, height, pixels: stored };
        }
        RgbImage::from_fn(width, height, |x, y| {
            let x = if self.flip_x { width - 1 - x } else { x };
            let y = if self.flip_y { height - 1 - y } else { y };
            let (column, row) = if self.transposed { (y, x) } else { (x, y) };
            stored[row as usize * self.columns as usize + column as usize]
        })
    }
}

struct Reader<'a> {
    data: &'a [u8],
    at: usize,
}

type RowResult<T = ()> = std::result::Result<T, &'static str>;

impl Reader<'_> {
    fn byte(&mut self) -> RowResult<u8> {
        let byte = *self.data.get(self.at).ok_or("the file ends too early")?;
        self.at += 1;
        Ok(byte)
    }

    fn pixel(&mut self) -> RowResult<[u8; 4]> {
        let pixel = self.data.get(self.at..self.at + 4).ok_or("the file ends too early")?;
        self.at += 4;
        Ok([pixel[0], pixel[1], pixel[2], pixel[3]])
    }

    fn row(&mut self, row: &mut [[u8; 4]]) -> RowResult {
        let first = self.pixel()?;
        let length = usize::from(first[2]) << 8 | usize::from(first[3]);
        let new = first[0] == 2 && first[1] == 2 && first[2] < 128;
        if new && (8..32_768).contains(&row.len()) {
            if length != row.len() {
                return Err("the row's length is not the picture's width");
            }
            return (0..4).try_for_each(|component| self.component(row, component));
        }
        self.old_row(row, first)
    }

    /// New run lengths: above 128 a run of one value, else as many values.
    fn component(&mut self, row: &mut [[u8; 4]], component: usize) -> RowResult {
        let mut x = 0;
        while x < row.len() {
            let code = usize::from(self.byte()?);
            let (count, run) = if code > 128 { (code - 128, true) } else { (code, false) };
            if count == 0 || x + count > row.len() {
                return Err("a run is longer than the row");
            }
            if run {
                let value = self.byte()?;
                row[x..x + count].iter_mut().for_each(|p| p[component] = value);
            } else {
                for pixel in &mut row[x..x + count] {
                    pixel[component] = self.byte()?;
                }
            }
            x += count;
        }
        Ok(())
    }

    /// Flat pixels; one of mantissas 1 1 1 repeats the last, and more of them in a row are the
    /// higher bytes of the count.
    fn old_row(&mut self, row: &mut [[u8; 4]], first: [u8; 4]) -> RowResult {
        let (mut x, mut shift, mut next) = (0, 0, Some(first));
        while x < row.len() {
            let pixel = match next.take() {
                Some(pixel) => pixel,
                None => self.pixel()?,
            };
            if pixel[..3] == [1, 1, 1] {
                if x == 0 || shift > 24 {
                    return Err("a run that repeats nothing");
                }
                let count = usize::from(pixel[3]) << shift;
                if x + count > row.len() {
                    return Err("a run is longer than the row");
                }
                let last = row[x - 1];
                row[x..x + count].fill(last);
                x += count;
                shift += 8;
            } else {
                row[x] = pixel;
                x += 1;
                shift = 0;
            }
        }
        Ok(())
    }
}

/// The middle of the quantisation step, as Radiance reads it; 0 for exponent 0.
fn to_linear([r, g, b, e]: [u8; 4]) -> Vec3 {
    if e == 0 {
        return Vec3::ZERO;
    }
    // In two steps: 2^(e - 136) alone would underflow for the smallest exponents.
    let scale = (f32::from(e) - 128.0).exp2();
    (Vec3::new(r.into(), g.into(), b.into()) + 0.5) * (1.0 / 256.0) * scale
}
