//! What a ray must find and which shaders must run, by a plain reading of the rules in `f64`: every
//! primitive of a small scene is tried. Nothing of the engine is used here.

use glam::{DAffine3, DVec3};

use crate::solids::{Solid, meet_box, meet_triangle};

/// Ray flags, by their values in the specification.
pub mod flag {
    pub const FORCE_OPAQUE: u32 = 0x1;
    pub const FORCE_NON_OPAQUE: u32 = 0x2;
    pub const ACCEPT_FIRST: u32 = 0x4;
    pub const SKIP_CLOSEST_HIT: u32 = 0x8;
    pub const CULL_BACK: u32 = 0x10;
    pub const CULL_FRONT: u32 = 0x20;
    pub const CULL_OPAQUE: u32 = 0x40;
    pub const CULL_NON_OPAQUE: u32 = 0x80;
    pub const SKIP_TRIANGLES: u32 = 0x100;
    pub const SKIP_PROCEDURAL: u32 = 0x200;
}

/// Hit kinds: of triangles by the specification, of solids by the suite's intersection shader.
pub mod kind {
    pub const FRONT: u8 = 254;
    pub const BACK: u8 = 255;
    pub const ENTRY: u8 = 1;
    pub const EXIT: u8 = 2;
}

#[derive(Clone, Debug)]
pub enum Shape {
    Triangles(Vec<[DVec3; 3]>),
    Solids(Vec<Solid>),
}

#[derive(Clone, Debug)]
pub struct Geometry {
    pub shape: Shape,
    pub opaque: bool,
    pub no_duplicate_any_hit: bool,
}

#[derive(Clone, Debug)]
pub struct Instance {
    pub blas: usize,
    pub transform: DAffine3,
    pub mask: u8,
    pub id: u32,
    pub contribution: u32,
    pub cull_disable: bool,
    pub front_clockwise: bool,
    pub force_opaque: Option<bool>,
}

impl Instance {
    pub fn new(blas: usize, transform: DAffine3) -> Self {
        Self {
            blas,
            transform,
            mask: 0xFF,
            id: 0,
            contribution: 0,
            cull_disable: false,
            front_clockwise: false,
            force_opaque: None,
        }
    }
}

#[derive(Clone, Debug, Default)]
pub struct Scene {
    pub blases: Vec<Vec<Geometry>>,
    pub instances: Vec<Instance>,
}

#[derive(Clone, Copy, Debug)]
pub struct Ray {
    pub origin: DVec3,
    pub direction: DVec3,
    pub t_min: f64,
    pub t_max: f64,
    pub flags: u32,
    pub mask: u8,
    /// Index of the ray type in the table.
    pub ray_type: usize,
}

/// What the any hit shader of a record does.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Policy {
    /// There is none.
    Absent,
    Accept,
    Ignore,
    /// Ignores primitives of odd index.
    IgnoreOdd,
    /// Ignores front faces and entries into solids.
    IgnoreFront,
    /// Accepts and ends the search.
    End,
    /// Ignores primitives of odd index, ends at others.
    EndEven,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Decision {
    Ignore,
    Accept,
    End,
}

impl Policy {
    pub fn decide(self, primitive: u32, hit_kind: u8) -> Decision {
        let is_odd = primitive % 2 == 1;
        match self {
            Self::Absent | Self::Accept => Decision::Accept,
            Self::Ignore => Decision::Ignore,
            Self::IgnoreOdd if is_odd => Decision::Ignore,
            Self::IgnoreOdd => Decision::Accept,
            Self::IgnoreFront if matches!(hit_kind, kind::FRONT | kind::ENTRY) => Decision::Ignore,
            Self::IgnoreFront => Decision::Accept,
            Self::EndEven if is_odd => Decision::Ignore,
            Self::End | Self::EndEven => Decision::End,
        }
    }
}

/// A hit record; its geometry's kind follows from the scene.
#[derive(Clone, Copy, Debug)]
pub enum Record {
    /// The null shader identifier.
    Null,
    Triangles {
        any_hit: Policy,
        closest_hit: bool,
    },
    Solids {
        any_hit: Policy,
        closest_hit: bool,
    },
}

#[derive(Clone, Copy, Debug)]
pub struct RayType {
    pub contribution: u32,
    pub multiplier: u32,
    pub miss: u32,
}

impl RayType {
    pub fn record(&self, instance_contribution: u32, geometry: u32) -> usize {
        (self.contribution + self.multiplier * geometry + instance_contribution) as usize
    }
}

