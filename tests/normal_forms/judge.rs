//! Compares what the crate says of a member of the catalogue with what is known of it.

use semismooth::piecewise::{PiecewiseSmooth, Traced};

use crate::answer::{Certainty, Explored, Local, Refusal, explore, local, options, run};
use crate::coordinates::Embedded;
use crate::forms::{Core, Curve, Entry, Kind};
use crate::random::Random;

/// Radius in normal coordinates up to which rounding of the data may change the picture of a degenerate point, and to which a certificate
/// must reach to say more than the unfolded picture.
const NEAR: f64 = 1e-3;
/// Vertices closer than this to the vertex are the vertex.
const SAME: f64 = 1e-5;
/// Solutions closer together are not compared: the crate's own resolution is 1e-7 of the size of x.
const RESOLVED: f64 = 2e-6;

/// What is counted.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Counts {
    pub instances: usize,
    /// Members with a wrong kind, an arm, a solution or a fold that does not exist, or an error.
    pub wrong: usize,
    /// Members with a claim of completeness although something is missing.
    pub falsely_complete: usize,
    /// Members whose folds differ between default and small steps, or from the known ones.
    pub folds: usize,
    /// Members with answers that claim nothing, those where arms or solutions are indeed missing, and those that are undecided.
    pub estimated: usize,
    pub missing: usize,
    pub undecided: usize,
}

/// Findings on one member.
#[derive(Default)]
pub struct Findings {
    pub wrong: Vec<String>,
    pub falsely_complete: Vec<String>,
    pub folds: Vec<String>,
    pub missing: Vec<String>,
    pub undecided: Vec<String>,
    pub estimated: bool,
}

impl Counts {
    pub fn add(&mut self, f: &Findings) {
        self.instances += 1;
        self.wrong += usize::from(!f.wrong.is_empty());
        self.falsely_complete += usize::from(!f.falsely_complete.is_empty());
        self.folds += usize::from(!f.folds.is_empty());
        self.missing += usize::from(!f.missing.is_empty());
        self.undecided += usize::from(!f.undecided.is_empty());
        self.estimated += usize::from(f.estimated);
    }
}

fn distance(a: &[f64], b: &[f64]) -> f64 {
    a.iter()
        .zip(b)
        .map(|(a, b)| (a - b) * (a - b))
        .sum::<f64>()
        .sqrt()
}

/// An arm as the crate should see it.
struct KnownArm {
    tangent: Vec<f64>,
    side: i8,
    /// A point on it, near enough for the selection of the arm.
    point: Vec<f64>,
}

struct Member<'a> {
    entry: &'a Entry,
    map: Traced<Embedded>,
    inner: Embedded,
    vertex: Vec<f64>,
    arms: Vec<KnownArm>,
    /// Half of the least distance of two tangents, by which arms are told apart.
    apart: f64,
    findings: Findings,
}

/// (y, a) of a curve.
fn on(curve: &Curve, t: f64) -> (Vec<f64>, f64) {
    ((curve.y)(t), f64::from(curve.side) * t)
}

impl<'a> Member<'a> {
    fn new(entry: &'a Entry, inner: Embedded) -> Self {
        let origin = vec![0.0; entry.core.unknowns()];
        let arms: Vec<KnownArm> = entry
            .arms
            .iter()
            .map(|curve| {
                // Curves begin at the origin exactly: a short secant is the tangent.
                let (y, a) = on(curve, 1e-14);
                let (there, b) = on(curve, 0.05);
                KnownArm {
                    tangent: inner.tangent(&y, a),
                    side: curve.side,
                    point: inner.place(&there, b),
                }
            })
            .collect();
        let mut apart = 1e-3_f64;
        for (i, p) in arms.iter().enumerate() {
            for q in &arms[..i] {
                let gap = distance(&p.tangent, &q.tangent);
                if gap > 1e-6 {
                    apart = apart.min(0.3 * gap);
                }
            }
        }
        Self {
            entry,
            map: Traced::new(inner.clone()),
            vertex: inner.place(&origin, 0.0),
            inner,
            arms,
            apart,
            findings: Findings::default(),
        }
    }

