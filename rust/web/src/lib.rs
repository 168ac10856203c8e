//! The solver in a browser, as a WebAssembly module with plain exports.
//!
//! The page writes what it gives into the memory that `reserve` returns, and reads what it gets at the address that
//! a function returns, before its next call. A function that fails returns 0; `message` then has a sentence.

mod player;

use std::cell::RefCell;
use std::slice;

use mpm::MpmError;
use player::{D, Player, Quantity};

thread_local! {
    /// What the page gives.
    static GIVEN: RefCell<Vec<f32>> = const { RefCell::new(Vec::new()) };
    /// Why the latest call failed.
    static MESSAGE: RefCell<String> = const { RefCell::new(String::new()) };
}

/// Memory for `length` bytes that the next call takes.
#[unsafe(no_mangle)]
pub extern "C" fn reserve(length: usize) -> *mut f32 {
    GIVEN.with_borrow_mut(|given| {
        given.resize(length.div_ceil(size_of::<f32>()), 0.0);
        given.as_mut_ptr()
    })
}

fn with_bytes<T>(length: usize, f: impl FnOnce(&[u8]) -> T) -> T {
    GIVEN.with_borrow(|given| {
        let length = length.min(size_of_val(given.as_slice()));
        // SAFETY: all bytes of numbers are initialised, and there are at least `length`.
        f(unsafe { slice::from_raw_parts(given.as_ptr().cast(), length) })
    })
}

fn keep<T>(result: Result<T, MpmError>) -> Option<T> {
    result.map_err(|error| MESSAGE.set(error.to_string())).ok()
}

/// Opens a start file of `length` bytes; null where it is refused.
#[unsafe(no_mangle)]
pub extern "C" fn open(length: usize) -> Option<Box<Player>> {
    keep(with_bytes(length, Player::open)).map(Box::new)
}

/// Frees a player.
#[unsafe(no_mangle)]
pub extern "C" fn close(player: Option<Box<Player>>) {
    drop(player);
}

/// The sentence of the latest failure, in UTF-8; `message_length` bytes.
#[unsafe(no_mangle)]
pub extern "C" fn message() -> *const u8 {
    MESSAGE.with_borrow(|message| message.as_ptr())
}

#[unsafe(no_mangle)]
pub extern "C" fn message_length() -> usize {
    MESSAGE.with_borrow(String::len)
}

/// Whether this module gives the bits of the native solver on this processor.
#[unsafe(no_mangle)]
pub extern "C" fn has_native_bits() -> bool {
    mpm::products_are_fused()
}

#[unsafe(no_mangle)]
pub extern "C" fn solver_version() -> u32 {
    mpm::SOLVER_VERSION
}

/// Dimension of the simulations of this module.
#[unsafe(no_mangle)]
pub extern "C" fn dim() -> usize {
    D
}

/// Number of particles.
#[unsafe(no_mangle)]
pub extern "C" fn count(player: &Player) -> usize {
    player.count()
}

/// Frames done.
#[unsafe(no_mangle)]
pub extern "C" fn frame(player: &Player) -> f64 {
    player.frame() as f64
}

/// Length of a frame [s].
#[unsafe(no_mangle)]
pub extern "C" fn frame_dt(player: &Player) -> f32 {
    player.frame_dt()
}

/// Advances by whole frames with the first `numbers` numbers that were given as the force [m/s^2]: none, D for all
/// particles, or N x D.
#[unsafe(no_mangle)]
pub extern "C" fn advance(player: &mut Player, frames: usize, numbers: usize) -> bool {
    let done =
        GIVEN.with_borrow(|given| player.advance(frames, &given[..numbers.min(given.len())]));
    keep(done).is_some()
}

/// Advances by one frame while a hand pushes; given are its point, its velocity, its radius and the largest
/// acceleration: D + D + 2 numbers in SI units.
#[unsafe(no_mangle)]
pub extern "C" fn advance_pushed(player: &mut Player) -> bool {
    keep(GIVEN.with_borrow(|given| player.advance_pushed(given))).is_some()
}

/// N x D positions [m].
#[unsafe(no_mangle)]
pub extern "C" fn positions(player: &mut Player) -> *const f32 {
    player.read(Quantity::Positions).as_ptr()
}

/// N x D velocities [m/s].
#[unsafe(no_mangle)]
pub extern "C" fn velocities(player: &mut Player) -> *const f32 {
    player.read(Quantity::Velocities).as_ptr()
}

/// N pressures [Pa].
#[unsafe(no_mangle)]
pub extern "C" fn pressures(player: &mut Player) -> *const f32 {
    player.read(Quantity::Pressures).as_ptr()
}

/// N volumes over rest volumes [-].
#[unsafe(no_mangle)]
pub extern "C" fn volume_ratios(player: &mut Player) -> *const f32 {
    player.read(Quantity::VolumeRatios).as_ptr()
}

/// N indices into the materials.
#[unsafe(no_mangle)]
pub extern "C" fn materials(player: &mut Player) -> *const u8 {
    player.materials().as_ptr()
}

/// The first `numbers` numbers that were given are points of an obstacle at time 0; returned are their places now.
#[unsafe(no_mangle)]
pub extern "C" fn moved(player: &mut Player, obstacle: usize, numbers: usize) -> *const f32 {
    GIVEN.with_borrow(|given| {
        player
            .moved(obstacle, &given[..numbers.min(given.len())])
            .as_ptr()
    })
}

/// 32 bytes: SHA-256 of ids (u64), positions and velocities (f32).
#[unsafe(no_mangle)]
pub extern "C" fn digest(player: &mut Player) -> *const u8 {
    player.digest().as_ptr()
}

/// The state as bytes; `length` has their number.
#[unsafe(no_mangle)]
pub extern "C" fn snapshot(player: &mut Player) -> *const u8 {
    player.snapshot().as_ptr()
}

/// Number of bytes that the latest call returned.
#[unsafe(no_mangle)]
pub extern "C" fn length(player: &Player) -> usize {
    player.length()
}

/// Takes the state of a snapshot of `length` bytes.
#[unsafe(no_mangle)]
pub extern "C" fn restore(player: &mut Player, length: usize) -> bool {
    keep(with_bytes(length, |data| player.restore(data))).is_some()
}
