//! The problems of the comparison of correctors, class by class.

use std::rc::Rc;

use semismooth::complementarity::{Mcp, McpFunction};
use semismooth::contact::{
    FrictionCoefficient, FullContact, HildRenard, LoadPath, PlanarCoulomb, read_delassus, read_folder,
};
use semismooth::linear::KrylovMethod;
use semismooth::sparse::Matrix;

use crate::common::bars::bar2d;
use crate::common::{Outcome, Random, files_or_shipped, shipped_folder};
use crate::cones::{KINDS, OnCones, cone_methods, random_delassus, random_over_cones};
use crate::contenders::{Complementarity, FunctionOf, METHODS, Run, random_lcp};
use crate::equations::{BY_PRODUCTS, EQUATION_METHODS, Equation, Kind, random_friction};
use crate::inequalities::{read_cone, read_vi};
use crate::{expressions, obstacles};

// Function spaces come from the examples that explain them.
#[allow(dead_code)]
#[path = "../bingham.rs"]
mod bingham;
#[allow(dead_code)]
#[path = "../plasticity.rs"]
mod plasticity;
#[allow(dead_code)]
#[path = "../sparse_control.rs"]
mod sparse_control;
#[allow(dead_code)]
#[path = "../state_constraints.rs"]
mod state_constraints;
#[allow(dead_code)]
#[path = "../total_variation.rs"]
mod total_variation;

/// Number and sizes of the problems of each kind.
pub(crate) struct Sizes {
    /// Whether the files of other tests are solved, too.
    pub(crate) files: bool,
    /// Random linear problems, and their orders.
    pub(crate) linear: usize,
    pub(crate) orders: &'static [usize],
    /// Points a side of obstacle problems.
    pub(crate) grids: &'static [usize],
    /// Random friction problems, in the plane and in space.
    pub(crate) friction: [usize; 2],
    /// Cells along a bar whose friction weakens.
    pub(crate) bar: usize,
    /// Contacts of the largest friction problems from files.
    pub(crate) contacts: usize,
    /// Points a side of grids with state constraints and of those with sparse controls, pixels a side of pictures, meshes of a pipe, and of
    /// plastic bodies.
    pub(crate) states: &'static [usize],
    pub(crate) controls: &'static [usize],
    pub(crate) pixels: &'static [usize],
    pub(crate) pipes: &'static [usize],
    pub(crate) plastic: &'static [usize],
}

type Running = Box<dyn Fn(usize) -> Outcome<Run>>;

/// Problems of one kind, and the methods for them.
pub(crate) struct Class {
    pub(crate) name: &'static str,
    pub(crate) title: &'static str,
    /// The method that the crate uses by default.
    pub(crate) usual: &'static str,
    pub(crate) methods: Vec<&'static str>,
    /// Their names, and the function that runs the method with a number.
    pub(crate) problems: Vec<(String, Running)>,
}

impl Class {
    fn of_complementarity(name: &'static str, title: &'static str, problems: &[Rc<Complementarity>]) -> Self {
        let running = |p: &Rc<Complementarity>| -> (String, Running) {
            let (name, p) = (p.name.clone(), p.clone());
            (name, Box::new(move |k| p.run(&METHODS[k])))
        };
        Self {
            name,
            title,
            usual: "McpSolver, all strategies",
            methods: METHODS.iter().map(|m| m.name).collect(),
            problems: problems.iter().map(running).collect(),
        }
    }

    /// With the first `count` methods.
    fn of_equations(name: &'static str, title: &'static str, count: usize, equations: Vec<Equation>) -> Self {
        let running = |e: Equation| -> (String, Running) {
            (e.name.clone(), Box::new(move |k| Ok(e.run(&EQUATION_METHODS[k]))))
        };
        Self {
            name,
            title,
            usual: match count {
                BY_PRODUCTS => "inexact Newton, line search on trouble",
                _ => "Newton, line search on trouble",
            },
            methods: EQUATION_METHODS[..count].iter().map(|m| m.name).collect(),
            problems: equations.into_iter().map(running).collect(),
        }
    }

