//! A report on a history of loading.

use std::ops::ControlFlow;

use super::body::{Change, MOST_ROWS, OF_SOLUTION, nodes, of_solution};
use super::page::Page;
use super::page_of_curve::words;
use super::words::number;
use super::{Observer, Report, ReportOptions, Subject};
use crate::contact::{
    Arrival, CondensedContact, ContactSolution, ContactState, EvolutionOptions, EvolutionProgress,
    EvolutionStep, NodeLaw, evolve_observed,
};
use crate::continuation::Event;
use crate::output::{BranchDiagram, Colour, Curve, Marker, OutputError, Panel, SegmentStyle};
use crate::words::{Count, Short};

impl BranchDiagram {
    /// The resultants of the contact forces through a history of loading, over the load: at each level the normal one, and the tangential
    /// ones along both axes. Levels that are visited twice are drawn twice; arrows show the order.
    #[must_use]
    pub fn of_history(levels: &[(f64, [f64; 3])]) -> Self {
        let panel = |label: &str, forces: &[(usize, &'static str, Colour)]| {
            let lines = forces.iter().map(|&(d, name, colour)| {
                let points: Vec<_> = levels.iter().map(|(level, f)| (*level, f[d])).collect();
                Curve::line(points.clone(), SegmentStyle::new(name, colour))
                    .with_arrows(true)
                    .with_marks(Marker::Value, points)
            });
            lines.fold(Panel::new("α", label), Panel::with_curve)
        };
        let normal = panel("sum of normal forces", &[(0, "normal", Colour::BLUE)]);
        let first = (1, "tangential", Colour::RED);
        let tangential = match levels.iter().all(|(_, f)| f[2] == 0.0) {
            true => panel("sum of tangential forces", &[first]),
            false => panel(
                "sums of tangential forces",
                &[first, (2, "along the second axis", Colour::GREEN)],
            ),
        };
        Self::new(normal).with_panel(tangential).with_size(860, 420)
    }
}

/// A history that was run.
pub(super) struct Run {
    start: Vec<f64>,
    before: ContactSolution,
    steps: Vec<EvolutionStep>,
    /// Changes of states on the branches that were followed, in order.
    changes: Vec<Change>,
    levels: usize,
}

pub(super) fn run<L: NodeLaw>(
    problem: &mut CondensedContact<L>,
    start: Vec<f64>,
    before: ContactSolution,
    levels: &[f64],
    observe: Observer<'_>,
) -> Result<Run, OutputError> {
    let (mut changes, mut steps) = (Vec::new(), Vec::<EvolutionStep>::new());
    for &level in levels {
        let mut passed = Vec::new();
        let x = steps.last().map_or(&start, |s| &s.x);
        let x = x.clone();
        let next = evolve_observed(
            problem,
            &x,
            &[level],
            &EvolutionOptions::default(),
            |now| match now {
                EvolutionProgress::Point(Event::Transition(t)) => {
                    passed.push((t.parameter(), t.before.clone(), t.after.clone()));
                    observe(&format!("the history, α = {}", Short(t.parameter())))
                }
                EvolutionProgress::Step(step) => {
                    steps.push((*step).clone());
                    ControlFlow::Continue(())
                }
                _ => observe(&format!("the history, to α = {}", Short(level))),
            },
        )?;
        let Some(step) = next.last() else {
            break;
        };
        if step.arrival.is_followed() {
            for (parameter, before, after) in passed {
                let [before, after] = [&before, &after].map(|s| problem.states(s));
                changes.extend(Change::between(parameter, &before, &after));
            }
        } else {
            // Between the levels nothing is known: what has changed is dated by the level.
            let before = steps.len().checked_sub(2).map_or(&before, |k| &steps[k].solution);
            changes.extend(Change::between(level, &before.states, &step.solution.states));
        }
    }
    Ok(Run {
        start,
        before,
        steps,
        changes,
        levels: levels.len(),
    })
}

pub(super) fn report(
    subject: &Subject<'_>,
    run: Run,
    options: &ReportOptions,
) -> Result<Report, OutputError> {
    let mut page = Page::default();
    summary(&mut page, &run);
    let first = run.start.last().copied().unwrap_or(f64::NAN);
    let mut forces = vec![(first, run.before.resultant())];
    forces.extend(run.steps.iter().map(|s| (s.level, s.solution.resultant())));
    page.section("Contact forces");
    let svg = BranchDiagram::of_history(&forces).to_svg()?;
    page.figure(
        &svg,
        "The sums of the contact forces at the levels of the history, in their order.",
    );
    levels(&mut page, &run);
    page.section("First slip and lift-off of each node");
    let last = run.steps.last().map_or(&run.before, |s| &s.solution);
    let states: [&[ContactState]; 2] = [&run.before.states, &last.states];
    nodes(&mut page, subject, &run.changes, states);
    pictures(&mut page, subject, &run)?;
    method(&mut page, &run);
    words(&mut page);
    page.section("Tables to copy");
    copy(&mut page, &run);
    let subtitle = format!(
        "A body in contact through a history of loading: {}, {}.",
        Count(subject.map.num_sites(), "contact node", "contact nodes"),
        Count(run.steps.len() + 1, "level", "levels")
    );
    Ok(Report {
        html: page.finish(&options.title, &subtitle),
        branch: None,
        diagram: None,
        lists: Vec::new(),
        steps: run.steps,
    })
}

fn summary(page: &mut Page, run: &Run) {
    page.section("In short");
    let first = run.start.last().copied().unwrap_or(f64::NAN);
    let mut items = vec![match run.steps.last() {
        Some(last) => format!(
            "The load α goes from {} through {} to {}.",
            Short(first),
            Count(run.steps.len(), "step", "steps"),
            Short(last.level)
        ),
        None => format!("No level after the first, α = {}, was reached.", Short(first)),
    }];
    let slip = run.changes.iter().find(|c| c.to.is_slip());
    let open = run.changes.iter().find(|c| c.to == ContactState::Open);
    for (change, what) in [(slip, "slip"), (open, "lift-off")] {
        items.push(match change {
            Some(c) => format!(
                "The first {what} after the start is at α = {}: {}.",
                Short(c.parameter),
                c.words()
            ),
            None => format!("There is no {what} after the start."),
        });
    }
    let jumps = run.steps.iter().filter(|s| matches!(s.arrival, Arrival::Jumped));
    let at: Vec<String> = jumps.map(|s| format!("α = {}", Short(s.level))).collect();
    if !at.is_empty() {
        items.push(format!(
            "Before {} the solution that was followed turns back at a fold: the body jumps to another state, which is found by Newton's \
             method and need not be the one that motion would lead to.",
            at.join(", ")
        ));
    }
    let dissipated: f64 = run.steps.iter().map(|s| s.dissipated).sum();
    let work: f64 = run.steps.iter().map(|s| s.work).sum();
    items.push(format!(
        "The loads do the work {}, of which friction dissipates {}.",
        Short(work),
        Short(dissipated)
    ));
    if run.steps.len() < run.levels {
        items.push(
            "The work was stopped before its end: this report has what was found until then.".to_owned(),
        );
    }
    page.list(&items);
}

fn levels(page: &mut Page, run: &Run) {
    page.section("The levels of the history");
    page.paragraph(
        "Work, stored and dissipated are those of the step from the level before; stored is the change of the elastic energy. Where the \
         solution was followed they balance: work = stored + dissipated.",
    );
    if run.steps.len() > MOST_ROWS {
        page.paragraph(&format!(
            "The first {MOST_ROWS} of {} levels; the table to copy has all.",
            run.steps.len()
        ));
    }
    let rows = run.steps.iter().take(MOST_ROWS).map(|s| {
        let [normal, first, second] = s.solution.resultant();
        let tangential = if second == 0.0 { first } else { first.hypot(second) };
        let size = normal.abs().max(tangential.abs());
        let energies = s.work.abs().max(s.stored.abs()).max(s.dissipated.abs());
        vec![
            number(s.level, 0.0),
            s.arrival.to_string(),
            s.solution.open().to_string(),
            s.solution.stick().to_string(),
            s.solution.slip().to_string(),
            number(normal, size),
            number(tangential, size),
            number(s.work, energies),
            number(s.stored, energies),
            number(s.dissipated, energies),
        ]
    });
    let rows: Vec<_> = rows.collect();
    let head = [
        "#α",
        "reached",
        "#open",
        "#stick",
        "#slip",
        "#sum of normal forces",
        "#sum of tangential forces",
        "#work",
        "#stored",
        "#dissipated",
    ];
    page.table(&head, &rows);
    let folds = run.steps.iter().flat_map(|s| s.folds.iter().map(move |f| (s, f)));
    let items: Vec<String> = folds
        .take(MOST_ROWS)
        .map(|(s, fold)| {
            format!(
                "On the way to α = {} the load turns back at α = {}, a fold: near it there are several solutions.",
                Short(s.level),
                Short(*fold)
            )
        })
        .collect();
    if !items.is_empty() {
        page.list(&items);
    }
}

fn pictures(page: &mut Page, subject: &Subject<'_>, run: &Run) -> Result<(), OutputError> {
    let (Some(contacts), Some(mut figures)) = (subject.contacts, subject.figures()) else {
        return Ok(());
    };
    let first = (
        &run.start,
        &run.before,
        run.start.last().copied().unwrap_or(f64::NAN),
    );
    let steps = run.steps.iter().map(|s| (&s.x, &s.solution, s.level));
    let all: Vec<_> = std::iter::once(first).chain(steps).collect();
    // The ends, then the levels at which most nodes have changed.
    let moved = |k: usize| {
        let pairs = all[k].1.states.iter().zip(&all[k - 1].1.states);
        pairs.filter(|(a, b)| a != b).count()
    };
    let mut order: Vec<usize> = (1..all.len().saturating_sub(1)).collect();
    order.sort_by_key(|&k| std::cmp::Reverse(moved(k)));
    for k in [0, all.len() - 1].into_iter().chain(order) {
        let (x, solution, level) = all[k];
        let displacements = contacts.displacements(x)?;
        let caption = format!(
            "Level {k}, α = {}: {} open, {} stick, {} slip",
            Short(level),
            solution.open(),
            solution.stick(),
            solution.slip()
        );
        figures.add((k, x), &solution.states, &displacements, &caption)?;
        if figures.is_full() {
            break;
        }
    }
    figures.section(page);
    Ok(())
}

fn method(page: &mut Page, run: &Run) {
    page.section("How this was computed, and what is not proven");
    let solutions = run.steps.iter().map(|s| &s.solution).chain([&run.before]);
    let residual = solutions.map(|s| s.residuals.largest()).fold(0.0, f64::max);
    let followed = run.steps.iter().filter(|s| s.arrival.is_followed()).count();
    let returned: f64 = run.steps.iter().map(|s| s.returned).sum();
    let mut items = vec![
        format!(
            "semismooth {}: in each step the static law holds for the increments of slip since the level before, and the curve of solutions \
             is followed from level to level: {} of {} steps. The largest residual of the equations, relative to the forces, is {residual:.1e}.",
            env!("CARGO_PKG_VERSION"),
            followed,
            run.steps.len()
        ),
        "Loads of changes of state on steps that were followed are exact to rounding; on the others a change is dated by the level at which \
         it is first seen."
            .to_owned(),
        "That the solution at a level is the only one is not examined; a report on the curve of static solutions counts them.".to_owned(),
        "A solution is a state in equilibrium. Whether it is stable, and how fast a jump goes, is not examined.".to_owned(),
    ];
    // Less is rounding.
    if returned > 1e-9 * run.steps.iter().map(|s| s.dissipated.abs()).sum::<f64>() {
        items.push(format!(
            "Friction returned the work {} where nodes reverse their slip within a step: an error of the length of the steps. Finer levels \
             make it smaller.",
            Short(returned)
        ));
    }
    page.list(&items);
}

fn copy(page: &mut Page, run: &Run) {
    let exact = |v: f64| format!("{v:?}");
    let mut head = vec!["α".to_owned(), "reached".to_owned()];
    head.extend(OF_SOLUTION.map(|h| h.trim_start_matches('#').to_owned()));
    head.extend(["work", "stored", "dissipated", "returned"].map(str::to_owned));
    let rows = run.steps.iter().map(|s| {
        let mut row = vec![exact(s.level), s.arrival.to_string()];
        row.extend(of_solution(&s.solution, &exact));
        row.extend([s.work, s.stored, s.dissipated, s.returned].map(exact));
        row
    });
    page.copyable("Levels", &head, &rows.collect::<Vec<_>>());
}
