//! Loop detection: keypoints, descriptors, the table of places, and what is found in a simulated street.

mod features;
mod streets;
mod table;
