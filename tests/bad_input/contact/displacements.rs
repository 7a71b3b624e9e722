use std::time::Duration;

use semismooth::InputError;
use semismooth::contact::{
    CondensedContact, ContactError, FrictionCoefficient, LoadPath, OrthotropicCoulomb, PlanarCoulomb,
    ReducedBody, ReducedContact, ReducedError, ReducedNodes, ReducedOptions, ReducedStep, ReducedSystem,
    solve_reduced, solve_reduced_observed,
};
use semismooth::run::Status;
use semismooth::sparse::{Matrix, NodalMatrix};

use super::{law, load, normal, stiffness, tangential};
use crate::table::{BAD, Table, rows};

fn nodal(a: &Matrix) -> Result<NodalMatrix, InputError> {
    NodalMatrix::new(a, vec![[0.0; 3]], &[[0, 0], [0, 1]], 2)
}

fn body() -> ReducedBody {
    ReducedBody::new(nodal(&stiffness()).unwrap(), &normal(), &[tangential()], load()).unwrap()
}

fn problem(options: ReducedOptions) -> Result<ReducedContact<PlanarCoulomb>, ContactError> {
    ReducedContact::new(body(), law(0.3), options)
}

/// A system with the identity as its matrix; the flag says whether another process, otherwise invisible, has found an error.
struct Unit(usize, bool);

impl ReducedSystem for Unit {
    type Error = InputError;

    fn len(&self) -> usize {
        self.0
    }

    fn mul(&mut self, u: &[f64], out: &mut [f64]) -> Result<(), InputError> {
        out.copy_from_slice(u);
        Ok(())
    }

    fn select(&mut self, _: &ReducedStep<'_>) -> Result<(), InputError> {
        Err(InputError::Malformed { what: "lost".into() })
    }

    fn solve(
        &mut self,
        _: &[f64],
        _: &mut [f64],
        _: f64,
    ) -> Result<semismooth::linear::KrylovReport, InputError> {
        Err(InputError::Malformed { what: "lost".into() })
    }

    fn sum(&self, _: &mut [f64]) -> Result<(), InputError> {
        Ok(())
    }

    fn max(&self, values: &mut [f64]) -> Result<(), InputError> {
        if self.1 {
            values.iter_mut().for_each(|v| *v = v.max(1.0));
        }
        Ok(())
    }
}

pub(super) fn displacements(t: &mut Table) {
    bodies(t);
    problems(t);
    let with = |elsewhere: bool, load: &[f64], components: &[usize], gap: &[f64], u: Vec<f64>| {
        let nodes = ReducedNodes {
            components,
            first: 0,
            gap,
            reference: &[],
            history: &[],
            r: 1.0,
            parameter: 0.0,
        };
        solve_reduced(
            &mut Unit(2, elsewhere),
            &nodes,
            &law(0.3),
            load,
            u,
            &ReducedOptions::default(),
        )
    };
    let at =
        |load: &[f64], components: &[usize], gap: &[f64], u: Vec<f64>| with(false, load, components, gap, u);
    let solve = "contact::solve_reduced";
    t.refuses(solve, "a system that fails", "linear system", || {
        at(&[1.0; 2], &[0], &[0.0], vec![0.0; 2])
    });
    t.refuses(solve, "a short load", "load", || {
        at(&[1.0], &[0], &[0.0], vec![0.0; 2])
    });
    t.refuses(solve, "a short start", "start", || {
        at(&[1.0; 2], &[0], &[0.0], vec![])
    });
    t.refuses("contact::solve_reduced_observed", "a short load", "load", || {
        let nodes = ReducedNodes {
            components: &[0],
            first: 0,
            gap: &[0.0],
            reference: &[],
            history: &[],
            r: 1.0,
            parameter: 0.0,
        };
        let go_on = &mut |_: &_| std::ops::ControlFlow::Continue(());
        let (mut system, options) = (Unit(2, false), ReducedOptions::default());
        solve_reduced_observed(
            &mut system,
            &nodes,
            &law(0.3),
            &[1.0],
            vec![0.0; 2],
            &options,
            go_on,
        )
    });
    t.refuses(solve, "no gap", "gap", || at(&[1.0; 2], &[0], &[], vec![0.0; 2]));
    t.refuses(solve, "components that do not exist", "components", || {
        at(&[1.0; 2], &[1], &[0.0], vec![0.0; 2])
    });
    t.holds(solve, "the failure of a system is its source", || {
        let error = at(&[1.0; 2], &[0], &[0.0], vec![0.0; 2]).unwrap_err();
        matches!(
            error,
            ReducedError::System {
                source: InputError::Malformed { .. },
                ..
            }
        )
    });
    t.holds(solve, "an error of another process ends this one", || {
        let error = with(true, &[1.0; 2], &[0], &[0.0], vec![0.0; 2]).unwrap_err();
        matches!(error, ReducedError::Contact(ContactError::Elsewhere { .. }))
    });
    t.holds(solve, "what this process has found is said before that", || {
        let error = with(true, &[1.0; 2], &[0], &[], vec![0.0; 2]).unwrap_err();
        matches!(
            error,
            ReducedError::Contact(ContactError::Input(InputError::Length { .. }))
        )
    });
    t.exempt(
        &[
            "contact::ReducedSystem::mul",
            "contact::ReducedSystem::select",
            "contact::ReducedSystem::solve",
            "contact::ReducedSystem::solve_observed",
            "contact::ReducedSystem::sum",
            "contact::ReducedSystem::max",
        ],
        "implemented elsewhere, called by `solve_reduced`",
    );
}

