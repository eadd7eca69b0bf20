//! Figures of a truck under way, each with its origin.

use crate::{DynamicsError, FigureOrigin, KnownBy, TruckParameters, catalogue};

/// Rolling circumference over the diameter of a truck tyre (European Tyre and Rim Technical
/// Organisation, as VECTO takes it for rims of form a).
const CIRCUMFERENCE_DIAMETERS: f64 = 3.03;
const INCH_M: f64 = 0.0254;

/// Diameter of a tyre by its size, e.g. `315/70 R22.5`, m.
pub(super) fn tyre_diameter_m(size: &str) -> Option<f64> {
    let (width, rest) = size.trim().split_once('/')?;
    let (aspect, rim) = rest.split_once(['R', 'r'])?;
    let number = |s: &str| s.trim().parse::<f64>().ok();
    let (width_mm, aspect_percent, rim_inch) = (number(width)?, number(aspect)?, number(rim)?);
    let diameter_m = rim_inch * INCH_M + 2e-5 * width_mm * aspect_percent;
    (0.5..=1.5).contains(&diameter_m).then_some(diameter_m)
}

/// Rolling radius of a tyre by its size, m.
pub(super) fn rolling_radius_m(size: &str) -> Option<f64> {
    Some(tyre_diameter_m(size)? * CIRCUMFERENCE_DIAMETERS / core::f64::consts::TAU)
}

/// A truck under way, and what its sheet is.
pub(super) struct Figures<'a> {
    pub(super) truck: TruckParameters,
    pub(super) sheet: &'a str,
}

impl Figures<'_> {
    fn note(&mut self, path: &str, known_by: KnownBy, sigma: Option<f64>, source: &str) {
        let origin = FigureOrigin { known_by, sigma, interval_90: None, source: source.into() };
        self.truck.provenance.insert(path.into(), origin);
    }

    /// Sets a figure.
    pub(super) fn set(&mut self, path: &str, value: f64) -> Result<(), DynamicsError> {
        self.truck = self.truck.with_parameter(path, value)?;
        Ok(())
    }

    /// A figure that the sheet says, or that follows from what it says.
    pub(super) fn said(&mut self, path: &str, value: f64) -> Result<(), DynamicsError> {
        self.set(path, value)?;
        self.listed(path);
        Ok(())
    }

    /// A list, or a figure that is set already, that the sheet says.
    pub(super) fn listed(&mut self, path: &str) {
        let source = self.sheet.to_owned();
        self.note(path, KnownBy::Sheet, None, &source);
    }

    /// A figure that is set already and that nobody said. Its spread is that of the catalogue of
    /// causes, else `sigma_frac` of the figure.
    pub(super) fn estimated(&mut self, path: &str, sigma_frac: f64, source: &str) {
        let Some(value) = self.truck.parameter(path) else { return };
        let mut sizes = catalogue::CATALOGUE.iter().flat_map(|c| c.sizes);
        let prior = sizes.find(|p| p.path == path).map(|p| p.prior_sigma * p.slope(value).abs());
        let sigma = prior.unwrap_or(sigma_frac * value.abs());
        self.note(path, KnownBy::Estimate, Some(sigma), source);
    }

    /// A figure of the sheet, or what it is now as an estimate.
    pub(super) fn answer(
        &mut self,
        path: &str,
        said: Option<f64>,
        sigma_frac: f64,
        source: &str,
    ) -> Result<(), DynamicsError> {
        match said {
            Some(value) => self.said(path, value)?,
            None => self.estimated(path, sigma_frac, source),
        }
        Ok(())
    }
}
