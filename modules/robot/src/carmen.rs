//! Logs of CARMEN, the robot navigation toolkit: one record a line, read as a stream.
//!
//! ```text
//! PARAM  name value                                     host time
//! ODOM   x y theta tv rv accel                    stamp host time
//! FLASER n r1 .. rn x y theta odom_x odom_y odom_theta stamp host time
//! ```
//!
//! The order of the lines is the truth; nothing is sorted. Other kinds of lines (NEFF, SYNC, TRUEPOS, RLASER, remarks)
//! are skipped and counted; a broken one is an item of its own, and reading goes on behind it.
//!
//! A FLASER line names no angles. CARMEN's own reader takes 180 and 181 readings to be one degree apart, beginning at
//! -90°: the 181st closes the half circle, the 180-reading scanner leaves it open. See [`beams`].

use flate2::bufread::MultiGzDecoder;
use rohrpost_modules::types::{LaserScan, Odometry, Pose, Twist};
use std::f64::consts::{FRAC_PI_2, PI};
use std::fs::File;
use std::io::{self, BufRead, BufReader, Read};
use std::path::Path;
use thiserror::Error;

/// The longest line that is read; a longer one is malformed. 4096 readings of ten characters fit.
pub const LINE_BYTES_MAX: usize = 64 * 1024;
/// Readings in one FLASER line.
pub const READINGS_MAX: usize = 4096;

/// How to read what the log does not say.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Settings {
    /// Readings of this length and more mean that nothing came back. The SICK scanners of most logs write 81.83 or
    /// 81.91.
    pub range_max_m: f32,
}

impl Default for Settings {
    fn default() -> Self {
        Self { range_max_m: 80.0 }
    }
}

/// A line that means something to us.
#[derive(Clone, Debug, PartialEq)]
pub enum LogRecord {
    /// A setting of the robot that wrote the log.
    Param {
        /// Its name.
        name: String,
        /// Its value, as written.
        value: String,
    },
    /// What the base said.
    Odometry {
        /// When, seconds in the log's own count.
        stamp_s: f64,
        /// What.
        odometry: Odometry,
    },
    /// What the front scanner saw; `scan.pose` is where the log says it stood (x y theta).
    Scan {
        /// When, seconds in the log's own count.
        stamp_s: f64,
        /// What it saw.
        scan: LaserScan,
        /// Where the robot stood by its odometry (odom_x odom_y odom_theta). A log that was corrected afterwards often
        /// repeats the corrected pose here.
        odometry: Pose,
    },
}

impl LogRecord {
    /// The stamp, if the record has one.
    pub fn stamp_s(&self) -> Option<f64> {
        match self {
            Self::Param { .. } => None,
            Self::Odometry { stamp_s, .. } | Self::Scan { stamp_s, .. } => Some(*stamp_s),
        }
    }
}

/// What is wrong with a line.
#[derive(Clone, Debug, PartialEq, Eq, Error)]
pub enum Flaw {
    /// The line ends too early.
    #[error("the line ends before its {0}")]
    Missing(&'static str),
    /// Not a number, or not a finite one.
    #[error("its {field} is `{found}`, not a number")]
    NotANumber {
        /// Which.
        field: &'static str,
        /// What stands there.
        found: String,
    },
    /// More or fewer fields than the kind of line has.
    #[error("{0} fields too many")]
    TooMany(usize),
    /// More than [`READINGS_MAX`].
    #[error("{0} readings are more than a scanner has")]
    TooManyReadings(usize),
    /// Longer than [`LINE_BYTES_MAX`].
    #[error("longer than any line of a log")]
    TooLong,
    /// Bytes that are no text.
    #[error("no text")]
    NotText,
}

/// Why an item of the log is none.
#[derive(Debug, Error)]
pub enum LogError {
    /// One bad line; reading goes on behind it.
    #[error("line {line}: {flaw}")]
    Malformed {
        /// From 1.
        line: u64,
        /// What is wrong.
        flaw: Flaw,
    },
    /// The file can't be read further; no item follows.
    #[error("after line {line}: {source}")]
    Io {
        /// The last line that was read.
        line: u64,
        /// Why.
        source: io::Error,
    },
}

/// A log file that can't be opened.
#[derive(Debug, Error)]
#[error("can't open the log {path}: {source}")]
pub struct OpenError {
    /// Which.
    pub path: String,
    /// Why.
    pub source: io::Error,
}

/// Opens a log; one that begins with the mark of gzip is unpacked as it is read, whatever its name.
pub fn open(path: &Path, settings: Settings) -> Result<Reader<Box<dyn BufRead + Send>>, OpenError> {
    let source = |source| OpenError { path: path.display().to_string(), source };
    let mut file = BufReader::new(File::open(path).map_err(source)?);
    let packed = file.fill_buf().map_err(source)?.starts_with(&[0x1f, 0x8b]);
    let plain: Box<dyn BufRead + Send> =
        if packed { Box::new(BufReader::new(MultiGzDecoder::new(file))) } else { Box::new(file) };
    Ok(Reader::new(plain, settings))
}

/// The records of a log, in the order of its lines.
///
/// ```
/// use rohrpost_robot::carmen::{Reader, LogRecord, Settings};
/// let log = "SYNC start\nODOM 1 2 0.5 0.3 0 0 7.25 robot 7.25\n";
/// let mut reader = Reader::new(log.as_bytes(), Settings::default());
/// let record = reader.next().unwrap().unwrap();
/// assert_eq!((record.stamp_s(), reader.skipped()), (Some(7.25), 1));
/// assert!(reader.next().is_none());
/// ```
pub struct Reader<R> {
    input: R,
    settings: Settings,
    buffer: Vec<u8>,
    line: u64,
    skipped: u64,
    over: bool,
}

impl<R: BufRead> Reader<R> {
    /// Reads from anything that has lines.
    pub fn new(input: R, settings: Settings) -> Self {
        Self { input, settings, buffer: Vec::new(), line: 0, skipped: 0, over: false }
    }

