//! What the values and kinks of a formula depend on, in one pass over its nodes.

use std::collections::HashSet;

use semismooth::sparse::Pattern;

use crate::expressions::Node;

/// Where the Jacobian of a formula has entries, and what its kinks depend on.
pub(crate) struct Structure {
    pub(crate) pattern: Pattern,
    pub(crate) dependencies: Dependencies,
}

/// What kinks depend on, and what depends on them: see `NonsmoothFunction::dependencies`.
#[derive(Default)]
pub(crate) struct Dependencies {
    pub(crate) rows: Vec<Vec<usize>>,
    pub(crate) variables: Vec<Vec<usize>>,
    pub(crate) nested: bool,
}

/// Members up to which a set is a list.
const FEW: usize = 16;

/// Variables, and behind them sites.
#[derive(Clone)]
enum Set {
    Few(Vec<usize>),
    Many(HashSet<usize>),
}

impl Set {
    fn len(&self) -> usize {
        match self {
            Self::Few(members) => members.len(),
            Self::Many(members) => members.len(),
        }
    }

    fn insert(&mut self, member: usize) {
        match self {
            Self::Many(members) => {
                members.insert(member);
            }
            Self::Few(members) if members.contains(&member) => {}
            Self::Few(members) if members.len() < FEW => members.push(member),
            Self::Few(members) => {
                let mut many: HashSet<usize> = members.drain(..).collect();
                many.insert(member);
                *self = Self::Many(many);
            }
        }
    }

    fn for_each(&self, act: impl FnMut(usize)) {
        match self {
            Self::Few(members) => members.iter().copied().for_each(act),
            Self::Many(members) => members.iter().copied().for_each(act),
        }
    }

    /// The union: the smaller set goes into the larger one, so that a long sum takes time in proportion to its length.
    fn with(self, other: Self) -> Self {
        let (mut large, small) = if self.len() < other.len() {
            (other, self)
        } else {
            (self, other)
        };
        small.for_each(|member| large.insert(member));
        large
    }
}

/// The sets of nodes whose arguments are done, each dropped at its last use.
struct Sets {
    of: Vec<Option<Set>>,
    uses: Vec<usize>,
}

impl Sets {
    /// The set of an argument; moved out where no other node needs it.
    fn take(&mut self, at: usize) -> Set {
        self.uses[at] -= 1;
        let set = &mut self.of[at];
        let found = if self.uses[at] == 0 {
            set.take()
        } else {
            set.clone()
        };
        found.unwrap_or(Set::Few(Vec::new()))
    }

    fn see(&self, at: usize, act: impl FnMut(usize)) {
        if let Some(set) = &self.of[at] {
            set.for_each(act);
        }
    }
}

/// The structure of the values of nodes, each after its arguments. Kinks depend on all of their pieces.
pub(crate) fn structure(variables: usize, nodes: &[Node], values: &[usize]) -> Structure {
    let mut sets = Sets {
        of: vec![None; nodes.len()],
        uses: vec![0; nodes.len()],
    };
    for argument in nodes.iter().flat_map(|node| node.arguments()).flatten() {
        sets.uses[argument] += 1;
    }
    let mut rows_of = vec![Vec::new(); nodes.len()];
    for (row, &at) in values.iter().enumerate() {
        rows_of[at].push(row);
    }
    let mut dependencies = Dependencies::default();
    let mut entries = Vec::new();
    for (at, node) in nodes.iter().enumerate() {
        let label = variables + dependencies.rows.len();
        let tests = tests_of(*node);
        for test in tests.iter().flatten() {
            let mut own = Vec::new();
            for &argument in test.iter().flatten() {
                sets.see(argument, |member| own.push(member));
            }
            own.sort_unstable();
            own.dedup();
            let first_site = own.partition_point(|&member| member < variables);
            dependencies.nested |= first_site < own.len();
            own.truncate(first_site);
            dependencies.variables.push(own);
        }
        let mut set = Set::Few(Vec::new());
        if let Node::Variable(k) = node {
            set.insert(*k);
        }
        for (place, argument) in node.arguments().into_iter().flatten().enumerate() {
            let own = sets.take(argument);
            // The test of a switch decides between its values, and is no part of them.
            if place > 0 || !matches!(node, Node::Switch(..)) {
                set = set.with(own);
            }
        }
        if tests[0].is_some() {
            set.insert(label);
            dependencies.rows.push(Vec::new());
        }
        set.for_each(|member| match member.checked_sub(variables) {
            None => entries.extend(rows_of[at].iter().map(|&row| (row, member))),
            Some(site) => dependencies.rows[site].extend(&rows_of[at]),
        });
        if sets.uses[at] > 0 {
            sets.of[at] = Some(set);
        }
    }
    for rows in &mut dependencies.rows {
        rows.sort_unstable();
    }
    let n = values.len();
    Structure {
        // All entries lie inside.
        pattern: Pattern::from_entries(n, variables, entries).unwrap_or_else(|_| Pattern::full(n, variables)),
        dependencies,
    }
}

/// The nodes that each test function of a kink is made of.
fn tests_of(node: Node) -> [Option<[Option<usize>; 2]>; 2] {
    match node {
        Node::Max(a, b) | Node::Min(a, b) => [Some([Some(a), Some(b)]), None],
        Node::Abs(a) | Node::Switch(a, _, _) => [Some([Some(a), None]), None],
        Node::Project(lower, z, upper) => [Some([Some(z), Some(lower)]), Some([Some(z), Some(upper)])],
        _ => [None; 2],
    }
}
