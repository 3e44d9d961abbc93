//! Search without derivatives.

pub mod pso;
