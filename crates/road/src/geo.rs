//! Where a map lies on the earth, as its file says.

use alloc::string::String;

/// The projection that a map's x and y are coordinates of. It is kept as written: whoever needs
/// latitude and longitude evaluates it.
///
/// Source: ASAM OpenDRIVE 1.8.1, 8.3 (`<geoReference>`, `<offset>`).
#[derive(Debug, Clone, PartialEq, Default)]
pub struct GeoReference {
    /// PROJ string; empty if the map has none.
    pub projection: String,
    /// Projected x, y and z of the map's origin, m.
    pub offset_m: [f64; 3],
    /// Map x axis against the projection's, rad, counter-clockwise.
    pub offset_heading_rad: f64,
}

impl GeoReference {
    /// Projected coordinates of a map point, m: turned by the heading, then moved by the offset.
    #[must_use]
    pub fn projected_m(&self, x_m: f64, y_m: f64, z_m: f64) -> [f64; 3] {
        let (sin, cos) = libm::sincos(self.offset_heading_rad);
        let [x, y, z] = self.offset_m;
        [x + cos * x_m - sin * y_m, y + sin * x_m + cos * y_m, z + z_m]
    }
}
