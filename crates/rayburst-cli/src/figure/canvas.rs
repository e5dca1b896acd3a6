//! A drawing surface for diagrams: anti-aliased lines, arrows, shapes and text.
//!
//! Units are points with y down; the picture has [`SCALE`] pixels a point. Text is the outline of
//! DejaVu Sans (embedded), so nothing depends on the fonts of the machine.

use rayburst::glam::Vec2;
use rayburst::image::Rgb8Image;
use tiny_skia::{
    Color, FillRule, LineCap, LineJoin, Paint, Path, PathBuilder, Pixmap, Stroke, StrokeDash,
    Transform,
};

use crate::error::{CliError, Result};

/// Pixels a point.
const SCALE: f32 = 2.0;

/// A colour of the diagrams: red, green, blue, opacity.
pub(crate) type Ink = [u8; 4];

/// The palette: dark ink, and hues that stay apart for colour-blind readers (Okabe and Ito 2008).
pub(crate) mod ink {
    use super::Ink;
    pub(crate) const PAPER: Ink = [255, 255, 255, 255];
    pub(crate) const BLACK: Ink = [33, 37, 41, 255];
    pub(crate) const GREY: Ink = [134, 142, 150, 255];
    pub(crate) const BLUE: Ink = [0, 114, 178, 255];
    pub(crate) const ORANGE: Ink = [213, 94, 0, 255];
    pub(crate) const GREEN: Ink = [0, 158, 115, 255];
    pub(crate) const PINK: Ink = [190, 90, 150, 255];
    pub(crate) const YELLOW: Ink = [240, 180, 30, 255];
    pub(crate) const SKY: Ink = [208, 228, 240, 255];
    pub(crate) const STONE: Ink = [216, 210, 200, 255];
}

/// Where a text stands relative to its point.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) enum Anchor {
    /// Begins there.
    Start,
    /// Is centred there.
    Middle,
    /// Ends there.
    End,
}

/// How a line looks.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Pen {
    pub(crate) ink: Ink,
    pub(crate) width: f32,
    pub(crate) dash: Option<[f32; 2]>,
}

impl Pen {
    /// A solid line.
    pub(crate) const fn new(ink: Ink, width: f32) -> Self {
        Self { ink, width, dash: None }
    }

    /// A dashed line.
    pub(crate) const fn dashed(ink: Ink, width: f32) -> Self {
        Self { ink, width, dash: Some([5.0, 4.0]) }
    }
}

/// Which cut of the typeface.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Style {
    Plain,
    Bold,
}

/// A page to draw on.
pub(crate) struct Canvas {
    pixels: Pixmap,
    size: Vec2,
}

impl Canvas {
    /// A white page of so many points.
    pub(crate) fn new(width: u32, height: u32) -> Result<Self> {
        let scaled = |n: u32| (n as f32 * SCALE) as u32;
        let mut pixels = Pixmap::new(scaled(width), scaled(height))
            .ok_or_else(|| CliError::failed("the diagram's size is not possible"))?;
        pixels.fill(color(ink::PAPER));
        Ok(Self { pixels, size: Vec2::new(width as f32, height as f32) })
    }

    /// Width and height in points.
    pub(crate) fn size(&self) -> Vec2 {
        self.size
    }

    /// The finished page.
    pub(crate) fn into_image(self) -> Rgb8Image {
        let data = self.pixels.pixels().iter().flat_map(|p| [p.red(), p.green(), p.blue()]);
        Rgb8Image { width: self.pixels.width(), height: self.pixels.height(), data: data.collect() }
    }

    /// A straight line.
    pub(crate) fn line(&mut self, a: Vec2, b: Vec2, pen: Pen) {
        self.polyline(&[a, b], pen);
    }

    /// Connected lines.
    pub(crate) fn polyline(&mut self, points: &[Vec2], pen: Pen) {
        if let Some(path) = path_of(points, false) {
            self.stroke(&path, pen);
        }
    }

    /// A filled polygon with an outline.
    pub(crate) fn polygon(&mut self, points: &[Vec2], fill: Ink, outline: Option<Pen>) {
        let Some(path) = path_of(points, true) else { return };
        self.fill(&path, fill);
        if let Some(pen) = outline {
            self.stroke(&path, pen);
        }
    }

