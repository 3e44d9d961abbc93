//! Segmentation: networks of the published architectures against ONNX Runtime, the real test network against its
//! reference, the way from pixels to points against a plain one, and files that are wrong.

mod bad_files;
mod nearest_neighbours;
mod networks;
mod reference;
mod scans;
mod support;