    fn of_cones(
        name: &'static str,
        title: &'static str,
        friction: bool,
        problems: Vec<(String, OnCones)>,
    ) -> Self {
        let running =
            |(name, p): (String, OnCones)| -> (String, Running) { (name, Box::new(move |k| p.run(k))) };
        Self {
            name,
            title,
            usual: if friction { "DelassusSolver" } else { "ConeSolver" },
            methods: cone_methods(friction),
            problems: problems.into_iter().map(running).collect(),
        }
    }
}

/// All classes; complementarity problems and variational inequalities are given.
pub(crate) fn classes(
    sizes: &Sizes,
    complementarity: &[Rc<Complementarity>],
    variational: &[Rc<Complementarity>],
) -> Outcome<Vec<Class>> {
    let count = EQUATION_METHODS.len();
    Ok(vec![
        Class::of_complementarity(
            "complementarity",
            "complementarity problems with their starts",
            complementarity,
        ),
        Class::of_complementarity("variational", "starts of variational inequalities", variational),
        Class::of_equations("friction", "friction problems", count, friction(sizes)?),
        Class::of_equations(
            "spaces",
            "problems of function spaces, with matrices",
            count,
            with_matrices(sizes)?,
        ),
        Class::of_equations(
            "products",
            "problems of function spaces, by products",
            BY_PRODUCTS,
            by_products(sizes)?,
        ),
        Class::of_cones("cones", "problems over second-order cones", false, cones()?),
        Class::of_cones(
            "delassus",
            "friction problems in Delassus form",
            true,
            delassus(sizes)?,
        ),
    ])
}

/// A problem from each of its starts.
fn push<F: McpFunction + 'static>(
    list: &mut Vec<Rc<Complementarity>>,
    family: &str,
    mcp: Mcp<F>,
    starts: Vec<(String, Vec<f64>)>,
) {
    let (lower, upper) = (mcp.lower().to_vec(), mcp.upper().to_vec());
    let function: Rc<dyn McpFunction> = Rc::new(FunctionOf(mcp));
    for (label, start) in starts {
        list.push(Rc::new(Complementarity {
            name: format!("{family} {label}"),
            family: family.to_owned(),
            function: function.clone(),
            lower: lower.clone(),
            upper: upper.clone(),
            start,
        }));
    }
}

/// Complementarity problems from files with their starts, obstacles on grids, and linear ones at random.
pub(crate) fn complementarity(sizes: &Sizes) -> Outcome<Vec<Rc<Complementarity>>> {
    let mut list = Vec::new();
    let mut files = files_or_shipped(&[], "complementarity")?;
    if sizes.files {
        files.extend(files_or_shipped(&[], "mcp")?);
    }
    for file in files {
        let expressions::Problem {
            name,
            solvable,
            mcp,
            starts,
            ..
        } = expressions::read(&file)?;
        if !solvable {
            continue;
        }
        push(&mut list, &name, mcp, starts);
    }
    for &m in sizes.grids {
        for kind in [
            obstacles::Problem::Mcplib,
            obstacles::Problem::Hemisphere,
            obstacles::Problem::Torsion,
        ] {
            let lcp = kind.lcp(m)?;
            list.push(Rc::new(Complementarity {
                name: format!("obstacle {} {m} x {m}", kind.name()),
                family: format!("obstacle {}", kind.name()),
                function: Rc::new(lcp.mcp().function().clone()),
                lower: lcp.lower().to_vec(),
                upper: lcp.upper().to_vec(),
                start: vec![0.0; m * m],
            }));
        }
    }
    let mut random = Random::new(1);
    for k in 0..sizes.linear {
        let n = sizes.orders[k / 4 % sizes.orders.len()];
        list.push(Rc::new(random_lcp(
            n,
            k,
            &mut random,
            &format!("LCP {k}, n = {n}"),
        )?));
    }
    Ok(list)
}

