//! What a report says of bodies in contact: nodes, forces, energies, uniqueness, and pictures.

use super::page::Page;
use super::words::{number, of_states};
use super::{ReportBody, Subject};
use crate::contact::{
    CondensedContact, ContactError, ContactSolution, ContactState, NodeLaw, UniquenessConstants,
    critical_friction,
};
use crate::fem::{ContactRows, ElasticSystem};
use crate::output::{BodyPicture, OutputError};
use crate::piecewise::Selection;

/// Largest number of contact nodes for which constants of uniqueness are computed: O(p³) with a factor of some tens.
const MOST_FOR_BOUNDS: usize = 300;
/// Bytes of all pictures of bodies together: a report of 2 MB has room for tables and curves beside them.
const MOST_BYTES: usize = 900_000;
/// Pictures of bodies.
pub(super) const MOST_PICTURES: usize = 8;
/// Rows of tables on the page; the tables to copy have all.
pub(super) const MOST_ROWS: usize = 60;

/// A contact problem, whatever its law.
pub(super) trait Contacts {
    fn solution(&self, x: &[f64]) -> Result<ContactSolution, ContactError>;
    /// Displacements: those that are free, and those of supports.
    fn displacements(&self, x: &[f64]) -> Result<[Vec<f64>; 2], ContactError>;
    fn states(&self, selection: &Selection) -> Vec<ContactState>;
    fn num_held(&self) -> usize;
    fn num_displacements(&self) -> usize;
    /// The largest coefficient of friction at α, without slip.
    fn friction(&self, alpha: f64) -> f64;
    /// What is known of uniqueness, in sentences.
    fn uniqueness(&self, alpha: f64, areas: Option<&[f64]>) -> Vec<String>;
}

impl<L: NodeLaw> Contacts for CondensedContact<L> {
    fn solution(&self, x: &[f64]) -> Result<ContactSolution, ContactError> {
        Self::solution(self, x)
    }

    fn displacements(&self, x: &[f64]) -> Result<[Vec<f64>; 2], ContactError> {
        Ok([Self::displacements(self, x)?, self.support_displacements(x)?])
    }

    fn states(&self, selection: &Selection) -> Vec<ContactState> {
        Self::states(self, selection)
    }

    fn num_held(&self) -> usize {
        self.body().num_held()
    }

    fn num_displacements(&self) -> usize {
        self.body().num_displacements()
    }

    fn friction(&self, alpha: f64) -> f64 {
        self.friction_at(alpha).into_iter().fold(0.0, f64::max)
    }

    fn uniqueness(&self, alpha: f64, areas: Option<&[f64]>) -> Vec<String> {
        let p = self.num_contacts();
        let law = self.node_law().is_coulomb() && self.body().num_tangents() == 1;
        if !law || self.num_held() > 0 {
            let what = "Bounds for the coefficient of friction below which solutions are unique are not computed here: they are for \
                        Coulomb's law with a coefficient independent of the slip, in the plane, without held tangents.";
            return vec![what.to_owned()];
        }
        if p > MOST_FOR_BOUNDS {
            return vec![format!(
                "Bounds for the coefficient of friction below which solutions are unique are computed for at most {MOST_FOR_BOUNDS} \
                 contact nodes; there are {p}."
            )];
        }
        let largest = Contacts::friction(self, alpha);
        let mut out = vec![format!(
            "The largest coefficient of friction is {}.",
            number(largest, 0.0)
        )];
        match critical_friction(self) {
            Ok(Some(critical)) => out.push(format!(
                "Critical coefficient F_crit = {}: below it no curve of solutions folds while all nodes are in contact and slip to one \
                 side, with the same coefficient everywhere. Other patterns of slip may fold below it.",
                number(critical, 0.0)
            )),
            Ok(None) => out.push(
                "While all nodes are in contact and slip to one side, with the same coefficient everywhere, no curve of solutions folds \
                 at any coefficient."
                    .to_owned(),
            ),
            Err(e) => out.push(format!("The critical coefficient was not computed: {e}.")),
        }
        match areas.map(|areas| UniquenessConstants::new(self, areas)) {
            Some(Ok(constants)) => {
                let bound = constants.guaranteed_friction();
                let margin = match largest < bound {
                    true => "it holds here: there is one solution at each load",
                    false => {
                        "it does not hold here, which proves nothing: the bound is sufficient, not necessary"
                    }
                };
                out.push(format!(
                    "Below the coefficient {} the solution is unique at every load (Haslinger, Kučera, Vlach 2008; the constants are \
                     computed in floating-point arithmetic); {margin}.",
                    number(bound, 0.0)
                ));
            }
            Some(Err(e)) => out.push(format!("The bound for uniqueness was not computed: {e}.")),
            None => {}
        }
        out
    }
}

