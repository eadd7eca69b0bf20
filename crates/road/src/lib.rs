//! Road geometry, lanes, grade, bank, curvature and limits from OpenDRIVE and CSV profiles.
