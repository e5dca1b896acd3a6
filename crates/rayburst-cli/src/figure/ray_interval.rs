//! Figure 26.7: a ray's interval from t_min to t_max; hits outside are not reported.

use rayburst::{
    glam::Vec2,
    math::{Ray, hash::Rng},
    pipeline::{Barycentrics, HitGroup, RwBuffer, ShaderTable},
    prelude::RayFlags,
};

use super::{
    Drawing,
    canvas::{Anchor, Canvas, Ink, Pen, Style, ink},
    slice::{Slice, SliceBuilder, Substance},
};
use crate::error::{CliError, Result};

const ORIGIN: Vec2 = Vec2::new(0.5, 1.4);
const DIRECTION: Vec2 = Vec2::new(1.0, 0.12);
/// The interval that is drawn.
const INTERVAL: (f32, f32) = (2.5, 7.2);
/// Rays that are checked.
const RAYS: u32 = 20_000;

/// Draws a ray through five things, of which two lie outside of its interval.
pub(super) fn draw() -> Result<Drawing> {
    let mut canvas = Canvas::new(790, 350)?;
    let slice = things(canvas.size().y)?;
    canvas.heading(
        "Figure 26.7 · the interval of a ray",
        "Only what lies between t_min and t_max counts as a hit; the nearest of it is the closest hit.",
    );
    slice.draw(&mut canvas);
    let whole = ray(0.0, f32::INFINITY);
    let at = |t: f32| slice.page(whole.at(t).truncate());
    canvas.line(at(0.0), at(INTERVAL.0), Pen::dashed(ink::GREY, 1.4));
    canvas.arrow(at(INTERVAL.1), at(9.6), Pen::dashed(ink::GREY, 1.4));
    canvas.line(at(INTERVAL.0), at(INTERVAL.1), Pen::new(ink::BLUE, 2.6));
    for (t, name) in [(INTERVAL.0, "t_min"), (INTERVAL.1, "t_max")] {
        let across = (at(1.0) - at(0.0)).normalize().perp();
        canvas.line(at(t) - 16.0 * across, at(t) + 16.0 * across, Pen::new(ink::BLUE, 2.6));
        let below = at(t) + Vec2::new(0.0, 36.0);
        canvas.text(below, name, 15.0, ink::BLUE, Anchor::Middle, Style::Bold);
    }
    canvas.circle(at(0.0), 4.5, ink::BLACK, None);
    canvas.label(at(0.0) + Vec2::new(0.0, 24.0), "origin", ink::BLACK, Anchor::Middle);

    let all = slice.hits(&whole);
    let inside = slice.hits(&ray(INTERVAL.0, INTERVAL.1));
    for hit in &all {
        let counts = inside.iter().any(|other| other.t == hit.t);
        let (fill, pen): (Ink, Pen) = match counts {
            true => (ink::GREEN, Pen::new(ink::BLACK, 1.0)),
            false => (ink::PAPER, Pen::new(ink::GREY, 1.4)),
        };
        canvas.circle(at(hit.t), 4.6, fill, Some(pen));
    }
    if let Some(first) = inside.first() {
        let from = at(first.t) + Vec2::new(-34.0, -58.0);
        canvas.arrow(from, at(first.t) + Vec2::new(-4.0, -7.0), Pen::new(ink::GREEN, 1.6));
        canvas.label(from + Vec2::new(0.0, -7.0), "closest hit", ink::GREEN, Anchor::Middle);
    }
    let check = check(&slice)?;
    let boundary = boundary(&slice)?;
    canvas.footing(&format!(
        "{} of the line's {} hits are in the interval; {} of {RAYS} random rays report a hit outside of theirs.",
        inside.len(),
        all.len(),
        check.outside
    ));
    let numbers = vec![
        ("hits of the whole line", all.len().to_string()),
        ("hits in the interval", inside.len().to_string()),
        ("random rays with random intervals", RAYS.to_string()),
        ("hits of their whole lines", check.hits.to_string()),
        ("reported outside of the interval", check.outside.to_string()),
        ("missing inside of the interval", check.missing.to_string()),
        (
            "queries: hits at t = t_min and at t = t_max",
            format!("{} of 2 reported", boundary.queries),
        ),
        ("shaders, triangles: the same", format!("{} of 2 reported", boundary.shaders)),
    ];
    Ok(Drawing { picture: canvas.into_image(), numbers })
}