    /// α of the parameter a of the normal form.
    fn alpha(&self, a: f64) -> f64 {
        if a == 0.0 {
            return self.vertex[self.inner.n];
        }
        self.inner.place(&vec![0.0; self.entry.core.unknowns()], a)[self.inner.n]
    }

    fn refused(&mut self, what: &str, refusal: Refusal) {
        match refusal {
            Refusal::Undecided => self.findings.undecided.push(format!("{what}: arms undecided")),
            Refusal::Error(e) => self.findings.wrong.push(format!("{what}: {e}")),
        }
    }

    /// Pairs the arms that were found with the known ones: numbers of found arms without partner, and the known arms without.
    fn pair(&self, answer: &Local) -> (usize, Vec<usize>, bool) {
        let mut free: Vec<usize> = (0..self.arms.len()).collect();
        let (mut strangers, mut sides_right) = (0, true);
        let mut residual = vec![0.0; self.inner.n];
        for arm in &answer.arms {
            let tangent = self.inner.measured(&arm.tangent);
            let mut fits = |known: &KnownArm| {
                self.map.residual(&arm.selection, &known.point, &mut residual);
                self.inner.largest(&residual) <= 1e-9
            };
            let near = free
                .iter()
                .copied()
                .filter(|&k| distance(&tangent, &self.arms[k].tangent) <= self.apart && fits(&self.arms[k]))
                .min_by(|&i, &j| {
                    let d = |k: usize| distance(&tangent, &self.arms[k].tangent);
                    d(i).total_cmp(&d(j))
                });
            match near {
                Some(k) => {
                    free.retain(|f| *f != k);
                    sides_right &= arm.side.is_none_or(|s| s == self.arms[k].side);
                }
                None => strangers += 1,
            }
        }
        (strangers, free, sides_right)
    }

    /// Judges the analysis of the vertex. `reached` says which arms lie in the range explored; `excused` that a kind of an unfolded point
    /// is confirmed by what was found beside it.
    fn judge_point(&mut self, what: &str, answer: &Local, reached: impl Fn(i8) -> bool, excused: bool) {
        let entry = self.entry;
        let (strangers, mut lost, sides_right) = self.pair(answer);
        lost.retain(|&k| reached(self.arms[k].side));
        let said = format!("{what}: {:?} with {} arms", answer.kind, answer.arms.len());
        let continuum = entry.kinds == [Kind::Continuum];
        match answer.certainty {
            Certainty::Undecided => {
                self.findings.undecided.push(format!("{said}, {}", answer.words));
                if !lost.is_empty() {
                    self.findings
                        .missing
                        .push(format!("{said}, {} missing", lost.len()));
                }
                return;
            }
            Certainty::Complete { radius } if radius >= NEAR => {
                if !(lost.is_empty() || excused) || (continuum && answer.kind != Some(Kind::Continuum)) {
                    let text = format!("{said}, complete, of {}", self.arms.len());
                    self.findings.falsely_complete.push(text);
                }
            }
            _ => self.findings.estimated = true,
        }
        let proven = answer.certainty
            == Certainty::Complete {
                radius: f64::INFINITY,
            };
        let right =
            |k: Kind| entry.kinds.contains(&k) || (entry.unfolded.contains(&k) && (excused || !proven));
        if answer.kind.is_some_and(|k| !right(k)) {
            let text = format!("{said}, right: {:?}", entry.kinds);
            self.findings.wrong.push(text);
        }
        if (strangers > 0 && !excused) || !sides_right {
            let text = format!("{said}, {strangers} of them none, sides {sides_right}");
            self.findings.wrong.push(text);
        }
    }

