//! Maps as texts. All are drawn with the north up; which format it is, the first line says.
//!
//! ```text
//! *******    seed 000, A.7        type octile    MovingAI           rohrpost-map 1    our own
//! *     *    * wall              height 2       . G S path        # a remark
//! * .R. *    . path              width 4        @ O T W wall      cell_m 0.2
//! * . . *    blank: neither      map                              map
//! * .I. *    R I robot and       @..T                             #####     # wall
//! *     *        intruder, both  @SG@                             #> .#     . or blank: path
//! *******        on paths                                         #####     > ^ < v a robot, facing so
//! ```
//!
//! In the seed's format a row may end early: editors drop blanks at its end. MovingAI's says nothing of sizes in
//! metres; its robots move in eight directions, ours in four. Water is wall there: it may be entered from water alone.

use super::cell::{Cell, Direction};
use super::map_error::{MapError, quoted};
use super::squares::{CELLS_MAX, Grid, Square};

/// A format of maps.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Format {
    /// That of seed 000: rows alone.
    Drawn,
    /// The grid maps of the MovingAI benchmarks (Sturtevant, "Benchmarks for Grid-Based Pathfinding", 2012).
    MovingAi,
    /// Our own, with the size of a cell.
    Rohrpost,
}

/// A grid, and what its text says besides.
#[derive(Clone, Debug, PartialEq)]
pub struct Map {
    /// Walls and paths.
    pub grid: Grid,
    /// How it is written.
    pub format: Format,
    /// Side of a cell, m, where the format says it.
    pub cell_m: Option<f64>,
    /// Robots that are drawn, and which way they look, if the format says it. All are on paths.
    pub robots: Vec<(Cell, Option<Direction>)>,
    /// Cells of intruders that are drawn. All are on paths.
    pub intruders: Vec<Cell>,
    /// Lines before the first row.
    header_lines: usize,
}

impl Map {
    /// Reads a map of any of the three formats.
    ///
    /// ```
    /// use rohrpost_team::grid::{Cell, Map};
    /// let map = Map::read(b"*****\n*   *\n* .R\n").unwrap();
    /// assert!(map.grid.is_path(Cell { column: 3, row: 2 }));
    /// assert!(Map::read(b"rohrpost-map 2\n").is_err());
    /// ```
    ///
    /// # Errors
    /// The first mistake, with its line and column.
    pub fn read(text: &[u8]) -> Result<Self, MapError> {
        // Some editors begin a file with a mark of its byte order, and many end it with empty lines.
        let text = text.strip_prefix(b"\xef\xbb\xbf").unwrap_or(text);
        let end = text.iter().rposition(|byte| !b"\r\n".contains(byte)).map_or(0, |last| last + 1);
        let text = &text[..end];
        let header = Header::read(text)?;
        let rows = lines(text).skip(header.lines);
        let (columns, count) = header.extent(rows.clone())?;
        let mut reader =
            MapReader { header: &header, columns, squares: Vec::new(), robots: Vec::new(), intruders: Vec::new() };
        reader.squares.reserve_exact(columns * count);
        for (index, row) in rows.clone().enumerate() {
            if index == count {
                return Err(MapError::MoreRows { line: header.lines + count + 1, expected: count });
            }
            reader.take(index, row)?;
        }
        let MapReader { squares, robots, intruders, .. } = reader;
        let missing = count - squares.len() / columns;
        if missing > 0 {
            return Err(ended(text, format!("{missing} more rows, as `height` says")));
        }
        let grid = Grid::new(columns as u32, squares).ok_or(MapError::TooLarge {
            line: header.lines + 1,
            columns,
            rows: count,
        })?;
        Ok(Self { grid, format: header.format, cell_m: header.cell_m, robots, intruders, header_lines: header.lines })
    }

    /// Where a cell stands in the text: line and column, from 1.
    pub fn line_and_column(&self, cell: Cell) -> (usize, usize) {
        (self.header_lines + cell.row as usize + 1, cell.column as usize + 1)
    }
}

