//! A board on a desk, stricter than a device: it refuses a read that comes too late or while a scan is unanswered, an answer
//! that no scan has asked for, and a loop that does not feed its watchdog.

use std::time::Instant;

use anyhow::{Context, bail, ensure};
use sdslam_core::snapshot::SnapshotError;
use sdslam_core::{FrameEstimate, LabelledPoint, Stage};
use sdslam_firmware_sim::profile::{AnyLoops, LoopUse};
use sdslam_firmware_sim::wire::{Answer, Received, ScanReader, WireError, write_answer};
use sdslam_firmware_sim::{Board, Fault, ScanHeader};

use crate::link::Delivery;
use crate::retained::Retained;

/// Bytes that the line hands over at once: a message comes in pieces that end anywhere.
const PIECE_BYTES: usize = 1500;

/// What the loop did, in order.
#[derive(Clone, Debug)]
pub enum Event {
    /// An answer.
    Answer {
        /// Number of the scan.
        sequence: u32,
        /// Pose and evidence.
        estimate: Box<FrameEstimate>,
        /// The loop table after it.
        loops: LoopUse,
    },
    /// A fault of the scan with this number.
    Fault {
        /// Number of the scan.
        sequence: u32,
        /// What was wrong.
        fault: Fault,
    },
    /// A message was left out.
    Damaged(WireError),
    /// The power was lost; what was saved is damaged.
    NotRestored(SnapshotError),
}

/// The scan in the board's hands.
#[derive(Clone, Copy)]
struct Open {
    sequence: u32,
    answered: bool,
    fed: bool,
}

/// A board that receives deliveries.
pub struct DeskBoard<'a> {
    line: Box<dyn Iterator<Item = anyhow::Result<Delivery>>>,
    delivery: Option<(Delivery, usize)>,
    reader: ScanReader,
    open: Option<Open>,
    ended: bool,
    clock_us: u64,
    busy_us: u64,
    loops: &'a mut dyn AnyLoops,
    retained: Option<Retained>,
    stage_began: Instant,
    /// What the loop did.
    pub events: Vec<Event>,
    /// Wall time of the stages of each scan on this machine \[ms\].
    pub stages_ms: Vec<[f64; Stage::ALL.len()]>,
    /// Answers as they go over the wire.
    pub answers: Vec<u8>,
    /// Largest answer \[bytes\].
    pub largest_answer: usize,
    answer: Vec<u8>,
}

impl<'a> DeskBoard<'a> {
    /// A board at the end of a line, that takes `busy_us` from a scan to its answer, and shows each answer to `loops`.
    pub fn new(
        line: Box<dyn Iterator<Item = anyhow::Result<Delivery>>>,
        busy_us: u64,
        loops: &'a mut dyn AnyLoops,
        retained: Option<Retained>,
    ) -> Self {
        Self {
            line,
            delivery: None,
            reader: ScanReader::new(),
            open: None,
            ended: false,
            clock_us: 0,
            busy_us,
            loops,
            retained,
            stage_began: Instant::now(),
            events: Vec::new(),
            stages_ms: Vec::new(),
            answers: Vec::new(),
            largest_answer: 0,
            answer: vec![0; 64 << 10],
        }
    }

    /// Bytes that belonged to no message.
    pub fn skipped(&self) -> u32 {
        self.reader.skipped()
    }

    /// Whether the loop ended because the board loses its power. It starts again with nothing in its hands but what outlives
    /// that.
    pub fn power_cycle(&mut self) -> bool {
        let delivery = self.delivery.as_mut().filter(|(_, at)| *at == 0);
        let Some(leaves) = delivery.and_then(|(delivery, _)| delivery.power_cycle.take()) else {
            return false;
        };
        (self.reader, self.ended) = (ScanReader::new(), false);
        self.loops.clear();
        if let Some(retained) = &mut self.retained {
            retained.lose_power(leaves);
        }
        true
    }

