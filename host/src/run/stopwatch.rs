//! Time per stage: the core has no clock, so the host reads one when a stage reports that it is done. Wall time tells what a
//! vehicle would wait; the CPU time of the thread is the one to compare on a busy machine.

use std::fmt;
use std::time::{Duration, Instant};

use cpu_time::ThreadTime;
use sdslam_core::{Stage, StageObserver};
use serde::Serialize;

use super::tally::Named;

/// Measures the stages of one frame.
pub(super) struct Stopwatch {
    cpu: ThreadTime,
    last: Instant,
    stages: [Duration; Stage::ALL.len()],
}

impl Stopwatch {
    pub(super) fn start() -> Self {
        Self { cpu: ThreadTime::now(), last: Instant::now(), stages: [Duration::ZERO; Stage::ALL.len()] }
    }

    /// Ends with the frame.
    pub(super) fn stop(self) -> FrameTimes {
        let rest = self.last.elapsed();
        let cpu = self.cpu.elapsed();
        let total = self.stages.iter().sum::<Duration>() + rest;
        FrameTimes {
            stages_ms: self.stages.map(milliseconds),
            total_ms: milliseconds(total),
            cpu_ms: milliseconds(cpu),
        }
    }
}

impl StageObserver for Stopwatch {
    fn finished(&mut self, stage: Stage) {
        let now = Instant::now();
        self.stages[stage as usize] += now - self.last;
        self.last = now;
    }
}

/// Times of one frame \[ms\].
pub(super) struct FrameTimes {
    /// In the order of [`Stage::ALL`].
    stages_ms: [f32; Stage::ALL.len()],
    total_ms: f32,
    /// CPU time of the thread.
    cpu_ms: f32,
}

fn milliseconds(duration: Duration) -> f32 {
    duration.as_secs_f32() * 1e3
}

/// Times of all frames.
#[derive(Default)]
pub(super) struct Times {
    stages: [Vec<f32>; Stage::ALL.len()],
    total: Vec<f32>,
    cpu: Vec<f32>,
    back_end: Vec<f32>,
}

impl Times {
    pub(super) fn push(&mut self, frame: &FrameTimes) {
        for (times, time) in self.stages.iter_mut().zip(frame.stages_ms) {
            times.push(time);
        }
        self.total.push(frame.total_ms);
        self.cpu.push(frame.cpu_ms);
    }

    /// CPU milliseconds of the back end for every frame.
    pub(super) fn set_back_end(&mut self, cpu_ms: Vec<f32>) {
        self.back_end = cpu_ms;
    }

    /// Wall milliseconds of every frame, one a line.
    pub(super) fn lines(&self) -> String {
        lines(&self.total)
    }

    /// CPU milliseconds of every frame, one a line.
    pub(super) fn cpu_lines(&self) -> String {
        lines(&self.cpu)
    }

    /// CPU milliseconds of the back end for every frame, one a line.
    pub(super) fn back_end_lines(&self) -> String {
        lines(&self.back_end)
    }

    /// Statistics per stage.
    pub(super) fn stages(&self) -> Named<Milliseconds, { Stage::ALL.len() }> {
        Named(Stage::ALL.map(|stage| (stage.name(), Milliseconds::of(&self.stages[stage as usize]))))
    }

    /// Statistics of whole frames.
    pub(super) fn total(&self) -> Milliseconds {
        Milliseconds::of(&self.total)
    }

    /// Statistics of the CPU time of whole frames.
    pub(super) fn cpu(&self) -> Milliseconds {
        Milliseconds::of(&self.cpu)
    }

    /// Statistics of the CPU time of the back end.
    pub(super) fn back_end(&self) -> Milliseconds {
        Milliseconds::of(&self.back_end)
    }
}

fn lines(times_ms: &[f32]) -> String {
    times_ms.iter().map(|ms| format!("{ms:.3}\n")).collect()
}

/// Milliseconds per frame.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize)]
pub struct Milliseconds {
    /// Mean.
    pub mean: f32,
    /// 95 % of the frames take at most this.
    pub p95: f32,
    /// The slowest frame.
    pub max: f32,
}

impl fmt::Display for Milliseconds {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Self { mean, p95, max } = self;
        write!(f, "{mean:.1} mean, {p95:.1} p95, {max:.1} max")
    }
}

impl Milliseconds {
    pub(super) fn of(times: &[f32]) -> Self {
        let mut sorted = times.to_vec();
        sorted.sort_by(f32::total_cmp);
        let Some(&max) = sorted.last() else { return Self::default() };
        let mean = sorted.iter().sum::<f32>() / sorted.len() as f32;
        Self { mean, p95: sorted[(sorted.len() * 95).div_ceil(100) - 1], max }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn statistics_of_one_to_a_hundred() {
        let times: Vec<f32> = (1..=100).rev().map(|ms| ms as f32).collect();
        assert_eq!(Milliseconds::of(&times), Milliseconds { mean: 50.5, p95: 95.0, max: 100.0 });
    }

    #[test]
    fn one_frame_is_its_own_statistics_and_none_is_zero() {
        assert_eq!(Milliseconds::of(&[3.0]), Milliseconds { mean: 3.0, p95: 3.0, max: 3.0 });
        assert_eq!(Milliseconds::of(&[]), Milliseconds::default());
    }
}
