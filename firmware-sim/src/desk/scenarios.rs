//! Many replays, each with faults of its own: does the loop come through, and how soon is it well again?

use std::fmt::{self, Write};
use std::ops::Range;
use std::panic::{AssertUnwindSafe, catch_unwind};

use anyhow::ensure;
use oorandom::Rand64;
use sdslam_core::{FrameEstimate, FrameStatus, MapPose};
use sdslam_firmware_sim::profile::Profile;

use crate::board::Event;
use crate::faults::{self, FaultKind, Plan};
use crate::replay::{Memory, Replay, replay_line, retained};
use crate::source::{RecordedScan, Source};

/// Good scans behind the last fault within which the loop must be well again.
const RECOVERY_SCANS: usize = 5;
/// Scans before the first fault.
const LEAD_IN: usize = 4;
/// The step from one scan to the next is right when it is this near that of the undisturbed replay.
const STEP_TOLERANCE: (f64, f64) = (0.1, 0.5);

/// How a scenario ended.
#[derive(Clone, Debug)]
enum Outcome {
    /// Well again, from this many good scans on.
    Recovered(usize),
    /// Not well again in time.
    NotRecovered,
    /// The board refused to go on: a rule of the desk was broken.
    Refused(String),
    /// The loop panicked.
    Panicked,
}

impl fmt::Display for Outcome {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Recovered(scans) => write!(f, "well after {scans} good scans"),
            Self::NotRecovered => write!(f, "not well again in time"),
            Self::Refused(why) => write!(f, "refused: {why}"),
            Self::Panicked => write!(f, "panicked"),
        }
    }
}

/// Counts of one kind of fault.
#[derive(Clone, Copy, Debug, Default)]
struct Row {
    injected: u32,
    scenarios: u32,
    damaged: u32,
    missed: u32,
    refused: u32,
    cut: u32,
    clock_set: u32,
    resumed: u32,
    anew: u32,
    predicted: u32,
    recovery_sum: usize,
    recovery_most: usize,
    failed: u32,
}

/// What was injected and what happened. A scenario with several kinds of faults counts in the row of each.
pub struct Table {
    rows: [Row; FaultKind::ALL.len()],
    scenarios: u32,
    failures: Vec<String>,
    panics: u32,
    /// What happened, scan by scan, where only one scenario was run.
    story: String,
}

impl Table {
    /// Every scenario was well again in time.
    pub fn all_recovered(&self) -> bool {
        self.failures.is_empty()
    }
}

/// Runs scenarios; all that is random follows from their numbers and `seed`.
pub fn scenarios<P: Profile>(source: Source, runs: Range<u32>, seed: u64) -> anyhow::Result<Table> {
    let scans = source.scans()?.collect::<anyhow::Result<Vec<_>>>()?;
    let last_fault = scans.len().checked_sub(RECOVERY_SCANS + 1).filter(|end| *end > LEAD_IN);
    ensure!(last_fault.is_some(), "{} scans are too few for a scenario", scans.len());
    let faulty = LEAD_IN..last_fault.unwrap_or(LEAD_IN);
    Memory::<P>::with(|memory| {
        let clean = replay_scans(memory, &scans, &Plan::new(), &mut Rand64::new(0))?;
        let truth = Steps::of(&clean);
        let mut table = Table {
            rows: Default::default(),
            scenarios: runs.len() as u32,
            failures: Vec::new(),
            panics: 0,
            story: String::new(),
        };
        for run in runs.clone() {
            let mut random = Rand64::new(u128::from(seed) << 32 | u128::from(run));
            let plan = faults::plan(&mut random, faulty.clone());
            let replayed =
                catch_unwind(AssertUnwindSafe(|| replay_scans(memory, &scans, &plan, &mut random)));
            let (outcome, replayed) = match replayed {
                Err(_) => (Outcome::Panicked, None),
                Ok(Err(error)) => (Outcome::Refused(format!("{error:#}")), None),
                Ok(Ok(replayed)) => (truth.judge(&replayed, &plan, &scans), Some(replayed)),
            };
            table.add(run, &plan, &outcome, replayed.as_ref());
            if let Some(replayed) = replayed.filter(|_| runs.len() == 1) {
                table.story = truth.story(&replayed);
            }
        }
        Ok(table)
    })
}

