//! Limits, observers that stop, and linear systems that break down: the best iterate is kept.

use std::ops::ControlFlow;
use std::sync::atomic::{AtomicUsize, Ordering};
use std::time::Duration;

use semismooth::InputError;
use semismooth::contact::{
    CondensedContact, ContactError, ContactStrategy, LoadPath, LocalRow, LocalValues, NodeLaw,
    OrthotropicCoulomb, PlanarCoulomb, ReducedBody, ReducedContact, ReducedError, ReducedNodes,
    ReducedOptions, ReducedProgress, ReducedStep, ReducedSystem, solve_reduced,
};
use semismooth::fem::Material;
use semismooth::linear::{KrylovReport, LinearError};
use semismooth::run::Status;

use crate::{block, constant, ground, rectangle, reduced_body};

/// An observer ends a search at any call, also within a linear solve, and is not called again; a search from the best iterate, which is
/// returned, ends at the same solution.
#[test]
fn observers_stop_searches() {
    let system = block([6, 6, 3], Material::isotropic(1.0, 0.277).unwrap());
    let problem = |options: ReducedOptions| {
        let law = OrthotropicCoulomb::isotropic(constant(0.3));
        ReducedContact::new(reduced_body(&system, &ground(3)), law, options).unwrap()
    };
    let mut seen: Vec<ReducedProgress> = Vec::new();
    let expected = problem(ReducedOptions::default()).solve_observed(1.0, None, |p| {
        seen.push(*p);
        ControlFlow::Continue(())
    });
    let expected = expected.unwrap();
    let starts: Vec<usize> = (0..seen.len()).filter(|k| seen[*k].krylov == 0).collect();
    let steps: Vec<usize> = expected.iterations.iter().map(|i| i.krylov).collect();
    assert!(steps.iter().all(|k| *k > 1), "{steps:?}");
    assert_eq!(seen[1].residual, expected.iterations[0].residuals.largest());
    let largest = expected.forces.iter().fold(0.0f64, |m, v| m.max(v.abs()));
    // In the middle of the last step but one, and before the first iteration of the last one: later iterates may be solutions.
    let last = starts.len();
    for stop in [0, 1, 3, starts[last - 4] + 1, starts[last - 2]] {
        let (mut calls, mut stopping) = (0, problem(ReducedOptions::default()));
        let found = stopping.solve_observed(1.0, None, |_| {
            calls += 1;
            match calls > stop {
                true => ControlFlow::Break(()),
                false => ControlFlow::Continue(()),
            }
        });
        let Err(ContactError::NotConverged { best }) = found else {
            panic!("{stop}: {found:?}");
        };
        assert_eq!(best.status, Status::Interrupted);
        assert_eq!((calls, best.newton()), (stop + 1, seen[stop].newton));
        assert!(best.residuals.largest() > 1e-10);
        let own = stopping.solution(1.0, &best.displacements).unwrap();
        assert!((own.residuals.equilibrium - best.residuals.equilibrium).abs() <= 1e-10);
        let again = stopping.solve(1.0, Some(&best.displacements)).unwrap();
        let pairs = again.forces.iter().zip(&expected.forces);
        assert!(pairs.fold(0.0f64, |m, (a, b)| m.max((a - b).abs())) <= 1e-8 * largest);
    }
    // In the attempts of the condensed form, which follow after Newton steps and load steps have failed.
    let few = expected.newton() - 1;
    let options = ReducedOptions::default()
        .with_max_iterations(few)
        .with_max_load_steps(0);
    let mut ends = 0;
    let found = problem(options).solve_observed(1.0, None, |p| {
        ends += usize::from((p.newton, p.krylov) == (few, 0));
        match ends {
            2 => ControlFlow::Break(()),
            _ => ControlFlow::Continue(()),
        }
    });
    assert!(
        matches!(&found, Err(ContactError::NotConverged { best }) if best.status == Status::Interrupted),
        "{found:?}"
    );
}

