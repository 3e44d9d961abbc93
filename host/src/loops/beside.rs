//! The back end runs beside the core where there is a thread for it; the order of the scans, and so the result, stays.

use std::sync::mpsc::{self, SyncSender};
use std::thread::{self, JoinHandle};

use super::{BackEnd, BackEndResult, BackEndScan};
use crate::run::RunError;

/// Scans that may wait: bounds the memory when the core is faster.
const WAITING: usize = 4;

/// A back end at work.
pub(crate) enum Beside {
    /// By the caller's thread.
    InTurns(Box<BackEnd>),
    /// By a thread of its own, which gives the back end back when there are no more scans.
    Thread {
        /// Where the scans go.
        scans: SyncSender<BackEndScan>,
        /// The thread.
        worker: JoinHandle<Result<Box<BackEnd>, RunError>>,
    },
}

impl Beside {
    /// Begins; with more than one thread, beside the caller.
    pub(crate) fn start(mut back_end: Box<BackEnd>, threads: usize) -> Self {
        if threads < 2 {
            return Self::InTurns(back_end);
        }
        let (scans, waiting) = mpsc::sync_channel::<BackEndScan>(WAITING);
        let worker = thread::spawn(move || {
            for scan in waiting {
                back_end.add(scan)?;
            }
            Ok(back_end)
        });
        Self::Thread { scans, worker }
    }

    /// Hands over a scan.
    pub(crate) fn add(&mut self, scan: BackEndScan) -> Result<(), RunError> {
        match self {
            Self::InTurns(back_end) => back_end.add(scan),
            // Sending fails only after the worker stopped with an error, which `finish` passes on.
            Self::Thread { scans, .. } => {
                drop(scans.send(scan));
                Ok(())
            }
        }
    }

    /// The result, when all scans are in.
    pub(crate) fn finish(self) -> Result<BackEndResult, RunError> {
        let back_end = match self {
            Self::InTurns(back_end) => back_end,
            Self::Thread { scans, worker } => {
                drop(scans);
                worker.join().unwrap_or_else(|panic| std::panic::resume_unwind(panic))?
            }
        };
        back_end.finish()
    }
}
