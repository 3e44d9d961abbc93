//! A progress bar on stderr; nothing is drawn where stderr is no terminal.

use indicatif::{ProgressBar, ProgressStyle};

const TEMPLATE: &str = "{prefix} [{bar:32}] {pos}/{len} frames, {per_sec:.1} frames/s, {eta} left";

/// The bar of a job over frames.
pub(super) struct Progress(ProgressBar);

impl Progress {
    pub(super) fn new(job: &'static str) -> Self {
        let style = ProgressStyle::with_template(TEMPLATE).expect("the template is a constant");
        Self(ProgressBar::new(0).with_style(style.progress_chars("=> ")).with_prefix(job))
    }

    /// `done` of `all` frames are done.
    pub(super) fn show(&self, done: usize, all: usize) {
        self.0.set_length(all as u64);
        self.0.set_position(done as u64);
    }
}

impl Drop for Progress {
    fn drop(&mut self) {
        self.0.finish_and_clear();
    }
}
