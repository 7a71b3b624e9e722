//! Options written to files and read back: a run is reproducible from a file.
#![cfg(feature = "serde")]

use std::fmt::Debug;
use std::ops::ControlFlow;

use semismooth::complementarity::active_set::{ActiveSetOptions, ActiveSetSolver};
use semismooth::complementarity::pivoting::{Lemke, LemkeOptions};
use semismooth::complementarity::{Lcp, McpOptions, McpSolver};
use semismooth::cones::ConeOptions;
use semismooth::contact::{
    CondensedContact, ContactBody, ContactOptions, DelassusOptions, DelassusSolver, EvolutionOptions,
    FixedPointOptions, FrictionCoefficient, FrictionCurve, LoadPath, PlanarCoulomb, ReducedOptions, evolve,
    fixed_point,
};
use semismooth::continuation::{
    ContinuationOptions, Diagram, DiagramOptions, SearchOptions, Strategy, search_solutions,
};
use semismooth::enumeration::EnumerationOptions;
use semismooth::newton::{Damping, NewtonKrylovOptions, NewtonOptions};
use semismooth::piecewise::check::CheckOptions;
use semismooth::piecewise::{MinMap, RegularityOptions};
use semismooth::sparse::Matrix;
use serde_json::json;

/// Defaults survive JSON, an empty file gives them, and unknown names are errors that name them. One format serves for all types, since
/// each further one is compiled again for each of them.
fn check<T: Default + PartialEq + Debug + serde::Serialize + serde::de::DeserializeOwned>() {
    let default = T::default();
    let text = serde_json::to_string(&default).unwrap();
    assert_eq!(serde_json::from_str::<T>(&text).unwrap(), default, "{text}");
    assert_eq!(serde_json::from_str::<T>("{}").unwrap(), default);
    let wrong = serde_json::from_str::<T>(r#"{ "no_such_option": 1 }"#).unwrap_err();
    assert!(wrong.to_string().contains("no_such_option"), "{wrong}");
}

#[test]
fn all_options_have_files() {
    check::<NewtonOptions>();
    check::<NewtonKrylovOptions>();
    check::<ContinuationOptions>();
    check::<DiagramOptions>();
    check::<SearchOptions>();
    #[cfg(feature = "svg")]
    check::<semismooth::output::ReportOptions>();
    check::<EnumerationOptions>();
    check::<CheckOptions>();
    check::<RegularityOptions>();
    check::<McpOptions>();
    check::<ActiveSetOptions>();
    check::<LemkeOptions>();
    check::<ConeOptions>();
    check::<DelassusOptions>();
    check::<FixedPointOptions>();
    check::<ContactOptions>();
    check::<EvolutionOptions>();
    check::<ReducedOptions>();
}

#[test]
fn names_are_those_of_the_fields() {
    let newton: NewtonOptions = toml::from_str("max_iterations = 7\ndamping = \"Always\"").unwrap();
    let expected = NewtonOptions::default()
        .with_max_iterations(7)
        .with_damping(Damping::Always);
    assert_eq!(newton, expected);
    assert_eq!(
        toml::from_str::<NewtonOptions>("").unwrap(),
        NewtonOptions::default()
    );
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

/// A value is read back from its file to the last bit.
fn same<T: PartialEq + Debug + serde::Serialize + serde::de::DeserializeOwned>(value: &T) {
    let text = serde_json::to_string(value).unwrap();
    assert_eq!(&serde_json::from_str::<T>(&text).unwrap(), value, "{text}");
}

#[test]
fn reports_of_complementarity_survive_files() {
    let matrix = Matrix::from_rows(&[[2.0, -1.0], [-1.0, 2.0]]).unwrap();
    let lcp = Lcp::new(matrix, vec![-1.0, 0.3]).unwrap();
    let mut z = [0.0; 2];
    let mut solver = McpSolver::new(McpOptions::default());
    same(solver.solve(lcp.mcp(), &mut z).unwrap());
    same(
        &ActiveSetSolver::new(ActiveSetOptions::default())
            .solve(&lcp, &mut [0.0; 2])
            .unwrap(),
    );
    same(
        &Lemke::new(LemkeOptions::default())
            .solve(&lcp, &mut [0.0; 2])
            .unwrap(),
    );
}

#[test]
fn states_of_contact_survive_files() {
    let rows = |row: [f64; 2]| Matrix::from_rows(&[row]).unwrap();
    let stiffness = Matrix::from_rows(&[[2.0, -1.0], [-1.0, 2.0]]).unwrap();
    let load = LoadPath::affine(vec![1.5, 7.0], vec![1.0, 0.0]);
    let body = ContactBody::new(stiffness, rows([1.0, 0.0]), vec![rows([0.0, 1.0])], load).unwrap();
    let friction = FrictionCoefficient::uniform(FrictionCurve::constant(0.3).unwrap());
    let mut contact = CondensedContact::new(body, PlanarCoulomb::new(friction)).unwrap();
    let x = contact.solve(0.0, None).unwrap();
    same(&contact.solution(&x).unwrap());
    same(&fixed_point(&contact, &x, &FixedPointOptions::default()).unwrap());
    let problem = contact.delassus(0.0).unwrap();
    same(
        &DelassusSolver::new(DelassusOptions::default())
            .solve(&problem)
            .unwrap(),
    );
    let steps = evolve(
        &mut contact,
        &x,
        &[0.2, 0.1],
        &EvolutionOptions::default(),
        |_| ControlFlow::Continue(()),
    )
    .unwrap();
    assert_eq!(steps.len(), 2);
    same(&steps);
}

#[test]
fn lists_of_solutions_survive_files() {
    let map = MinMap::curve(1, |x: &[f64], a: &mut [f64], b: &mut [f64]| {
        a[0] = x[0] - x[1];
        b[0] = x[0] + x[1];
    });
    let range = ContinuationOptions::default().with_parameter_range((-1.0, 1.0));
    let options = DiagramOptions::default().with_continuation(range);
    let diagram = Diagram::explore(&map, &[[0.5, 0.5]], &options).unwrap();
    same(&diagram);
    same(&diagram.branches());
    same(&diagram.folds());
    same(&diagram.solutions_at(&map, 0.25).unwrap());
    same(
        &search_solutions(
            &map,
            0.25,
            &[[0.5, 0.25]],
            &SearchOptions::default().with_diagram(options),
        )
        .unwrap(),
    );
    // A file whose parts do not fit together is refused as it is read.
    let mut file = serde_json::to_value(&diagram).unwrap();
    for (pointer, wrong) in [
        ("/edges/0/from/vertex", 99),
        ("/edges/0/to/arm", 99),
        ("/vertices/0/arms/0/edge", u64::MAX),
    ] {
        let mut spoilt = file.clone();
        *spoilt.pointer_mut(pointer).unwrap() = json!(wrong);
        let error = serde_json::from_str::<Diagram>(&spoilt.to_string()).unwrap_err();
        assert!(error.to_string().contains("of the diagram"), "{error}");
    }
    // One that fits, but not the map, is refused as it is used.
    *file.pointer_mut("/edges/0/points/0/selection/pieces/0").unwrap() = json!(7);
    let foreign: Diagram = serde_json::from_str(&file.to_string()).unwrap();
    let error = foreign.solutions_at(&map, 0.25).unwrap_err();
    assert!(error.to_string().contains("piece 7 at site 0"), "{error}");
}