/// A change of the state of a contact node.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Change {
    pub(super) parameter: f64,
    pub(super) node: usize,
    pub(super) from: ContactState,
    pub(super) to: ContactState,
}

impl Change {
    pub(super) fn between(parameter: f64, before: &[ContactState], after: &[ContactState]) -> Vec<Self> {
        let pairs = before.iter().zip(after).enumerate();
        pairs
            .filter(|(_, (from, to))| from != to)
            .map(|(node, (&from, &to))| Self {
                parameter,
                node,
                from,
                to,
            })
            .collect()
    }

    pub(super) fn words(&self) -> String {
        format!("node {} {}", self.node, of_states(self.from, self.to))
    }
}

/// The first slip, lift-off and contact of each node, and its state at both ends.
pub(super) fn nodes(
    page: &mut Page,
    subject: &Subject<'_>,
    changes: &[Change],
    [first, last]: [&[ContactState]; 2],
) {
    let rows = subject.body.map(|(_, rows)| rows);
    let dim = subject.body.map_or(0, |(system, _)| system.mesh().dim());
    let begin = |node: usize, wanted: &dyn Fn(ContactState) -> bool| match wanted(first[node]) {
        true => Some(None),
        false => (changes.iter().find(|c| c.node == node && wanted(c.to))).map(|c| Some(c.parameter)),
    };
    let shown = |at: Option<Option<f64>>, digits: &dyn Fn(f64) -> String| match at {
        Some(Some(parameter)) => digits(parameter),
        Some(None) => "from the start".to_owned(),
        None => "–".to_owned(),
    };
    let row = |node: usize, digits: &dyn Fn(f64) -> String| {
        let mut row = vec![node.to_string()];
        row.extend(
            rows.into_iter()
                .flat_map(|r| r.points[node][..dim].iter().map(|v| digits(*v))),
        );
        let slip = begin(node, &|s| s.is_slip());
        let open = begin(node, &|s| s == ContactState::Open);
        row.extend([slip, open].map(|at| shown(at, digits)));
        row.extend([first[node], last[node]].map(|s| s.name().to_owned()));
        row
    };
    let coordinates = &["#x", "#y", "#z"][..dim];
    let forced = ["#first slip", "#first lift-off", "at the start", "at the end"];
    let head: Vec<&str> = std::iter::once("#node")
        .chain(coordinates.iter().copied())
        .chain(forced)
        .collect();
    // Those that change first come first; the others in their order.
    let mut order: Vec<usize> = (0..first.len()).collect();
    let earliest = |node: usize| changes.iter().position(|c| c.node == node).unwrap_or(usize::MAX);
    order.sort_by_cached_key(|&node| earliest(node));
    page.paragraph(&format!(
        "The load {} at which each contact node first slips and first lifts off{}. A dash: it does not.",
        subject.parameter(),
        match order.len() > MOST_ROWS {
            true => format!(
                ", for the {MOST_ROWS} nodes that change first; the table to copy below has all {}",
                order.len()
            ),
            false => String::new(),
        }
    ));
    let listed = order.iter().take(MOST_ROWS);
    let brief: Vec<_> = listed.map(|&node| row(node, &|v| number(v, 0.0))).collect();
    page.table(&head, &brief);
    let head: Vec<String> = head
        .iter()
        .map(|h| h.trim_start_matches('#').to_owned())
        .collect();
    let all: Vec<_> = (0..first.len())
        .map(|node| row(node, &|v| format!("{v:?}")))
        .collect();
    page.copyable("All contact nodes", &head, &all);
}

