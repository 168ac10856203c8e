//! Ways as bytes, little-endian: a snapshot of the law, and what a page follows. Arrays begin with their length.

use crate::error::GuidanceError;
use crate::paths::Paths;
use crate::ways::{Forces, Found, Motion, Present, Room, Settings, Settling, Ways};

/// First number of a file of ways.
const MAGIC: u32 = u32::from_le_bytes(*b"HMWY");
/// Version of its layout.
const VERSION: u32 = 3;
/// What is refused, in messages.
const BYTES: &str = "ways";

impl<const D: usize> Ways<D> {
    /// The law with the places that it has found, so that it goes on to the same bits.
    pub fn to_bytes(&self) -> Vec<u8> {
        let mut out = Writer::default();
        out.words(&[MAGIC, VERSION, D as u32]);
        out.array(&self.ids, |id| id.to_le_bytes());
        out.array(&self.weight, |one| one.to_le_bytes());
        let settings = &self.settings;
        out.singles(&settings.gravity);
        out.words(&[settings.cells, settings.ahead]);
        out.doubles(&[settings.frame_dt, settings.cap, settings.unit]);
        match &settings.room {
            None => out.words(&[0]),
            Some(room) => {
                out.words(&[D as u32]);
                out.words(&room.counts.map(|count| count as u32));
                out.doubles(&room.lower);
                out.doubles(&[room.spacing]);
                out.doubles(&room.distance);
            }
        }
        out.motion(&self.moving);
        let Some(settling) = &self.settling else {
            out.words(&[0]);
            return out.bytes;
        };
        out.words(&[1, u32::from(settling.velocity.is_some())]);
        out.doubles(&settling.velocity.unwrap_or([0.0; D]));
        out.doubles(&[settling.side]);
        out.words(&[settling.start as u32, settling.frames as u32]);
        out.array(settling.cells.as_flattened(), |one| one.to_le_bytes());
        out.words(&[settling.found.len() as u32]);
        for one in &settling.found {
            out.words(&[one.time as u32, one.first as u32]);
            out.motion(&one.motion);
        }
        out.bytes
    }

    /// The law of `to_bytes`.
    pub fn from_bytes(data: &[u8]) -> Result<Self, GuidanceError> {
        let mut reader = Reader { rest: data };
        let ways = reader.ways()?;
        if reader.rest.is_empty() {
            return Ok(ways);
        }
        Err(refused("of their length", "more bytes"))
    }
}

/// The ways of a page: one law after another, each from some frame on.
#[derive(Debug)]
pub struct Followed<const D: usize> {
    first_frame: u64,
    frames: u64,
    /// Frames since `first_frame` at which each law begins.
    legs: Vec<(u64, Ways<D>)>,
}

impl<const D: usize> Followed<D> {
    /// Reads the first frame, the number of frames, and for each law where it begins and its bytes.
    pub fn read(data: &[u8]) -> Result<Self, GuidanceError> {
        let mut reader = Reader { rest: data };
        let [first_frame, frames, count] = reader.head()?;
        let legs: Vec<(u64, Ways<D>)> = (0..count)
            .map(|_| Ok((reader.word()?.into(), reader.ways()?)))
            .collect::<Result<_, GuidanceError>>()?;
        if !legs.is_sorted_by_key(|leg| leg.0) || !reader.rest.is_empty() {
            return Err(refused("laws in turn", "others"));
        }
        Ok(Self {
            first_frame: first_frame.into(),
            frames: frames.into(),
            legs,
        })
    }

    /// One law for some frames.
    pub fn one(first_frame: u64, frames: u64, ways: Ways<D>) -> Self {
        let legs = vec![(0, ways)];
        Self {
            first_frame,
            frames,
            legs,
        }
    }

    /// Accelerations of all particles in the frame after `frame` [m/s^2]; None before the first and after the last.
    pub fn force(
        &mut self,
        frame: u64,
        present: Present<'_, D>,
    ) -> Result<Option<Vec<[f32; D]>>, GuidanceError> {
        let index = frame.checked_sub(self.first_frame);
        let Some(index) = index.filter(|&index| index < self.frames) else {
            return Ok(None);
        };
        let begun = self.legs.partition_point(|leg| leg.0 <= index);
        let Some((start, ways)) = self.legs[..begun].last_mut() else {
            return Ok(None);
        };
        let (rows, led): Forces<D> = ways.force(index - *start, present)?;
        let Some(rows) = rows else {
            return Ok(Some(led));
        };
        let mut force = vec![[0.0; D]; present.ids.len()];
        for (row, led) in rows.into_iter().zip(led) {
            force[row] = led;
        }
        Ok(Some(force))
    }
}

fn refused(allowed: &str, got: &str) -> GuidanceError {
    GuidanceError::new(BYTES, allowed, &got)
}

#[derive(Default)]
struct Writer {
    bytes: Vec<u8>,
}

impl Writer {
    fn words(&mut self, words: &[u32]) {
        self.bytes
            .extend(words.iter().flat_map(|word| word.to_le_bytes()));
    }

    fn singles(&mut self, numbers: &[f32]) {
        self.bytes
            .extend(numbers.iter().flat_map(|one| one.to_le_bytes()));
    }

    fn doubles(&mut self, numbers: &[f64]) {
        self.bytes
            .extend(numbers.iter().flat_map(|one| one.to_le_bytes()));
    }

