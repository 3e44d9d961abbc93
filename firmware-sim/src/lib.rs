//! On-vehicle loop.
#![no_std]
