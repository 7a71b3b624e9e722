use super::Pattern;

/// Groups of columns no two of which have an entry in the same row, so that one difference quotient or dual number serves a group
/// (Curtis, Powell and Reid 1974); greedy in the order of the columns.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(crate) struct Coloring {
    groups: Vec<Vec<usize>>,
}

impl Coloring {
    pub(crate) fn new(pattern: &Pattern) -> Self {
        let (rows, cols) = (pattern.nrows(), pattern.ncols());
        let full = pattern.is_full();
        let mut by_row = vec![Vec::new(); rows];
        let mut colour = vec![usize::MAX; cols];
        let mut forbidden: Vec<usize> = Vec::new();
        let mut groups: Vec<Vec<usize>> = Vec::new();
        for j in 0..cols {
            let entries = &pattern.row_idx()[pattern.col_ptr()[j]..pattern.col_ptr()[j + 1]];
            let c = if full {
                j
            } else {
                for &i in entries {
                    let neighbours: &Vec<usize> = &by_row[i];
                    for &k in neighbours {
                        forbidden[colour[k]] = j;
                    }
                }
                // Colour c is free unless a neighbour has marked it with this column.
                (0..groups.len())
                    .find(|&c| forbidden[c] != j)
                    .unwrap_or(groups.len())
            };
            if c == groups.len() {
                groups.push(Vec::new());
                forbidden.push(usize::MAX);
            }
            colour[j] = c;
            groups[c].push(j);
            if !full {
                entries.iter().for_each(|&i| by_row[i].push(j));
            }
        }
        Self { groups }
    }

    pub(crate) fn groups(&self) -> &[Vec<usize>] {
        &self.groups
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn tridiagonal_matrices_need_three_colours() {
        let n = 50;
        let entries = (0..n).flat_map(|i: usize| (i.saturating_sub(1)..(i + 2).min(n)).map(move |j| (i, j)));
        let pattern = Pattern::from_entries(n, n, entries).unwrap();
        let coloring = Coloring::new(&pattern);
        assert_eq!(coloring.groups().len(), 3);
        for group in coloring.groups() {
            let mut rows: Vec<usize> = group
                .iter()
                .flat_map(|&j| pattern.row_idx()[pattern.col_ptr()[j]..pattern.col_ptr()[j + 1]].to_vec())
                .collect();
            let all = rows.len();
            rows.sort_unstable();
            rows.dedup();
            assert_eq!(rows.len(), all);
        }
        assert_eq!(Coloring::new(&Pattern::full(4, 4)).groups().len(), 4);
    }
}