/// A history stopped on the way to a level keeps the levels before, and resumes from there as if uninterrupted.
#[test]
fn histories_stopped_on_the_way_go_on() {
    let system = rectangle([24, 12]);
    let problem = || {
        let law = PlanarCoulomb::new(constant(0.3));
        ReducedContact::new(reduced_body(&system, &ground(2)), law, ReducedOptions::default()).unwrap()
    };
    let levels = [0.4, 0.8, 1.2];
    let whole = problem()
        .evolve(None, &levels, |_| ControlFlow::Continue(()))
        .unwrap();
    let (mut stopping, done) = (problem(), AtomicUsize::new(0));
    let before = stopping.evolve_observed(
        None,
        &levels,
        |_| match done.load(Ordering::Relaxed) {
            2 => ControlFlow::Break(()),
            _ => ControlFlow::Continue(()),
        },
        |_| {
            done.fetch_add(1, Ordering::Relaxed);
            ControlFlow::Continue(())
        },
    );
    let before = before.unwrap();
    assert_eq!(before.len(), 2);
    for (a, b) in before.iter().zip(&whole) {
        assert_eq!(a.report.displacements, b.report.displacements);
    }
    let last = stopping
        .solve(levels[2], Some(&before[1].report.displacements))
        .unwrap();
    let largest = last.forces.iter().fold(0.0f64, |m, v| m.max(v.abs()));
    for (a, b) in last.forces.iter().zip(&whole[2].report.forces) {
        assert!((a - b).abs() <= 1e-8 * largest);
    }
    // From the beginning again, once slips and histories have been reset.
    stopping
        .set_reference_slip(&vec![0.0; stopping.body().num_contacts()])
        .unwrap();
    stopping.set_history(&[]).unwrap();
    let first = stopping.solve(levels[0], None).unwrap();
    for (a, b) in first.forces.iter().zip(&whole[0].report.forces) {
        assert!((a - b).abs() <= 1e-8 * largest);
    }
}

/// A diagonal matrix whose linear solver breaks down at a given solve, or whose products are NaN from a given one on.
struct Brittle {
    diagonal: Vec<f64>,
    constrained: Vec<usize>,
    added: Vec<(usize, usize, f64)>,
    solves: usize,
    products: usize,
    /// The fraction of the right-hand side that remains after a solve.
    left: f64,
}

impl Brittle {
    const NODES: ReducedNodes<'static> = ReducedNodes {
        components: &[0],
        first: 0,
        gap: &[10.0],
        reference: &[],
        history: &[],
        r: 1.0,
        parameter: 0.0,
    };

    fn new(solves: usize, products: usize, left: f64) -> Self {
        Self {
            diagonal: vec![2.0, 4.0, 1.0, 1.0],
            constrained: Vec::new(),
            added: Vec::new(),
            solves,
            products,
            left,
        }
    }
}

impl ReducedSystem for Brittle {
    type Error = LinearError;

    fn len(&self) -> usize {
        self.diagonal.len()
    }

    fn mul(&mut self, u: &[f64], out: &mut [f64]) -> Result<(), LinearError> {
        self.products = self.products.saturating_sub(1);
        for ((out, u), a) in out.iter_mut().zip(u).zip(&self.diagonal) {
            *out = if self.products == 0 { f64::NAN } else { a * u };
        }
        Ok(())
    }

    fn select(&mut self, step: &ReducedStep<'_>) -> Result<(), LinearError> {
        (self.constrained, self.added) = (step.constrained.to_vec(), step.added.to_vec());
        Ok(())
    }

    /// Solves inexactly, so that Newton's method takes a few steps.
    fn solve(&mut self, r: &[f64], d: &mut [f64], _: f64) -> Result<KrylovReport, LinearError> {
        self.solves = self.solves.saturating_sub(1);
        if self.solves == 0 {
            return Err(LinearError::NotFactored);
        }
        for (k, d) in d.iter_mut().enumerate() {
            let more = self.added.iter().filter(|a| (a.0, a.1) == (k, k)).map(|a| a.2);
            *d = (1.0 - self.left) * r[k] / (self.diagonal[k] + more.sum::<f64>());
        }
        self.constrained.iter().for_each(|k| d[*k] = 0.0);
        Ok(KrylovReport::new(Status::Stalled, 1, self.left))
    }

    fn sum(&self, _: &mut [f64]) -> Result<(), LinearError> {
        Ok(())
    }

    fn max(&self, _: &mut [f64]) -> Result<(), LinearError> {
        Ok(())
    }
}