/// Models with few nodes, an elastic block and a bar whose friction weakens with the slip, at some parameters, and bodies at random; from
/// 0.
fn friction(sizes: &Sizes) -> Outcome<Vec<Equation>> {
    let mut list = Vec::new();
    for k in 0..8 {
        let parameter = 0.5 + 0.5 * f64::from(k);
        let at = |name: &str| format!("{name}, at {parameter}");
        let one = HildRenard::new(1.5, 7.0, 1.0, 1.0)?.problem()?;
        list.push(Equation::pieces(
            at("one node of Hild and Renard"),
            Box::new(one),
            parameter,
        ));
        list.push(Equation::pieces(
            at("two nodes"),
            Box::new(two_nodes()?),
            parameter,
        ));
        let block = read_folder(shipped_folder())?.condensed()?;
        list.push(Equation::pieces(
            format!("elastic block, at {}", parameter / 4.0),
            Box::new(block),
            parameter / 4.0,
        ));
        let bar = bar2d(sizes.bar)?.problem;
        list.push(Equation::pieces(
            at("bar whose friction weakens"),
            Box::new(bar),
            parameter,
        ));
    }
    let mut random = Random::new(2);
    for k in 0..sizes.friction[0] {
        let p = 1 + k % 6;
        list.push(random_friction(
            p,
            &mut random,
            format!("random body {k}, {p} nodes"),
        )?);
    }
    Ok(list)
}

/// The Moreau–Yosida regularisation of a state constraint at log₁₀ γ = 0 … 8, and plastic bodies under half the load and all of it; from 0.
fn with_matrices(sizes: &Sizes) -> Outcome<Vec<Equation>> {
    let mut list = Vec::new();
    for &m in sizes.states {
        for s in [0.0, 2.0, 4.0, 6.0, 8.0] {
            let map = Box::new(state_constraints::Yosida::new(m)?);
            let name = format!("state constraint {m} x {m}, gamma = 1e{s}");
            list.push(Equation::pieces(name, map, s));
        }
    }
    for &level in sizes.plastic {
        let body = plasticity::pressed(level)?.0.body;
        list.push(Equation {
            name: format!("plastic tube, mesh {level}"),
            start: vec![0.0; body.system().num_free()],
            kind: Kind::Matrix(Box::new(body)),
        });
        for share in [0.5, 1.0] {
            let (mut rings, unit) = plasticity::quarter(level)?;
            let load: Vec<f64> = unit.iter().map(|f| share * f).collect();
            rings.body.set_load(&load)?;
            list.push(Equation {
                name: format!("plastic strip, mesh {level}, load {share}"),
                kind: Kind::Matrix(Box::new(rings.body)),
                start: vec![0.0; load.len()],
            });
        }
    }
    Ok(list)
}

/// Sparse controls, pastes in a pipe, and pictures without noise; from 0.
fn by_products(sizes: &Sizes) -> Outcome<Vec<Equation>> {
    const GMRES: KrylovMethod = KrylovMethod::Gmres { directions: 10 };
    let mut list = Vec::new();
    for &m in sizes.controls {
        let map = sparse_control::Control::new(m)?;
        let name = format!("sparse control {m} x {m}");
        list.push(Equation::products(name, map, KrylovMethod::Minres));
    }
    for &level in sizes.pipes {
        let disc = (0..=level).fold(bingham::Disc::hexagon(), |d, _| d.refined());
        for gamma in [1e2, 1e3, 1e4] {
            let name = format!("paste in a pipe, mesh {level}, gamma = {gamma:e}");
            list.push(Equation::products(
                name,
                bingham::flow(&disc, 1.0 / gamma)?,
                GMRES,
            ));
        }
    }
    for &pixels in sizes.pixels {
        let (_, picture) = total_variation::example(pixels, 6e-4)?;
        for threshold in [1e-1, 1e-2, 1e-3] {
            let name = format!("picture {pixels} x {pixels}, threshold {threshold:e}");
            list.push(Equation::products(name, picture.equations(threshold)?, GMRES));
        }
    }
    Ok(list)
}

