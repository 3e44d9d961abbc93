//! The memory profile that the programs are built for.

use sdslam_firmware_sim::profile::Profile;

#[cfg(not(feature = "landmark"))]
pub use sdslam_firmware_sim::profile::FullScan as Chosen;
#[cfg(feature = "landmark")]
pub use sdslam_firmware_sim::profile::LandmarkOnly as Chosen;

/// Its odometry.
pub type Odometry = <Chosen as Profile>::Odometry;
