//! Link-time proof that no panic can be reached from the hot path: a program of nothing else, whose panic handler calls a
//! function that does not exist. It links exactly when the linker has thrown the handler away.
#![no_std]
#![no_main]

use core::hint::black_box;
use core::panic::PanicInfo;
use core::ptr;

use sdslam_core::{LabelledPoint, LabelledScan};
use sdslam_firmware_sim::wire::{Received, ScanReader};

mod profile;

use profile::Odometry;

/// The hot path: bytes to a scan, a scan to an estimate. The memory is the caller's.
///
/// # Safety
/// The pointers must be valid for what they point to.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn hot_path(
    bytes: *const u8,
    length: usize,
    points: *mut LabelledPoint,
    capacity: usize,
    reader: *mut ScanReader,
    odometry: *mut Odometry,
) -> u32 {
    // SAFETY: the caller vouches for it.
    let (bytes, points, reader) = unsafe {
        (
            &*ptr::slice_from_raw_parts(bytes, length),
            &mut *ptr::slice_from_raw_parts_mut(points, capacity),
            &mut *reader,
        )
    };
    let (_, received) = reader.read(bytes, points);
    let Some(Received::Scan(header)) = received else { return 0 };
    let points = points.get_mut(..header.points).unwrap_or_default();
    let mut scan = LabelledScan { stamp_s: header.stamp_s, points };
    // SAFETY: the caller vouches for it.
    black_box(unsafe { (*odometry).process_scan(&mut scan) }.is_ok());
    black_box(&mut scan);
    1
}

unsafe extern "C" {
    /// Does not exist.
    fn a_panic_can_be_reached() -> !;
}

#[panic_handler]
fn panic(_: &PanicInfo<'_>) -> ! {
    // SAFETY: never linked.
    unsafe { a_panic_can_be_reached() }
}