    /// Solutions of the diagram at ±level against the known ones.
    fn judge_solutions(&mut self, what: &str, diagram: &Explored, range: (f64, f64)) {
        let complete = matches!(diagram.certainty, Certainty::Complete { .. });
        let mut absent = Vec::new();
        for level in self.entry.levels.iter().flat_map(|l| [*l, -*l]) {
            if level < range.0 || level > range.1 {
                continue;
            }
            let known = self.entry.at(level);
            let gaps = known
                .iter()
                .enumerate()
                .flat_map(|(i, p)| known[..i].iter().map(move |q| distance(p, q)));
            let gap = gaps.fold(4e-6, f64::min);
            if gap < RESOLVED {
                continue;
            }
            let (found, continua) = match diagram.solutions(&self.map, self.alpha(level)) {
                Ok(found) => found,
                Err(refusal) => {
                    self.refused(&format!("{what}, solutions at {level}"), refusal);
                    continue;
                }
            };
            let found: Vec<Vec<f64>> = found.iter().map(|z| self.inner.normal(z)).collect();
            let close = |y: &[f64], x: &[f64]| distance(y, &x[..y.len()]) <= gap / 4.0;
            let lost = known
                .iter()
                .filter(|y| !found.iter().any(|x| close(y, x)))
                .count();
            let strange = found
                .iter()
                .filter(|x| !known.iter().any(|y| close(y, x)))
                .count();
            if strange + continua > 0 {
                self.findings.wrong.push(format!(
                    "{what}: {strange} solutions and {continua} continua at {level} are none"
                ));
            }
            if lost > 0 {
                absent.push(format!(
                    "{what}: {lost} of {} solutions at {level} missing",
                    known.len()
                ));
            }
        }
        let flat = self.arms.iter().any(|a| a.side == 0);
        if self.entry.vertex && self.entry.kinds != [Kind::Continuum] {
            match diagram.solutions(&self.map, self.alpha(0.0)) {
                Ok((_, continua)) if continua > 0 && !flat => {
                    let text = format!("{what}: {continua} vertical segments that do not exist");
                    self.findings.wrong.push(text);
                }
                Ok((_, 0)) if flat => absent.push(format!("{what}: no vertical segment")),
                Ok(_) => {}
                Err(refusal) => self.refused(&format!("{what}, solutions at the vertex"), refusal),
            }
        }
        let words = diagram.diagram.completeness();
        if words.is_limited() {
            self.findings.undecided.push(format!("{what}: {words}"));
        } else if !complete {
            self.findings.estimated = true;
        }
        let list = if complete {
            &mut self.findings.falsely_complete
        } else {
            &mut self.findings.missing
        };
        list.extend(absent);
    }

    /// Whether folds, in normal coordinates, are the known ones; near the vertex up to pairs that rounding may unfold.
    fn folds_right(&self, found: &[Vec<f64>], range: (f64, f64)) -> Result<(), String> {
        let entry = self.entry;
        let inside = |f: &&Vec<f64>| {
            let a = f[f.len() - 1];
            a > range.0 && a < range.1
        };
        let known: Vec<&Vec<f64>> = entry.folds.iter().filter(inside).collect();
        let size = |x: &[f64]| x.iter().map(|v| v * v).sum::<f64>().sqrt();
        let (near, far): (Vec<&Vec<f64>>, Vec<&Vec<f64>>) = found
            .iter()
            .filter(inside)
            .partition(|f| entry.vertex && size(f) <= NEAR);
        let lost = known
            .iter()
            .filter(|k| !far.iter().any(|f| distance(f, k) <= entry.fold_accuracy));
        let lost = lost.count();
        if lost > 0 || far.len() != known.len() {
            return Err(format!("{} folds, {lost} of {} missing", far.len(), known.len()));
        }
        let turns = usize::from(entry.kinds == [Kind::Fold]);
        let two = entry.vertex && entry.arms.len() == 2 && entry.arms.iter().all(|a| a.side != 0);
        let same = if entry.codimension == 0 {
            near.len() == turns
        } else {
            near.len() % 2 == turns
        };
        if two && range.0 < 0.0 && range.1 > 0.0 && !same {
            return Err(format!("{} folds at the vertex instead of {turns}", near.len()));
        }
        Ok(())
    }