    /// Lines so far that are of no kind we read.
    pub fn skipped(&self) -> u64 {
        self.skipped
    }

    /// Lines so far.
    pub fn line(&self) -> u64 {
        self.line
    }

    /// The next line into the buffer; none at the end, `false` if it was too long to keep.
    fn fill(&mut self) -> io::Result<Option<bool>> {
        self.buffer.clear();
        let limit = LINE_BYTES_MAX as u64 + 1;
        if self.input.by_ref().take(limit).read_until(b'\n', &mut self.buffer)? == 0 {
            return Ok(None);
        }
        self.line += 1;
        if self.buffer.len() <= LINE_BYTES_MAX {
            return Ok(Some(true));
        }
        while self.buffer.last() != Some(&b'\n') {
            self.buffer.clear();
            if self.input.by_ref().take(limit).read_until(b'\n', &mut self.buffer)? == 0 {
                break;
            }
        }
        Ok(Some(false))
    }

    /// None: a line of no kind we read.
    fn parse(&self) -> Result<Option<LogRecord>, Flaw> {
        let text = str::from_utf8(&self.buffer).map_err(|_| Flaw::NotText)?;
        let mut fields = Fields(text.split_ascii_whitespace());
        match fields.0.next() {
            Some("PARAM") => fields.param(),
            Some("ODOM") => fields.odometry(),
            Some("FLASER") => fields.scan(self.settings),
            _ => return Ok(None),
        }
        .map(Some)
    }
}

impl<R: BufRead> Iterator for Reader<R> {
    type Item = Result<LogRecord, LogError>;

    fn next(&mut self) -> Option<Self::Item> {
        while !self.over {
            let parsed = match self.fill() {
                Ok(Some(true)) => self.parse(),
                Ok(Some(false)) => Err(Flaw::TooLong),
                Ok(None) => break,
                Err(source) => {
                    self.over = true;
                    return Some(Err(LogError::Io { line: self.line, source }));
                }
            };
            match parsed {
                Ok(None) => self.skipped += 1,
                Ok(Some(record)) => return Some(Ok(record)),
                Err(flaw) => return Some(Err(LogError::Malformed { line: self.line, flaw })),
            }
        }
        self.over = true;
        None
    }
}

/// First direction and step of a FLASER line with this many readings, radians.
///
/// An odd number closes the half circle (181 readings: 180 steps of 1°), an even one leaves it open (180 readings: 1°
/// too).
pub fn beams(readings: usize) -> (f64, f64) {
    let steps = if readings % 2 == 1 { readings - 1 } else { readings };
    (-FRAC_PI_2, PI / steps.max(1) as f64)
}

/// The rest of a line.
struct Fields<'t>(std::str::SplitAsciiWhitespace<'t>);

impl<'t> Fields<'t> {
    fn word(&mut self, field: &'static str) -> Result<&'t str, Flaw> {
        self.0.next().ok_or(Flaw::Missing(field))
    }

    fn number(&mut self, field: &'static str) -> Result<f64, Flaw> {
        let word = self.word(field)?;
        let number = word.parse().ok().filter(|number: &f64| number.is_finite());
        number.ok_or_else(|| Flaw::NotANumber { field, found: word.chars().take(40).collect() })
    }

    fn pose(&mut self) -> Result<Pose, Flaw> {
        Ok(Pose { x_m: self.number("x")?, y_m: self.number("y")?, heading_rad: self.number("theta")? })
    }

    /// Stamp, host and the logger's time, which end a line.
    fn stamp(&mut self) -> Result<f64, Flaw> {
        let stamp_s = self.number("stamp")?;
        self.word("host")?;
        self.number("logger's time")?;
        match self.0.by_ref().count() {
            0 => Ok(stamp_s),
            more => Err(Flaw::TooMany(more)),
        }
    }

    fn param(&mut self) -> Result<LogRecord, Flaw> {
        let (name, value) = (self.word("name")?.to_owned(), self.word("value")?.to_owned());
        Ok(LogRecord::Param { name, value })
    }

    fn odometry(&mut self) -> Result<LogRecord, Flaw> {
        let pose = self.pose()?;
        let twist = Twist { speed_m_s: self.number("speed")?, turn_rate_rad_s: self.number("turn rate")? };
        self.number("acceleration")?;
        Ok(LogRecord::Odometry { stamp_s: self.stamp()?, odometry: Odometry { pose, twist } })
    }

    fn scan(&mut self, settings: Settings) -> Result<LogRecord, Flaw> {
        let word = self.word("number of readings")?;
        let not_a_number = || Flaw::NotANumber { field: "number of readings", found: word.chars().take(40).collect() };
        let readings: usize = word.parse().map_err(|_| not_a_number())?;
        if readings > READINGS_MAX {
            return Err(Flaw::TooManyReadings(readings));
        }
        let mut ranges_m = Vec::with_capacity(readings);
        for _ in 0..readings {
            ranges_m.push(self.number("reading")? as f32);
        }
        let (pose, odometry) = (self.pose()?, self.pose()?);
        let (start_rad, step_rad) = beams(readings);
        let scan = LaserScan {
            start_rad: start_rad as f32,
            step_rad: step_rad as f32,
            range_max_m: settings.range_max_m,
            ranges_m,
            pose: Some(pose),
        };
        Ok(LogRecord::Scan { stamp_s: self.stamp()?, scan, odometry })
    }
}

#[cfg(test)]
#[path = "carmen_tests.rs"]
mod tests;
