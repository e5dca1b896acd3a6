//! Rays from inside closed meshes under every build, instruction set, mode and query: none may leave.
//!
//! The work is a list of tasks that depends on nothing but the lists of what can be chosen: a scene
//! × a build × an instruction set. A task traces the same rays in every mode and query. Tasks that
//! are done are written to a file, from which an interrupted run goes on.

mod progress;

use std::sync::{
    Arc, Mutex,
    atomic::{AtomicBool, Ordering},
};

use bytemuck::bytes_of;
use rayburst_accel::{AcceptAll, Blas, Instance, IsaLevel, Tlas, TraceMode, TraceOptions};
use rayburst_math::{Hit, Ray, hash::Rng};
use rayon::prelude::*;

pub use progress::Progress;

use crate::{
    builds::{Build, Query, traces},
    meshes::ClosedScene,
    rays,
};

/// Rays in a batch.
const BATCH: usize = 4096;
/// Leaks that are described; all are counted.
const DESCRIBED: usize = 20;

/// What to trace.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Plan {
    /// Rays in total, at least.
    pub rays: u64,
    /// Where randomness starts.
    pub seed: u64,
}

/// A scene, a build and an instruction set.
#[derive(Clone, Copy, Debug)]
pub struct Task<'a> {
    /// The number of the task.
    pub number: usize,
    /// What is traced.
    pub scene: &'a ClosedScene,
    /// How it is built.
    pub build: Build,
    /// With which instruction set.
    pub isa: IsaLevel,
}

/// All tasks over some scenes.
pub fn tasks(scenes: &[ClosedScene]) -> Vec<Task<'_>> {
    let mut tasks = vec![];
    for scene in scenes {
        for build in Build::all() {
            for isa in IsaLevel::available() {
                tasks.push(Task { number: tasks.len(), scene, build, isa });
            }
        }
    }
    tasks
}

/// What a task found.
#[derive(Clone, Debug, Default)]
pub struct Outcome {
    /// Rays traced.
    pub rays: u64,
    /// Rays that left.
    pub leaks: u64,
    /// The first leaks.
    pub described: Vec<String>,
}

/// A structure over a scene.
enum Traced {
    Whole(Blas),
    Instanced(Tlas),
}

impl Traced {
    fn build(task: &Task<'_>) -> Result<Self, String> {
        let problem = |e: &dyn std::fmt::Display| format!("{}: {e}", describe(task));
        let options = task.build.options(task.isa);
        let blas = Blas::build(&[task.scene.mesh.geometry()], &options).map_err(|e| problem(&e))?;
        if blas.stats().inactive != 0 {
            return Err(problem(&"triangles of a closed mesh are never hit"));
        }
        if task.scene.instances.is_empty() {
            return Ok(Self::Whole(blas));
        }
        let instances: Vec<_> = task.scene.instances.iter().map(|&t| Instance::new(0, t)).collect();
        let tlas = Tlas::build(vec![Arc::new(blas)], &instances, &options);
        tlas.map(Self::Instanced).map_err(|e| problem(&e))
    }

    /// Whether each ray hits.
    fn hits(&self, rays: &[Ray], mode: TraceMode, query: Query, answers: &mut Answers) {
        let options = TraceOptions { mode, ..TraceOptions::default() };
        answers.any.clear();
        match query {
            Query::Any => {
                answers.any.resize(rays.len(), false);
                let any = &mut answers.any;
                match self {
                    Self::Whole(blas) => blas.any_hits(rays, any, &options, &AcceptAll),
                    Self::Instanced(tlas) => tlas.any_hits(rays, any, &options, &AcceptAll),
                }
            }
            Query::Closest => {
                answers.closest.clear();
                answers.closest.resize(rays.len(), Hit::MISS);
                let hits = &mut answers.closest;
                match self {
                    Self::Whole(blas) => blas.closest_hits(rays, hits, &options, &AcceptAll),
                    Self::Instanced(tlas) => tlas.closest_hits(rays, hits, &options, &AcceptAll),
                }
                answers.any.extend(hits.iter().map(Hit::is_hit));
            }
        }
    }
}

/// Memory for answers.
#[derive(Default)]
struct Answers {
    closest: Vec<Hit>,
    any: Vec<bool>,
}

fn describe(task: &Task<'_>) -> String {
    format!("task {}, {}, {}, {}", task.number, task.scene.name, task.build, task.isa.name())
}

