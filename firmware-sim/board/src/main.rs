//! The on-vehicle loop on an emulated board: scans come from the file `recording.sdr`, answers go to `answers.sda`, both
//! through semihosting in the emulator's working folder; what happens is logged through defmt.
#![no_std]
#![no_main]

use core::mem::MaybeUninit;
use core::panic::PanicInfo;

use defmt_semihosting as _;
use sdslam_core::LabelledPoint;
use sdslam_firmware_sim::profile::Profile;
use sdslam_firmware_sim::{Totals, run};
use semihosting::process::ExitCode;

mod board;
#[cfg_attr(processor = "cortex_a", path = "cortex_a.rs")]
#[cfg_attr(processor = "cortex_m", path = "cortex_m.rs")]
#[cfg_attr(processor = "cortex_r", path = "cortex_r.rs")]
mod processor;
mod profile;
mod stack;

use board::EmulatedBoard;
use profile::{Chosen, Odometry};

type Points = [LabelledPoint; Chosen::POINTS];

#[unsafe(link_section = ".external")]
static mut ODOMETRY: MaybeUninit<Odometry> = MaybeUninit::uninit();
#[unsafe(link_section = ".external")]
static mut POINTS: MaybeUninit<Points> = MaybeUninit::uninit();

/// Sets a static to zero and hands it out.
///
/// # Safety
/// All-zero bytes must be a value of `T`, and nobody else may use the static, now or later.
unsafe fn zeroed<T>(memory: *mut MaybeUninit<T>) -> &'static mut T {
    // SAFETY: the pointer is that of a static, which lives for ever; the caller vouches for the rest.
    unsafe {
        memory.write_bytes(0, 1);
        (*memory).assume_init_mut()
    }
}

/// What every board does once its processor is set up.
fn start() -> ExitCode {
    // SAFETY: numbers, options of numbers, arrays and fieldless enums with a zero variant; called once.
    let (odometry, points) = unsafe { (zeroed(&raw mut ODOMETRY), zeroed(&raw mut POINTS)) };
    // The odometry is all zeros so far: this makes it that of `Odometry::new`, without a copy on the stack.
    if odometry.restart(Chosen::CONFIG).is_err() {
        defmt::error!("the configuration is out of range");
        return ExitCode::FAILURE;
    }
    stack::paint();
    let code = drive(odometry, points);
    let peak = stack::peak_bytes();
    defmt::info!("peak stack {=usize} bytes", peak);
    code
}

#[inline(never)]
fn drive(odometry: &mut Odometry, points: &mut Points) -> ExitCode {
    let mut totals = Totals::default();
    let end = EmulatedBoard::open().and_then(|mut board| run(&mut board, odometry, points, &mut totals));
    let Totals { scans, estimates, predicted, faults, .. } = totals;
    defmt::info!(
        "{=u32} scans, {=u32} estimates, {=u32} predicted, {=u32} faults",
        scans,
        estimates,
        predicted,
        faults
    );
    match end {
        Ok(()) => ExitCode::SUCCESS,
        Err(error) => {
            defmt::error!("{}", error);
            ExitCode::FAILURE
        }
    }
}

#[panic_handler]
fn panic(_: &PanicInfo<'_>) -> ! {
    defmt::error!("panicked");
    semihosting::process::exit(101)
}
