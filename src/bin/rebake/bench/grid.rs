//! Tables in plain text: names to the left, numbers to the right.

/// Rows of cells, the first of them the heads of the columns.
pub struct Grid {
    title: String,
    rows: Vec<Vec<String>>,
}

impl Grid {
    pub fn new(title: impl Into<String>, heads: impl IntoIterator<Item = String>) -> Self {
        Self {
            title: title.into(),
            rows: vec![heads.into_iter().collect()],
        }
    }

    pub fn row(&mut self, cells: impl IntoIterator<Item = String>) {
        self.rows.push(cells.into_iter().collect());
    }
}

impl std::fmt::Display for Grid {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        let columns = self.rows.iter().map(Vec::len).max().unwrap_or(0);
        let width = |c: usize| {
            let cells = self.rows.iter().filter_map(|r| r.get(c));
            cells.map(|s| s.chars().count()).max().unwrap_or(0)
        };
        let widths: Vec<usize> = (0..columns).map(width).collect();
        write!(f, "\n{}", self.title)?;
        for row in &self.rows {
            let mut line = String::new();
            for (c, cell) in row.iter().enumerate() {
                let pad = " ".repeat(widths[c] - cell.chars().count());
                line += &match c {
                    0 => format!("{cell}{pad}"),
                    _ => format!("  {pad}{cell}"),
                };
            }
            write!(f, "\n  {}", line.trim_end())?;
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn columns_line_up() {
        let mut grid = Grid::new("t", ["name".to_owned(), "ms".to_owned()]);
        grid.row(["a".to_owned(), "10.5".to_owned()]);
        assert_eq!(grid.to_string(), "\nt\n  name    ms\n  a     10.5");
    }
}