/// A shader table; a miss record may have no shader.
#[derive(Clone, Debug, Default)]
pub struct Table {
    pub ray_types: Vec<RayType>,
    pub records: Vec<Record>,
    pub misses: Vec<bool>,
}

impl Table {
    /// A table that fits a scene: as many records as its rays can find, of the right kinds, each with the
    /// shaders that `policy` gives for its index, and as many miss records as are found.
    pub fn fit(scene: &Scene, ray_types: &[RayType], policy: impl Fn(usize) -> Policy) -> Self {
        let mut records = vec![];
        for ray_type in ray_types {
            for instance in &scene.instances {
                for (geometry, number) in scene.blases[instance.blas].iter().zip(0..) {
                    let index = ray_type.record(instance.contribution, number);
                    if records.len() <= index {
                        records.resize(index + 1, Record::Null);
                    }
                    let (any_hit, closest_hit) = (policy(index), true);
                    records[index] = match geometry.shape {
                        Shape::Triangles(_) => Record::Triangles { any_hit, closest_hit },
                        Shape::Solids(_) => Record::Solids { any_hit, closest_hit },
                    };
                }
            }
        }
        let misses = ray_types.iter().map(|ray_type| ray_type.miss + 1).max().unwrap_or(0);
        Self { ray_types: ray_types.to_vec(), records, misses: vec![true; misses as usize] }
    }
}

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Place {
    pub instance: u32,
    pub geometry: u32,
    pub primitive: u32,
}

/// A hit that a shader saw, or must see.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Event {
    pub place: Place,
    pub record: usize,
    pub t: f64,
    pub kind: u8,
    /// Barycentrics and zero, or the point in the instance's space.
    pub attributes: DVec3,
}

/// What the shaders of a ray saw.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Seen {
    pub any_hits: Vec<Event>,
    pub closest_hits: Vec<Event>,
    /// Indices of miss records.
    pub misses: Vec<u32>,
    pub intersections: Vec<(Place, usize)>,
}

/// A hit that may count, if the ray gets there.
#[derive(Clone, Copy, Debug)]
pub struct Candidate {
    pub event: Event,
    /// Whether the any hit shader is asked.
    pub asks: bool,
    pub decision: Decision,
    has_closest_hit: bool,
}

/// A box that the ray meets within its interval.
#[derive(Clone, Copy, Debug)]
pub struct MetBox {
    pub place: Place,
    pub record: usize,
    pub entry: f64,
}

/// What a ray must find.
#[derive(Clone, Debug)]
pub struct Expected {
    pub candidates: Vec<Candidate>,
    pub boxes: Vec<MetBox>,
    /// Indices of candidates at which the ray may stop; one of them unless the order of hits matters.
    pub stops: Vec<Option<usize>>,
    may_end: bool,
    ends_at_first: bool,
    skips_closest_hit: bool,
    miss: Option<u32>,
    /// Whether any hit shaders may be asked again of what they ignored, as after spatial splits.
    pub may_repeat: bool,
}

/// The ray comes too near to an edge, a silhouette or the end of an interval for `f32` and `f64` to agree.
#[derive(Clone, Copy, Debug)]
pub struct Unclear;

/// Whether two distances are too near to each other to be told apart.
fn is_near(a: f64, b: f64) -> bool {
    (a - b).abs() < 2e-4 * (1.0 + a.abs())
}

/// Whether `t` is well inside or well outside of an interval.
fn is_within(t: f64, ray: &Ray) -> Result<bool, Unclear> {
    if is_near(t, ray.t_min) || is_near(t, ray.t_max) {
        return Err(Unclear);
    }
    Ok(ray.t_min < t && t < ray.t_max)
}

fn has(ray: &Ray, flag: u32) -> bool {
    ray.flags & flag != 0
}

/// The opacity of a geometry: rays override instances, which override geometries.
fn is_opaque(ray: &Ray, instance: &Instance, geometry: &Geometry) -> bool {
    if has(ray, flag::FORCE_OPAQUE) {
        true
    } else if has(ray, flag::FORCE_NON_OPAQUE) {
        false
    } else {
        instance.force_opaque.unwrap_or(geometry.opaque)
    }
}

