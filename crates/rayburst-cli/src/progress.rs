//! A bar on a terminal: how far, how fast, how long still.

use std::time::Duration;

use indicatif::{ProgressBar, ProgressDrawTarget, ProgressStyle};
use rayburst::render::Progress;

/// Shows the progress of renders; silent where stderr is not a terminal.
pub(crate) struct Bar {
    bar: ProgressBar,
    pixels: f64,
    limits: Limits,
}

/// What may end a render before its last sample.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct Limits {
    pub(crate) budget: Option<Duration>,
    pub(crate) noise: Option<f32>,
}

/// Steps of the bar.
const STEPS: u64 = 1000;

impl Bar {
    /// A bar for a picture of so many pixels.
    pub(crate) fn new(pixels: usize, limits: Limits, prefix: String) -> Self {
        let bar = ProgressBar::with_draw_target(Some(STEPS), ProgressDrawTarget::stderr());
        let style = ProgressStyle::with_template("{prefix}[{bar:30}] {percent:>3} %  {msg}");
        if let Ok(style) = style {
            bar.set_style(style.progress_chars("=> "));
        }
        bar.set_prefix(prefix);
        Self { bar, pixels: pixels as f64, limits }
    }

    /// Draws the state of a render; may be called from any thread, often.
    pub(crate) fn show(&self, progress: &Progress, resumed: u32) {
        if self.bar.is_hidden() {
            return;
        }
        let done = progress.samples_done();
        let own = done - f64::from(resumed);
        let seconds = progress.elapsed.as_secs_f64();
        let wanted = f64::from(progress.target.saturating_sub(resumed)).max(1.0);
        let mut share = own / wanted;
        let mut left = (share > 0.0).then(|| seconds * (1.0 - share) / share);
        if let Some(budget) = self.limits.budget.map(|b| b.as_secs_f64()) {
            share = share.max(seconds / budget);
            left = Some(left.unwrap_or(f64::INFINITY).min((budget - seconds).max(0.0)));
        }
        if let (Some(now), Some(wanted)) = (progress.noise, self.limits.noise) {
            // The error falls with the square root of the samples.
            let ratio = f64::from(wanted / now.max(f32::MIN_POSITIVE));
            share = share.max((ratio * ratio).min(1.0));
            if ratio > 0.0 && seconds > 0.0 {
                let by_noise = seconds * (1.0 / (ratio * ratio) - 1.0).max(0.0);
                left = Some(left.unwrap_or(f64::INFINITY).min(by_noise));
            }
        }
        self.bar.set_position((share.clamp(0.0, 1.0) * STEPS as f64) as u64);
        let rate = own * self.pixels / seconds.max(1e-3) / 1e6;
        let rest = left.map_or(String::new(), |s| format!(", {} left", shown(s)));
        let samples = done as u64;
        self.bar.set_message(format!("{samples} spp, {rate:.2} Msamples/s{rest}"));
    }

    /// Removes the bar.
    pub(crate) fn clear(&self) {
        self.bar.finish_and_clear();
    }
}

/// Seconds for people.
pub(crate) fn shown(seconds: f64) -> String {
    if !seconds.is_finite() {
        return "a long time".into();
    }
    match seconds {
        s if s < 10.0 => format!("{s:.1} s"),
        s if s < 120.0 => format!("{s:.0} s"),
        s if s < 7200.0 => format!("{:.0} min {:.0} s", (s / 60.0).floor(), s % 60.0),
        s => format!("{:.0} h {:.0} min", (s / 3600.0).floor(), (s % 3600.0) / 60.0),
    }
}

#[cfg(test)]
mod tests {
    #[test]
    fn times_are_short() {
        assert_eq!(super::shown(3.21), "3.2 s");
        assert_eq!(super::shown(99.6), "100 s");
        assert_eq!(super::shown(150.0), "2 min 30 s");
        assert_eq!(super::shown(7500.0), "2 h 5 min");
    }
}