/// Variational inequalities over polyhedra by their multiplier conditions, from the starts of their files with multipliers 0.
pub(crate) fn variational() -> Outcome<Vec<Rc<Complementarity>>> {
    let mut list = Vec::new();
    for file in files_or_shipped(&[], "vi")? {
        let (problem, vi) = read_vi(&file)?;
        if !problem.solvable {
            continue;
        }
        // Its conditions borrow it, and are kept to the end.
        let vi: &'static _ = Box::leak(Box::new(vi));
        let conditions = vi.kkt()?;
        let mut starts = problem.starts;
        starts.iter_mut().for_each(|s| s.1.resize(conditions.len(), 0.0));
        push(&mut list, &problem.name, conditions, starts);
    }
    Ok(list)
}

/// Problems over second-order cones from files, with their starts.
fn cones() -> Outcome<Vec<(String, OnCones)>> {
    let mut list = Vec::new();
    for file in files_or_shipped(&[], "cones")? {
        let (problem, _) = read_cone(&file)?;
        for (label, start) in problem.starts.iter().filter(|_| problem.solvable) {
            let name = format!("{} {label}", problem.name);
            list.push((name, OnCones::General(read_cone(&file)?.1, start.clone())));
        }
    }
    Ok(list)
}

/// Problems over cones by their families, the same from all starts, all friction at random one of them.
pub(crate) fn over_cones(sizes: &Sizes) -> Outcome<Vec<(String, OnCones)>> {
    let named = cones()?.into_iter().chain(delassus(sizes)?);
    let family = |name: String| name.split(' ').next().unwrap_or_default().to_owned();
    let mut list: Vec<_> = named.map(|(name, p)| (family(name), p)).collect();
    let mut random = Random::new(6);
    for (kind, name) in KINDS.iter().enumerate() {
        for count in [2, 4, 8] {
            for _ in 0..4 {
                let problem = random_over_cones(kind, count, &mut random)?;
                let start = vec![0.0; problem.len()];
                list.push((format!("{name}, {count} cones"), OnCones::General(problem, start)));
            }
        }
    }
    Ok(list)
}

/// Friction from files and at random.
fn delassus(sizes: &Sizes) -> Outcome<Vec<(String, OnCones)>> {
    let mut list = Vec::new();
    for file in files_or_shipped(&[], "friction")? {
        let problem = read_delassus(&file)?;
        if problem.contacts() <= sizes.contacts {
            let stem = file.file_stem().unwrap_or_default();
            let name = stem.to_string_lossy().into_owned();
            list.push((name, OnCones::Friction(Rc::new(problem))));
        }
    }
    let mut random = Random::new(4);
    for k in 0..sizes.friction[1] {
        let p = 1 + k % 6;
        let problem = random_delassus(p, &mut random)?;
        let name = format!("random contacts {k}, {p} of them");
        list.push((name, OnCones::Friction(Rc::new(problem))));
    }
    Ok(list)
}

/// The model with two contact nodes of Haslinger, Janovský and Ligurský, λ = μ = 1.
pub(crate) fn two_nodes() -> Outcome<FullContact<PlanarCoulomb>> {
    let stiffness = [
        [0.5, 0.0, -0.5, -0.5],
        [0.0, 1.5, -0.5, -1.5],
        [-0.5, -0.5, 4.0, 0.0],
        [-0.5, -1.5, 0.0, 4.0],
    ];
    Ok(FullContact::planar(
        Matrix::from_rows(&stiffness)?,
        Matrix::from_rows(&[[1.0, 0.0, 0.0, 0.0], [0.0, 0.0, 1.0, 0.0]])?,
        Matrix::from_rows(&[[0.0, 1.0, 0.0, 0.0], [0.0, 0.0, 0.0, 1.0]])?,
        LoadPath::constant(vec![0.4, -2.1417, 1.3717, -2.1417]),
        FrictionCoefficient::affine(vec![0.0; 2], vec![1.0; 2])?,
    )?)
}