/// Tries every primitive.
pub fn expect(scene: &Scene, table: &Table, ray: &Ray) -> Result<Expected, Unclear> {
    let mut expected = Expected {
        candidates: vec![],
        boxes: vec![],
        stops: vec![],
        may_end: false,
        ends_at_first: has(ray, flag::ACCEPT_FIRST),
        skips_closest_hit: has(ray, flag::SKIP_CLOSEST_HIT),
        miss: None,
        may_repeat: false,
    };
    let ray_type = table.ray_types[ray.ray_type];
    if table.misses[ray_type.miss as usize] {
        expected.miss = Some(ray_type.miss);
    }
    for (instance, number) in scene.instances.iter().zip(0..) {
        if instance.mask & ray.mask == 0 {
            continue;
        }
        let to_object = instance.transform.inverse();
        let origin = to_object.transform_point3(ray.origin);
        let direction = to_object.transform_vector3(ray.direction);
        let local = Ray { origin, direction, ..*ray };
        for (geometry, geometry_number) in scene.blases[instance.blas].iter().zip(0..) {
            let opaque = is_opaque(ray, instance, geometry);
            let culled = if opaque { flag::CULL_OPAQUE } else { flag::CULL_NON_OPAQUE };
            if has(ray, culled) {
                continue;
            }
            let record = ray_type.record(instance.contribution, geometry_number);
            let place =
                |primitive| Place { instance: number, geometry: geometry_number, primitive };
            match &geometry.shape {
                Shape::Triangles(triangles) if !has(ray, flag::SKIP_TRIANGLES) => {
                    for (corners, primitive) in triangles.iter().zip(0..) {
                        let place = place(primitive);
                        expected.try_triangle(
                            table, &local, instance, place, record, opaque, corners,
                        )?;
                    }
                }
                Shape::Solids(solids) if !has(ray, flag::SKIP_PROCEDURAL) => {
                    for (solid, primitive) in solids.iter().zip(0..) {
                        expected.try_solid(
                            table,
                            &local,
                            place(primitive),
                            record,
                            opaque,
                            solid,
                        )?;
                    }
                }
                _ => {}
            }
        }
    }
    expected.conclude(ray)?;
    Ok(expected)
}

impl Expected {
    fn try_triangle(
        &mut self,
        table: &Table,
        local: &Ray,
        instance: &Instance,
        place: Place,
        record: usize,
        opaque: bool,
        corners: &[DVec3; 3],
    ) -> Result<(), Unclear> {
        let Some(hit) = meet_triangle(local.origin, local.direction, corners)? else {
            return Ok(());
        };
        // Instance transforms do not matter: the facing is decided in the instance's space.
        let is_front = hit.is_counter_clockwise != instance.front_clockwise;
        let culled = if is_front { flag::CULL_FRONT } else { flag::CULL_BACK };
        if !is_within(hit.t, local)? || (has(local, culled) && !instance.cull_disable) {
            return Ok(());
        }
        let hit_kind = if is_front { kind::FRONT } else { kind::BACK };
        let (policy, has_closest_hit) = match table.records[record] {
            Record::Triangles { any_hit, closest_hit } => (any_hit, closest_hit),
            _ => (Policy::Absent, false),
        };
        let asks = !opaque && policy != Policy::Absent;
        let decision =
            if asks { policy.decide(place.primitive, hit_kind) } else { Decision::Accept };
        let attributes = DVec3::new(hit.u, hit.v, 0.0);
        let event = Event { place, record, t: hit.t, kind: hit_kind, attributes };
        self.candidates.push(Candidate { event, asks, decision, has_closest_hit });
        Ok(())
    }

    /// The shader reports the entry, and the exit if that was not accepted.
    fn try_solid(
        &mut self,
        table: &Table,
        local: &Ray,
        place: Place,
        record: usize,
        opaque: bool,
        solid: &Solid,
    ) -> Result<(), Unclear> {
        let Record::Solids { any_hit: policy, closest_hit: has_closest_hit } =
            table.records[record]
        else {
            return Ok(());
        };
        let (origin, direction) = (local.origin, local.direction);
        let Some((entry, exit)) = meet_box(origin, direction, solid.low, solid.high)? else {
            return Ok(());
        };
        is_within(entry, local)?;
        is_within(exit, local)?;
        if exit < local.t_min || entry > local.t_max {
            return Ok(());
        }
        self.boxes.push(MetBox { place, record, entry });
        let Some((entry, exit)) = solid.meet(origin, direction)? else { return Ok(()) };
        for (t, hit_kind) in [(entry, kind::ENTRY), (exit, kind::EXIT)] {
            if !is_within(t, local)? {
                continue;
            }
            let asks = !opaque && policy != Policy::Absent;
            let decision =
                if asks { policy.decide(place.primitive, hit_kind) } else { Decision::Accept };
            let attributes = origin + t * direction;
            let event = Event { place, record, t, kind: hit_kind, attributes };
            self.candidates.push(Candidate { event, asks, decision, has_closest_hit });
            if decision != Decision::Ignore {
                break;
            }
        }
        Ok(())
    }

