//! Ambient occlusion from depth alone.
//!
//! Jimenez, Wu, Pesce, Jarabo: "Practical Real-Time Strategies for Accurate Indirect Occlusion",
//! SIGGRAPH 2016 courses (GTAO); horizons after Bavoil, Sainz, Dimitrov: "Image-Space Horizon-Based
//! Ambient Occlusion", SIGGRAPH 2008 talks. The hemisphere over a point is cut into slices through the
//! direction to the eye; along each the depth buffer is searched on both sides for the highest horizon
//! within the radius, and the cosine-weighted open part of the slice has a closed form.
//!
//! It is what rays of the same length would see if the depth buffer were solid behind what it shows,
//! and if nothing were outside it: thin things take too much light away, things that are hidden or off
//! screen none. Slices are even around the direction to the eye, not on the screen, so that the edges
//! of wide views are not favoured.

use std::f32::consts::{FRAC_PI_2, PI};

use rayburst_image::{Band, Plane, Plane3};
use rayburst_math::{
    Frame,
    glam::{Vec2, Vec3},
    hash,
};
use rayon::prelude::*;

use super::{
    gbuffer::BAND,
    screen::{Screen, check_size, fit},
    view::FrameView,
};
use crate::Result;

/// The most slices a pixel and samples a side of a slice.
const MOST: u32 = 64;
/// Sine of the elevation over the surface up to which what is seen counts as the surface itself.
const LEAST_ELEVATION: f32 = 0.01;

/// How [`screen_occlusion`] searches.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ScreenOcclusion {
    /// What is further from a point does not darken it; world units. Nothing does if it is not
    /// positive.
    pub radius: f32,
    /// Slices a pixel, 1 to 64.
    pub slices: u32,
    /// Samples on each of a slice's two sides, 1 to 64.
    pub steps: u32,
    /// Turns the slices and shifts the samples of each pixel.
    pub seed: u32,
    /// Number of the frame; turns them differently each frame.
    pub frame: u32,
}

impl Default for ScreenOcclusion {
    fn default() -> Self {
        Self { radius: 1.0, slices: 2, steps: 6, seed: 0, frame: 0 }
    }
}

/// The cosine-weighted open share of the hemisphere over each pixel's surface, from 0 to 1; 1 where
/// nothing is seen.
///
/// `depth` is the distance along the camera's forward axis in world units, +∞ where nothing is;
/// `normal` the unit geometric normal in the world, on either side. `visibility` is made anew if it is
/// not of their size. The same bits for any number of threads. Fails if sizes of inputs differ.
pub fn screen_occlusion(
    depth: &Plane,
    normal: &Plane3,
    view: &FrameView,
    settings: &ScreenOcclusion,
    visibility: &mut Plane,
) -> Result<()> {
    check_size("the plane of normals", normal.size(), depth.size())?;
    check_size("the view", view.size(), depth.size())?;
    fit(visibility, depth.size())?;
    let pass = Pass { depth, normal, screen: Screen::new(view), settings };
    let mut bands: Vec<Band<'_>> = visibility.bands_mut(BAND).collect();
    bands.par_iter_mut().for_each(|band| {
        for y in band.top()..band.top() + band.rows() {
            for (x, open) in (0..).zip(band.row_mut(y)) {
                *open = pass.open(x, y);
            }
        }
    });
    Ok(())
}

struct Pass<'a> {
    depth: &'a Plane,
    normal: &'a Plane3,
    screen: Screen,
    settings: &'a ScreenOcclusion,
}

/// A surface point in view space.
struct Point {
    position: Vec3,
    normal: Vec3,
    to_eye: Vec3,
    pixel: Vec2,
}

