//! One replay through the loop.

use std::path::Path;
use std::thread;

use anyhow::{Context, anyhow, ensure};
use sdslam_core::{FrameEstimate, LabelledPoint, SemanticClass, Stage};
use sdslam_firmware_sim::memory::Part;
use sdslam_firmware_sim::profile::{AnyLoops, AnyOdometry, LoopUse, Profile};
use sdslam_firmware_sim::wire::WireError;
use sdslam_firmware_sim::{Fault, SAVED_HEAD_BYTES, Totals, run};

use crate::board::{DeskBoard, Event};
use crate::link::Delivery;
use crate::report::parts_of;
use crate::retained::Retained;
use crate::source::Source;

/// What a replay left.
pub struct Replay {
    /// Points that the buffer holds.
    pub points: usize,
    /// Parts of the profile's memory, the points left out.
    pub parts: Vec<Part>,
    /// Bytes in all.
    pub bytes: usize,
    /// What the loop has counted.
    pub totals: Totals,
    /// What it did.
    pub events: Vec<Event>,
    /// Wall time of the stages of each scan \[ms\].
    pub stages_ms: Vec<[f64; Stage::ALL.len()]>,
    /// Bytes that belonged to no message.
    pub skipped: u32,
    /// Largest answer \[bytes\].
    pub largest_answer: usize,
    answers: Vec<u8>,
}

impl Replay {
    /// The answers, in order.
    pub fn estimates(&self) -> impl Iterator<Item = (u32, &FrameEstimate)> {
        self.events.iter().filter_map(|event| match event {
            Event::Answer { sequence, estimate, .. } => Some((*sequence, &**estimate)),
            _ => None,
        })
    }

    /// The loop table after each answer, in order.
    pub fn loops(&self) -> impl Iterator<Item = LoopUse> {
        self.events.iter().filter_map(|event| match event {
            Event::Answer { loops, .. } => Some(*loops),
            _ => None,
        })
    }

    /// The faults, in order.
    pub fn faults(&self) -> impl Iterator<Item = (u32, Fault)> {
        self.events.iter().filter_map(|event| match event {
            Event::Fault { sequence, fault } => Some((*sequence, *fault)),
            _ => None,
        })
    }

    /// The messages that were left out, in order.
    pub fn damaged(&self) -> impl Iterator<Item = WireError> {
        self.events.iter().filter_map(|event| match event {
            Event::Damaged(error) => Some(*error),
            _ => None,
        })
    }

    /// Writes the answers to a file.
    pub fn write_answers(&self, file: &Path) -> anyhow::Result<()> {
        std::fs::write(file, &self.answers).with_context(|| format!("failed to write {}", file.display()))
    }
}

/// The memory of a board on the heap.
pub struct Memory<P: Profile> {
    /// The odometry.
    pub odometry: Box<P::Odometry>,
    /// The loop table.
    pub loops: Box<P::Loops>,
    /// The points of a scan.
    pub points: Vec<LabelledPoint>,
}

impl<P: Profile> Memory<P> {
    /// As after the power comes on. It takes a few times the odometry's size of stack.
    fn new() -> anyhow::Result<Self> {
        let blank = LabelledPoint::new([0.0; 3], SemanticClass::Unlabelled);
        Ok(Self {
            odometry: Box::new(P::Odometry::create(P::CONFIG)?),
            loops: Box::new(P::Loops::create(P::CONFIG.loop_closure)?),
            points: vec![blank; P::POINTS],
        })
    }

    /// Does `work` with the memory of a board, on a thread with room for it.
    pub fn with<T: Send>(work: impl FnOnce(&mut Self) -> anyhow::Result<T> + Send) -> anyhow::Result<T> {
        let stack = 4 * (size_of::<P::Odometry>() + size_of::<P::Loops>()) + (4 << 20);
        thread::scope(|scope| {
            let builder = thread::Builder::new().stack_size(stack);
            let thread = builder.spawn_scoped(scope, || work(&mut Self::new()?));
            let end = thread.context("failed to start a thread")?.join();
            end.map_err(|_| anyhow!("the loop panicked"))?
        })
    }
}

/// Replays a source as it is.
pub fn replay<P: Profile>(source: Source, busy_us: u64) -> anyhow::Result<Replay> {
    let replayed = Memory::<P>::with(|memory| {
        let line = Box::new(source.scans()?.map(|scan| Ok(Delivery::of(&scan?))));
        replay_line(memory, line, busy_us, None)
    })?;
    ensure!(replayed.totals.estimates > 0, "no scan gave an estimate");
    Ok(replayed)
}

/// Memory for the saved states of a profile.
pub fn retained<P: Profile>() -> Retained {
    Retained::new(size_of::<P::Odometry>() + SAVED_HEAD_BYTES)
}

/// Runs the loop until the line ends; after each loss of power it starts again, with what was `retained`.
pub fn replay_line<P: Profile>(
    memory: &mut Memory<P>,
    line: Box<dyn Iterator<Item = anyhow::Result<Delivery>>>,
    busy_us: u64,
    retained: Option<Retained>,
) -> anyhow::Result<Replay> {
    let mut totals = Totals::default();
    memory.loops.clear();
    let mut board = DeskBoard::new(line, busy_us, &mut *memory.loops, retained);
    loop {
        memory.odometry.restart(P::CONFIG)?;
        run(&mut board, &mut *memory.odometry, &mut memory.points, &mut totals)
            .with_context(|| format!("failed after {} scans", totals.scans))?;
        if !board.power_cycle() {
            break;
        }
    }
    Ok(Replay {
        points: P::POINTS,
        parts: parts_of::<P>(),
        bytes: P::BYTES,
        totals,
        skipped: board.skipped(),
        events: board.events,
        stages_ms: board.stages_ms,
        largest_answer: board.largest_answer,
        answers: board.answers,
    })
}