/// A linear solver that breaks down leaves the best iterate so far with its history and forces; NaN products are not taken for a solution,
/// although a NaN residual exceeds no tolerance.
#[test]
fn breakdowns_leave_the_best_iterate() {
    let solve = |solves: usize, products: usize, left: f64| {
        let mut system = Brittle::new(solves, products, left);
        let law = PlanarCoulomb::new(constant(0.3));
        let load = [1.0, 0.5, 3.0, -1.0];
        let options = ReducedOptions::default().with_max_load_steps(0);
        solve_reduced(&mut system, &Brittle::NODES, &law, &load, vec![0.0; 4], &options)
    };
    let mut before = f64::INFINITY;
    for solves in 1..6 {
        let Err(ReducedError::System { source, best }) = solve(solves, usize::MAX, 0.25) else {
            panic!("{solves}");
        };
        assert_eq!((source, best.newton()), (LinearError::NotFactored, solves));
        // Each step leaves a quarter of the error of u = (1/2, 1/8, 3, −1), where no node is in contact.
        let left = 0.25f64.powi(solves as i32 - 1);
        for (u, exact) in best.displacements.iter().zip([0.5, 0.125, 3.0, -1.0]) {
            // The open node keeps some 1e-9 of r as stiffness.
            assert!((u - (1.0 - left) * exact).abs() <= 1e-8);
        }
        assert!((best.residuals.equilibrium - left).abs() <= 1e-8);
        assert!((best.forces[0] - left).abs() <= 1e-8 && best.residuals.largest() < before);
        before = best.residuals.largest();
    }
    match solve(usize::MAX, 1, 0.25) {
        Err(ReducedError::Contact(ContactError::NotConverged { best })) => {
            assert_eq!(best.residuals.largest(), f64::INFINITY);
        }
        other => panic!("{other:?}"),
    }
    // Steps that leave most of the right-hand side are rejected.
    match solve(usize::MAX, usize::MAX, 0.75) {
        Err(ReducedError::Contact(ContactError::NotConverged { best })) => {
            assert_eq!(best.displacements, [0.0; 4]);
            assert!(best.iterations.iter().all(|i| i.step == 0.0 && i.krylov == 1));
            assert_eq!((best.newton(), best.residuals.equilibrium), (1, 1.0));
        }
        other => panic!("{other:?}"),
    }
}

/// Coulomb's law, except that nodes which have slipped prescribe their slip and no force.
#[derive(Clone)]
struct Driven(PlanarCoulomb);

impl NodeLaw for Driven {
    fn num_tangents(&self) -> usize {
        1
    }
    fn tests(&self, v: &LocalValues, out: &mut [f64]) {
        self.0.tests(v, out);
    }
    fn test_rows(&self, v: &LocalValues, rows: &mut [LocalRow]) {
        self.0.test_rows(v, rows);
    }
    fn residual(&self, piece: usize, v: &LocalValues) -> [f64; 3] {
        let h = self.0.residual(piece, v);
        if piece < 2 || v.slip[0] == 0.0 {
            h
        } else {
            [h[0], v.slip[0] - 1.0, 0.0]
        }
    }
    fn rows(&self, piece: usize, v: &LocalValues) -> [LocalRow; 3] {
        let rows = self.0.rows(piece, v);
        if piece < 2 || v.slip[0] == 0.0 {
            rows
        } else {
            [rows[0], LocalRow::of_slip(0), rows[2]]
        }
    }
}

/// A law that cannot be eliminated ends the solve with the steps made so far, and their forces.
#[test]
fn laws_that_do_not_determine_forces_leave_the_best_iterate() {
    let system = rectangle([8, 4]);
    let body = reduced_body(&system, &ground(2));
    let law = Driven(PlanarCoulomb::new(constant(0.3)));
    let mut problem = ReducedContact::new(body, law, ReducedOptions::default()).unwrap();
    match problem.solve(0.0, None) {
        Err(ContactError::NotReducible { node, piece, best }) => {
            assert!(node < system.contact("bottom", &ground(2)).unwrap().nodes.len());
            assert!(piece.starts_with("slip"), "{piece}");
            assert_eq!(best.displacements.len(), system.num_free());
            assert!(best.newton() > 0 && best.residuals.largest() < f64::INFINITY);
            let solution = problem.solution(0.0, &best.displacements).unwrap();
            let p = solution.nodes.len();
            for (k, v) in solution.nodes.iter().enumerate() {
                assert_eq!([v.pressure, v.traction[0]], [best.forces[k], best.forces[p + k]]);
            }
        }
        other => panic!("{other:?}"),
    }
}