fn replay_scans<P: Profile>(
    memory: &mut Memory<P>,
    scans: &[RecordedScan],
    plan: &Plan,
    random: &mut Rand64,
) -> anyhow::Result<Replay> {
    let line = faults::inject(scans, plan, P::POINTS, random);
    let power_is_lost = line.iter().any(|delivery| delivery.power_cycle.is_some());
    let retained = power_is_lost.then(retained::<P>);
    replay_line(memory, Box::new(line.into_iter().map(Ok)), 0, retained)
}

/// The poses of the undisturbed replay.
struct Steps(Vec<(u32, MapPose)>);

impl Steps {
    fn of(replay: &Replay) -> Self {
        Self(replay.estimates().map(|(sequence, e)| (sequence, e.map_from_sensor)).collect())
    }

    fn pose(&self, sequence: u32) -> Option<&MapPose> {
        self.0.iter().find(|(s, _)| *s == sequence).map(|(_, pose)| pose)
    }

    /// How far the step to answer `at` is off \[m\], \[deg\].
    fn off(&self, answers: &[(u32, &FrameEstimate)], at: usize) -> Option<(f64, f64)> {
        let (sequence, estimate) = answers.get(at)?;
        let (before, previous) = answers.get(at.checked_sub(1)?)?;
        let step = previous.map_from_sensor.inv_mul(&estimate.map_from_sensor);
        let off = self.pose(*before)?.inv_mul(self.pose(*sequence)?).inv_mul(&step);
        Some((off.translation.vector.norm(), off.rotation.angle().to_degrees()))
    }

    /// What happened, scan by scan.
    fn story(&self, replay: &Replay) -> String {
        let answers: Vec<_> = replay.estimates().collect();
        let (mut text, mut at) = (String::new(), 0);
        for event in &replay.events {
            // Writing to a string cannot fail.
            let _ = match event {
                Event::Answer { sequence, estimate, .. } => {
                    let (metres, degrees) = self.off(&answers, at).unwrap_or_default();
                    at += 1;
                    writeln!(
                        text,
                        "scan {sequence}: {:?}, step off by {metres:.3} m, {degrees:.2} deg",
                        estimate.status
                    )
                }
                Event::Fault { sequence, fault } => writeln!(text, "scan {sequence}: {fault}"),
                Event::Damaged(error) => writeln!(text, "{error}"),
                Event::NotRestored(error) => writeln!(text, "power lost, started anew: {error}"),
            };
        }
        text
    }

    /// The scans behind the last fault are answered, registered, and the steps between them are right from some scan on.
    fn judge(&self, replay: &Replay, plan: &Plan, scans: &[RecordedScan]) -> Outcome {
        let last =
            plan.iter().map(|(at, kind)| at + usize::from(*kind == FaultKind::Late)).max().unwrap_or(0);
        let good = &scans[last + 1..];
        let answers: Vec<_> = replay.estimates().collect();
        let well = |k: &usize| {
            let at = answers.iter().position(|(s, _)| *s == good[*k].sequence)?;
            let (metres, degrees) = self.off(&answers, at)?;
            let right = metres < STEP_TOLERANCE.0 && degrees < STEP_TOLERANCE.1;
            (right && !matches!(answers[at].1.status, FrameStatus::Predicted(_))).then_some(())
        };
        let wrong = (0..good.len()).rev().find(|k| well(k).is_none());
        match wrong.map_or(1, |k| k + 2) {
            scans if scans <= RECOVERY_SCANS && scans <= good.len() => Outcome::Recovered(scans),
            _ => Outcome::NotRecovered,
        }
    }
}

