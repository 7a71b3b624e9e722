//! Pictures of the contact of a bar with the ground.

use std::path::PathBuf;

use semismooth::contact::{LocalValues, NodeLaw};
use semismooth::output::{BranchDiagram, Colour, Curve, Panel, SegmentStyle};

use crate::common::Outcome;
use crate::common::bars::Bar;

/// A quantity of a contact node: name with unit, and value from the coefficient of friction, the nodal area and the local values.
pub(crate) struct Quantity {
    name: &'static str,
    value: fn(f64, f64, &LocalValues) -> f64,
}

/// The quantities that the talk shows of each solution.
pub(crate) const QUANTITIES: [Quantity; 5] = [
    Quantity {
        name: "normal displacement [mm]",
        value: |_, _, v| 1e3 * v.penetration,
    },
    Quantity {
        name: "normal stress [GPa]",
        value: |_, area, v| -v.pressure / area,
    },
    Quantity {
        name: "slip ‖u_t‖ [mm]",
        value: |_, _, v| 1e3 * v.slip_norm(),
    },
    Quantity {
        name: "slip bound ζ F λ_ν [GPa]",
        value: |friction, area, v| friction * v.pressure / area,
    },
    Quantity {
        name: "coefficient ζ F(‖u_t‖)",
        value: |friction, _, _| friction,
    },
];

const COLOURS: [Colour; 3] = [Colour::GREEN, Colour::ORANGE, Colour::BLUE];
/// Steps of the colour scale.
const SHADES: usize = 8;

fn values<L: NodeLaw>(bar: &Bar<L>, nodes: &[LocalValues], quantity: &Quantity) -> Vec<f64> {
    let law = bar.problem.node_law();
    let each = nodes.iter().zip(&bar.rows.areas);
    each.map(|(v, area)| (quantity.value)(law.friction(v)[0], *area, v))
        .collect()
}

/// All quantities along the bar, in space along the line of nodes nearest to the middle, in two pictures.
///
/// # Errors
/// Pictures that cannot be written.
pub(crate) fn along_the_ground<L: NodeLaw>(
    bar: &Bar<L>,
    solutions: &[Vec<LocalValues>],
    title: &str,
    file: &dyn Fn(&str) -> Outcome<PathBuf>,
) -> Outcome<Vec<PathBuf>> {
    let solid = bar.problem.node_law().num_tangents() == 2;
    let off = |p: &[f64; 3]| if solid { (p[1] - 0.5).abs() } else { 0.0 };
    let points = &bar.rows.points;
    let nearest = points.iter().map(off).fold(f64::INFINITY, f64::min);
    let line: Vec<usize> = (0..points.len())
        .filter(|&i| off(&points[i]) <= nearest + 1e-9)
        .collect();
    let panel = |quantity: &Quantity| {
        let each = solutions.iter().enumerate();
        each.fold(Panel::new("x [m]", quantity.name), |panel, (k, nodes)| {
            let values = values(bar, nodes, quantity);
            let vertices = line.iter().map(|&i| (points[i][0], values[i])).collect();
            let style = SegmentStyle::new(format!("solution {}", k + 1), COLOURS[k % COLOURS.len()]);
            panel.with_curve(Curve::line(vertices, style))
        })
    };
    let mut written = Vec::new();
    for (part, quantities) in [("ground", &QUANTITIES[..3]), ("friction", &QUANTITIES[3..])] {
        let path = file(part)?;
        let first = BranchDiagram::new(panel(&quantities[0]));
        let all = quantities[1..].iter().fold(first, |d, q| d.with_panel(panel(q)));
        all.with_title(format!("{title} along the ground"))
            .with_size(400 * quantities.len() as u32, 420)
            .write(&path)?;
        written.push(path);
    }
    Ok(written)
}

/// One quantity of every solution on the contact surface of a solid bar, one panel a solution, in shades of one scale.
pub(crate) fn surface<L: NodeLaw>(
    bar: &Bar<L>,
    solutions: &[Vec<LocalValues>],
    quantity: &Quantity,
    title: &str,
) -> BranchDiagram {
    let all: Vec<Vec<f64>> = solutions
        .iter()
        .map(|nodes| values(bar, nodes, quantity))
        .collect();
    let range = all
        .iter()
        .flatten()
        .fold((f64::INFINITY, f64::NEG_INFINITY), |(a, b), v| {
            (a.min(*v), b.max(*v))
        });
    let step = (range.1 - range.0).max(f64::MIN_POSITIVE) / SHADES as f64;
    let shade_of = |v: f64| (((v - range.0) / step) as usize).min(SHADES - 1);
    let cells = cells(&bar.rows.points);
    let mut panels = all.iter().enumerate().map(|(k, values)| {
        let mut panel = Panel::new("x [m]", "y [m]").with_caption(format!("solution {}", k + 1));
        for cell in &cells {
            let mean = cell.iter().map(|&i| values[i]).sum::<f64>() / 4.0;
            let corners = cell
                .iter()
                .map(|&i| (bar.rows.points[i][0], bar.rows.points[i][1]));
            panel = panel.with_region(corners.collect(), shade(shade_of(mean)));
        }
        // The scale goes into the legend once.
        for s in (0..SHADES).filter(|_| k == 0) {
            let from = range.0 + s as f64 * step;
            panel = panel.with_class(SegmentStyle::new(format!("from {from:.3}"), shade(s)));
        }
        panel
    });
    let first = BranchDiagram::new(panels.next().unwrap_or_default());
    let title = format!("{title}: {}", quantity.name);
    panels
        .fold(first, BranchDiagram::with_panel)
        .with_title(title)
        .with_size(1200, 300)
}

/// From light to dark, in steps of lightness that are distinguishable without colour vision.
fn shade(step: usize) -> Colour {
    let t = step as f64 / (SHADES - 1) as f64;
    let mix = |light: f64, dark: f64| (light + t * (dark - light)).round() as u8;
    Colour::new(mix(247.0, 8.0), mix(251.0, 48.0), mix(255.0, 107.0))
}

/// Quadrilaterals of the grid that the contact nodes of a bar form, corners in turn.
fn cells(points: &[[f64; 3]]) -> Vec<[usize; 4]> {
    let line = |d: usize| {
        let mut c: Vec<f64> = points.iter().map(|p| p[d]).collect();
        c.sort_by(f64::total_cmp);
        c.dedup_by(|a, b| (*a - *b).abs() < 1e-9);
        c
    };
    let at = |x: f64, y: f64| {
        let near = |p: &[f64; 3]| (p[0] - x).abs() + (p[1] - y).abs() < 1e-8;
        points.iter().position(near)
    };
    let (xs, ys) = (line(0), line(1));
    let mut all = Vec::new();
    for x in xs.windows(2) {
        for y in ys.windows(2) {
            let corners = [at(x[0], y[0]), at(x[1], y[0]), at(x[1], y[1]), at(x[0], y[1])];
            if let [Some(a), Some(b), Some(c), Some(d)] = corners {
                all.push([a, b, c, d]);
            }
        }
    }
    all
}