fn bodies(t: &mut Table) {
    let new = "contact::ReducedBody::new";
    let with = |n: Matrix, b: Vec<Matrix>| ReducedBody::new(nodal(&stiffness()).unwrap(), &n, &b, load());
    t.refuses(new, "no tangents", "tangential", || with(normal(), vec![]));
    t.refuses(new, "normal rows of another width", "normal", || {
        with(rows(&[&[1.0]]), vec![tangential()])
    });
    t.refuses(new, "a tangent that is no unit vector", "orthonormal", || {
        with(normal(), vec![rows(&[&[0.0, 2.0]])])
    });
    t.refuses(new, "a normal that is zero", "orthonormal", || {
        with(rows(&[&[0.0, 0.0]]), vec![tangential()])
    });
    t.refuses(new, "one node twice", "another contact node", || {
        with(
            rows(&[&[1.0, 0.0], &[1.0, 0.0]]),
            vec![rows(&[&[0.0, 1.0], &[0.0, 1.0]])],
        )
    });
    t.refuses(new, "a trace of two nodes", "several nodes", || {
        let a = NodalMatrix::new(
            &Matrix::identity(4),
            vec![[0.0; 3], [1.0, 0.0, 0.0]],
            &[[0, 0], [0, 1], [1, 0], [1, 1]],
            2,
        );
        let half = rows(&[&[0.5, 0.0, 0.5, 0.0]]);
        ReducedBody::new(
            a.unwrap(),
            &half,
            std::slice::from_ref(&half),
            LoadPath::constant(vec![0.0; 4]),
        )
    });
    for bad in BAD {
        t.refuses(new, "normal rows", "(0, 0)", || {
            with(rows(&[&[bad, 0.0]]), vec![tangential()])
        });
        t.refuses(new, "the load", "load", || {
            let load = LoadPath::constant(vec![bad, 0.0]);
            ReducedBody::new(nodal(&stiffness()).unwrap(), &normal(), &[tangential()], load)
        });
        t.refuses("contact::ReducedBody::with_gap", "the gap", "gap[0]", || {
            body().with_gap(vec![bad])
        });
    }
    t.refuses("contact::ReducedBody::with_gap", "another length", "gap", || {
        body().with_gap(vec![])
    });
    t.holds(
        "contact::ReducedBody::to_contact_body",
        "it is the same body",
        || {
            body()
                .to_contact_body()
                .is_ok_and(|b| *b.stiffness() == stiffness())
        },
    );
}

