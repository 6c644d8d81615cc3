//! A sparse matrix whose entries are always written in the same order.

use clarabel::algebra::CscMatrix;

/// Column-compressed, with the place of each entry in the order of writing.
#[derive(Clone, Debug)]
pub struct Sparse {
    /// The matrix.
    pub matrix: CscMatrix<f64>,
    places: Vec<usize>,
}

impl Sparse {
    /// Room for `entries` (row, column), some of them possibly at the same place.
    pub fn new(rows: usize, columns: usize, entries: &[(usize, usize)]) -> Self {
        let mut unique: Vec<_> = entries.iter().map(|(row, column)| (*column, *row)).collect();
        unique.sort_unstable();
        unique.dedup();
        let place = |(row, column): &(usize, usize)| unique.partition_point(|at| *at < (*column, *row));
        let places = entries.iter().map(place).collect();
        let starts = (0..=columns).map(|column| unique.partition_point(|at| at.0 < column)).collect();
        let row_of = unique.iter().map(|(_, row)| *row).collect();
        let matrix = CscMatrix::new(rows, columns, starts, row_of, vec![0.0; unique.len()]);
        Self { matrix, places }
    }

    /// Begins a new set of values; entries at the same place add up.
    pub fn writer(&mut self) -> Writer<'_> {
        self.matrix.nzval.fill(0.0);
        Writer { values: &mut self.matrix.nzval, places: self.places.iter() }
    }
}

/// Takes the entries in their order.
pub struct Writer<'a> {
    values: &'a mut [f64],
    places: std::slice::Iter<'a, usize>,
}

impl Writer<'_> {
    /// The next entry.
    pub fn put(&mut self, value: f64) {
        if let Some(place) = self.places.next() {
            self.values[*place] += value;
        }
    }
}
