//! Reflections from what is on the screen.
//!
//! McGuire, Mara: "Efficient GPU Screen-Space Ray Tracing", JCGT 2014: a ray is a line of the picture,
//! walked pixel by pixel; along it 1/z is linear, so that depth is right in perspective. Depths of the
//! picture are read where the line is, between two pixels of a smooth surface; 1/z is then exact for
//! planes, and rays do not meet the flat surface that they leave.
//!
//! What is off screen or hidden behind something is not found: those pixels are marked as not valid,
//! and want a ray.

use rayburst_image::{Band, Band3, Plane, Plane3};
use rayburst_math::glam::{Vec2, Vec3};
use rayon::prelude::*;

use super::{
    gbuffer::BAND,
    screen::{Screen, check_size, fit},
    view::FrameView,
};
use crate::Result;

/// Rays end where they come this much nearer to the camera's plane than they began.
const NEAR: f32 = 0.01;
/// The most that depth changes from pixel to pixel of one surface, unless it changes evenly.
const STEEP: f32 = 0.02;
/// Rays that are behind what is seen by this share of its nearness are not yet behind it: what is
/// rounded, above all where a ray begins.
const TOUCHING: f32 = 2e-5;

/// How far and how finely [`screen_reflections`] searches.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ScreenReflectionsSettings {
    /// How thick everything is taken to be behind what is seen of it, world units along the camera's
    /// forward axis.
    pub thickness: f32,
    /// Length of rays, world units.
    pub distance: f32,
    /// The most steps along a ray.
    pub steps: u32,
    /// Pixels a step, at least 1; where something may be met, each pixel is looked at.
    pub stride: u32,
}

impl Default for ScreenReflectionsSettings {
    fn default() -> Self {
        Self { thickness: 0.1, distance: 1e4, steps: 1024, stride: 1 }
    }
}

/// What is on the screen, and rays into it.
#[derive(Clone, Copy, Debug)]
pub struct ScreenReflectionsInput<'a> {
    /// Distance along the camera's forward axis in world units, +∞ where nothing is.
    pub depth: &'a Plane,
    /// Radiance of each pixel, of the same size as `depth`.
    pub colour: &'a Plane3,
    /// The view of both.
    pub view: &'a FrameView,
    /// Origins of rays in the world. Any size: one a pixel, or one for several.
    pub origin: &'a Plane3,
    /// Their unit directions in the world; zero where there is no ray. Of the same size.
    pub direction: &'a Plane3,
}

/// What the rays found; each plane of the size of the rays' planes.
#[derive(Clone, Debug, Default)]
pub struct ScreenReflections {
    /// Radiance of what was met; black where nothing was.
    pub colour: Plane3,
    /// Distance to it along the ray; +∞ where nothing was met.
    pub distance: Plane,
    /// 1 where something was met, 0 where the ray left the screen, went behind something, or found
    /// nothing.
    pub validity: Plane,
    /// Of what is on the screen, NaN where nothing is: not to be worked out for every step of every
    /// ray.
    nearness: Plane,
}

