//! Curves with known transitions, folds and branch points; diagrams, lists, saved runs.

#[path = "../common/mod.rs"]
mod common;
#[path = "../dense/mod.rs"]
mod dense;
#[path = "../maps/mod.rs"]
mod maps;
#[path = "../common/random.rs"]
mod random;
#[path = "../../examples/common/squares.rs"]
mod squares;
#[allow(dead_code)]
#[path = "../support/mod.rs"]
mod support;

mod altered;
mod black_box;
mod chains;
mod clusters;
mod control;
mod curves;
mod diagram;
mod diagram_output;
mod diagram_resume;
mod embedded;
mod enumeration;
mod friction_parameter;
mod ill_conditioned;
mod kinks;
mod live_output;
mod load_paths;
mod local_arms;
mod many_kinks;
mod monitors;
mod near_crossings;
mod nested_kinks;
mod printed_examples;
mod printed_runs;
mod reproducibility;
mod resume;
mod row_units;
mod search;
mod small_angles;
mod smooth;
mod step_control;
mod transition_sets;
mod uniqueness;
mod units;
mod within_steps;