    /// Where the ray may stop.
    fn conclude(&mut self, ray: &Ray) -> Result<(), Unclear> {
        let distances = self.candidates.iter().map(|candidate| candidate.event.t);
        let mut distances: Vec<_> = distances.chain(self.boxes.iter().map(|b| b.entry)).collect();
        distances.sort_by(f64::total_cmp);
        if distances.windows(2).any(|pair| is_near(pair[0], pair[1])) {
            return Err(Unclear);
        }
        let accepted = || {
            let candidates = self.candidates.iter().enumerate();
            candidates.filter(|(_, candidate)| candidate.decision != Decision::Ignore)
        };
        let nearest = accepted().min_by(|a, b| a.1.event.t.total_cmp(&b.1.event.t));
        let nearest = nearest.map(|(index, _)| index);
        let first = has(ray, flag::ACCEPT_FIRST);
        let ends = accepted().filter(|(_, c)| first || c.decision == Decision::End);
        let mut stops: Vec<_> = ends.map(|(index, _)| Some(index)).collect();
        self.may_end = !stops.is_empty();
        if !stops.contains(&nearest) {
            stops.push(nearest);
        }
        self.stops = stops;
        Ok(())
    }

    /// Whether shaders ran as they must.
    pub fn check(&self, seen: &Seen) -> Result<(), String> {
        let mut reasons = vec![];
        for stop in &self.stops {
            match self.check_stop(stop.map(|index| &self.candidates[index]), seen) {
                Ok(()) => return Ok(()),
                Err(reason) => reasons.push(reason),
            }
        }
        Err(format!("{reasons:#?}\nseen {seen:#?}\nexpected {self:#?}"))
    }

    fn check_stop(&self, stop: Option<&Candidate>, seen: &Seen) -> Result<(), String> {
        let is_same = |a: &Event, b: &Event| {
            (a.place, a.record, a.kind) == (b.place, b.record, b.kind)
                && is_near(a.t, b.t)
                && a.attributes.distance(b.attributes) < 2e-3
        };
        let runs = stop.filter(|stop| !self.skips_closest_hit && stop.has_closest_hit);
        match (runs, &seen.closest_hits[..]) {
            (Some(stop), [event]) if is_same(&stop.event, event) => {}
            (None, []) => {}
            _ => return Err(format!("closest hit shaders, if the ray stops at {stop:?}")),
        }
        let misses = if stop.is_some() { None } else { self.miss };
        if seen.misses != misses.into_iter().collect::<Vec<_>>() {
            return Err(format!("miss shaders, if the ray stops at {stop:?}"));
        }
        let end = stop.map_or(f64::INFINITY, |stop| stop.event.t);
        let mut total = 0;
        for candidate in self.candidates.iter().filter(|candidate| candidate.asks) {
            let times = seen.any_hits.iter().filter(|e| is_same(e, &candidate.event)).count();
            let must = candidate.event.t == end || (candidate.event.t < end && !self.may_end);
            let most = if self.may_repeat { usize::MAX } else { 1 };
            if times > most || (must && times == 0) {
                return Err(format!("{times} calls of any hit shaders for {candidate:?}"));
            }
            total += times;
            // What ends the search is the last that is asked, and the ray stops there.
            let ends = candidate.decision == Decision::End
                || (candidate.decision == Decision::Accept && self.ends_at_first);
            if ends && times > 0 {
                let is_last =
                    seen.any_hits.last().is_some_and(|last| is_same(last, &candidate.event));
                if !is_last || candidate.event.t != end {
                    return Err(format!("the search went on after {candidate:?}"));
                }
            }
        }
        if total != seen.any_hits.len() {
            return Err("any hit shaders for what cannot be hit".to_owned());
        }
        let mut total = 0;
        for met in &self.boxes {
            let key = (met.place, met.record);
            let times = seen.intersections.iter().filter(|place| **place == key).count();
            let is_stop = stop.is_some_and(|stop| stop.event.place == met.place);
            let must = is_stop || (met.entry < end && !self.may_end);
            if times > 1 || (must && times == 0) {
                return Err(format!("{times} calls of intersection shaders for {met:?}"));
            }
            total += times;
        }
        if total != seen.intersections.len() {
            return Err("intersection shaders for boxes that are not met".to_owned());
        }
        Ok(())
    }

    /// Whether the order of hits decides where the ray stops.
    pub fn is_exact(&self) -> bool {
        self.stops.len() == 1
    }
}
