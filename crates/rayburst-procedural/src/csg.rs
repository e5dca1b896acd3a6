//! Constructive solid geometry: solids made of solids.

use std::ops::ControlFlow;

use rayburst_math::{Aabb, Ray};

use crate::crossed::InInterval;
use crate::{Crossing, IntervalList, Line, Shape, ShapeHit, Solid};

/// How two solids become one.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum Operation {
    /// What is in either.
    Union,
    /// What is in both.
    Intersection,
    /// What is in the first and not in the second.
    Difference,
}

impl Operation {
    fn of(self, first: bool, second: bool) -> bool {
        match self {
            Self::Union => first || second,
            Self::Intersection => first && second,
            Self::Difference => first && !second,
        }
    }
}

/// A solid made of two, which may be made of others in turn: along a line, the intervals inside both
/// are merged (Roth: "Ray Casting for Modeling Solids", Computer Graphics and Image Processing 1982).
///
/// Normals and coordinates are those of the solid whose surface is met; the normal of a solid taken
/// away is turned around. Surfaces nearer to each other than rounding are one surface, so nothing is
/// left between solids that end in the same place, and the operations are regularised: they leave no
/// parts without a volume (Requicha: "Representations for Rigid Solids", ACM Computing Surveys 1980).
/// Where such surfaces are met at grazing angles rounding can still leave slivers.
///
/// Operations nest on the stack: [`union_of`] keeps many solids shallow.
#[derive(Clone, Debug)]
pub struct Csg<A, B> {
    operation: Operation,
    first: A,
    second: B,
    bounds: Aabb,
}

impl<A: Solid, B: Solid> Csg<A, B> {
    /// Makes one solid of two.
    pub fn new(operation: Operation, first: A, second: B) -> Self {
        let bounds = match operation {
            Operation::Union => first.bounds().union(second.bounds()),
            Operation::Intersection => first.bounds().intersection(second.bounds()),
            Operation::Difference => first.bounds(),
        };
        let bounds = if bounds.is_empty() { Aabb::EMPTY } else { bounds };
        Self { operation, first, second, bounds }
    }

    /// What is in either.
    pub fn union(first: A, second: B) -> Self {
        Self::new(Operation::Union, first, second)
    }

    /// What is in both.
    pub fn intersection(first: A, second: B) -> Self {
        Self::new(Operation::Intersection, first, second)
    }

    /// What is in the first and not in the second.
    pub fn difference(first: A, second: B) -> Self {
        Self::new(Operation::Difference, first, second)
    }
}

/// The union of many solids as a balanced tree, so that lines need little stack; none of none.
pub fn union_of(solids: Vec<Box<dyn Solid>>) -> Option<Box<dyn Solid>> {
    balanced(Operation::Union, solids)
}

/// The intersection of many solids as a balanced tree; none of none.
pub fn intersection_of(solids: Vec<Box<dyn Solid>>) -> Option<Box<dyn Solid>> {
    balanced(Operation::Intersection, solids)
}

fn balanced(operation: Operation, mut solids: Vec<Box<dyn Solid>>) -> Option<Box<dyn Solid>> {
    while solids.len() > 1 {
        let mut rest = solids.into_iter();
        let mut halved: Vec<Box<dyn Solid>> = Vec::with_capacity(rest.len().div_ceil(2));
        while let Some(first) = rest.next() {
            halved.push(match rest.next() {
                Some(second) => Box::new(Csg::new(operation, first, second)),
                None => first,
            });
        }
        solids = halved;
    }
    solids.pop()
}

impl<A: Solid, B: Solid> Shape for Csg<A, B> {
    fn bounds(&self) -> Aabb {
        self.bounds
    }

    fn hits(&self, ray: &Ray, report: &mut dyn FnMut(ShapeHit) -> ControlFlow<()>) {
        let Some(line) = Line::of(ray) else { return };
        let mut list = IntervalList::new();
        self.intervals(&line, &mut list);
        for interval in list.as_slice() {
            for crossing in [&interval.entry, &interval.exit] {
                let t = match InInterval::of(crossing.t, ray) {
                    InInterval::Before => continue,
                    InInterval::At(t) => t,
                    InInterval::Beyond => return,
                };
                let hit = ShapeHit { t, normal: crossing.normal, uv: crossing.uv };
                if report(hit).is_break() {
                    return;
                }
            }
        }
    }
}

impl<A: Solid, B: Solid> Solid for Csg<A, B> {
    fn intervals(&self, line: &Line, list: &mut IntervalList) {
        list.clear();
        if !line.may_meet(&self.bounds) {
            return;
        }
        let (mut first, mut second) = (IntervalList::new(), IntervalList::new());
        self.first.intervals(line, &mut first);
        if first.as_slice().is_empty() && self.operation != Operation::Union {
            return;
        }
        self.second.intervals(line, &mut second);
        // Rounding of distances is relative to how far away the solid is and to how large.
        let size = line.t((self.bounds.upper.as_dvec3() - self.bounds.lower.as_dvec3()).length());
        merge(self.operation, &first, &second, size, list);
    }
}

/// Merges the intervals inside two solids.
fn merge(
    operation: Operation,
    first: &IntervalList,
    second: &IntervalList,
    size: f64,
    list: &mut IntervalList,
) {
    let (first_count, second_count) = (first.crossing_count(), second.crossing_count());
    let (mut i, mut j) = (0, 0);
    let mut entry: Option<Crossing> = None;
    while i < first_count || j < second_count {
        let t = match (i < first_count, j < second_count) {
            (true, true) => first.crossing(i).t.min(second.crossing(j).t),
            (true, false) => first.crossing(i).t,
            (false, _) => second.crossing(j).t,
        };
        let rounding = 1e-14 * (t.abs() + size);
        let same = if rounding.is_finite() { t + rounding } else { t };
        // All crossings in one place count as one: the last that changes what the line is in.
        let mut inside = entry.is_some();
        let mut change = None;
        while i < first_count && first.crossing(i).t <= same {
            i += 1;
            if operation.of(i % 2 == 1, j % 2 == 1) != inside {
                inside = !inside;
                change = Some(*first.crossing(i - 1));
            }
        }
        while j < second_count && second.crossing(j).t <= same {
            j += 1;
            if operation.of(i % 2 == 1, j % 2 == 1) != inside {
                inside = !inside;
                let mut crossing = *second.crossing(j - 1);
                if operation == Operation::Difference {
                    crossing.normal = -crossing.normal;
                }
                change = Some(crossing);
            }
        }
        match (entry, change) {
            (None, Some(crossing)) if inside => entry = Some(crossing),
            (Some(from), Some(crossing)) if !inside => {
                list.push(from, crossing);
                entry = None;
            }
            _ => {}
        }
    }
}