impl Pass<'_> {
    /// What is open over a pixel.
    fn open(&self, x: u32, y: u32) -> f32 {
        let depth = self.depth.get(x, y);
        let radius = self.settings.radius;
        let searches = radius > 0.0 && radius.is_finite();
        if !searches || !self.screen.is_surface(depth) {
            return 1.0;
        }
        let pixel = Vec2::new(x as f32 + 0.5, y as f32 + 0.5);
        let position = self.screen.at(pixel, depth);
        let to_eye =
            if self.screen.perspective { -position.normalize_or(Vec3::Z) } else { -Vec3::Z };
        let normal = self.screen.turn(self.normal.get(x, y)).normalize_or(to_eye);
        let normal = if normal.dot(to_eye) < 0.0 { -normal } else { normal };
        let point = Point { position, normal, to_eye, pixel };
        // The radius in pixels where it is nearest to the eye, at most the whole picture.
        let nearest = (depth - radius).max(0.5 * depth).max(f32::MIN_POSITIVE);
        let (width, height) = self.depth.size();
        let reach = self.screen.pixels(radius, nearest).min((width + height) as f32);
        let random = hash::words(&[self.settings.seed, self.settings.frame, x, y]);
        let turn = hash::to_unit(random);
        let shift = hash::to_unit(hash::pcg(random));
        let around = Frame::from_normal(to_eye);
        let slices = self.settings.slices.clamp(1, MOST);
        let mut open = 0.0;
        for slice in 0..slices {
            let angle = PI * (slice as f32 + turn) / slices as f32;
            let (sin, cos) = angle.sin_cos();
            let along = around.to_world(Vec3::new(cos, sin, 0.0));
            open += self.open_in_slice(
                &point,
                along,
                reach,
                (shift + slice as f32 * 0.618_034).fract(),
            );
        }
        let open = open / slices as f32;
        if open.is_finite() { open.clamp(0.0, 1.0) } else { 1.0 }
    }

    /// The open part of the slice through the direction to the eye and `along`, a unit vector at right
    /// angles to it; 1 on average over all slices where nothing occludes.
    fn open_in_slice(&self, point: &Point, along: Vec3, reach: f32, shift: f32) -> f32 {
        let Point { position, normal, to_eye, .. } = *point;
        let across = along.cross(to_eye);
        let projected = normal - across * normal.dot(across);
        let length = projected.length();
        let Some(direction) = self.direction(position, along).filter(|_| length > 0.0) else {
            return length;
        };
        let tilt = (projected.dot(along)).atan2(projected.dot(to_eye));
        let side = |sign: f32| self.horizon(point, sign * direction, reach, shift);
        let (right, left) = (side(1.0), -side(-1.0));
        // Horizons are angles from the direction to the eye; none is below the surface.
        let arc = |horizon: f32| {
            let h = tilt + (horizon - tilt).clamp(-FRAC_PI_2, FRAC_PI_2);
            0.25 * (-(2.0 * h - tilt).cos() + tilt.cos() + 2.0 * h * tilt.sin())
        };
        length * (arc(right) + arc(left))
    }

    /// Unit direction on the screen in which a move along a view-space direction leads.
    fn direction(&self, position: Vec3, along: Vec3) -> Option<Vec2> {
        let moved = if self.screen.perspective {
            along.truncate() * position.z - position.truncate() * along.z
        } else {
            along.truncate()
        };
        (moved * Vec2::new(1.0, -1.0)).try_normalize()
    }

    /// The highest horizon within the radius along a direction of the screen, as an angle from the
    /// direction to the eye.
    fn horizon(&self, point: &Point, direction: Vec2, reach: f32, shift: f32) -> f32 {
        let steps = self.settings.steps.clamp(1, MOST);
        let radius = self.settings.radius;
        let mut highest = -1.0f32;
        let mut before: Option<Vec3> = None;
        for step in 0..steps {
            // Closer together near the point, where occluders cover more.
            let t = (step as f32 + shift) / steps as f32;
            let place = point.pixel + direction * (reach * t * t).max(1.0);
            let Some(to) = self.seen(point, place) else {
                before = None;
                continue;
            };
            let distance = to.length();
            if distance <= radius {
                highest = highest.max(elevation(point, to, distance));
            } else if let Some(inside) = before.filter(|b| b.length_squared() < radius * radius) {
                // The surface goes on to where the radius ends, between two samples.
                let step = to - inside;
                if step.length() <= radius {
                    let end = inside + step * leaves_sphere(inside, step, radius);
                    highest = highest.max(elevation(point, end, end.length()));
                }
            }
            before = Some(to);
        }
        highest.clamp(-1.0, 1.0).acos()
    }

    /// From a point to what a place of the picture shows.
    fn seen(&self, point: &Point, place: Vec2) -> Option<Vec3> {
        let (width, height) = self.depth.size();
        let inside =
            place.cmpge(Vec2::ZERO).all() && place.x < width as f32 && place.y < height as f32;
        if !inside {
            return None;
        }
        let (x, y) = (place.x as u32, place.y as u32);
        let depth = self.depth.get(x, y);
        let centre = Vec2::new(x as f32 + 0.5, y as f32 + 0.5);
        let to = self.screen.at(centre, depth) - point.position;
        self.screen.is_surface(depth).then_some(to)
    }
}

/// Cosine of the angle between the direction to the eye and that to something; −1 if that is not above
/// the surface.
fn elevation(point: &Point, to: Vec3, distance: f32) -> f32 {
    let above = to.dot(point.normal) > LEAST_ELEVATION * distance && distance > 0.0;
    if above { to.dot(point.to_eye) / distance } else { -1.0 }
}

/// The share of a step at which it leaves a sphere around the origin, in which it begins.
fn leaves_sphere(from: Vec3, step: Vec3, radius: f32) -> f32 {
    let (a, b) = (step.length_squared(), from.dot(step));
    let c = from.length_squared() - radius * radius;
    let root = (b * b - a * c).max(0.0).sqrt();
    ((root - b) / a.max(f32::MIN_POSITIVE)).clamp(0.0, 1.0)
}
