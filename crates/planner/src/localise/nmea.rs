//! Sentences of a satellite receiver (NMEA 0183): position from GGA, position and course from RMC.

use tractrix_core::Fix;

/// The longest sentence, bytes (the standard: 82; receivers with more digits send more).
const LONGEST: usize = 120;
/// One knot, m/s.
const KNOT_M_S: f64 = 1852.0 / 3600.0;
/// Below this speed a course over ground is noise, m/s.
const COURSE_FROM_M_S: f64 = 3.0;

/// Why a sentence brings no fix.
#[derive(Debug, Clone, Copy, PartialEq, Eq, thiserror::Error)]
#[non_exhaustive]
pub enum NmeaError {
    /// It is no sentence, or too long a one.
    #[error("not an NMEA 0183 sentence of at most {LONGEST} bytes")]
    Form,
    /// The checksum is missing or wrong.
    #[error("the checksum of an NMEA 0183 sentence is missing or wrong")]
    Checksum,
    /// A field does not say what it should.
    #[error("field {0} of an NMEA 0183 sentence cannot be read")]
    Field(usize),
}

/// Reads sentences; of those of one instant the first position counts, and none of GGA once RMC,
/// which has the course, has been seen.
#[derive(Debug, Clone, Copy, Default)]
pub struct Nmea {
    has_course: bool,
    /// Time of day of the last fix, ms.
    last_ms: Option<u32>,
}

impl Nmea {
    /// The fix in a sentence; `None` for sentences of other kinds, for a receiver that has none, and
    /// for an instant that had one already.
    ///
    /// # Errors
    /// [`NmeaError`] for what cannot be read.
    pub fn sentence(&mut self, line: &[u8]) -> Result<Option<Fix>, NmeaError> {
        if line.len() > LONGEST {
            return Err(NmeaError::Form);
        }
        let text = core::str::from_utf8(line).map_err(|_| NmeaError::Form)?.trim_end();
        let (body, sum) =
            text.strip_prefix('$').and_then(|text| text.rsplit_once('*')).ok_or(NmeaError::Form)?;
        let xor = body.bytes().fold(0, |xor, byte| xor ^ byte);
        if u8::from_str_radix(sum, 16) != Ok(xor) || sum.len() != 2 {
            return Err(NmeaError::Checksum);
        }
        let field = |at: usize| body.split(',').nth(at).ok_or(NmeaError::Field(at));
        let (position, course_rad) = match field(0)?.get(2..) {
            Some("GGA") if field(6)? != "0" && !self.has_course => (2, None),
            Some("RMC") if field(2)? == "A" => {
                self.has_course = true;
                let number = |at| number(field(at)?).ok_or(NmeaError::Field(at));
                let fast = !field(7)?.is_empty() && number(7)? * KNOT_M_S >= COURSE_FROM_M_S;
                let known = fast && !field(8)?.is_empty();
                (3, if known { Some(number(8)?.to_radians()) } else { None })
            }
            _ => return Ok(None),
        };
        let time = number(field(1)?).ok_or(NmeaError::Field(1))?;
        let time_ms = Some((time.clamp(0.0, 240_000.0) * 1000.0) as u32);
        let (latitude_deg, longitude_deg) = (
            degrees(field(position)?, field(position + 1)?, ["N", "S"], 90.0)
                .ok_or(NmeaError::Field(position))?,
            degrees(field(position + 2)?, field(position + 3)?, ["E", "W"], 180.0)
                .ok_or(NmeaError::Field(position + 2))?,
        );
        if core::mem::replace(&mut self.last_ms, time_ms) == time_ms {
            return Ok(None);
        }
        Ok(Some(Fix { latitude_deg, longitude_deg, course_rad }))
    }
}

fn number(text: &str) -> Option<f64> {
    text.parse::<f64>().ok().filter(|value| value.is_finite())
}

/// `dddmm.mmmm` and the letter of a hemisphere as signed degrees.
fn degrees(text: &str, letter: &str, [plus, minus]: [&str; 2], most: f64) -> Option<f64> {
    let value = number(text).filter(|value| *value >= 0.0)?;
    let whole = libm::trunc(value / 100.0);
    let minutes = value - 100.0 * whole;
    let degrees = whole + minutes / 60.0;
    let sign = match letter {
        letter if letter == plus => 1.0,
        letter if letter == minus => -1.0,
        _ => return None,
    };
    (minutes < 60.0 && degrees <= most).then_some(sign * degrees)
}
