//! Rigident from outside, as a program and as a library: `cargo test --release -p rigident --test integration NAME`.
//!
//! One program for all of them, because linking costs more than most of what they test. Tests that hold the wall clock
//! are in `real_time`.

mod accuracy;
mod autocorrelation;
mod body_identify;
mod body_rows;
mod c3d_independent;
mod calibrate_joints;
mod calibrate_joints_contacts;
mod calibrate_joints_faults;
mod calibration;
mod command_line;
mod commands;
mod device_precision;
mod device_tree_commands;
mod documents;
mod examples;
mod factors;
mod failures;
mod fitting;
mod flashed_image;
mod forgetting;
mod knocks;
mod known;
mod legged;
mod mcap_damage;
mod mcap_independent;
mod model_commands;
mod monitor;
mod montecarlo;
mod motion_page;
mod no_simulator;
mod opensim_independent;
mod payload;
mod pendulum;
mod plan_excitation;
mod plan_motion;
mod plan_poses;
mod predict;
mod program;
mod published_robots;
mod rates;
mod report;
mod rig_errors;
mod streams;
mod support;
mod trajectory_independent;
mod tree_commands;
mod tree_pinocchio;
mod trees;
mod vibration;
mod weakest;
mod workspace;
mod wrong_recordings;
mod wrong_trials;
