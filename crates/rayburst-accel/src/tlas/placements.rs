//! Where all instances are, and the tree over their boxes.

use std::sync::Arc;

use glam::{Affine3A, Vec3, Vec4};
use rayburst_math::Aabb;
use rayon::prelude::*;

use super::{Placed, place};
use crate::{
    Blas, BuildError, BuildOptions, Instance,
    build::{
        boxes::{Boxes, TASK, twice_the_centre},
        monitor::Monitor,
        primitives::MAX_PRIMITIVES,
    },
    layout::bvh8::Bvh8,
};

/// All instances in the world.
pub(crate) struct Placements {
    spots: Vec<Spot>,
    summary: Summary,
}

/// What an instance takes up in the world.
#[derive(Clone, Copy)]
struct Spot {
    /// Empty if the instance cannot be hit.
    bounds: Aabb,
    condition: f32,
}

/// What is known of many instances: minima, maxima and a count of those that can be hit, so the order
/// in which they are merged does not matter.
#[derive(Clone, Copy)]
struct Summary {
    active: usize,
    first: u32,
    condition: f32,
    translation: f32,
    /// The box around twice the boxes' centres.
    centres: [Vec4; 2],
}

impl Summary {
    const NONE: Self = Self {
        active: 0,
        first: u32::MAX,
        condition: 1.0,
        translation: 0.0,
        centres: [Vec4::INFINITY, Vec4::NEG_INFINITY],
    };

    fn of(index: usize, instance: &Instance, spot: &Spot) -> Self {
        if spot.bounds.is_empty() {
            return Self::NONE;
        }
        Self {
            active: 1,
            first: index as u32,
            condition: spot.condition,
            translation: Vec3::from(instance.transform.translation).abs().max_element(),
            centres: [twice_the_centre(&spot.bounds); 2],
        }
    }

    fn merge(self, other: Self) -> Self {
        let ([lower, upper], [other_lower, other_upper]) = (self.centres, other.centres);
        Self {
            active: self.active + other.active,
            first: self.first.min(other.first),
            condition: self.condition.max(other.condition),
            translation: self.translation.max(other.translation),
            centres: [lower.min(other_lower), upper.max(other_upper)],
        }
    }
}

/// Whether there can be so many instances, and their BLASes are there.
pub(super) fn check(blases: &[Arc<Blas>], instances: &[Instance]) -> Result<(), BuildError> {
    if instances.len() > MAX_PRIMITIVES {
        let (count, limit) = (instances.len(), MAX_PRIMITIVES);
        return Err(BuildError::TooMany { what: "instances", count, limit });
    }
    let unknown = |instance: &Instance| {
        instance.blas != Instance::NO_BLAS && instance.blas as usize >= blases.len()
    };
    match instances.iter().position(unknown) {
        Some(index) => Err(BuildError::NoSuchBlas {
            instance: index as u32,
            blas: instances[index].blas,
            blases: blases.len(),
        }),
        None => Ok(()),
    }
}

impl Placements {
    /// Places instances that were checked, given the boxes of what counts in BLASes, and writes what rays
    /// must know of them.
    pub(crate) fn new(
        blases: &[Arc<Blas>],
        instances: &[Instance],
        bounds_of: fn(&Blas) -> Aabb,
        placed: &mut Vec<Placed>,
    ) -> Self {
        let mut spots = Vec::new();
        let place_one = |instance: &Instance| {
            let bounds = blases.get(instance.blas as usize).map(|blas| bounds_of(blas));
            let placement = place(instance, &bounds.unwrap_or(Aabb::EMPTY));
            let placed = Placed {
                inverse: placement.inverse,
                blas: instance.blas,
                mask: instance.mask,
                flags: instance.flags,
                identity: instance.transform == Affine3A::IDENTITY,
            };
            (placed, Spot { bounds: placement.bounds, condition: placement.condition })
        };
        instances.par_iter().with_min_len(TASK).map(place_one).unzip_into_vecs(placed, &mut spots);
        let summary = instances
            .par_iter()
            .zip(&spots)
            .enumerate()
            .with_min_len(TASK)
            .fold(
                || Summary::NONE,
                |sum, (index, (instance, spot))| sum.merge(Summary::of(index, instance, spot)),
            )
            .reduce(|| Summary::NONE, Summary::merge);
        Self { spots, summary }
    }

    /// How many can be hit.
    pub(crate) fn active(&self) -> usize {
        self.summary.active
    }

    /// The only instance that can be hit, if there is just one.
    pub(super) fn sole(&self) -> Option<u32> {
        (self.summary.active == 1).then_some(self.summary.first)
    }

    /// The greatest κ.
    pub(crate) fn condition(&self) -> f32 {
        self.summary.condition
    }

    /// The greatest coordinate of a translation or of the box around all.
    pub(crate) fn reach(&self, bounds: &Aabb) -> f32 {
        let translation = self.summary.translation;
        if bounds.is_empty() {
            return translation;
        }
        bounds.lower.abs().max(bounds.upper.abs()).max_element().max(translation)
    }

    /// The box of an instance, empty if it cannot be hit.
    pub(crate) fn bounds(&self, index: u32) -> Aabb {
        self.spots[index as usize].bounds
    }

    /// Builds the tree over the boxes.
    pub(crate) fn tree(&self, options: &BuildOptions<'_>) -> Result<Bvh8, BuildError> {
        let Summary { active, centres, .. } = self.summary;
        let bounds_of = |index| self.bounds(index);
        let boxes = Boxes { count: self.spots.len(), active, centres, bounds_of };
        boxes.tree(options, Monitor::default())
    }
}
