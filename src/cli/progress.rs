//! Progress of fits on a terminal.

use indicatif::{ProgressBar, ProgressDrawTarget, ProgressStyle};
use std::time::Duration;

/// A spinner on a terminal, nothing elsewhere.
pub(super) fn progress_bar(stem: &str) -> ProgressBar {
    let bar = ProgressBar::with_draw_target(None, ProgressDrawTarget::stderr());
    if let Ok(style) = ProgressStyle::with_template("{spinner} {prefix}: {msg} [{elapsed}]") {
        bar.set_style(style);
    }
    bar.set_prefix(stem.to_owned());
    bar.enable_steady_tick(Duration::from_millis(100));
    bar
}
