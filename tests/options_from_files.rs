//! Options written to files and read back: a run is reproducible from a file.
#![cfg(feature = "serde")]

use std::fmt::Debug;

use semismooth::complementarity::McpOptions;
use semismooth::complementarity::active_set::ActiveSetOptions;
use semismooth::complementarity::pivoting::LemkeOptions;
use semismooth::contact::{DelassusOptions, FixedPointOptions};
use semismooth::continuation::{ContinuationOptions, DiagramOptions, SearchOptions, Strategy};
use semismooth::enumeration::EnumerationOptions;
use semismooth::newton::{Damping, NewtonOptions};
use semismooth::piecewise::check::CheckOptions;
use serde_json::json;

/// Defaults survive JSON, an empty file gives them, and names that do not exist are errors which name them.
fn check<T: Default + PartialEq + Debug + serde::Serialize + serde::de::DeserializeOwned>() {
    let default = T::default();
    let text = serde_json::to_string(&default).unwrap();
    assert_eq!(serde_json::from_str::<T>(&text).unwrap(), default, "{text}");
    assert_eq!(serde_json::from_str::<T>("{}").unwrap(), default);
    assert_eq!(toml::from_str::<T>("").unwrap(), default);
    let wrong = serde_json::from_value::<T>(json!({ "no_such_option": 1 })).unwrap_err();
    assert!(wrong.to_string().contains("no_such_option"), "{wrong}");
}

#[test]
fn all_options_have_files() {
    check::<NewtonOptions>();
    check::<ContinuationOptions>();
    check::<DiagramOptions>();
    check::<SearchOptions>();
    check::<EnumerationOptions>();
    check::<CheckOptions>();
    check::<McpOptions>();
    check::<ActiveSetOptions>();
    check::<LemkeOptions>();
    check::<DelassusOptions>();
    check::<FixedPointOptions>();
}

#[test]
fn names_are_those_of_the_fields() {
    let newton: NewtonOptions = toml::from_str("max_iterations = 7\ndamping = \"Always\"").unwrap();
    let expected = NewtonOptions::default()
        .with_max_iterations(7)
        .with_damping(Damping::Always);
    assert_eq!(newton, expected);
}

#[test]
fn infinities_are_words() {
    let text = r#"{ "parameter_range": ["-inf", 2], "max_arclength": "inf", "max_step": 0.25, "strategy": "Switching" }"#;
    let options: ContinuationOptions = serde_json::from_str(text).unwrap();
    assert_eq!(options.parameter_range, (f64::NEG_INFINITY, 2.0));
    assert_eq!(
        (options.max_arclength, options.max_step, options.strategy),
        (f64::INFINITY, 0.25, Strategy::Switching)
    );
    let same: ContinuationOptions = toml::from_str(
        "parameter_range = [-inf, 2.0]\nmax_arclength = inf\nmax_step = 0.25\nstrategy = \"Switching\"",
    )
    .unwrap();
    assert_eq!(same, options);
    let wrong = serde_json::from_str::<ContinuationOptions>(r#"{ "max_arclength": "far" }"#).unwrap_err();
    assert!(wrong.to_string().contains("far"), "{wrong}");
}
