//! The force that keeps particles on the ways of a sketch, as Python's law of the same name computes it.

use guidance::{FreeSpace, Law, Paths, Tracks};

use crate::dimension::D;

/// First number of a file of ways.
const MAGIC: u32 = u32::from_le_bytes(*b"HMWY");
/// Version of its layout.
const VERSION: u32 = 2;

/// Particles on their ways for some frames.
pub struct Following {
    tracks: Tracks<D>,
    /// Permanent ids of the particles that are led, ascending, and the mass of each over that of all.
    ids: Vec<u64>,
    weight: Vec<f32>,
    first_frame: u64,
    frames: u64,
    frame_dt: f64,
    /// Longest side of the world [m], the length in which ways and law are given.
    unit: f32,
}

impl Following {
    /// Reads the ways that Python's `playing.ways.ways_file` has written; the error is a reason.
    pub fn read(data: &[u8]) -> Result<Self, String> {
        let mut reader = Reader { rest: data };
        let [magic, version, dim] = reader.head()?;
        if magic != MAGIC || version != VERSION {
            return Err("these bytes are no ways of particles, or of another version".into());
        }
        if dim as usize != D {
            return Err(format!(
                "the ways are of a scene in {dim}D, and this build plays those in {D}D"
            ));
        }
        let [first_frame, frames, cells] = reader.head()?;
        let [frame_dt] = reader.doubles(1)?[..] else {
            unreachable!("one number was read")
        };
        let unit = reader.float()?;
        let law = Law {
            gravity: reader.vector()?,
            size: reader.vector()?,
            shortest: reader.float()?,
            ahead: reader.float()?,
            cap: reader.float()?,
            cells,
        };
        let paths = Paths {
            starts: reader.words()?,
            times: reader.floats()?,
            x: reader.vectors()?,
            v: reader.vectors()?,
        };
        let path = reader.words()?;
        let offset = reader.vectors()?;
        let weight = reader.floats()?;
        let ids: Vec<u64> = reader.words()?.into_iter().map(u64::from).collect();
        let space = reader.space()?;
        if !(reader.rest.is_empty() && ids.len() == path.len() && ids.len() == weight.len()) {
            return Err("the ways of particles are damaged: their numbers do not agree".into());
        }
        let tracks = Tracks::new(paths, path, offset, law, space.as_ref())
            .map_err(|error| error.to_string())?;
        Ok(Self {
            tracks,
            ids,
            weight,
            first_frame: first_frame.into(),
            frames: frames.into(),
            frame_dt,
            unit,
        })
    }

    /// Accelerations of all particles in the frame after `frame` [m/s^2]; None before the first and after the last.
    pub fn force(
        &self,
        frame: u64,
        ids: &[u64],
        x: &[[f32; D]],
        v: &[[f32; D]],
    ) -> Option<Vec<f32>> {
        let index = frame.checked_sub(self.first_frame)?;
        if index >= self.frames {
            return None;
        }
        let time = (index as f64 * self.frame_dt) as f32;
        let in_units = |rows: &[[f32; D]]| -> Vec<[f32; D]> {
            let rows = rows.iter();
            rows.map(|row| row.map(|number| number / self.unit))
                .collect()
        };
        if ids == self.ids {
            let (x, v) = (in_units(x), in_units(v));
            let force = self.tracks.force(&x, &v, &self.weight, time, None);
            let force = force.into_iter().flatten();
            return Some(force.map(|number| self.unit * number).collect());
        }
        // Rows of those that are led and still there.
        let led: Vec<(usize, u32)> = (ids.iter().enumerate())
            .filter_map(|(place, id)| Some((place, self.ids.binary_search(id).ok()? as u32)))
            .collect();
        let (mut near, mut speeds) = (Vec::new(), Vec::new());
        let (mut weight, mut rows) = (Vec::new(), Vec::new());
        for &(place, row) in &led {
            near.push(x[place].map(|number| number / self.unit));
            speeds.push(v[place].map(|number| number / self.unit));
            weight.push(self.weight[row as usize]);
            rows.push(row);
        }
        let wanted = self
            .tracks
            .force(&near, &speeds, &weight, time, Some(&rows));
        let mut force = vec![[0.0; D]; ids.len()];
        for (&(place, _), wanted) in led.iter().zip(wanted) {
            force[place] = wanted.map(|number| self.unit * number);
        }
        Some(force.into_flattened())
    }
}

/// Numbers of four or eight bytes, little-endian. Arrays begin with their length in words.
struct Reader<'a> {
    rest: &'a [u8],
}

impl Reader<'_> {
    fn take<const N: usize>(&mut self) -> Result<[u8; N], String> {
        let (taken, rest) = self
            .rest
            .split_first_chunk()
            .ok_or("the ways of particles are cut off")?;
        self.rest = rest;
        Ok(*taken)
    }

    fn word(&mut self) -> Result<u32, String> {
        Ok(u32::from_le_bytes(self.take()?))
    }

    fn float(&mut self) -> Result<f32, String> {
        Ok(f32::from_le_bytes(self.take()?))
    }

    fn head(&mut self) -> Result<[u32; 3], String> {
        Ok([self.word()?, self.word()?, self.word()?])
    }

    fn vector(&mut self) -> Result<[f32; D], String> {
        let mut vector = [0.0; D];
        for number in &mut vector {
            *number = self.float()?;
        }
        Ok(vector)
    }

    fn doubles(&mut self, count: usize) -> Result<Vec<f64>, String> {
        (0..count)
            .map(|_| Ok(f64::from_le_bytes(self.take()?)))
            .collect()
    }

    fn words(&mut self) -> Result<Vec<u32>, String> {
        let count = self.word()?;
        (0..count).map(|_| self.word()).collect()
    }

    fn floats(&mut self) -> Result<Vec<f32>, String> {
        let count = self.word()?;
        (0..count).map(|_| self.float()).collect()
    }

    fn vectors(&mut self) -> Result<Vec<[f32; D]>, String> {
        let count = self.word()?;
        (0..count).map(|_| self.vector()).collect()
    }

    /// The room between obstacles; none where its grid has no nodes.
    fn space(&mut self) -> Result<Option<FreeSpace<D>>, String> {
        let counts = self.words()?;
        let Ok(counts) = <[u32; D]>::try_from(counts) else {
            return Ok(None);
        };
        let mut lower = [0.0; D];
        lower.copy_from_slice(&self.doubles(D)?);
        let spacing = self.doubles(1)?[0];
        let counts = counts.map(|count| count as usize);
        let distance = self.doubles(counts.iter().product())?;
        let space = FreeSpace::new(lower, spacing, counts, distance);
        Ok(Some(space.map_err(|error| error.to_string())?))
    }
}