    fn judge_vertex(&mut self) {
        let limits = options(self.inner.alpha_unit, (f64::NEG_INFINITY, f64::INFINITY), 1.0);
        match local(&self.map, &self.vertex, &limits) {
            Ok(answer) => {
                let what = format!(
                    "at the vertex {:?}, α in units of {}",
                    self.vertex, self.inner.alpha_unit
                );
                self.judge_point(&what, &answer, |_| true, false);
            }
            Err(refusal) => self.refused("at the vertex", refusal),
        }
    }

    fn judge_diagram(&mut self, what: &str, start: &[f64], range: (f64, f64)) {
        let limits = (self.alpha(range.0), self.alpha(range.1));
        let diagram = match explore(&self.map, start, options(self.inner.alpha_unit, limits, 1.0)) {
            Ok(diagram) => diagram,
            Err(refusal) => return self.refused(what, refusal),
        };
        self.judge_solutions(what, &diagram, range);
        if self.entry.kinds == [Kind::Continuum] {
            if matches!(diagram.certainty, Certainty::Complete { .. })
                && diagram.vertices.iter().all(|v| v.1.kind != Some(Kind::Continuum))
            {
                self.findings
                    .falsely_complete
                    .push(format!("{what}: a continuum is not named"));
            }
            return;
        }
        if !self.entry.vertex {
            return self.judge_folds(what, &diagram, range);
        }
        let normal = |x: &[f64]| self.inner.normal(x);
        let near = |v: &&(Vec<f64>, Local)| {
            let size = normal(&v.0).iter().map(|v| v * v).sum::<f64>().sqrt();
            size <= SAME
        };
        let here: Vec<&(Vec<f64>, Local)> = diagram.vertices.iter().filter(near).collect();
        // Several vertices are the unfolded picture, which the solutions have judged.
        let excused = here.len() > 1 || {
            let folds: Vec<Vec<f64>> = diagram.folds.iter().map(|f| normal(f)).collect();
            self.entry.arms.len() == 2
                && self.entry.codimension > 0
                && self.folds_right(&folds, range).is_ok()
        };
        // Where the curve crosses its kinks at an angle the vertex cannot be overlooked.
        let transversal = match &self.entry.core {
            Core::Sides(_, powers) => *powers == [1, 1],
            Core::Thin(_) | Core::Corner(..) | Core::Touch(..) => true,
            _ => false,
        };
        let complete = matches!(diagram.certainty, Certainty::Complete { .. });
        if transversal && complete && here.is_empty() && !self.entry.arms.is_empty() {
            self.findings
                .wrong
                .push(format!("{what}: the vertex is not in the diagram"));
        }
        if let [vertex] = here[..] {
            let reached = |side: i8| side == 0 || (side > 0 && range.1 > 0.0) || (side < 0 && range.0 < 0.0);
            self.judge_point(&format!("{what}, vertex"), &vertex.1, reached, excused);
        }
        self.judge_folds(what, &diagram, range);
    }

    fn judge_folds(&mut self, what: &str, diagram: &Explored, range: (f64, f64)) {
        let folds: Vec<Vec<f64>> = diagram.folds.iter().map(|f| self.inner.normal(f)).collect();
        // Where the diagram is a curve through a branching, kinks at which another arm goes on are no folds of it.
        if let Err(text) = self.folds_right(&folds, range) {
            match diagram.certainty {
                Certainty::Complete { .. } => self.findings.folds.push(format!("{what}: {text}")),
                _ => self.findings.missing.push(format!("{what}: {text}")),
            }
        }
    }

