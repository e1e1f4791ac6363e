//! The whole map as a picture, for people and tests.

use super::{Mapper, TILE_CELLS, TileIndex};
use rohrpost_modules::types::Cell;

impl Mapper {
    /// The map as a grey picture (PGM, binary), north up: occupied black, free white, never seen grey.
    pub fn to_pgm(&self) -> Vec<u8> {
        let (columns, rows, cells) = self.mosaic();
        let mut pgm = format!("P5\n{columns} {rows}\n255\n").into_bytes();
        pgm.extend(cells.into_iter().map(|cell| match cell {
            cell if cell == Cell::UNKNOWN.0 => 205,
            percent => 254 - (f32::from(percent.min(100)) * 2.54).round() as u8,
        }));
        pgm
    }

    /// The map as text, north up: `#` occupied, `.` free, space never seen. For small maps.
    pub fn to_text(&self) -> String {
        let (columns, _, cells) = self.mosaic();
        let line = |row: &[u8]| row.iter().map(|cell| symbol(*cell)).collect::<String>().trim_end().to_owned() + "\n";
        cells.chunks(columns.max(1)).map(line).collect()
    }

    /// Columns, rows, and the squares of all tiles side by side, cut to what was seen; the northern row first.
    fn mosaic(&self) -> (usize, usize, Vec<u8>) {
        let seen: Vec<(i64, i64, u8)> = self.tiles().flat_map(|index| self.seen(index)).collect();
        let range = |of: fn(&(i64, i64, u8)) -> i64| Some((seen.iter().map(of).min()?, seen.iter().map(of).max()?));
        let (Some((west, east)), Some((south, north))) = (range(|cell| cell.0), range(|cell| cell.1)) else {
            return (0, 0, Vec::new());
        };
        let (columns, rows) = ((east - west + 1) as usize, (north - south + 1) as usize);
        let mut cells = vec![Cell::UNKNOWN.0; columns * rows];
        for (column, row, value) in seen {
            cells[(north - row) as usize * columns + (column - west) as usize] = value;
        }
        (columns, rows, cells)
    }

    /// The squares of a tile that were seen: column, row, percent.
    fn seen(&self, index: TileIndex) -> Vec<(i64, i64, u8)> {
        let side = i64::from(TILE_CELLS);
        let cells = self.tile(index).map_or_else(Vec::new, |grid| grid.cells);
        let place = |cell: usize| {
            let (column, row) = (cell as i64 % side, cell as i64 / side);
            (i64::from(index.column) * side + column, i64::from(index.row) * side + row)
        };
        let seen = cells.into_iter().enumerate().filter(|(_, value)| *value != Cell::UNKNOWN.0);
        seen.map(|(cell, value)| (place(cell).0, place(cell).1, value)).collect()
    }
}

fn symbol(cell: u8) -> char {
    match cell {
        255 => ' ',
        51.. => '#',
        _ => '.',
    }
}