    fn array<T, const N: usize>(&mut self, rows: &[T], bytes: impl Fn(&T) -> [u8; N]) {
        self.words(&[rows.len() as u32]);
        self.bytes.extend(rows.iter().flat_map(bytes));
    }

    fn motion<const D: usize>(&mut self, motion: &Motion<D>) {
        self.array(&motion.paths.starts, |one| one.to_le_bytes());
        self.array(&motion.paths.times, |one| one.to_le_bytes());
        self.array(motion.paths.x.as_flattened(), |one| one.to_le_bytes());
        self.array(motion.paths.v.as_flattened(), |one| one.to_le_bytes());
        self.array(&motion.path, |one| one.to_le_bytes());
        self.array(motion.offset.as_flattened(), |one| one.to_le_bytes());
    }
}

struct Reader<'a> {
    rest: &'a [u8],
}

impl Reader<'_> {
    fn take<const N: usize>(&mut self) -> Result<[u8; N], GuidanceError> {
        let (taken, rest) = (self.rest.split_first_chunk())
            .ok_or_else(|| refused("whole", "bytes that are cut off"))?;
        self.rest = rest;
        Ok(*taken)
    }

    fn word(&mut self) -> Result<u32, GuidanceError> {
        Ok(u32::from_le_bytes(self.take()?))
    }

    fn head<const N: usize>(&mut self) -> Result<[u32; N], GuidanceError> {
        let mut words = [0; N];
        for word in &mut words {
            *word = self.word()?;
        }
        Ok(words)
    }

    fn vector<const D: usize>(&mut self) -> Result<[f64; D], GuidanceError> {
        let mut numbers = [0.0; D];
        for number in &mut numbers {
            *number = f64::from_le_bytes(self.take()?);
        }
        Ok(numbers)
    }

    /// An array of as many numbers as are given, at most as many as there are bytes.
    fn some<T, const N: usize>(
        &mut self,
        count: usize,
        number: impl Fn([u8; N]) -> T,
    ) -> Result<Vec<T>, GuidanceError> {
        (0..count).map(|_| Ok(number(self.take()?))).collect()
    }

    fn array<T, const N: usize>(
        &mut self,
        number: impl Fn([u8; N]) -> T,
    ) -> Result<Vec<T>, GuidanceError> {
        let count = self.word()?;
        self.some(count as usize, number)
    }

    fn rows<T: Copy, const D: usize>(
        &mut self,
        number: impl Fn([u8; size_of::<f32>()]) -> T,
    ) -> Result<Vec<[T; D]>, GuidanceError> {
        Ok(self.array(number)?.as_chunks().0.to_vec())
    }

    fn ways<const D: usize>(&mut self) -> Result<Ways<D>, GuidanceError> {
        let [magic, version, dim] = self.head()?;
        if magic != MAGIC || version != VERSION {
            return Err(refused(
                "of this version",
                "bytes of another kind or version",
            ));
        }
        if dim as usize != D {
            return Err(refused(&format!("of a scene in {D}D"), &format!("{dim}D")));
        }
        let ids = self.array(u64::from_le_bytes)?;
        let weight = self.array(f32::from_le_bytes)?;
        let gravity = self.some(D, f32::from_le_bytes)?;
        let [cells, ahead] = self.head()?;
        let [frame_dt, cap, unit] = self.vector()?;
        let settings = Settings {
            gravity: std::array::from_fn(|axis| gravity[axis]),
            frame_dt,
            cells,
            cap,
            ahead,
            unit,
            room: self.room()?,
        };
        let moving = self.motion(&settings)?;
        let settling = match self.word()? {
            0 => None,
            _ => Some(self.settling(&settings)?),
        };
        Ways::checked(ids, weight, settings, moving, settling)
    }

    fn room<const D: usize>(&mut self) -> Result<Option<Room<D>>, GuidanceError> {
        if self.word()? == 0 {
            return Ok(None);
        }
        let counts = self.head::<D>()?.map(|count| count as usize);
        let lower = self.vector()?;
        let [spacing] = self.vector()?;
        let distance = self.some(counts.iter().product(), f64::from_le_bytes)?;
        Ok(Some(Room {
            lower,
            spacing,
            counts,
            distance,
        }))
    }

    fn motion<const D: usize>(
        &mut self,
        settings: &Settings<D>,
    ) -> Result<Motion<D>, GuidanceError> {
        let paths = Paths {
            starts: self.array(u32::from_le_bytes)?,
            times: self.array(f32::from_le_bytes)?,
            x: self.rows(f32::from_le_bytes)?,
            v: self.rows(f32::from_le_bytes)?,
        };
        let path = self.array(u32::from_le_bytes)?;
        Motion::new(paths, path, self.rows(f32::from_le_bytes)?, settings)
    }

    fn settling<const D: usize>(
        &mut self,
        settings: &Settings<D>,
    ) -> Result<Settling<D>, GuidanceError> {
        let moves = self.word()? != 0;
        let velocity = Some(self.vector()?).filter(|_| moves);
        let [side] = self.vector()?;
        let times = self.head()?.map(u64::from);
        let cells = self.array(f64::from_le_bytes)?.as_chunks().0.to_vec();
        let mut settling = Settling::new(cells, side, times, velocity)?;
        // What is matched anew is not smoothed.
        let anew = settings.anew();
        for _ in 0..self.word()? {
            let [time, first] = self.head()?.map(u64::from);
            let motion = self.motion(&anew)?;
            settling.found.push(Found {
                time,
                first,
                motion,
            });
        }
        Ok(settling)
    }
}
