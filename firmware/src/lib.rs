//! The portable application of the microcontroller.
#![no_std]
