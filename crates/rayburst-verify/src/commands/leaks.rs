//! `leaks`.

#[cfg(feature = "files")]
use std::path::PathBuf;
use std::time::{Duration, Instant};

use clap::Args;
use rayburst_verify::{
    leaks::{self, Plan, Progress},
    meshes,
};

#[derive(Args)]
pub(super) struct Options {
    /// Rays in total, over all combinations
    #[arg(long, default_value_t = 1_000_000_000)]
    rays: u64,
    /// Where randomness starts
    #[arg(long, default_value_t = 1)]
    seed: u64,
    /// Threads [default: one for each of the machine's]
    #[arg(long)]
    threads: Option<usize>,
    /// Go on from where an interrupted run of the same rays and seed stopped
    #[arg(long)]
    resume: bool,
    /// Only this task, by the number that a leak is reported with
    #[arg(long)]
    task: Option<usize>,
    /// Closed meshes in addition, in any format that scenes come in
    #[cfg(feature = "files")]
    #[arg(long, value_name = "FILE")]
    mesh: Vec<PathBuf>,
}

/// Between two lines about the progress.
const SILENCE: Duration = Duration::from_secs(10);

pub(super) fn run(options: &Options) -> Result<(), String> {
    let path = super::folder("target/verify")?.join("progress.txt");
    #[cfg_attr(not(feature = "files"), allow(unused_mut))]
    let mut scenes = meshes::scenes();
    #[cfg(feature = "files")]
    for file in &options.mesh {
        scenes.push(rayburst_verify::files::load(file)?);
    }
    let mut tasks = leaks::tasks(&scenes);
    let plan = Plan { rays: options.rays, seed: options.seed };
    if let Some(number) = options.task {
        let task = tasks.get(number).ok_or_else(|| format!("there are {} tasks", tasks.len()))?;
        let outcome = leaks::run_task(task, tasks.len(), &plan)?;
        return report(outcome.rays, outcome.leaks, outcome.described.iter().map(String::as_str));
    }
    let mut progress = Progress::new(&tasks, &plan);
    if options.resume {
        progress = progress.resume(&path)?;
    }
    let total = tasks.len();
    eprintln!("{} scenes, {total} tasks, {} done", scenes.len(), progress.tasks().0);
    // Costly tasks are spread, so that the time left can be told.
    tasks.sort_by_key(|task| task.number.wrapping_mul(0x9E37_79B1) as u32);
    let (begin, before) = (Instant::now(), progress.rays());
    let said = std::sync::Mutex::new(Instant::now());
    let watch = |progress: &Progress| {
        progress.save(&path)?;
        let mut said = said.lock().map_err(|e| e.to_string())?;
        if said.elapsed() > SILENCE {
            *said = Instant::now();
            let seconds = begin.elapsed().as_secs_f64();
            let rate = (progress.rays() - before) as f64 / seconds;
            let left = plan.rays.saturating_sub(progress.rays()) as f64 / rate;
            eprintln!(
                "{} of {total} tasks, {:.0} M rays, {:.2} Mrays/s, {left:.0} s left, {} leaks",
                progress.tasks().0,
                progress.rays() as f64 / 1e6,
                rate / 1e6,
                progress.leaks()
            );
        }
        Ok(true)
    };
    let pool = super::pool(options.threads)?;
    let end = pool.install(|| leaks::run(&tasks, &plan, progress, &watch))?;
    end.save(&path)?;
    eprintln!("{:.0} s", begin.elapsed().as_secs_f64());
    report(end.rays(), end.leaks(), end.described().into_iter())
}

fn report<'a>(
    rays: u64,
    leaks: u64,
    described: impl Iterator<Item = &'a str>,
) -> Result<(), String> {
    if leaks == 0 {
        eprintln!("{rays} rays, no leak");
        return Ok(());
    }
    for leak in described {
        eprintln!("leak: {leak}");
    }
    Err(format!("{leaks} of {rays} rays leave closed meshes"))
}