/// Follows rays across the picture. `found` is made anew where it is not of the right size. The same
/// bits for any number of threads. Fails if sizes of inputs that belong together differ.
pub fn screen_reflections(
    input: &ScreenReflectionsInput<'_>,
    settings: &ScreenReflectionsSettings,
    found: &mut ScreenReflections,
) -> Result<()> {
    check_size("the view", input.view.size(), input.depth.size())?;
    check_size("the plane of colours", input.colour.size(), input.depth.size())?;
    check_size("the plane of directions", input.direction.size(), input.origin.size())?;
    let size = input.origin.size();
    for plane in found.colour.channels.iter_mut().chain([&mut found.distance, &mut found.validity])
    {
        fit(plane, size)?;
    }
    let screen = Screen::new(input.view);
    fit(&mut found.nearness, input.depth.size())?;
    let mut rows: Vec<Band<'_>> = found.nearness.bands_mut(1).collect();
    rows.par_iter_mut().for_each(|row| {
        let y = row.top();
        for (nearness, &depth) in row.row_mut(y).iter_mut().zip(input.depth.row(y)) {
            *nearness = if screen.is_surface(depth) { screen.nearness(depth) } else { f32::NAN };
        }
    });
    let march = March { nearness: &found.nearness, screen, settings };
    let colours = found.colour.bands_mut(BAND);
    let distances = found.distance.bands_mut(BAND).zip(found.validity.bands_mut(BAND));
    let mut bands: Vec<(Band3<'_>, (Band<'_>, Band<'_>))> = colours.zip(distances).collect();
    bands.par_iter_mut().for_each(|(colour, (distance, validity))| {
        for y in distance.top()..distance.top() + distance.rows() {
            for x in 0..size.0 {
                let hit = march.follow(input.origin.get(x, y), input.direction.get(x, y));
                colour.set(x, y, hit.map_or(Vec3::ZERO, |(hit, _)| input.colour.get(hit.0, hit.1)));
                distance.set(x, y, hit.map_or(f32::INFINITY, |(_, t)| t));
                validity.set(x, y, if hit.is_some() { 1.0 } else { 0.0 });
            }
        }
    });
    Ok(())
}

struct March<'a> {
    nearness: &'a Plane,
    screen: Screen,
    settings: &'a ScreenReflectionsSettings,
}

/// A ray as a line of the picture: everything is linear in the share s of the way on the screen.
struct Line {
    start: Vec2,
    /// To the end, in pixels.
    delta: Vec2,
    /// Whether x changes faster than y.
    along_x: bool,
    /// Nearness at the start, and how it changes.
    nearness: f32,
    slope: f32,
    /// Length of the ray at the end.
    length: f32,
}

/// The ray and the picture at one place of the line.
#[derive(Clone, Copy)]
struct Look {
    s: f32,
    /// Nearness of the ray less that of the picture: negative behind what is seen.
    lead: f32,
    ray: f32,
    seen: f32,
}

impl Look {
    /// Where nothing is seen.
    fn nothing(s: f32, ray: f32) -> Self {
        Self { s, lead: f32::INFINITY, ray, seen: 0.0 }
    }

    fn is_in_front(&self) -> bool {
        self.lead >= -TOUCHING * self.seen.abs()
    }
}

/// See [`March::pixels`].
struct Pixels {
    along: i32,
    nearest: i32,
    /// 1 or −1.
    towards: i32,
    share: f32,
}

/// Centres of pixels along the main direction of a line.
struct Centres {
    first: f32,
    step: f32,
    start: f32,
    delta: f32,
    count: u32,
}

impl Centres {
    /// The place on the line, as a share of it.
    fn at(&self, i: u32) -> f32 {
        (self.first + self.step * i as f32 - self.start) / self.delta
    }
}