fn ray(t_min: f32, t_max: f32) -> Ray {
    Ray::with_interval(ORIGIN.extend(0.0), DIRECTION.extend(0.0), t_min, t_max)
}

fn things(page_height: f32) -> Result<Slice> {
    let mut builder = SliceBuilder::default();
    let is = Substance::default();
    let inside = (ink::SKY, ink::BLUE);
    let outside = (ink::STONE, ink::GREY);
    builder.disk(Vec2::new(2.05, 1.45), 0.5, outside, is);
    let triangle = [Vec2::new(3.7, 0.9), Vec2::new(5.0, 1.2), Vec2::new(4.1, 2.8)];
    builder.polygon(&triangle, inside, is);
    builder.disk(Vec2::new(6.2, 2.2), 0.62, inside, is);
    builder.rectangle(Vec2::new(8.5, 1.4), Vec2::new(9.3, 3.1), outside, is);
    builder.build(page_height)
}

struct Check {
    hits: usize,
    outside: usize,
    missing: usize,
}

/// The hits of random rays against those of their whole lines.
fn check(slice: &Slice) -> Result<Check> {
    let mut rng = Rng::new(267);
    let mut check = Check { hits: 0, outside: 0, missing: 0 };
    for _ in 0..RAYS {
        let origin = Vec2::new(rng.range(0.0, 10.0), rng.range(0.0, 4.0));
        let direction =
            Vec2::from_angle(rng.range(0.0, std::f32::consts::TAU)) * rng.range(0.3, 3.0);
        let (a, b) = (rng.range(-5.0, 12.0), rng.range(-5.0, 12.0));
        let [origin, direction] = [origin, direction].map(|v: Vec2| v.extend(0.0));
        let part = Ray::with_interval(origin, direction, a.min(b), a.max(b));
        let whole = Ray { t_min: f32::NEG_INFINITY, t_max: f32::INFINITY, ..part };
        let contains = |t: f32| part.t_min <= t && t <= part.t_max;
        let (all, reported) = (slice.hits(&whole), slice.hits(&part));
        check.hits += all.len();
        check.outside += reported.iter().filter(|hit| !contains(hit.t)).count();
        let expected = all.iter().filter(|hit| contains(hit.t)).count();
        check.missing += expected.saturating_sub(reported.len());
    }
    Ok(check)
}

struct Boundary {
    queries: u32,
    shaders: u32,
}

/// Whether hits at the very ends of the interval are reported, by queries and by shaders.
fn boundary(slice: &Slice) -> Result<Boundary> {
    let Some(first) = slice.hits(&ray(0.0, f32::INFINITY)).first().map(|hit| hit.t) else {
        return Err(CliError::failed("the figure's ray meets nothing"));
    };
    let ends = [ray(first, first.next_up()), ray(first.next_down(), first)];
    let queries = ends.iter().filter(|ray| !slice.hits(ray).is_empty()).count() as u32;
    let reported = RwBuffer::<u32>::new(1);
    let mut table = ShaderTable::new();
    let any = table.ray_type::<()>("any", 0, 0, 0);
    table.no_miss();
    let group = HitGroup::<(), Barycentrics>::triangles("thing").closest_hit(|_, ()| {
        reported.atomic_add(0, 1);
    });
    table.hit(&group, ());
    let generate = table.ray_generation(|launch| {
        for ray in &ends {
            launch.trace_ray(any, RayFlags::empty(), 0xFF, ray, &mut ());
        }
    });
    let failed = |e: &dyn std::fmt::Display| CliError::failed(e.to_string());
    let pipeline = table.build(1).map_err(|e| failed(&e))?;
    pipeline.dispatch_rays(slice.structure(), generate, 1, 1, 1).map_err(|e| failed(&e))?;
    Ok(Boundary { queries, shaders: reported.load(0) })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn nothing_outside_is_reported_and_nothing_inside_is_missing() {
        let slice = things(350.0).unwrap();
        let Check { hits, outside, missing } = check(&slice).unwrap();
        assert!(hits > 1000 && outside == 0 && missing == 0, "{hits} {outside} {missing}");
        let Boundary { queries, shaders } = boundary(&slice).unwrap();
        assert_eq!((queries, shaders), (2, 0));
        assert_eq!(slice.hits(&ray(INTERVAL.0, INTERVAL.1)).len(), 4);
    }
}
