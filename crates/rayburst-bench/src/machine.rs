//! Where and when something was measured.

use std::time::{SystemTime, UNIX_EPOCH};

use rayburst_accel::IsaLevel;
use serde::Serialize;

/// The machine and the day of a measurement; part of every row.
#[derive(Clone, Debug, Default, Serialize)]
pub struct Machine {
    /// The processor's name.
    pub machine: String,
    /// Threads that the processor runs at once.
    pub hardware_threads: usize,
    /// Instruction set of Rayburst's kernels.
    pub isa: &'static str,
    /// The day, `2026-01-31`, UTC.
    pub date: String,
}

impl Machine {
    /// This machine, today.
    pub fn here() -> Self {
        let information = std::fs::read_to_string("/proc/cpuinfo").unwrap_or_default();
        let now = SystemTime::now().duration_since(UNIX_EPOCH).unwrap_or_default();
        Self {
            machine: processor(&information),
            hardware_threads: hardware_threads(&information),
            isa: IsaLevel::from_environment().map_or("unknown", IsaLevel::name),
            date: date(now.as_secs() / 86_400),
        }
    }
}

/// The processor's name in the text of `/proc/cpuinfo`; else the architecture.
fn processor(information: &str) -> String {
    let line = information.lines().find_map(|line| line.strip_prefix("model name"));
    let name = line.and_then(|rest| rest.split_once(':')).map_or("", |(_, name)| name.trim());
    if name.is_empty() { std::env::consts::ARCH.to_owned() } else { name.to_owned() }
}

/// The processors in the text of `/proc/cpuinfo`; else those that this process may use.
fn hardware_threads(information: &str) -> usize {
    let listed = information.lines().filter(|line| line.starts_with("processor")).count();
    if listed > 0 { listed } else { std::thread::available_parallelism().map_or(1, usize::from) }
}

/// Year, month and day of a day since 1970-01-01 in the Gregorian calendar.
fn date(days: u64) -> String {
    let leap = |year: u64| {
        year.is_multiple_of(4) && (!year.is_multiple_of(100) || year.is_multiple_of(400))
    };
    let (mut year, mut day) = (1970, days);
    while day >= 365 + u64::from(leap(year)) {
        day -= 365 + u64::from(leap(year));
        year += 1;
    }
    let february = 28 + u64::from(leap(year));
    let mut month = 1;
    for length in [31, february, 31, 30, 31, 30, 31, 31, 30, 31, 30, 31] {
        if day < length {
            break;
        }
        day -= length;
        month += 1;
    }
    format!("{year:04}-{month:02}-{:02}", day + 1)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn days_have_dates() {
        for (days, expected) in [
            (0, "1970-01-01"),
            (364, "1970-12-31"),
            (11_016, "2000-02-29"),
            (19_782, "2024-02-29"),
            (20_454, "2026-01-01"),
            (47_540, "2100-02-28"),
            (47_541, "2100-03-01"),
        ] {
            assert_eq!(date(days), expected);
        }
    }

    #[test]
    fn the_processor_has_a_name() {
        let text = "processor\t: 0\nmodel name\t: Some CPU @ 3 GHz\nflags\t: fpu\n";
        assert_eq!(processor(text), "Some CPU @ 3 GHz");
        assert_eq!(processor("model name\t:\n"), std::env::consts::ARCH);
        assert_eq!(hardware_threads("processor\t: 0\nx\t: 1\n\nprocessor\t: 1\n"), 2);
        assert!(hardware_threads("") > 0);
        let here = Machine::here();
        assert!(!here.machine.is_empty() && here.hardware_threads > 0 && here.date.len() == 10);
    }
}