/// A ray as eight words of bits, from which it can be made again.
fn words(ray: &Ray) -> String {
    let words = bytemuck::cast_slice::<u8, u32>(bytes_of(ray)).iter();
    words.map(|word| format!("{word:08x}")).collect::<Vec<_>>().join(" ")
}

/// Runs one of `count` tasks.
pub fn run_task(task: &Task<'_>, count: usize, plan: &Plan) -> Result<Outcome, String> {
    let traced = Traced::build(task)?;
    let traces = traces();
    let rays_in_all = plan.rays.div_ceil((count * traces.len()) as u64) as usize;
    let mut outcome = Outcome::default();
    let mut answers = Answers::default();
    let mut seeds = Rng::new(plan.seed ^ (task.number as u64) << 32);
    let mut done = 0;
    while done < rays_in_all {
        let seed = seeds.u64();
        let rays = rays::batch(task.scene, seed, BATCH.min(rays_in_all - done));
        for &(mode, query) in &traces {
            traced.hits(&rays, mode, query, &mut answers);
            outcome.rays += rays.len() as u64;
            for (index, _) in answers.any.iter().enumerate().filter(|(_, hit)| !**hit) {
                outcome.leaks += 1;
                if outcome.described.len() < DESCRIBED {
                    let (ray, words) = (&rays[index], words(&rays[index]));
                    let task = describe(task);
                    outcome.described.push(format!(
                        "{task}, {mode:?}, {query:?}: ray {index} of batch {seed:#x} of {}: \
                         {words}: {ray:?}",
                        rays.len()
                    ));
                }
            }
        }
        done += rays.len();
    }
    Ok(outcome)
}

/// Runs all tasks that are not done yet, on the threads of the current pool, and tells `watch` of
/// each; ends early, with what is done noted, when `watch` says so.
pub fn run(
    tasks: &[Task<'_>],
    plan: &Plan,
    progress: Progress,
    watch: &(dyn Fn(&Progress) -> Result<bool, String> + Sync),
) -> Result<Progress, String> {
    let waiting: Vec<_> = tasks.iter().filter(|task| !progress.is_done(task.number)).collect();
    let progress = Mutex::new(progress);
    let stop = AtomicBool::new(false);
    let run = |task: &&Task<'_>| -> Result<(), String> {
        if stop.load(Ordering::Relaxed) {
            return Ok(());
        }
        let outcome = run_task(task, tasks.len(), plan)?;
        let mut progress = progress.lock().map_err(|e| e.to_string())?;
        progress.note(task.number, outcome);
        if !watch(&progress)? {
            stop.store(true, Ordering::Relaxed);
        }
        Ok(())
    };
    waiting.par_iter().with_max_len(1).try_for_each(run)?;
    progress.into_inner().map_err(|e| e.to_string())
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::meshes::{grid_box, scenes};

    #[test]
    fn ten_million_rays_do_not_leak() {
        let scenes = scenes();
        let tasks = tasks(&scenes);
        let plan = Plan { rays: 10_000_000, seed: 1 };
        let progress = Progress::new(&tasks, &plan);
        let end = run(&tasks, &plan, progress, &|_| Ok(true)).unwrap();
        assert!(end.rays() >= plan.rays, "{}", end.rays());
        assert_eq!(end.leaks(), 0, "{}", end.described().join("\n"));
    }

    #[test]
    fn a_hole_is_found() {
        let mut mesh = grid_box([3; 3]);
        mesh.indices.pop();
        let scenes = [ClosedScene { name: "box with a hole".into(), mesh, instances: vec![] }];
        let tasks = tasks(&scenes);
        // A ray in two hundred or so goes through the hole.
        let rays_of_each = 4000;
        let plan = Plan { rays: rays_of_each * (tasks.len() * traces().len()) as u64, seed: 2 };
        let end = run(&tasks, &plan, Progress::new(&tasks, &plan), &|_| Ok(true)).unwrap();
        // Under every combination.
        let unseen = tasks.iter().find(|task| end.leaks_of(task.number) == 0);
        assert!(unseen.is_none(), "{}", unseen.map(describe).unwrap_or_default());
        println!("{} rays, {} leaks", end.rays(), end.leaks());
        assert!(end.described()[0].contains("box with a hole"));
    }
}