/// Lines without their ends.
fn lines(text: &[u8]) -> impl Iterator<Item = &[u8]> + Clone {
    text.split(|byte| *byte == b'\n').map(|line| line.strip_suffix(b"\r").unwrap_or(line))
}

fn ended(text: &[u8], missing: String) -> MapError {
    let (line, last) = lines(text).enumerate().last().unwrap_or_default();
    MapError::Ended { line: line + 1, column: last.len() + 1, missing }
}

/// The lines before the rows.
struct Header {
    format: Format,
    /// How many there are.
    lines: usize,
    columns: Option<usize>,
    rows: Option<usize>,
    cell_m: Option<f64>,
}

impl Header {
    fn read(text: &[u8]) -> Result<Self, MapError> {
        let first = lines(text).next().unwrap_or_default();
        let format = match first.trim_ascii_end() {
            b"rohrpost-map 1" => Format::Rohrpost,
            b"type octile" => Format::MovingAi,
            _ if !text.is_empty() && first.first().is_none_or(|byte| square(Format::Drawn, *byte).is_some()) => {
                return Ok(Self { format: Format::Drawn, lines: 0, columns: None, rows: None, cell_m: None });
            }
            _ => return Err(MapError::UnknownFormat { found: quoted(&String::from_utf8_lossy(first)) }),
        };
        let mut header = Self { format, lines: 1, columns: None, rows: None, cell_m: None };
        for line in lines(text).skip(1) {
            header.lines += 1;
            if header.take(line)? {
                return Ok(header);
            }
        }
        Err(ended(text, format!("{}, then the line `map`", keys(format))))
    }

    /// Whether this is the last line of the header.
    fn take(&mut self, text: &[u8]) -> Result<bool, MapError> {
        let line = self.lines;
        let words = String::from_utf8_lossy(text);
        let mistake = |expected| MapError::Header { line, expected, found: quoted(&words) };
        let (key, value) = words.trim_end().split_once(' ').unwrap_or((words.trim_end(), ""));
        let value = value.trim();
        match (self.format, key) {
            (Format::Rohrpost, _) if key.is_empty() || key.starts_with('#') => {}
            (Format::Rohrpost, "cell_m") if self.cell_m.is_none() => {
                let metres = value.parse().ok().filter(|metres: &f64| metres.is_finite() && *metres > 0.0);
                self.cell_m = Some(metres.ok_or(mistake("`cell_m` and a positive number of metres"))?);
            }
            (Format::MovingAi, "height") if self.rows.is_none() => {
                self.rows = Some(positive(value).ok_or(mistake("`height` and a positive number of rows"))?);
            }
            (Format::MovingAi, "width") if self.columns.is_none() => {
                self.columns = Some(positive(value).ok_or(mistake("`width` and a positive number of columns"))?);
            }
            (_, "map") if value.is_empty() && self.is_complete() => return Ok(true),
            (_, "map") if value.is_empty() => return Err(mistake(missing_before_map(self.format))),
            _ => return Err(mistake(keys(self.format))),
        }
        Ok(false)
    }

    fn is_complete(&self) -> bool {
        self.cell_m.is_some() || self.rows.is_some() && self.columns.is_some()
    }

    /// Columns and rows, as the header says or the rows are.
    fn extent<'t>(&self, rows: impl Iterator<Item = &'t [u8]> + Clone) -> Result<(usize, usize), MapError> {
        let widest = || rows.clone().map(<[u8]>::len).max();
        let columns = match self.format {
            Format::Drawn => widest(),
            Format::MovingAi => self.columns,
            Format::Rohrpost => rows.clone().next().map(<[u8]>::len),
        };
        let columns = columns.unwrap_or_default();
        let rows = self.rows.unwrap_or_else(|| rows.count());
        let line = self.lines + usize::from(self.rows.is_none());
        if columns.saturating_mul(rows) > CELLS_MAX {
            return Err(MapError::TooLarge { line, columns, rows });
        }
        if columns == 0 || rows == 0 {
            let missing = "rows of squares below the line `map`".into();
            return Err(MapError::Ended { line: self.lines.max(1), column: 1 + "map".len(), missing });
        }
        Ok((columns, rows))
    }
}

