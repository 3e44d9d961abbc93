//! run.log: what happened, in the order of the frames. No clock and no path of the outputs: two runs write the same.

use std::collections::BTreeMap;
use std::fmt::Display;

/// Noteworthy events of a run.
#[derive(Default)]
pub(super) struct Journal {
    lines: Vec<String>,
    /// What is reported once and summed: frames concerned and total.
    sums: BTreeMap<&'static str, (u64, u64)>,
}

impl Journal {
    /// A line about the run as a whole.
    pub(super) fn note(&mut self, text: impl Display) {
        self.lines.push(text.to_string());
    }

    /// Something about one frame.
    pub(super) fn event(&mut self, frame: usize, text: impl Display) {
        self.lines.push(format!("frame {frame:06}: {text}"));
    }

    /// `count` of `what` in a frame: a line the first time, a sum at the end.
    pub(super) fn count(&mut self, frame: usize, what: &'static str, count: u64) {
        if count == 0 {
            return;
        }
        let (frames, total) = self.sums.entry(what).or_default();
        *frames += 1;
        *total += count;
        if *frames == 1 {
            self.event(frame, format_args!("{count} {what} (first time; the sum is below)"));
        }
    }

    /// An error with everything that caused it, in one line.
    pub(super) fn fault(&mut self, frame: usize, error: &dyn std::error::Error) {
        let mut text = error.to_string();
        let mut cause = error.source();
        while let Some(error) = cause {
            text.push_str(&format!(": {error}"));
            cause = error.source();
        }
        self.event(frame, text);
    }

    pub(super) fn to_text(&self) -> String {
        let sums =
            self.sums.iter().map(|(what, (frames, total))| format!("{total} {what} in {frames} frames"));
        self.lines.iter().cloned().chain(sums).map(|line| line + "\n").collect()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_repeats_is_told_once_and_summed() {
        let mut journal = Journal::default();
        for frame in 0..3 {
            journal.count(frame, "points not finite", frame as u64);
        }
        let text = journal.to_text();
        assert_eq!(text.lines().count(), 2);
        assert!(text.starts_with("frame 000001: 1 points not finite"));
        assert!(text.ends_with("3 points not finite in 2 frames\n"));
    }
}
