//! Version of the solver's results.

/// Which truth this solver computes: raised whenever the same scene gives other bits, on purpose.
///
/// Version 1 led volumes back by crowding alone, within the substeps. Version 2 corrects them every 5 ms and gives
/// elastic solids a barrier against collapse. Version 3 rounds differently: products are fused with sums, and sand flows by
/// matrix series. Version 4 lets material touch a wall at the same distance wherever the wall lies between grid nodes.
/// Version 5 takes boxes that end on a wall as going on behind it.
pub const SOLVER_VERSION: u32 = 5;
