//! Version of the solver's results.

/// Version of the results, raised whenever the same scene gives other bits, on purpose.
///
/// Version 1 corrected volumes by density alone, within substeps. Version 2 corrects them every 5 ms and gives elastic
/// solids a barrier against collapse. Version 3 rounds differently: products are fused with sums, and sand flows by
/// matrix series. In version 4 material touches a wall at the same distance, wherever the wall lies between grid nodes.
/// In version 5 boxes that end on a wall continue behind it. In version 6 an elastic body parts from all that it touches,
/// obstacles act at their surface, and sand that falls lies.
pub const SOLVER_VERSION: u32 = 6;
