//! The board around the loop: files of the host as sensor and receiver, the emulator's clock to count instructions.

use sdslam_core::{LabelledPoint, Stage};
use sdslam_firmware_sim::wire::{Answer, Received, ScanReader, write_answer};
use sdslam_firmware_sim::{Board, Fault, ScanHeader};
use semihosting::fs::File;
use semihosting::io::{Read, Write};

use crate::processor;

/// Bytes that the sensor hands over at once.
const PIECE_BYTES: usize = 4096;
/// Room for the largest answer.
const ANSWER_BYTES: usize = 24 << 10;

/// Why the board cannot go on.
#[derive(Clone, Copy, defmt::Format)]
pub enum BoardError {
    /// `recording.sdr` cannot be read.
    Recording,
    /// `answers.sda` cannot be written.
    Answers,
    /// An answer is larger than its buffer.
    AnswerTooLarge,
}

/// The buffers of the board.
struct Buffers {
    piece: [u8; PIECE_BYTES],
    answer: [u8; ANSWER_BYTES],
}

static mut BUFFERS: Buffers = Buffers { piece: [0; PIECE_BYTES], answer: [0; ANSWER_BYTES] };

/// A board with a file on either side.
pub struct EmulatedBoard {
    recording: File,
    answers: File,
    reader: ScanReader,
    buffers: &'static mut Buffers,
    /// Bytes of the piece: taken, and there.
    taken: usize,
    there: usize,
    clock_us: u64,
    sequence: u32,
    last_count: u64,
    /// Instructions: decoding, the stages, answering.
    counts: [u32; 9],
}

impl EmulatedBoard {
    /// Opens the files. To be called once.
    pub fn open() -> Result<Self, BoardError> {
        let recording = File::open(c"recording.sdr").map_err(|_| BoardError::Recording)?;
        let answers = File::create(c"answers.sda").map_err(|_| BoardError::Answers)?;
        Ok(Self {
            recording,
            answers,
            reader: ScanReader::new(),
            // SAFETY: this function is called once, and nobody else names the static.
            buffers: unsafe { &mut *(&raw mut BUFFERS) },
            taken: 0,
            there: 0,
            clock_us: 0,
            sequence: 0,
            last_count: processor::instructions(),
            counts: [0; 9],
        })
    }

    /// Books the instructions since the last call.
    fn book(&mut self, part: usize) {
        let now = processor::instructions();
        if let Some(count) = self.counts.get_mut(part) {
            *count = processor::since(self.last_count, now) as u32;
        }
        self.last_count = processor::instructions();
    }
}

impl Board for EmulatedBoard {
    type Error = BoardError;

    fn next_scan(&mut self, points: &mut [LabelledPoint]) -> Result<Option<ScanHeader>, BoardError> {
        self.last_count = processor::instructions();
        loop {
            if self.taken == self.there {
                self.there =
                    self.recording.read(&mut self.buffers.piece).map_err(|_| BoardError::Recording)?;
                self.taken = 0;
                if self.there == 0 {
                    return Ok(None);
                }
            }
            let piece = self.buffers.piece.get(self.taken..self.there).unwrap_or_default();
            let (used, received) = self.reader.read(piece, points);
            self.taken += used;
            match received {
                Some(Received::Scan(header)) => {
                    // Replayed at the time of its stamp.
                    self.clock_us = self.clock_us.max((header.stamp_s.max(0.0) * 1e6) as u64);
                    self.sequence = header.sequence;
                    self.book(0);
                    return Ok(Some(header));
                }
                Some(Received::Damaged(error)) => defmt::warn!("{}", error),
                None => {}
            }
        }
    }

    fn now_us(&mut self) -> u64 {
        self.clock_us
    }

    fn publish(&mut self, answer: Answer<'_>) -> Result<(), BoardError> {
        self.last_count = processor::instructions();
        let bytes = write_answer(answer, &mut self.buffers.answer).map_err(|_| BoardError::AnswerTooLarge)?;
        self.book(8);
        let bytes = self.buffers.answer.get(..bytes).unwrap_or_default();
        self.answers.write_all(bytes).map_err(|_| BoardError::Answers)
    }

    fn alive(&mut self) {
        // The emulated boards have no watchdog: the heartbeat goes to the log, with what the scan cost.
        defmt::info!("scan {=u32} instructions {}", self.sequence, self.counts);
    }

    fn fault(&mut self, fault: Fault) {
        defmt::warn!("scan {=u32}: {}", self.sequence, fault);
    }

    fn stage_finished(&mut self, stage: Stage) {
        self.book(1 + stage as usize);
    }
}
