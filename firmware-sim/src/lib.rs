//! SD-SLAM's on-vehicle loop: fetch a labelled scan, find the pose, publish it.
//!
//! The library is what runs in the vehicle: no standard library, no allocation, no panic, memory that the caller
//! provides. The program of this crate runs the same loop on a desk: on the recording that comes with it, on one made by
//! `sdslam run --record FILE`, or on a drive; `firmware-sim/board/` runs it on emulated ECUs.
//!
//! ```sh
//! cargo run --release --bin sdslam-firmware-sim -- --help
//! ```
//!
//! # Porting to a board
//!
//! Implement [`Board`], provide the memory of an odometry and of the points of a scan, call [`run`]:
//!
//! ```
//! use sdslam_core::{Config, LabelledPoint, Odometry, SemanticClass};
//! use sdslam_firmware_sim::wire::Answer;
//! use sdslam_firmware_sim::{Board, Fault, ScanHeader, Totals, run};
//!
//! struct OneScan(bool);
//!
//! impl Board for OneScan {
//!     type Error = core::convert::Infallible;
//!
//!     fn next_scan(&mut self, points: &mut [LabelledPoint]) -> Result<Option<ScanHeader>, Self::Error> {
//!         if core::mem::replace(&mut self.0, true) {
//!             return Ok(None);
//!         }
//!         points[0] = LabelledPoint::new([5.0, 0.0, -1.7], SemanticClass::Road);
//!         Ok(Some(ScanHeader { sequence: 0, stamp_s: 0.0, points: 1 }))
//!     }
//!
//!     fn now_us(&mut self) -> u64 {
//!         0 // a timer of the board
//!     }
//!
//!     fn publish(&mut self, answer: Answer<'_>) -> Result<(), Self::Error> {
//!         println!("{}", answer.estimate.map_from_sensor);
//!         Ok(())
//!     }
//!
//!     fn alive(&mut self) {} // feed the watchdog
//!
//!     fn fault(&mut self, fault: Fault) {
//!         eprintln!("{fault}");
//!     }
//! }
//!
//! // A small profile; the capacities are explained in `sdslam_core::capacity`.
//! let mut odometry = Box::new(Odometry::<1024, 128, 32, 16, 256, 32>::new(Config::accurate())?);
//! let mut points = [LabelledPoint::new([0.0; 3], SemanticClass::Unlabelled); 1024];
//! let mut totals = Totals::default();
//! run(&mut OneScan(false), &mut *odometry, &mut points, &mut totals)?;
//! assert_eq!(totals.estimates, 1);
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```
#![no_std]

mod any_odometry;
mod board;
mod clock;
mod loops;
pub mod memory;
pub mod profile;
mod saved;
mod vehicle;
pub mod wire;

pub use board::{Board, Fault, ScanHeader};
pub use clock::SensorClock;
pub use saved::SAVED_HEAD_BYTES;
pub use vehicle::{HighWater, Totals, run};
