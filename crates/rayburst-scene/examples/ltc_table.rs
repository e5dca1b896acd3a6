//! Fits the lobes of polygon lights and writes their table: `ltc_table FILE [--check]`.
//!
//! With `--check` the file is read and compared. Numbers may differ a little between machines whose
//! square roots round otherwise; up to 1 in 100 may differ by more than 1/200.
#![allow(clippy::print_stderr, reason = "a command line tells what it does")]

use std::process::ExitCode;

use rayburst_scene::ltc::fit;

fn main() -> ExitCode {
    let arguments: Vec<String> = std::env::args().skip(1).collect();
    let outcome = match arguments.iter().map(String::as_str).collect::<Vec<_>>()[..] {
        [file] => write(file),
        [file, "--check"] => check(file),
        _ => Err("usage: ltc_table FILE [--check]".to_owned()),
    };
    match outcome {
        Ok(()) => ExitCode::SUCCESS,
        Err(problem) => {
            eprintln!("error: {problem}");
            ExitCode::FAILURE
        }
    }
}

fn write(file: &str) -> Result<(), String> {
    let table = fit::fit_all();
    std::fs::write(file, &table).map_err(|e| format!("cannot write {file}: {e}"))?;
    eprintln!("{file}: {} bytes", table.len());
    Ok(())
}

fn check(file: &str) -> Result<(), String> {
    let stored = std::fs::read(file).map_err(|e| format!("cannot read {file}: {e}"))?;
    let fitted = fit::fit_all();
    if stored.len() != fitted.len() {
        return Err(format!("{file} has {} bytes, the fit {}", stored.len(), fitted.len()));
    }
    let number = |bytes: &[u8]| i32::from(i16::from_le_bytes([bytes[0], bytes[1]]));
    let pairs = stored.chunks(2).zip(fitted.chunks(2));
    let differences: Vec<i32> = pairs.map(|(a, b)| (number(a) - number(b)).abs()).collect();
    let far = differences.iter().filter(|&&d| d > 40).count();
    let most = differences.iter().max().copied().unwrap_or(0);
    eprintln!("{} numbers, {far} differ by more than 40, the most by {most}", differences.len());
    if far * 100 > differences.len() {
        return Err(format!("{file} is not what the fit makes; run `cargo xtask ltc`"));
    }
    Ok(())
}
