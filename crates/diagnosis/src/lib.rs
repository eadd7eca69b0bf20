//! Measured drives to replay, residuals, named cause, extended truck, gain and report.