/// Numbers of nodes in each state, reactions and energies, as cells.
pub(super) fn of_solution(s: &ContactSolution, digits: &dyn Fn(f64) -> String) -> Vec<String> {
    let [normal, first, second] = s.resultant();
    let counts = [s.open(), s.stick(), s.slip()].map(|n| n.to_string());
    let tangential = if second == 0.0 { first } else { first.hypot(second) };
    let values = [normal, tangential, s.energy.stored, s.energy.dissipated].map(digits);
    counts.into_iter().chain(values).collect()
}

/// The heads of these cells.
pub(super) const OF_SOLUTION: [&str; 7] = [
    "#open",
    "#stick",
    "#slip",
    "#sum of normal forces",
    "#sum of tangential forces",
    "#elastic energy",
    "#friction × slip",
];

/// Pictures of a body, as long as there is room for them.
pub(super) struct Figures<'a> {
    system: &'a ElasticSystem,
    rows: &'a ContactRows,
    bytes: usize,
    /// Solutions that are drawn already.
    seen: Vec<Vec<f64>>,
    /// Where on the way, picture, caption.
    done: Vec<(usize, String, String)>,
    left_out: bool,
    /// Whether bodies in the plane are drawn without their cells.
    outlined: bool,
}

impl<'a> Figures<'a> {
    pub(super) fn new(system: &'a ElasticSystem, rows: &'a ContactRows) -> Self {
        Self {
            system,
            rows,
            bytes: 0,
            seen: Vec::new(),
            done: Vec::new(),
            left_out: false,
            outlined: false,
        }
    }

    /// Whether no further picture is drawn.
    pub(super) fn is_full(&self) -> bool {
        self.done.len() >= MOST_PICTURES || self.left_out
    }

    /// Draws the body at a solution x, which is passed at a place on the way, unless it has been drawn or there is no room.
    pub(super) fn add(
        &mut self,
        (place, x): (usize, &[f64]),
        states: &[ContactState],
        displacements: &[Vec<f64>; 2],
        caption: &str,
    ) -> Result<(), OutputError> {
        if self.seen.iter().any(|s| s == x) {
            return Ok(());
        }
        self.seen.push(x.to_vec());
        if self.is_full() {
            return Ok(());
        }
        let (system, [free, supports]) = (self.system, displacements);
        let mesh = system.mesh();
        let nodes = &self.rows.nodes;
        let picture =
            BodyPicture::of_contact(system, nodes, states, [free, supports], None)?.with_size(560, 400);
        let magnified = picture.magnification();
        let mut svg = picture.to_svg()?;
        if svg.len() > MOST_BYTES / 4 && mesh.dim() == 2 {
            svg = picture.with_outline_alone().to_svg()?;
            self.outlined = true;
        }
        if self.bytes + svg.len() > MOST_BYTES {
            self.left_out = true;
            return Ok(());
        }
        self.bytes += svg.len();
        let times = match magnified == 1.0 {
            true => "displacements to scale".to_owned(),
            false => format!("displacements × {}", number(magnified, 0.0)),
        };
        self.done.push((place, svg, format!("{caption} ({times})")));
        Ok(())
    }

    /// The section, if there is anything to show or to say.
    pub(super) fn section(mut self, page: &mut Page) {
        if self.done.is_empty() && !self.left_out {
            return;
        }
        page.section("Pictures of the body");
        page.paragraph(match self.outlined {
            true => {
                "Discs are contact nodes, by their state. There is no room in this file for all cells of the mesh, so that outlines alone \
                 are drawn."
            }
            false => {
                "Colours in the body are the equivalent stress of von Mises; discs are contact nodes, by their state. Each picture has its \
                 own scale of colours."
            }
        });
        if self.left_out {
            page.paragraph("More are left out, so that this file stays below 2 MB.");
        }
        self.done.sort_by_key(|figure| figure.0);
        let figures = self.done.into_iter().map(|(_, svg, caption)| (svg, caption));
        page.figures(&figures.collect::<Vec<_>>());
    }
}

/// The body of a subject, for its areas.
pub(super) fn areas<'a>(body: Option<ReportBody<'a>>) -> Option<&'a [f64]> {
    body.map(|(_, rows)| rows.areas.as_slice())
}