fn positive(text: &str) -> Option<usize> {
    text.parse().ok().filter(|number| *number > 0)
}

fn keys(format: Format) -> &'static str {
    if format == Format::MovingAi { "`height` and `width` with a number each" } else { "`cell_m` and metres" }
}

fn missing_before_map(format: Format) -> &'static str {
    if format == Format::MovingAi {
        "`height` and `width` with a number each before `map`"
    } else {
        "`cell_m` and metres before `map`"
    }
}

/// What is drawn on a path.
#[derive(Clone, Copy)]
enum Mark {
    Robot(Option<Direction>),
    Intruder,
}

/// What one character means.
fn square(format: Format, byte: u8) -> Option<(Square, Option<Mark>)> {
    let robot = |facing| (Square::Path, Some(Mark::Robot(facing)));
    Some(match (format, byte) {
        (Format::Drawn, b'*') | (Format::Rohrpost, b'#') | (Format::MovingAi, b'@' | b'O' | b'T' | b'W') => {
            (Square::Wall, None)
        }
        (_, b'.') | (Format::Rohrpost, b' ') | (Format::MovingAi, b'G' | b'S') => (Square::Path, None),
        (Format::Drawn, b' ') => (Square::Blank, None),
        (Format::Drawn, b'R') => robot(None),
        (Format::Drawn, b'I') => (Square::Path, Some(Mark::Intruder)),
        (Format::Rohrpost, b'^') => robot(Some(Direction::North)),
        (Format::Rohrpost, b'>') => robot(Some(Direction::East)),
        (Format::Rohrpost, b'v') => robot(Some(Direction::South)),
        (Format::Rohrpost, b'<') => robot(Some(Direction::West)),
        _ => return None,
    })
}

/// The characters of [`square`], for messages.
fn squares_of(format: Format) -> &'static str {
    match format {
        Format::Drawn => "`*` (wall), `.` (path), a blank (neither), `R` (robot) or `I` (intruder)",
        Format::MovingAi => "`.`, `G` or `S` (path), `@`, `O`, `T` or `W` (wall)",
        Format::Rohrpost => "`#` (wall), `.` or a blank (path), `>`, `^`, `<` or `v` (robot)",
    }
}

struct MapReader<'a> {
    header: &'a Header,
    columns: usize,
    squares: Vec<Square>,
    robots: Vec<(Cell, Option<Direction>)>,
    intruders: Vec<Cell>,
}

impl MapReader<'_> {
    fn take(&mut self, index: usize, row: &[u8]) -> Result<(), MapError> {
        let (line, format) = (self.header.lines + index + 1, self.header.format);
        for (column, byte) in row.iter().take(self.columns).enumerate() {
            let (square, mark) = square(format, *byte).ok_or_else(|| {
                let found = String::from_utf8_lossy(&row[column..]).chars().next().unwrap_or_default();
                MapError::Square { line, column: column + 1, found, expected: squares_of(format) }
            })?;
            self.squares.push(square);
            let cell = Cell { column: column as u32, row: index as u32 };
            match mark {
                Some(Mark::Robot(facing)) => self.robots.push((cell, facing)),
                Some(Mark::Intruder) => self.intruders.push(cell),
                None => {}
            }
        }
        if format == Format::Drawn {
            self.squares.resize((index + 1) * self.columns, Square::Blank);
        } else if row.len() != self.columns {
            let found = String::from_utf8_lossy(row).chars().count();
            return Err(MapError::RowLength { line, found, expected: self.columns });
        }
        Ok(())
    }
}