fn problems(t: &mut Table) {
    let o = ReducedOptions::default;
    for (name, options) in [
        ("tolerance", o().with_tolerance(0.0)),
        ("tolerance", o().with_tolerance(f64::NAN)),
        ("forcing", o().with_forcing(1.0)),
        ("max_iterations", o().with_max_iterations(0)),
        ("max_krylov", o().with_max_krylov(0)),
        ("directions", o().with_directions(0)),
    ] {
        t.refuses("contact::ReducedOptions::validate", name, name, || {
            options.validate()
        });
        t.refuses("contact::ReducedContact::new", name, name, || problem(options));
    }
    let new = "contact::ReducedContact::new";
    t.refuses(new, "little memory", "bytes", || {
        problem(o().with_max_memory(Some(64)))
    });
    t.refuses(new, "a law in space", "tangential", || {
        let law = OrthotropicCoulomb::isotropic(FrictionCoefficient::constant(0.3).unwrap());
        ReducedContact::new(body(), law, o())
    });
    t.refuses(new, "coefficients for three nodes", "coefficients", || {
        let law = PlanarCoulomb::new(FrictionCoefficient::nodal(vec![0.3; 3]).unwrap());
        ReducedContact::new(body(), law, o())
    });
    // A body of one node floats in each direction in which its matrix vanishes.
    for (a, named) in [
        ([1.0, -1.0, 1.0], "translation along y"),
        ([-1.0, 0.0, 1.0], "positive definite"),
        ([1.0, 2.0, 1.0], "positive definite"),
        ([0.0, 0.0, 1.0], "translation along x"),
    ] {
        t.refuses(new, "a floating or unstable body", named, || {
            let a = nodal(&rows(&[&[a[0], a[1]], &[a[1], a[2]]])).unwrap();
            let body = ReducedBody::new(a, &normal(), &[tangential()], load()).unwrap();
            ReducedContact::new(body, law(0.3), o())
        });
    }
    t.refuses(new, "no time", "time", || {
        let points: Vec<_> = (0..200).map(|k| [f64::from(k), 0.0, 0.0]).collect();
        let unknowns: Vec<_> = (0..400).map(|k| [k / 2, k % 2]).collect();
        let a = NodalMatrix::new(&Matrix::identity(400), points, &unknowns, 2).unwrap();
        let trace = |k: usize| Matrix::from_triplets(1, 400, &[(0, k, 1.0)]).unwrap();
        let load = LoadPath::constant(vec![0.0; 400]);
        let body = ReducedBody::new(a, &trace(0), &[trace(1)], load).unwrap();
        ReducedContact::new(body, law(0.3), o().with_max_time(Some(Duration::ZERO)))
    });
    let within = "contact::CondensedContact::within";
    t.refuses(within, "little memory", "bytes", || {
        CondensedContact::within(body().to_contact_body().unwrap(), law(0.3), Some(64), None)
    });
    t.refuses(within, "no time", "the time limit has passed", || {
        CondensedContact::within(
            body().to_contact_body().unwrap(),
            law(0.3),
            None,
            Some(Duration::ZERO),
        )
    });
    t.holds(
        "contact::ContactBody::condensed_memory",
        "it is what is refused",
        || {
            let body = || body().to_contact_body().unwrap();
            let needed = body().condensed_memory().unwrap();
            let error = CondensedContact::within(body(), law(0.3), Some(needed - 1), None).err();
            error
                == Some(ContactError::Memory {
                    needed,
                    limit: needed - 1,
                })
        },
    );
    let mut solver = problem(o()).unwrap();
    for bad in BAD {
        t.refuses("contact::ReducedContact::solve", "alpha", "parameter", || {
            solver.solve(bad, None)
        });
        t.refuses("contact::ReducedContact::solve", "the start", "[1]", || {
            solver.solve(0.0, Some(&[0.0, bad]))
        });
        t.refuses("contact::ReducedContact::solution", "u", "[0]", || {
            solver.solution(0.0, &[bad, 0.0])
        });
        t.refuses("contact::ReducedContact::end_level", "u", "[0]", || {
            solver.end_level(0.0, &[bad, 0.0])
        });
    }
    t.refuses(
        "contact::ReducedContact::set_reference_slip",
        "slips",
        "slip",
        || solver.set_reference_slip(&[]),
    );
    t.refuses(
        "contact::ReducedContact::set_history",
        "a history",
        "history",
        || solver.set_history(&[0.0]),
    );
    t.refuses(
        "contact::ReducedContact::set_options",
        "a tolerance",
        "tolerance",
        || solver.set_options(o().with_tolerance(0.0)),
    );
    t.refuses(
        "contact::ReducedContact::set_options",
        "little memory",
        "bytes",
        || solver.set_options(o().with_max_memory(Some(64))),
    );
    t.refuses(
        "contact::ReducedContact::solve_observed",
        "a short start",
        "start",
        || solver.solve_observed(0.0, Some(&[0.0]), |_| std::ops::ControlFlow::Continue(())),
    );
    t.refuses(
        "contact::ReducedContact::evolve_observed",
        "a level",
        "levels",
        || {
            let go_on = std::ops::ControlFlow::Continue(());
            solver.evolve_observed(None, &[0.0, f64::NAN], |_| go_on, |_| go_on)
        },
    );
    let go_on = |_: &_| std::ops::ControlFlow::Continue(());
    t.refuses("contact::ReducedContact::evolve", "a level", "levels", || {
        solver.evolve(None, &[0.0, f64::NAN], go_on)
    });
    t.refuses("contact::ReducedContact::evolve", "the start", "start", || {
        solver.evolve(Some(&[0.0]), &[0.0], go_on)
    });
    t.refuses("contact::ReducedContact::solve", "a short start", "start", || {
        solver.solve(0.0, Some(&[0.0]))
    });
    t.refuses("contact::ReducedContact::solve", "F below 0", "friction", || {
        let law = PlanarCoulomb::new(FrictionCoefficient::affine(vec![0.3], vec![1.0]).unwrap());
        ReducedContact::new(body(), law, o()).unwrap().solve(-1.0, None)
    });
    t.holds(
        "contact::ReducedContact::solve",
        "out of time, the best iterate comes back",
        || {
            let mut solver = problem(o().with_max_time(Some(Duration::ZERO))).unwrap();
            match solver.solve(10.0, None) {
                Err(ContactError::NotConverged { best }) => {
                    best.displacements == [0.0, 0.0] && best.status == Status::TimeLimit
                }
                _ => false,
            }
        },
    );
}