    /// A filled circle with an outline.
    pub(crate) fn circle(&mut self, centre: Vec2, radius: f32, fill: Ink, outline: Option<Pen>) {
        let Some(path) = PathBuilder::from_circle(centre.x, centre.y, radius) else { return };
        self.fill(&path, fill);
        if let Some(pen) = outline {
            self.stroke(&path, pen);
        }
    }

    /// Part of a circle; angles in radians, clockwise from +x on the page.
    pub(crate) fn arc(&mut self, centre: Vec2, radius: f32, from: f32, to: f32, pen: Pen) {
        let steps = 24;
        let points: Vec<Vec2> = (0..=steps)
            .map(|i| {
                let angle = from + (to - from) * i as f32 / steps as f32;
                centre + radius * Vec2::from_angle(angle)
            })
            .collect();
        self.polyline(&points, pen);
    }

    /// A line with a head at its end.
    pub(crate) fn arrow(&mut self, from: Vec2, to: Vec2, pen: Pen) {
        let Some(along) = (to - from).try_normalize() else { return };
        let (length, half) = (4.0 + 3.0 * pen.width, 1.5 + 1.2 * pen.width);
        let base = to - along * length;
        self.line(from, base + along * 0.5, pen);
        let side = along.perp() * half;
        self.polygon(&[to, base + side, base - side], pen.ink, None);
    }

    /// A line with a head in its middle: the way a ray runs.
    pub(crate) fn ray(&mut self, from: Vec2, to: Vec2, pen: Pen) {
        self.line(from, to, pen);
        let Some(along) = (to - from).try_normalize() else { return };
        let (length, half) = (4.0 + 2.5 * pen.width, 1.2 + 1.2 * pen.width);
        let tip = from.lerp(to, 0.55) + along * 0.5 * length;
        let side = along.perp() * half;
        let base = tip - along * length;
        self.polygon(&[tip, base + side, base - side], pen.ink, None);
    }

    /// A text on its base line.
    pub(crate) fn text(
        &mut self,
        at: Vec2,
        text: &str,
        size: f32,
        ink: Ink,
        anchor: Anchor,
        style: Style,
    ) {
        let Some((path, width)) = outline(text, size, style) else { return };
        let shift = match anchor {
            Anchor::Start => 0.0,
            Anchor::Middle => -0.5 * width,
            Anchor::End => -width,
        };
        let place = Transform::from_translate(at.x + shift, at.y);
        let Some(path) = path.transform(place) else { return };
        // A halo keeps letters readable over lines.
        self.stroke(&path, Pen::new([255, 255, 255, 225], 3.0));
        self.fill(&path, ink);
    }

    /// A plain label.
    pub(crate) fn label(&mut self, at: Vec2, text: &str, ink: Ink, anchor: Anchor) {
        self.text(at, text, 13.0, ink, anchor, Style::Plain);
    }

    /// The page's heading and, under it, what the figure shows.
    pub(crate) fn heading(&mut self, title: &str, subtitle: &str) {
        self.text(Vec2::new(24.0, 32.0), title, 17.0, ink::BLACK, Anchor::Start, Style::Bold);
        self.text(Vec2::new(24.0, 52.0), subtitle, 12.5, ink::GREY, Anchor::Start, Style::Plain);
    }

    /// The line at the bottom: the property as a number.
    pub(crate) fn footing(&mut self, text: &str) {
        let at = Vec2::new(24.0, self.size.y - 16.0);
        self.text(at, text, 12.5, ink::BLACK, Anchor::Start, Style::Plain);
    }

