//! Meaning of the lanes of a node during the correction of volumes.

/// Volume of all matter over that of a cell [-].
pub const VOLUME: usize = 0;
/// Rest volume of the matter that shares its pressure over that of a cell [-].
pub const SHARING: usize = 1;
/// That times the pressure, then the mean pressure [Pa].
pub const PRESSURE: usize = 2;
/// In its place, once pressures are means: the volume, smoothed along all axes but the first [-].
pub const HALF_SMOOTH: usize = SHARING;
/// The volume, smoothed [-].
pub const SMOOTH: usize = 3;