/// Time that runs out before the multigrid hierarchy is built is reported.
#[test]
fn time_ends_the_making_of_a_problem() {
    let options = ReducedOptions::default().with_max_time(Some(Duration::ZERO));
    let body = reduced_body(
        &block([6, 6, 3], Material::isotropic(1.0, 0.3).unwrap()),
        &ground(3),
    );
    let made = ReducedContact::new(body, OrthotropicCoulomb::isotropic(constant(0.3)), options);
    assert_eq!(made.err(), Some(ContactError::Linear(LinearError::TimeLimit)));
}

/// A matrix that overflows is reported as such, not as indefinite.
#[test]
fn stiffness_beyond_the_range_of_numbers_is_refused() {
    let system = block([6, 6, 3], Material::isotropic(1e308, 0.3).unwrap());
    let rows = system.contact("bottom", &ground(3)).unwrap();
    let tangential = rows.tangential;
    let load = LoadPath::constant(vec![0.0; system.num_free()]);
    let body = ReducedBody::new(system.nodal_stiffness().unwrap(), &rows.normal, &tangential, load);
    match body.err() {
        Some(ContactError::Matrix {
            source: InputError::Entry { row, col, value },
            ..
        }) => assert!(!value.is_finite() && row.max(col) < system.num_free()),
        other => panic!("{other:?}"),
    }
}

/// Both forms report the memory they need and are refused with one byte less; the condensed form is not tried where it would not fit beside
/// multigrid.
#[test]
fn memory_is_reported_before_it_is_allocated() {
    let system = block([6, 6, 3], Material::isotropic(1.0, 0.277).unwrap());
    let law = || OrthotropicCoulomb::isotropic(constant(0.3));
    let body = || reduced_body(&system, &ground(3));
    let options = || {
        ReducedOptions::default()
            .with_max_iterations(1)
            .with_max_load_steps(0)
    };
    let contact = || body().to_contact_body().unwrap();
    let needed = contact().condensed_memory().unwrap();
    assert!(CondensedContact::within(contact(), law(), Some(needed), None).is_ok());
    let refused = CondensedContact::within(contact(), law(), Some(needed - 1), None).err();
    assert_eq!(
        refused,
        Some(ContactError::Memory {
            needed,
            limit: needed - 1
        })
    );
    // C, half of it, and a Jacobian with its factors at least.
    let traces = 3 * body().num_contacts() as u64;
    assert!(needed > 8 * 5 * traces * traces);

    let own = body().memory(&options());
    let made = |limit: u64| ReducedContact::new(body(), law(), options().with_max_memory(Some(limit)));
    let refused = made(own - 1).err();
    assert_eq!(
        refused,
        Some(ContactError::Memory {
            needed: own,
            limit: own - 1
        })
    );
    let tight = made(own + needed).unwrap().solve(1.0, None);
    assert!(
        matches!(tight, Err(ContactError::NotConverged { .. })),
        "{tight:?}"
    );
    let wide = made(own + 2 * needed + (64 << 20))
        .unwrap()
        .solve(1.0, None)
        .unwrap();
    assert_eq!(wide.strategy, ContactStrategy::Condensed);
}

/// Loads that overflow and laws without a reachable solution end with the best iterate, which is finite.
#[test]
fn failures_carry_finite_iterates() {
    let system = block([6, 6, 3], Material::isotropic(1.0, 0.277).unwrap());
    let rows = system.contact("bottom", &ground(3)).unwrap();
    let tangential = rows.tangential;
    for pressure in [1e150, 1e290, 1e307, 1e308] {
        let press = system.traction("top", |_| [0.0, 0.0, -pressure]).unwrap();
        let load = LoadPath::constant(press);
        let body = ReducedBody::new(system.nodal_stiffness().unwrap(), &rows.normal, &tangential, load);
        let law = OrthotropicCoulomb::isotropic(constant(0.3));
        let options = ReducedOptions::default();
        match ReducedContact::new(body.unwrap(), law, options)
            .unwrap()
            .solve(0.0, None)
        {
            Ok(found) => {
                assert!(found.residuals.largest() <= 1e-10);
                assert!(
                    found
                        .displacements
                        .iter()
                        .chain(&found.forces)
                        .all(|u| u.is_finite())
                );
            }
            Err(ContactError::NotConverged { best } | ContactError::StepFailed { best, .. }) => {
                assert!(best.displacements.iter().all(|u| u.is_finite()));
            }
            Err(e) => panic!("{pressure:e}: {e}"),
        }
    }
}
