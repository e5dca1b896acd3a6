//! `bench update`: what it takes to keep structures up to date with what moves, and what it costs rays.

mod deform;
mod instances;
mod motion;
mod particles;
mod timing;
mod twist;

use rayburst_accel::BuildOptions;

pub(crate) use timing::median;

use crate::{
    BenchError, FlatMesh, Row,
    engine::Preset,
    error,
    machine::Machine,
    updates::timing::{Contender, Measured},
};

/// What moves.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum UpdateCase {
    /// A mesh in waves: refits beside builds.
    Deform,
    /// Many instances: updates and builds of the structure over them.
    Instances,
    /// A mesh that twists further every frame: policies.
    Twist,
    /// Boxes that all fly their own way.
    Particles,
}

impl UpdateCase {
    /// All with their names.
    pub const ALL: [(&'static str, Self); 4] = [
        ("deform", Self::Deform),
        ("instances", Self::Instances),
        ("twist", Self::Twist),
        ("particles", Self::Particles),
    ];

    fn name(self) -> &'static str {
        Self::ALL.iter().find(|(_, case)| *case == self).map_or("", |(name, _)| name)
    }
}

/// What to measure.
#[derive(Clone, Debug)]
pub struct UpdateBench {
    /// Threads that build, ≥ 1.
    pub threads: usize,
    /// Timed runs of each, ≥ 1.
    pub repeats: usize,
    /// Least length of a timed run, seconds; short ones are repeated.
    pub seconds: f64,
    /// Which cases.
    pub cases: Vec<UpdateCase>,
    /// Triangles, instances and particles as parts of the usual numbers.
    pub scale: f32,
}

impl UpdateBench {
    /// A part of a usual number; at least one.
    fn scaled(&self, usual: usize) -> usize {
        ((usual as f64 * f64::from(self.scale)) as usize).max(1)
    }
}

/// Measures all cases, those of meshes on a mesh of their own or on one that is given with its name.
/// Every row is also given to `report`.
pub fn bench_updates(
    mesh: Option<(&str, &FlatMesh)>,
    options: &UpdateBench,
    report: &mut dyn FnMut(&Row),
) -> Result<Vec<Row>, BenchError> {
    let bench = Bench { options, pool: error::pool(options.threads)?, machine: Machine::here() };
    let mut rows = Vec::new();
    for case in &options.cases {
        let new = match case {
            UpdateCase::Deform => deform::run(&bench, mesh)?,
            UpdateCase::Instances => instances::run(&bench)?,
            UpdateCase::Twist => twist::run(&bench, mesh)?,
            UpdateCase::Particles => particles::run(&bench)?,
        };
        new.iter().for_each(&mut *report);
        rows.extend(new);
    }
    Ok(rows)
}

/// What all cases need.
struct Bench<'a> {
    options: &'a UpdateBench,
    pool: rayon::ThreadPool,
    machine: Machine,
}

/// What moves in a case.
struct Subject {
    case: UpdateCase,
    scene: String,
    triangles: usize,
    instances: usize,
}

impl Bench<'_> {
    /// A row to be filled in.
    fn row(&self, subject: &Subject, policy: &str) -> Row {
        Row {
            bench: "update",
            case: Some(subject.case.name()),
            scene: subject.scene.clone(),
            triangles: subject.triangles,
            instances: subject.instances,
            policy: Some(policy.to_owned()),
            threads: self.options.threads,
            machine: self.machine.clone(),
            ..Row::default()
        }
    }

    /// Interleaves contenders; returns a row of millions a second and one of milliseconds for each.
    fn rates(
        &self,
        subject: &Subject,
        unit: &'static str,
        contenders: &mut [Contender<'_>],
    ) -> Result<(Vec<Row>, Vec<Measured>), BenchError> {
        let measured = timing::interleave(contenders, self.options.repeats, self.options.seconds)?;
        let count = if unit == "Minst/s" { subject.instances } else { subject.triangles };
        let rate = |seconds: f64| count as f64 / seconds / 1e6;
        let mut rows = Vec::new();
        for (contender, m) in contenders.iter().zip(&measured) {
            let row = Row {
                repeats: m.seconds.len(),
                sah_cost: m.sah_cost,
                ..self.row(subject, &contender.policy)
            };
            rows.push(Row {
                value: rate(m.median()),
                unit,
                min: rate(m.most()),
                max: rate(m.least()),
                ..row.clone()
            });
            rows.push(Row {
                value: 1e3 * m.median(),
                unit: "ms",
                min: 1e3 * m.least(),
                max: 1e3 * m.most(),
                ..row
            });
        }
        Ok((rows, measured))
    }

    /// How many times as fast one contender is as another, run by run.
    fn faster(
        &self,
        subject: &Subject,
        (policy, fast): (&str, &Measured),
        (other, slow): (&str, &Measured),
    ) -> Row {
        let ratios = timing::ratios(slow, fast);
        Row {
            value: slow.median() / fast.median(),
            unit: "ratio",
            ratio_of: Some("speed"),
            peer: Some(other.to_owned()),
            repeats: ratios.len(),
            min: ratios[0],
            max: ratios[ratios.len() - 1],
            ..self.row(subject, policy)
        }
    }
}

/// The presets that moving things are built with, and their names.
fn presets() -> [(&'static str, BuildOptions<'static>); 2] {
    let [fast, balanced, ..] = Preset::USUAL;
    [(fast.name, fast.options()), (balanced.name, balanced.options())]
}