impl March<'_> {
    /// The pixel that a ray meets, and the distance to it.
    fn follow(&self, origin: Vec3, direction: Vec3) -> Option<((u32, u32), f32)> {
        let (line, range) = self.line(origin, direction)?;
        let stride = self.settings.stride.max(1);
        let centres = line.centres(range);
        let steps = centres.count.div_ceil(stride).min(self.settings.steps);
        let (mut before, mut in_front) = (range.0, true);
        for step in 0..steps {
            let last = ((step + 1) * stride).min(centres.count) - 1;
            let s = centres.at(last);
            if self.is_far_in_front(&line, s) {
                (before, in_front) = (s, true);
                continue;
            }
            let now = self.look(&line, s);
            if in_front && self.meets(line.at(before), &now) {
                let first = step * stride;
                let fine = if first < last {
                    self.refine(&line, before, (first..=last).map(|i| centres.at(i)))
                } else {
                    Some((before, now))
                };
                if let Some((a, b)) = fine {
                    // Where the ray begins there is nothing to compare with.
                    let a = if a == range.0 { Look::nothing(a, 0.0) } else { self.look(&line, a) };
                    return self.hit(&line, &a, &b);
                }
            }
            (before, in_front) = (s, now.is_in_front());
        }
        None
    }

    /// The part of the line that is on the screen, as shares of the way.
    fn line(&self, origin: Vec3, direction: Vec3) -> Option<(Line, (f32, f32))> {
        let (from, towards) = (self.screen.view(origin), self.screen.turn(direction));
        let mut length = self.settings.distance;
        let perspective = self.screen.perspective;
        if perspective && towards.z < 0.0 {
            length = length.min(from.z * (1.0 - NEAR) / -towards.z);
        }
        let usable = (!perspective || from.z > 0.0) && length > 0.0 && from.is_finite();
        if !usable || direction == Vec3::ZERO || !towards.is_finite() {
            return None;
        }
        let to = from + towards * length;
        let (start, end) = (self.screen.pixel(from), self.screen.pixel(to));
        let delta = end - start;
        if !(start.is_finite() && delta.is_finite()) || delta == Vec2::ZERO {
            return None;
        }
        let nearness = self.screen.nearness(from.z);
        let slope = self.screen.nearness(to.z) - nearness;
        let along_x = delta.x.abs() >= delta.y.abs();
        let line = Line { start, delta, along_x, nearness, slope, length };
        // Liang and Barsky's clipping to the screen (ACM Transactions on Graphics 1984).
        let (mut low, mut high) = (0.0f32, 1.0f32);
        let size = self.nearness.size();
        for (p, d, most) in [(start.x, delta.x, size.0 as f32), (start.y, delta.y, size.1 as f32)] {
            if d == 0.0 {
                if !(0.0..most).contains(&p) {
                    return None;
                }
                continue;
            }
            let (a, b) = (-p / d, (most - p) / d);
            low = low.max(a.min(b));
            high = high.min(a.max(b));
        }
        (low < high).then_some((line, (low, high)))
    }

    /// Two pixels at a place whose coordinate along the line's main direction is that of a pixel's
    /// centre: the nearest, the next across that direction, and how far towards it the place is.
    #[inline]
    fn pixels(&self, line: &Line, s: f32) -> Pixels {
        let place = line.start + s * line.delta;
        let (along, across) = if line.along_x { (place.x, place.y) } else { (place.y, place.x) };
        // Places are on the screen: rounding towards zero is rounding down.
        let (along, nearest) = (along as i32, across as i32);
        let off = across - 0.5 - nearest as f32;
        Pixels { along, nearest, towards: if off < 0.0 { -1 } else { 1 }, share: off.abs() }
    }

    /// Nearness of one of those pixels, or NaN.
    #[inline]
    fn at(&self, line: &Line, pixels: &Pixels, steps: i32) -> f32 {
        let across = pixels.nearest + steps * pixels.towards;
        let (x, y) = if line.along_x { (pixels.along, across) } else { (across, pixels.along) };
        let (width, height) = self.nearness.size();
        // Negative numbers become large ones.
        let inside = (x as u32) < width && (y as u32) < height;
        if inside { self.nearness.get(x as u32, y as u32) } else { f32::NAN }
    }

    /// Whether the ray is in front of both pixels at a place: most are.
    #[inline]
    fn is_far_in_front(&self, line: &Line, s: f32) -> bool {
        let ray = line.at(s);
        let pixels = self.pixels(line, s);
        let here = self.at(line, &pixels, 0);
        let next = self.at(line, &pixels, 1);
        (ray >= here || here.is_nan()) && (ray >= next || next.is_nan())
    }

    /// The ray and the picture at a place of the line.
    fn look(&self, line: &Line, s: f32) -> Look {
        let ray = line.at(s);
        let seen = self.seen(line, s);
        if seen.is_nan() { Look::nothing(s, ray) } else { Look { s, lead: ray - seen, ray, seen } }
    }

    /// Nearness of what is seen at a place: in between of two pixels if both are of one surface. NaN
    /// where nothing is seen.
    fn seen(&self, line: &Line, s: f32) -> f32 {
        let pixels = self.pixels(line, s);
        let (here, next) = (self.at(line, &pixels, 0), self.at(line, &pixels, 1));
        if here.is_nan() || next.is_nan() {
            return here;
        }
        let change = next - here;
        // Steep surfaces change much from pixel to pixel, but evenly. NaN is not even.
        let goes_on = |from: f32, to: f32| (to - from - change).abs() < 0.2 * change.abs();
        let smooth = self.is_close(here, next)
            || goes_on(self.at(line, &pixels, -1), here)
            || goes_on(next, self.at(line, &pixels, 2));
        if smooth { here + change * pixels.share } else { here }
    }

    /// Whether two pixels side by side are of one surface.
    fn is_close(&self, a: f32, b: f32) -> bool {
        let (a, b) = (self.screen.depth(a), self.screen.depth(b));
        (a - b).abs() <= self.settings.thickness.min(STEEP * a.abs())
    }

    /// Whether the ray, of the nearness `before` one step earlier, passes from in front of the picture
    /// to behind it, but not behind the thickness of what is seen.
    fn meets(&self, before: f32, now: &Look) -> bool {
        let entering = self.screen.depth(before.max(now.ray));
        !now.is_in_front() && entering <= self.screen.depth(now.seen) + self.settings.thickness
    }

    /// The step from one pixel to the next at which the ray meets something, if it does: where it
    /// begins, and what is at its end.
    fn refine(
        &self,
        line: &Line,
        mut before: f32,
        places: impl Iterator<Item = f32>,
    ) -> Option<(f32, Look)> {
        let mut in_front = true;
        for s in places {
            let now = self.look(line, s);
            if in_front && self.meets(line.at(before), &now) {
                return Some((before, now));
            }
            (before, in_front) = (s, now.is_in_front());
        }
        None
    }

    /// Where between two places the ray meets the picture: where their nearness is the same, if it is
    /// one surface, else at the second place.
    fn hit(&self, line: &Line, a: &Look, b: &Look) -> Option<((u32, u32), f32)> {
        let one_surface = a.lead.is_finite() && self.is_close(a.seen, b.seen);
        let share = if one_surface { a.lead / (a.lead - b.lead) } else { 1.0 };
        let s = a.s + (b.s - a.s) * share.clamp(0.0, 1.0);
        let place = line.start + s * line.delta;
        let (width, height) = self.nearness.size();
        let (x, y) = (place.x.max(0.0) as u32, place.y.max(0.0) as u32);
        let (x, y) = (x.min(width - 1), y.min(height - 1));
        let distance = line.distance(s, self.screen.perspective);
        (distance.is_finite() && distance > 0.0).then_some(((x, y), distance))
    }
}

impl Line {
    /// The centres of pixels on a part of the line, but the one where it begins.
    fn centres(&self, (low, high): (f32, f32)) -> Centres {
        let (start, delta) =
            if self.along_x { (self.start.x, self.delta.x) } else { (self.start.y, self.delta.y) };
        let (from, to) = (start + low * delta - 0.5, start + high * delta - 0.5);
        let (first, count) = if delta > 0.0 {
            (from.floor() + 1.0, to.floor() - from.floor())
        } else {
            (from.ceil() - 1.0, from.ceil() - to.ceil())
        };
        Centres { first: first + 0.5, step: delta.signum(), start, delta, count: count as u32 }
    }

    /// Nearness of the ray.
    #[inline]
    fn at(&self, s: f32) -> f32 {
        self.nearness + self.slope * s
    }

    /// Distance along the ray, of which distance times nearness is linear.
    #[inline]
    fn distance(&self, s: f32, perspective: bool) -> f32 {
        if perspective {
            s * self.length * (self.nearness + self.slope) / self.at(s)
        } else {
            s * self.length
        }
    }
}