impl Table {
    fn add(&mut self, run: u32, plan: &Plan, outcome: &Outcome, replay: Option<&Replay>) {
        let mut counts = Row::default();
        for event in replay.iter().flat_map(|r| &r.events) {
            match event {
                Event::Fault { fault, .. } => counts.count(fault),
                Event::Answer { .. } | Event::Damaged(_) => {}
                Event::NotRestored(_) => counts.anew += 1,
            }
        }
        counts.damaged = replay.map_or(0, |r| r.damaged().count() as u32);
        counts.predicted = replay.map_or(0, |r| r.totals.predicted);
        counts.resumed = replay.map_or(0, |r| r.totals.resumed);
        let recovery = match outcome {
            Outcome::Recovered(scans) => *scans,
            _ => 0,
        };
        for (kind, row) in FaultKind::ALL.into_iter().zip(&mut self.rows) {
            let injected = plan.iter().filter(|(_, k)| *k == kind).count() as u32;
            if injected > 0 {
                row.injected += injected;
                row.scenarios += 1;
                row.add(&counts);
                row.recovery_sum += recovery;
                row.recovery_most = row.recovery_most.max(recovery);
                row.failed += u32::from(recovery == 0);
            }
        }
        self.panics += u32::from(matches!(outcome, Outcome::Panicked));
        if recovery == 0 {
            let faults: Vec<String> = plan.iter().map(|(at, k)| format!("{} at {at}", k.name())).collect();
            self.failures.push(format!("scenario {run} ({}): {outcome}", faults.join(", ")));
        }
    }
}

impl Row {
    fn count(&mut self, fault: &sdslam_firmware_sim::Fault) {
        use sdslam_firmware_sim::Fault::*;
        match fault {
            Missed { scans } => self.missed += scans,
            Refused(_) => self.refused += 1,
            PointsLost { .. } => self.cut += 1,
            ClockSet { .. } => self.clock_set += 1,
            Late { .. } | NotRestored(_) | NotSaved(_) => {}
        }
    }

    fn add(&mut self, counts: &Self) {
        self.damaged += counts.damaged;
        self.missed += counts.missed;
        self.refused += counts.refused;
        self.cut += counts.cut;
        self.clock_set += counts.clock_set;
        self.resumed += counts.resumed;
        self.anew += counts.anew;
        self.predicted += counts.predicted;
    }
}

impl fmt::Display for Table {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let heads = [
            "injected",
            "scenarios",
            "damaged",
            "missed",
            "refused",
            "cut",
            "clock set",
            "resumed",
            "anew",
            "predicted",
        ];
        write!(f, "{:15}", "fault")?;
        for head in heads {
            write!(f, "{head:>10}")?;
        }
        writeln!(f, "{:>22}{:>8}", "well after mean, most", "failed")?;
        for (kind, row) in FaultKind::ALL.into_iter().zip(&self.rows) {
            write!(f, "{:15}", kind.name())?;
            for count in [
                row.injected,
                row.scenarios,
                row.damaged,
                row.missed,
                row.refused,
                row.cut,
                row.clock_set,
                row.resumed,
                row.anew,
                row.predicted,
            ] {
                write!(f, "{count:>10}")?;
            }
            let mean = row.recovery_sum as f64 / f64::from((row.scenarios - row.failed).max(1));
            writeln!(f, "{:>22}{:>8}", format!("{mean:.2}, {}", row.recovery_most), row.failed)?;
        }
        let failed = self.failures.len();
        writeln!(
            f,
            "\n{} scenarios, {} panics, {failed} not well again within {RECOVERY_SCANS} good scans",
            self.scenarios, self.panics
        )?;
        self.failures.iter().take(20).try_for_each(|failure| writeln!(f, "  {failure}"))?;
        f.write_str(&self.story)
    }
}
