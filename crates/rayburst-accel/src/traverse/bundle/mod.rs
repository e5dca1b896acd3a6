//! Bundles of up to 64 coherent rays that go through the tree together.
//!
//! A bundle visits a node once for all its rays. An interval of rays (see [`Frustum`]) is tested
//! against the eight children first; each child that it meets is then tested against the groups of
//! sixteen rays until one group meets it (the first active group; Wald, Boulos, Shirley, "Ray tracing
//! deformable scenes using dynamic bounding volume hierarchies", 2007, who track the first ray), so a
//! child costs little more for 64 rays than for one. In leaves, triangles are tested against the
//! groups that meet the leaf's box.
//!
//! The rays of a bundle agree in the signs of their directions, in the longest component and in its
//! power of two. Rays for which the tests in groups are in doubt, and blocks that the filter has a say
//! in, are left to the tests of single rays, so that the answers are the same bits.

mod rays;
mod walk;

use rayburst_math::Ray;
use rayburst_simd::{GROUP, Isa, Rays16};

use super::{answers::Answers, bits::take_bit, count::Count, prepare, query::Query};
use crate::{
    CandidateFilter,
    structure::{Structure, Tracer},
};
use rays::Bundle;
use walk::Pilot;

/// Rays in a bundle.
pub(crate) const BUNDLE: usize = 64;
const GROUPS: usize = BUNDLE / GROUP;

/// Rays that agree make a bundle only if there are as many.
const FEWEST: u32 = 16;

/// The key of rays that no bundle takes: invalid, of extreme lengths, backwards in time, or with an
/// interval that ends where numbers are not exact.
const UNABLE: u32 = u32::MAX;

/// Exponents of the longest component at which scales and distances are far from the ends of `f32`.
const EXPONENTS: std::ops::Range<u32> = 64..190;

/// What each of sixteen rays must agree in with the others of its bundle: signs, longest component
/// and its exponent.
#[inline(always)]
fn keys(rays: &Rays16) -> [u32; GROUP] {
    let mut keys = [UNABLE; GROUP];
    for (lane, key) in keys.iter_mut().enumerate() {
        let d = [rays.direction[0][lane], rays.direction[1][lane], rays.direction[2][lane]];
        let [x, y, z] = d.map(f32::abs);
        let xy = if x > y { x } else { y };
        let longest = if xy > z { xy } else { z };
        let axis = (u32::from(y > x) & u32::from(y >= z)) + 2 * u32::from(z > xy);
        let exponent = longest.to_bits() >> 23;
        let [sx, sy, sz] = d.map(|d| d.to_bits() >> 31);
        let o = [rays.origin[0][lane], rays.origin[1][lane], rays.origin[2][lane]];
        let [a, b, c] = o.map(f32::abs);
        let most = prepare::MAX_ORIGIN;
        let (t_min, t_max) = (rays.t_min[lane], rays.t_max[lane]);
        // False for NaN.
        let able = (a <= most)
            & (b <= most)
            & (c <= most)
            & (x <= f32::MAX)
            & (y <= f32::MAX)
            & (z <= f32::MAX)
            & (t_min >= 0.0)
            & (t_min <= t_max)
            & (t_max >= f32::MIN_POSITIVE)
            & EXPONENTS.contains(&exponent);
        *key = if able { sx | sy << 1 | sz << 2 | axis << 3 | exponent << 5 } else { UNABLE };
    }
    keys
}

/// Traces up to 64 rays of a batch from `first` on; those that belong in no bundle, or would not
/// profit, are appended to `others`.
#[inline(always)]
pub(crate) fn trace<'a, I: Isa, S: Structure, F: CandidateFilter, C: Count, A: Answers>(
    tracer: &mut Tracer<'a, I, S, F, C>,
    rays: &'a [Ray],
    first: usize,
    counts: &mut [C],
    answers: &mut A,
    others: &mut Vec<u32>,
) {
    let part = &rays[first..];
    let part = &part[..part.len().min(BUNDLE)];
    let Some(place) = tracer.structure.place(tracer.options) else {
        others.extend((first..first + part.len()).map(|index| index as u32));
        return;
    };
    let mut side_by_side = [Rays16::ZERO; GROUPS];
    let mut all_keys = [[UNABLE; GROUP]; GROUPS];
    let mut left = [0; GROUPS];
    for (group, part) in part.chunks(GROUP).enumerate() {
        let mut local = [[0.0; 8]; GROUP];
        let given: &[[f32; 8]] = bytemuck::cast_slice(part);
        let rows = match given.try_into() {
            Ok(rows) if !S::IS_INSTANCE => rows,
            _ => {
                for (row, ray) in local.iter_mut().zip(part) {
                    *row = bytemuck::cast(tracer.structure.local(ray));
                }
                &local
            }
        };
        tracer.isa.load16(rows, &mut side_by_side[group]);
        all_keys[group] = keys(&side_by_side[group]);
        left[group] = (1u32 << part.len()) - 1;
    }
    while let Some(group) = left.iter().position(|&lanes| lanes != 0) {
        let leader = left[group].trailing_zeros() as usize % GROUP;
        let key = all_keys[group][leader];
        let mut members = [0; GROUPS];
        for g in 0..GROUPS {
            let alike = (0..GROUP).fold(0, |m, l| m | u32::from(all_keys[g][l] == key) << l);
            members[g] = alike & left[g];
            left[g] &= !alike;
        }
        let size: u32 = members.iter().map(|m| m.count_ones()).sum();
        if key == UNABLE || size < FEWEST {
            for (g, mut lanes) in members.into_iter().enumerate() {
                while lanes != 0 {
                    others.push((first + g * GROUP) as u32 + take_bit(&mut lanes));
                }
            }
            continue;
        }
        let chief = tracer.structure.local(&part[group * GROUP + leader]);
        let last = members.iter().rposition(|&lanes| lanes != 0).unwrap_or(0);
        let other = last * GROUP + (31 - members[last].leading_zeros()) as usize % GROUP;
        let other = tracer.structure.local(&part[other]);
        let bounds = place.blas.bounds();
        let mut bundle =
            Bundle::new(tracer.isa, &side_by_side, members, [&chief, &other], key, &bounds);
        let mut pilot =
            Pilot { tracer: &mut *tracer, place: &place, rays, first, counts: &mut *counts };
        if C::ACTIVE {
            pilot.begin_counts(&members);
        }
        let complete = pilot.traverse::<A::Query>(&mut bundle);
        for (g, mut lanes) in members.into_iter().enumerate() {
            while lanes != 0 {
                let lane = take_bit(&mut lanes) as usize % GROUP;
                let index = first + g * GROUP + lane;
                let looking = bundle.active[g] >> lane & 1 != 0;
                let answered = if A::Query::ORDERED { complete } else { complete || !looking };
                if answered && bundle.left[g] >> lane & 1 == 0 {
                    let query = bundle.query::<A::Query>(g, lane, &rays[index], &place);
                    answers.end(tracer.structure, index, &query);
                } else {
                    others.push(index as u32);
                }
            }
        }
    }
}