    /// Folds of a curve that leaves `start` towards the vertex, with default steps and with a twentieth of them.
    fn judge_steps(&mut self, start: &[f64], increasing: bool, range: (f64, f64)) {
        let limits = (self.alpha(range.0), self.alpha(range.1));
        for share in [1.0, 0.05] {
            let what = format!("curve at {share} of the default step");
            let options =
                options(self.inner.alpha_unit, limits, share).with_max_points((3000.0 / share) as usize);
            match run(&self.map, start, increasing, options) {
                Ok(run) => {
                    let folds: Vec<Vec<f64>> = run.folds.iter().map(|f| self.inner.normal(f)).collect();
                    if let Err(text) = self.folds_right(&folds, range) {
                        let findings = &mut self.findings;
                        let list = if run.stopped {
                            &mut findings.missing
                        } else {
                            &mut findings.folds
                        };
                        list.push(format!("{what}: {text}"));
                    }
                }
                Err(refusal) => self.refused(&what, refusal),
            }
        }
    }
}

/// Examines the vertex of a member in units that the map does not tell.
pub fn examine_in_untold_units(entry: &Entry, random: &mut Random) -> Findings {
    let mut inner = Embedded::random(entry.core.clone(), random);
    // In its own coordinates a point is at 0, and nothing there tells in which units it is.
    if !inner.is_plain() {
        inner.unit = [1e8, 1e-8, 1.0][random.below(3)];
        inner.alpha_unit = [1e8, 1e-8, 1.0][random.below(3)];
    }
    inner.declared = false;
    let mut member = Member::new(entry, inner);
    if entry.vertex {
        member.judge_vertex();
    }
    member.findings
}

/// Examines the vertex of a form in its own coordinates.
pub fn examine_plain(entry: &Entry, _random: &mut Random) -> Findings {
    let mut member = Member::new(entry, Embedded::plain(entry.core.clone()));
    if entry.vertex {
        member.judge_vertex();
    }
    member.findings
}

/// Examines the vertex alone of the member that [`examine`] examines.
pub fn examine_vertex(entry: &Entry, random: &mut Random) -> Findings {
    let mut member = Member::new(entry, Embedded::random(entry.core.clone(), random));
    if entry.vertex {
        member.judge_vertex();
    }
    member.findings
}

/// Examines one member of a family in random coordinates.
pub fn examine(entry: &Entry, random: &mut Random) -> Findings {
    let mut member = Member::new(entry, Embedded::random(entry.core.clone(), random));
    let reach = entry.reach;
    let whole = (-reach, reach);
    if entry.vertex {
        let at = member.vertex.clone();
        member.judge_vertex();
        member.judge_diagram("from the vertex", &at, whole);
        let half = if random.below(2) == 0 {
            (0.0, reach)
        } else {
            (-reach, 0.0)
        };
        member.judge_diagram("from the vertex on the bound", &at, half);
    }
    let mut starts: Vec<(Vec<f64>, f64)> = Vec::new();
    for curve in &entry.arms {
        let (y, a) = on(curve, 0.6 * reach);
        starts.push((member.inner.place(&y, a), a));
    }
    for start in &entry.starts {
        let (a, y) = start.split_last().expect("a start has a parameter");
        starts.push((member.inner.place(y, *a), *a));
    }
    if starts.is_empty() {
        return member.findings;
    }
    let (start, a) = starts[random.below(starts.len())].clone();
    member.judge_diagram("from a branch", &start, whole);
    let half = if a > 0.0 || (a == 0.0 && random.below(2) == 0) {
        (0.0, reach)
    } else {
        (-reach, 0.0)
    };
    if entry.vertex {
        member.judge_diagram("from a branch to the bound", &start, half);
    }
    // At a fold neither arm has a sign of α to begin with.
    let at_fold = entry
        .folds
        .iter()
        .any(|f| distance(f, &member.inner.normal(&start)) < entry.fold_accuracy);
    if a != 0.0 && !at_fold {
        member.judge_steps(&start, a < 0.0, whole);
    }
    member.findings
}
