//! The solver in a browser, as a WebAssembly module with plain exports.
//!
//! The page writes what it gives into the memory that `reserve` returns, and reads what it gets at the address that
//! a function returns, before its next call. A function that fails returns 0; `message` then has a sentence.

mod dimension;
#[cfg(not(feature = "space"))]
mod drawing;
mod player;

use std::cell::RefCell;
use std::ptr::null;
use std::slice;

use dimension::D;
#[cfg(not(feature = "space"))]
use drawing::Drawing;
use mpm::MpmError;
use player::{Player, Quantity};

thread_local! {
    /// What the page gives.
    static GIVEN: RefCell<Vec<f64>> = const { RefCell::new(Vec::new()) };
    /// Why the latest call failed.
    static MESSAGE: RefCell<String> = const { RefCell::new(String::new()) };
}

/// Memory for `length` bytes that the next call takes.
#[unsafe(no_mangle)]
pub extern "C" fn reserve(length: usize) -> *mut f64 {
    GIVEN.with_borrow_mut(|given| {
        given.resize(length.div_ceil(size_of::<f64>()), 0.0);
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

fn keep<T, E: ToString>(result: Result<T, E>) -> Option<T> {
    result.map_err(|error| MESSAGE.set(error.to_string())).ok()
}

/// Opens a start file of `length` bytes; null where it is refused.
#[unsafe(no_mangle)]
pub extern "C" fn open(length: usize) -> Option<Box<Player>> {
    keep(with_bytes(length, Player::open)).map(Box::new)
}

/// Lets particles follow the ways of `length` bytes from now on.
#[unsafe(no_mangle)]
pub extern "C" fn follow(player: &mut Player, length: usize) -> bool {
    keep(with_bytes(length, |data| player.follow(data))).is_some()
}

/// Lets the fluid fill an outline, or follow an arrow, from now on, in place of what it followed before. The `numbers`
/// that were given are those of `Drawing::read`, in double precision. In space a hand draws in no plane.
#[cfg(not(feature = "space"))]
#[unsafe(no_mangle)]
pub extern "C" fn draw(player: &mut Player, numbers: usize) -> bool {
    let drawing = GIVEN.with_borrow(|given| Drawing::read(&given[..numbers.min(given.len())]));
    let drawing = drawing.ok_or("there are fewer numbers than a drawing has");
    keep(drawing).is_some_and(|drawing| keep(player.draw(drawing)).is_some())
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

/// Dimension of the simulations of this module.
#[unsafe(no_mangle)]
pub extern "C" fn dim() -> usize {
    D
}

/// Number of particles that are shown.
#[unsafe(no_mangle)]
pub extern "C" fn count(player: &Player) -> usize {
    player.count()
}

/// Number of particles that are simulated: fewer in coarse mode.
#[unsafe(no_mangle)]
pub extern "C" fn simulated(player: &Player) -> usize {
    player.simulated()
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

/// Advances by whole frames. With `numbers` above 0 a hand pushes; given are its point, its velocity, its radius and the
/// largest acceleration [g]: D + D + 2 numbers in double precision, those in metres and seconds. Or a hand pulls; given are the
/// number of a rigid body, the point that is held in the body's own frame, where it is drawn to, reach [m] and strength [N].
#[unsafe(no_mangle)]
pub extern "C" fn advance(player: &mut Player, frames: usize, numbers: usize) -> bool {
    let done =
        GIVEN.with_borrow(|given| player.advance(frames, &given[..numbers.min(given.len())]));
    keep(done).is_some()
}

/// N permanent numbers of the particles, ascending.
#[unsafe(no_mangle)]
pub extern "C" fn ids(player: &Player) -> *const u64 {
    player.ids().as_ptr()
}

/// The first numbers of N x D positions [m]; null where they cannot be computed.
#[unsafe(no_mangle)]
pub extern "C" fn positions(player: &mut Player) -> *const f32 {
    address(player.read(Quantity::Positions))
}

/// N x D velocities [m/s].
#[unsafe(no_mangle)]
pub extern "C" fn velocities(player: &mut Player) -> *const f32 {
    address(player.read(Quantity::Velocities))
}

/// N masses [kg].
#[unsafe(no_mangle)]
pub extern "C" fn masses(player: &mut Player) -> *const f32 {
    address(player.read(Quantity::Masses))
}

/// n x D positions of the particles that are simulated [m].
#[unsafe(no_mangle)]
pub extern "C" fn simulated_positions(player: &mut Player) -> *const f32 {
    address(player.read(Quantity::SimulatedPositions))
}

/// n pressures [Pa].
#[unsafe(no_mangle)]
pub extern "C" fn pressures(player: &mut Player) -> *const f32 {
    address(player.read(Quantity::Pressures))
}

/// n volumes over rest volumes [-].
#[unsafe(no_mangle)]
pub extern "C" fn volume_ratios(player: &mut Player) -> *const f32 {
    address(player.read(Quantity::VolumeRatios))
}

/// N indices into the materials.
#[unsafe(no_mangle)]
pub extern "C" fn materials(player: &mut Player) -> *const u8 {
    player.materials().as_ptr()
}

/// The first `numbers` numbers that were given are points of an obstacle at time 0; returned are their places now.
#[unsafe(no_mangle)]
pub extern "C" fn moved(player: &mut Player, obstacle: usize, numbers: usize) -> *const f32 {
    with_numbers(numbers, |points| player.moved(obstacle, points).as_ptr())
}

/// The first `numbers` numbers that were given are points; returned are their distances from the nearest obstacle [m].
#[unsafe(no_mangle)]
pub extern "C" fn distances(player: &mut Player, numbers: usize) -> *const f32 {
    with_numbers(numbers, |points| player.distances(points).as_ptr())
}

/// D components of the force and 2 D - 3 of the torque on each of 2 D walls and all obstacles, means over the latest frame
/// in double precision; null before the first that follows a call.
#[unsafe(no_mangle)]
pub extern "C" fn forces(player: &mut Player) -> *const f64 {
    match player.forces() {
        [] => null(),
        forces => forces.as_ptr(),
    }
}

/// Number of rigid bodies.
#[unsafe(no_mangle)]
pub extern "C" fn rigid_count(player: &Player) -> usize {
    player.rigid_count()
}

/// 13 numbers of each rigid body in double precision: centre of mass [m], unit quaternion of its turn with the scalar first,
/// velocity [m/s] and angular velocity [rad/s]; null without rigid bodies.
#[unsafe(no_mangle)]
pub extern "C" fn rigid(player: &mut Player) -> *const f64 {
    match player.rigid() {
        [] => null(),
        numbers => numbers.as_ptr(),
    }
}

/// 32 bytes: SHA-256 of ids (u64), positions and velocities (f32), and the numbers of rigid bodies (f64); null where they cannot be computed.
#[unsafe(no_mangle)]
pub extern "C" fn digest(player: &mut Player) -> *const u8 {
    keep(player.digest()).map_or(null(), <[u8]>::as_ptr)
}

fn with_numbers<T>(length: usize, f: impl FnOnce(&[f32]) -> T) -> T {
    GIVEN.with_borrow(|given| {
        let length = length.min(size_of_val(given.as_slice()) / size_of::<f32>());
        // SAFETY: every pattern of bits is a number, there are at least `length`, and doubles are aligned more strictly.
        f(unsafe { slice::from_raw_parts(given.as_ptr().cast(), length) })
    })
}

fn address(numbers: Result<&[f32], MpmError>) -> *const f32 {
    keep(numbers).map_or(null(), <[f32]>::as_ptr)
}
