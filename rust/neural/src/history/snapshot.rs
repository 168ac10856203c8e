//! The history as bytes: going on from them gives the same bits.
//!
//! Little-endian: the version, then the settings by which a foreign snapshot is known, the number of positions
//! pushed, whether the latest can be undone, and all numbers in the order of the fields.

use super::{AccelerationHistory, Products, SafeguardError};

const VERSION: u32 = 1;

impl AccelerationHistory {
    /// The complete state.
    pub fn snapshot(&self) -> Vec<u8> {
        let mut out = self.fingerprint();
        out.extend((self.pushed as u64).to_le_bytes());
        out.push(u8::from(self.undoable));
        for vector in self.positions.iter().chain(&self.ring) {
            out.extend(vector.iter().flat_map(|number| number.to_le_bytes()));
        }
        out.extend(self.replaced.iter().flat_map(|number| number.to_le_bytes()));
        for sums in self.products.all().into_iter().chain(self.before.all()) {
            out.extend(sums.iter().flat_map(|number| number.to_le_bytes()));
        }
        out
    }

    /// Takes the state of a snapshot of a history with the same settings; on an error nothing changes.
    pub fn restore(&mut self, data: &[u8]) -> Result<(), SafeguardError> {
        let fingerprint = self.fingerprint();
        let foreign = "the bytes are no snapshot of an acceleration history with these settings";
        let rest = data
            .strip_prefix(fingerprint.as_slice())
            .ok_or(SafeguardError::Snapshot(foreign))?;
        if data.len() != self.snapshot().len() {
            return Err(SafeguardError::Snapshot(
                "the snapshot of the acceleration history is cut off or too long",
            ));
        }
        let mut reader = Reader(rest);
        self.pushed = u64::from_le_bytes(reader.take()) as usize;
        self.undoable = reader.take::<1>()[0] != 0;
        for vector in self.positions.iter_mut().chain(&mut self.ring) {
            for number in vector {
                *number = f32::from_le_bytes(reader.take());
            }
        }
        for number in &mut self.replaced {
            *number = f32::from_le_bytes(reader.take());
        }
        for products in [&mut self.products, &mut self.before] {
            for sums in products.all_mut() {
                for number in sums {
                    *number = f64::from_le_bytes(reader.take());
                }
            }
        }
        Ok(())
    }

    fn fingerprint(&self) -> Vec<u8> {
        let settings = &self.settings;
        let mut out = VERSION.to_le_bytes().to_vec();
        for number in [settings.particles, settings.dim, settings.window] {
            out.extend((number as u64).to_le_bytes());
        }
        for number in [
            settings.dt,
            settings.calm_acceleration,
            settings.min_active_share,
        ] {
            out.extend(number.to_le_bytes());
        }
        out
    }
}

impl Products {
    fn all(&self) -> [&Vec<f64>; 3] {
        [&self.across, &self.older, &self.newer]
    }

    fn all_mut(&mut self) -> [&mut Vec<f64>; 3] {
        [&mut self.across, &mut self.older, &mut self.newer]
    }
}

/// Reads numbers off bytes, whose length has been checked.
struct Reader<'a>(&'a [u8]);

impl Reader<'_> {
    fn take<const N: usize>(&mut self) -> [u8; N] {
        let (number, rest) = self.0.split_first_chunk().expect("the length was checked");
        self.0 = rest;
        *number
    }
}