    /// A picture with its upper left corner at a point; each of its pixels takes `scale` points.
    pub(crate) fn picture(&mut self, at: Vec2, picture: &Rgb8Image, scale: f32) {
        let columns = (picture.width as f32 * scale * SCALE).round() as u32;
        let rows = (picture.height as f32 * scale * SCALE).round() as u32;
        let (left, top) = ((at.x * SCALE).round() as u32, (at.y * SCALE).round() as u32);
        let stride = self.pixels.width();
        let (right, bottom) = (stride.min(left + columns), self.pixels.height().min(top + rows));
        let data = self.pixels.data_mut();
        for y in top..bottom {
            for x in left..right {
                let column = (x - left) * picture.width / columns;
                let row = (y - top) * picture.height / rows;
                let from = 3 * (row as usize * picture.width as usize + column as usize);
                let to = 4 * (y as usize * stride as usize + x as usize);
                data[to..to + 3].copy_from_slice(&picture.data[from..from + 3]);
                data[to + 3] = 255;
            }
        }
    }

    fn fill(&mut self, path: &Path, ink: Ink) {
        let scale = Transform::from_scale(SCALE, SCALE);
        self.pixels.fill_path(path, &paint(ink), FillRule::Winding, scale, None);
    }

    fn stroke(&mut self, path: &Path, pen: Pen) {
        let stroke = Stroke {
            width: pen.width,
            line_cap: if pen.dash.is_some() { LineCap::Butt } else { LineCap::Round },
            line_join: LineJoin::Round,
            dash: pen.dash.and_then(|d| StrokeDash::new(d.to_vec(), 0.0)),
            ..Stroke::default()
        };
        let scale = Transform::from_scale(SCALE, SCALE);
        self.pixels.stroke_path(path, &paint(pen.ink), &stroke, scale, None);
    }
}

fn color(ink: Ink) -> Color {
    Color::from_rgba8(ink[0], ink[1], ink[2], ink[3])
}

fn paint(ink: Ink) -> Paint<'static> {
    let mut paint = Paint { anti_alias: true, ..Paint::default() };
    paint.set_color(color(ink));
    paint
}

fn path_of(points: &[Vec2], closed: bool) -> Option<Path> {
    let (first, rest) = points.split_first()?;
    let mut builder = PathBuilder::new();
    builder.move_to(first.x, first.y);
    for p in rest {
        builder.line_to(p.x, p.y);
    }
    if closed {
        builder.close();
    }
    builder.finish()
}

/// The outline of a text that starts at the origin, and its width.
fn outline(text: &str, size: f32, style: Style) -> Option<(Path, f32)> {
    let data = match style {
        Style::Plain => dejavu::sans::regular(),
        Style::Bold => dejavu::sans::bold(),
    };
    let face = ttf_parser::Face::parse(data, 0).ok()?;
    let scale = size / f32::from(face.units_per_em());
    let mut pen = Outliner { builder: PathBuilder::new(), x: 0.0, scale };
    for letter in text.chars() {
        let glyph = face.glyph_index(letter).unwrap_or_default();
        face.outline_glyph(glyph, &mut pen);
        pen.x += f32::from(face.glyph_hor_advance(glyph).unwrap_or(0)) * scale;
    }
    let width = pen.x;
    pen.builder.finish().map(|path| (path, width))
}

/// Font units, y up, to points, y down.
struct Outliner {
    builder: PathBuilder,
    x: f32,
    scale: f32,
}

impl Outliner {
    fn at(&self, x: f32, y: f32) -> (f32, f32) {
        (self.x + x * self.scale, -y * self.scale)
    }
}

impl ttf_parser::OutlineBuilder for Outliner {
    fn move_to(&mut self, x: f32, y: f32) {
        let (x, y) = self.at(x, y);
        self.builder.move_to(x, y);
    }

    fn line_to(&mut self, x: f32, y: f32) {
        let (x, y) = self.at(x, y);
        self.builder.line_to(x, y);
    }

    fn quad_to(&mut self, x1: f32, y1: f32, x: f32, y: f32) {
        let ((x1, y1), (x, y)) = (self.at(x1, y1), self.at(x, y));
        self.builder.quad_to(x1, y1, x, y);
    }

    fn curve_to(&mut self, x1: f32, y1: f32, x2: f32, y2: f32, x: f32, y: f32) {
        let ((x1, y1), (x2, y2), (x, y)) = (self.at(x1, y1), self.at(x2, y2), self.at(x, y));
        self.builder.cubic_to(x1, y1, x2, y2, x, y);
    }

    fn close(&mut self) {
        self.builder.close();
    }
}
