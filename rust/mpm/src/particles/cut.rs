//! Groups cut into slabs, for threads that work on these side by side.

use std::sync::{Mutex, MutexGuard, PoisonError};

use super::block::Block;
use super::group::Group;
use crate::material::Constitutive;

/// Active particles of one group, slab by slab.
pub struct CutGroup<'a, const D: usize, M: Constitutive<D>> {
    pub material: &'a M,
    pub wall_friction: f32,
    /// See `Group`.
    pub field: u16,
    awake: Vec<Mutex<&'a mut [Block<D, M::State>]>>,
    border: Vec<&'a [Block<D, M::State>]>,
}

impl<'a, const D: usize, M: Constitutive<D>> CutGroup<'a, D, M> {
    /// Of a sorted group.
    pub fn of(group: &'a mut Group<D, M>) -> Self {
        Self {
            material: &group.material,
            wall_friction: group.wall_friction,
            field: group.field,
            awake: group.awake.by_slab().into_iter().map(Mutex::new).collect(),
            border: (group.border.by_slab().into_iter())
                .map(|blocks| &*blocks)
                .collect(),
        }
    }

    /// Those of a slab that are awake, for the one thread that works on it at a time.
    pub fn awake(&self, slab: usize) -> MutexGuard<'_, &'a mut [Block<D, M::State>]> {
        unlocked(&self.awake[slab])
    }

    /// Those of a slab that sleep beside awake ones.
    pub fn border(&self, slab: usize) -> &'a [Block<D, M::State>] {
        self.border[slab]
    }
}

/// Locks an item that one thread works on at a time.
pub fn unlocked<T>(mutex: &Mutex<T>) -> MutexGuard<'_, T> {
    mutex.lock().unwrap_or_else(PoisonError::into_inner)
}
