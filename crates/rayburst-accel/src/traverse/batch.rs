//! What becomes of a batch of rays: bundles where consecutive rays go the same way, the others
//! interleaved, sorted if that is asked for.

use std::cell::Cell;

use glam::Vec3;
use rayburst_math::Ray;
use rayburst_simd::Isa;

use super::{
    answers::Answers,
    bundle::{self, BUNDLE},
    count::Count,
    interleaved, stream,
};
use crate::{
    CandidateFilter, TraceMode,
    structure::{Structure, Tracer},
};

/// Rays that are looked at before those without a bundle are traced.
const PIECE: usize = 64 * BUNDLE;

thread_local! {
    /// Indices of rays without a bundle, kept between batches; taken while in use.
    static OTHERS: Cell<Vec<u32>> = const { Cell::new(Vec::new()) };
}

/// Traces a batch.
#[inline(always)]
pub(crate) fn trace<'a, I: Isa, S: Structure, F: CandidateFilter, C: Count, A: Answers>(
    tracer: &mut Tracer<'a, I, S, F, C>,
    rays: &'a [Ray],
    counts: &mut [C],
    answers: &mut A,
) {
    let mode = tracer.options.mode;
    let sorts = mode == TraceMode::Stream;
    let bundles = !S::TWO_LEVEL && mode != TraceMode::Interleaved;
    let size = if sorts { stream::PIECE } else { PIECE };
    let mut others = OTHERS.take();
    let mut luck = Luck::default();
    for piece in (0..rays.len()).step_by(size) {
        others.clear();
        let end = (piece + size).min(rays.len());
        if sorts {
            stream::sort(&rays[piece..end], piece as u32, &mut others);
        }
        let unsorted = if sorts { end } else { piece };
        for first in (unsorted..end).step_by(BUNDLE) {
            let part = first..(first + BUNDLE).min(end);
            let before = others.len();
            if bundles
                && (mode == TraceMode::Packet || (is_coherent(&rays[part.clone()]) && luck.tries()))
            {
                bundle::trace(tracer, rays, first, counts, answers, &mut others);
                luck.note(2 * (others.len() - before) < part.len());
            } else {
                others.extend(part.map(|index| index as u32));
            }
        }
        if !others.is_empty() {
            interleaved::trace(tracer, rays, &others, counts, answers);
        }
    }
    OTHERS.set(others);
}

/// Whether a few rays of a part go about the same way.
#[inline(always)]
fn is_coherent(part: &[Ray]) -> bool {
    let [first, .., last] = part else {
        return false;
    };
    let (leads, count) = (first.direction, part.len());
    let (Some(second), Some(third)) = (part.get(count / 3), part.get(count * 2 / 3)) else {
        return false;
    };
    count >= BUNDLE / 2
        && is_alike(leads, last)
        && is_alike(leads, second)
        && is_alike(leads, third)
}

/// Whether a ray goes about the way of a direction: within 37°. Not a closure: called more than once, it
/// would not be inlined for sure.
#[inline(always)]
fn is_alike(leads: Vec3, ray: &Ray) -> bool {
    let (d, cosine) = (ray.direction, leads.dot(ray.direction));
    cosine > 0.0 && cosine * cosine > 0.64 * leads.length_squared() * d.length_squared()
}

/// Whether bundles paid lately: after failures they are tried now and then only.
#[derive(Default)]
struct Luck {
    failures: u32,
    waits: u32,
}

impl Luck {
    #[inline(always)]
    fn tries(&mut self) -> bool {
        let tries = self.waits == 0;
        self.waits = self.waits.saturating_sub(1);
        tries
    }

    #[inline(always)]
    fn note(&mut self, paid: bool) {
        self.failures = if paid { 0 } else { (self.failures + 1).min(5) };
        self.waits = if self.failures < 2 { 0 } else { (1 << self.failures) - 1 };
    }
}
