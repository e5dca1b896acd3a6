//! `fuzz`.

use std::{
    fs,
    panic::catch_unwind,
    path::PathBuf,
    time::{Duration, Instant},
};

use clap::Args;
use rayburst_verify::fuzz::{self, inputs::Mutator};

#[derive(Args)]
pub(super) struct Options {
    /// How long to go on
    #[arg(long, default_value_t = 1.0)]
    minutes: f64,
    /// Where randomness starts
    #[arg(long, default_value_t = 1)]
    seed: u64,
    /// Inputs to pass over first
    #[arg(long, default_value_t = 0)]
    skip: u64,
    /// Go on after findings
    #[arg(long)]
    keep_going: bool,
    /// Only these inputs, and what they mean
    #[arg(value_name = "FILE")]
    inputs: Vec<PathBuf>,
}

pub(super) fn run(options: &Options) -> Result<(), String> {
    // Builds of a hundred triangles need no threads.
    super::pool(Some(1))?.install(|| run_here(options))
}

fn run_here(options: &Options) -> Result<(), String> {
    for path in &options.inputs {
        let bytes = fs::read(path).map_err(|e| format!("cannot read {}: {e}", path.display()))?;
        eprintln!("{}: {:?}", path.display(), fuzz::inputs::Input::new(&bytes));
        fuzz::check(&bytes);
    }
    if !options.inputs.is_empty() {
        return Ok(());
    }
    let folder = super::folder("target/fuzz")?;
    let running = folder.join(format!("running-{}.bin", options.seed));
    let (begin, mut said) = (Instant::now(), Instant::now());
    let limit = Duration::from_secs_f64(60.0 * options.minutes.clamp(0.0, 1e6));
    let mut mutator = Mutator::new(options.seed);
    let (mut count, mut findings) = (0u64, 0);
    while begin.elapsed() < limit {
        let bytes = mutator.next_input();
        count += 1;
        if count <= options.skip {
            continue;
        }
        // What a crash leaves behind.
        fs::write(&running, &bytes)
            .map_err(|e| format!("cannot write {}: {e}", running.display()))?;
        if catch_unwind(|| fuzz::check(&bytes)).is_err() {
            findings += 1;
            let path = folder.join(format!("finding-{}-{count}.bin", options.seed));
            fs::write(&path, shrink(bytes))
                .map_err(|e| format!("cannot write {}: {e}", path.display()))?;
            eprintln!("finding {findings}: {}", path.display());
            if !options.keep_going {
                break;
            }
        }
        if said.elapsed() > Duration::from_secs(60) {
            said = Instant::now();
            let seconds = begin.elapsed().as_secs_f64();
            eprintln!("{count} inputs, {:.0}/s, {findings} findings", count as f64 / seconds);
        }
    }
    fs::remove_file(&running).map_err(|e| format!("cannot remove {}: {e}", running.display()))?;
    if findings > 0 {
        return Err(format!("{findings} findings among {count} inputs; they are in target/fuzz"));
    }
    eprintln!("{count} inputs, no finding");
    Ok(())
}

/// Takes away what the finding does not need.
fn shrink(mut bytes: Vec<u8>) -> Vec<u8> {
    let hook = std::panic::take_hook();
    std::panic::set_hook(Box::new(|_| ()));
    let fails = |bytes: &[u8]| catch_unwind(|| fuzz::check(bytes)).is_err();
    let mut step = bytes.len() / 2;
    while step > 0 {
        let mut at = 0;
        while at < bytes.len() {
            let mut shorter = bytes.clone();
            shorter.drain(at..(at + step).min(bytes.len()));
            if fails(&shorter) {
                bytes = shorter;
            } else {
                at += step;
            }
        }
        step /= 2;
    }
    std::panic::set_hook(hook);
    bytes
}