    /// The rest of the delivery at hand, or the next one.
    fn refill(&mut self) -> anyhow::Result<bool> {
        if matches!(&self.delivery, Some((delivery, at)) if *at < delivery.bytes.len()) {
            return Ok(true);
        }
        let Some(delivery) = self.line.next().transpose()? else { return Ok(false) };
        // What arrives while the board is busy is there once it looks, unless more has come by then.
        let waited_us = self.clock_us.saturating_sub(delivery.arrival_us);
        ensure!(
            self.busy_us == 0 || waited_us <= Self::DEADLINE_US,
            "late read: the scan of {:.3} s waited {waited_us} us and was overwritten by the next one",
            delivery.arrival_us as f64 * 1e-6
        );
        self.clock_us = self.clock_us.max(delivery.arrival_us);
        self.delivery = Some((delivery, 0));
        Ok(true)
    }

    fn check_read(&self) -> anyhow::Result<()> {
        ensure!(!self.ended, "a scan was asked for after the last one");
        match self.open {
            Some(Open { sequence, answered: false, .. }) => {
                bail!("a scan was asked for while scan {sequence} is neither answered nor refused")
            }
            Some(Open { sequence, fed: false, .. }) => {
                bail!("the watchdog was not fed after scan {sequence}")
            }
            _ => Ok(()),
        }
    }
}

impl Board for DeskBoard<'_> {
    type Error = anyhow::Error;

    fn next_scan(&mut self, points: &mut [LabelledPoint]) -> anyhow::Result<Option<ScanHeader>> {
        self.check_read()?;
        self.open = None;
        while self.refill()? {
            let Some((delivery, at)) = &mut self.delivery else { break };
            if delivery.power_cycle.is_some() && *at == 0 {
                self.ended = true;
                return Ok(None);
            }
            let end = (*at + PIECE_BYTES).min(delivery.bytes.len());
            let (used, found) = self.reader.read(&delivery.bytes[*at..end], points);
            *at += used;
            match found {
                Some(Received::Scan(header)) => {
                    self.open = Some(Open { sequence: header.sequence, answered: false, fed: false });
                    self.stages_ms.push([0.0; Stage::ALL.len()]);
                    self.stage_began = Instant::now();
                    return Ok(Some(header));
                }
                Some(Received::Damaged(error)) => self.events.push(Event::Damaged(error)),
                None => {}
            }
        }
        self.ended = true;
        Ok(None)
    }

    fn now_us(&mut self) -> u64 {
        self.clock_us
    }

    fn publish(&mut self, answer: Answer<'_>) -> anyhow::Result<()> {
        let open = self.open.as_mut().context("an answer without a scan")?;
        ensure!(!open.answered, "scan {} was answered twice", open.sequence);
        ensure!(answer.sequence == open.sequence, "an answer to a scan other than {}", open.sequence);
        open.answered = true;
        self.loops.add_scan(&answer.estimate, answer.points);
        self.events.push(Event::Answer {
            sequence: answer.sequence,
            estimate: Box::new(answer.estimate),
            loops: self.loops.usage(),
        });
        let bytes = write_answer(answer, &mut self.answer).context("the answer does not fit its buffer")?;
        self.answers.extend_from_slice(&self.answer[..bytes]);
        self.largest_answer = self.largest_answer.max(bytes);
        self.clock_us += self.busy_us;
        Ok(())
    }

    fn alive(&mut self) {
        if let Some(open) = &mut self.open {
            open.fed = true;
        }
    }

    fn fault(&mut self, fault: Fault) {
        match (&mut self.open, fault) {
            (Some(open), fault) => {
                open.answered |= matches!(fault, Fault::Refused(_));
                self.events.push(Event::Fault { sequence: open.sequence, fault });
            }
            (None, Fault::NotRestored(error)) => self.events.push(Event::NotRestored(error)),
            (None, _) => {}
        }
    }

    fn saved_state(&mut self) -> Option<&[u8]> {
        self.retained.as_ref()?.saved()
    }

    fn room_for_state(&mut self) -> Option<&mut [u8]> {
        self.retained.as_mut()?.room()
    }

    fn state_saved(&mut self, bytes: usize) {
        if let Some(retained) = &mut self.retained {
            retained.saved_in_room(bytes);
        }
    }

    fn stage_finished(&mut self, stage: Stage) {
        let now = Instant::now();
        if let Some(times) = self.stages_ms.last_mut() {
            times[stage as usize] = now.duration_since(self.stage_began).as_secs_f64() * 1e3;
        }
        self.stage_began = now;
    }
}
