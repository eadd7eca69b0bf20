//! A CSV table that the program wrote, by columns.

/// Names, and rows of numbers.
pub struct Columns {
    names: Vec<String>,
    pub rows: Vec<Vec<f64>>,
}

impl Columns {
    pub fn read(file: &str) -> Self {
        let csv = std::fs::read_to_string(file).unwrap();
        let mut lines = csv.lines();
        let names = lines.next().unwrap().split(',').map(str::to_owned).collect();
        let row = |l: &str| l.split(',').map(|x| x.parse().unwrap()).collect();
        Self { names, rows: lines.map(row).collect() }
    }

    pub fn has(&self, name: &str) -> bool {
        self.names.iter().any(|n| n == name)
    }

    pub fn of(&self, name: &str) -> Vec<f64> {
        let k = self.names.iter().position(|n| n == name).unwrap();
        self.rows.iter().map(|row| row[k]).collect()
    }
}
