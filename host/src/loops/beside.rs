//! The back end runs beside the core where there is a thread for it; the order of the scans, and so the result, stays.

use std::sync::mpsc::{self, SyncSender};
use std::thread::{self, JoinHandle};

use cpu_time::ThreadTime;

use super::{BackEnd, BackEndResult, BackEndScan};
use crate::run::RunError;

/// Scans that may wait: bounds the memory when the core is faster.
const WAITING: usize = 4;

/// A back end, and the CPU time that every scan took it \[ms\]: it has no clock of its own.
pub(crate) struct Timed {
    back_end: Box<BackEnd>,
    cpu_ms: Vec<f32>,
}

impl Timed {
    fn add(&mut self, scan: BackEndScan) -> Result<(), RunError> {
        let start = ThreadTime::now();
        let done = self.back_end.add(scan);
        self.cpu_ms.push(start.elapsed().as_secs_f32() * 1e3);
        done
    }
}

/// A back end at work.
pub(crate) enum Beside {
    /// By the caller's thread.
    InTurns(Timed),
    /// By a thread of its own, which gives the back end back when there are no more scans.
    Thread {
        /// Where the scans go.
        scans: SyncSender<BackEndScan>,
        /// The thread.
        worker: JoinHandle<Result<Timed, RunError>>,
    },
}

impl Beside {
    /// Begins; with more than one thread, beside the caller.
    pub(crate) fn start(back_end: Box<BackEnd>, threads: usize) -> Self {
        let mut timed = Timed { back_end, cpu_ms: Vec::new() };
        if threads < 2 {
            return Self::InTurns(timed);
        }
        let (scans, waiting) = mpsc::sync_channel::<BackEndScan>(WAITING);
        let worker = thread::spawn(move || {
            for scan in waiting {
                timed.add(scan)?;
            }
            Ok(timed)
        });
        Self::Thread { scans, worker }
    }

    /// Hands over a scan.
    pub(crate) fn add(&mut self, scan: BackEndScan) -> Result<(), RunError> {
        match self {
            Self::InTurns(timed) => timed.add(scan),
            // Sending fails only after the worker stopped with an error, which `finish` passes on.
            Self::Thread { scans, .. } => {
                drop(scans.send(scan));
                Ok(())
            }
        }
    }

    /// The result, when all scans are in, and the CPU time of every scan \[ms\].
    pub(crate) fn finish(self) -> Result<(BackEndResult, Vec<f32>), RunError> {
        let Timed { back_end, cpu_ms } = match self {
            Self::InTurns(timed) => timed,
            Self::Thread { scans, worker } => {
                drop(scans);
                worker.join().unwrap_or_else(|panic| std::panic::resume_unwind(panic))?
            }
        };
        Ok((back_end.finish()?, cpu_ms))
    }
}
