//! Your own nonsmooth problem: a rectifier and a tunnel diode in series with a resistor; struct and trait take 24 lines (19–42).
//! You will see the operating point of the circuit, its hysteresis over the source voltage with every kink and fold, and a picture.
//! Run: cargo run --release --example your_own_problem [-- --out DIR]

#[macro_use]
mod common;

use std::error::Error;
use std::path::PathBuf;
use std::process::ExitCode;

use clap::Parser;
use semismooth::continuation::{Branch, ContinuationOptions, Direction};
use semismooth::newton::{Newton, NewtonOptions};
use semismooth::output::{BranchDiagram, Colour, Curve, Panel, SegmentStyle};
use semismooth::piecewise::{Kinks, NonsmoothFunction, PiecewiseSmoothExt, Real, Traced};

/// x = (current i, voltage v of the tunnel diode, reverse voltage w of the rectifier, source voltage e), in mA and V.
pub(crate) struct TunnelDiode;

impl NonsmoothFunction for TunnelDiode {
    fn num_vars(&self) -> usize {
        4
    }

    fn num_residuals(&self) -> usize {
        3
    }

    fn eval<T: Real>(&self, x: &[T], kinks: &mut Kinks<'_, T>, out: &mut [T]) {
        let [i, v, w, e] = [x[0], x[1], x[2], x[3]];
        // Ideal rectifier: 0 ≤ i ⟂ w ≥ 0.
        out[0] = kinks.min(i, w);
        // Kirchhoff, with 1 kΩ.
        out[1] = e - i - v + w;
        // Tunnel current, 10 mA/V up to the peak at 0.1 V and down to the valley at 0.35 V, and the diode's exponential.
        let peak = kinks.positive_part(v - 0.1);
        let valley = kinks.positive_part(v - 0.35);
        let thermal = ((v / 0.075).exp() - 1.0) * 1e-3;
        out[2] = i - (v * 10.0 - peak * 14.0 + valley * 4.0 + thermal);
    }
}

/// Solves a circuit with a tunnel diode and follows it over the source voltage.
#[derive(Parser)]
struct Args {
    /// Folder for the picture.
    #[arg(long, default_value = "out")]
    out: PathBuf,
}

fn main() -> ExitCode {
    common::exit(run(&common::parse::<Args>()))
}

fn run(args: &Args) -> Result<(), Box<dyn Error>> {
    let circuit = Traced::new(TunnelDiode);

    // One operating point: the last variable, the source voltage, is kept fixed.
    let mut x = [0.0, 0.0, 0.0, -0.5];
    let mut newton = Newton::new(NewtonOptions::default());
    newton.solve(&circuit, &mut x)?;
    println!(
        "at e = {} V: i = {} mA, v = {} V, w = {} V",
        x[3], x[0], x[1], x[2]
    );

    // All of them, through folds and kinks.
    let options = ContinuationOptions::default()
        .with_parameter_range((-0.5, 2.0))
        .with_max_step(0.05);
    let branch = Branch::follow(&circuit, &x, Direction::Increasing, options)?;
    for t in &branch.transitions {
        for c in t.sites.iter().filter(|c| c.from != c.to) {
            println!(
                "e = {:.6} V: {}, {} → {}: {}",
                // Rounds off errors, so that −0 is not printed.
                (t.parameter() * 1e9).round() / 1e9 + 0.0,
                ["rectifier", "peak", "valley"][c.site],
                circuit.piece_name(c.site, c.from),
                circuit.piece_name(c.site, c.to),
                t.kind,
            );
        }
    }
    println!("folds at e = {} V", common::list(&branch.folds(), 9));
    // The current falls from the peak at 0.1 V on and rises again from the valley at 0.35 V on.
    let thermal = |v: f64| ((v / 0.075).exp() - 1.0) * 1e-3;
    let exact = [0.1 + 1.0 + thermal(0.1), 0.35 + thermal(0.35)];
    let same = |(found, exact): (&f64, &f64)| (found - exact).abs() < 1e-9;
    if branch.folds().len() != 2 || !branch.folds().iter().zip(&exact).all(same) {
        return Err(format!("the folds should be at {}", common::list(&exact, 9)).into());
    }

    let style = |s: &semismooth::piecewise::Selection, _: &[usize]| {
        if s.piece(0) == 0 {
            SegmentStyle::new("blocked", Colour::RED)
        } else if s.piece(1) == 1 {
            SegmentStyle::new("before the peak", Colour::GREEN)
        } else if s.piece(2) == 1 {
            SegmentStyle::new("peak to valley", Colour::ORANGE)
        } else {
            SegmentStyle::new("behind the valley", Colour::BLUE)
        }
    };
    let curve = Curve::of_branch(&branch, |x| x[0], style);
    std::fs::create_dir_all(&args.out)?;
    let picture = args.out.join("your_own_problem.svg");
    BranchDiagram::new(Panel::new("source voltage [V]", "current [mA]").with_curve(curve))
        .with_title("A tunnel diode behind a rectifier")
        .write(&picture)?;
    println!("written: {}", picture.display());
    Ok(())
}
