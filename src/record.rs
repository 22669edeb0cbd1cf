//! Conversion of values to bytes and back: little-endian, lengths before contents. The order of a struct's fields in
//! `record!` defines its format.
//!
//! Reading allocates at most the memory that the remaining bytes could fill, whatever a length claims.

use std::path::PathBuf;

use vi_core::{EnergyLedger, State, StepEnergy};
use vi_solvers::{StepperMemory, Work};

/// The bytes do not represent a value of the requested type.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
#[error("byte {at}: {what}")]
pub struct Damage {
    /// Position of the damage in the record, bytes from 0.
    pub at: usize,
    /// Description of the problem.
    pub what: String,
}

/// Bytes to read.
pub(crate) struct Source<'a> {
    bytes: &'a [u8],
    at: usize,
}

impl<'a> Source<'a> {
    pub(crate) fn new(bytes: &'a [u8]) -> Self {
        Self { bytes, at: 0 }
    }

    /// Returns the number of bytes left.
    pub(crate) fn left(&self) -> usize {
        self.bytes.len() - self.at
    }

    pub(crate) fn damage(&self, what: impl Into<String>) -> Damage {
        Damage { at: self.at, what: what.into() }
    }

    fn take(&mut self, count: usize) -> Result<&'a [u8], Damage> {
        if count > self.left() {
            let what = format!("{count} bytes are announced, {} are left", self.left());
            return Err(self.damage(what));
        }
        let taken = &self.bytes[self.at..self.at + count];
        self.at += count;
        Ok(taken)
    }

    /// Reads a length; each item takes at least `size` bytes.
    fn length(&mut self, size: usize) -> Result<usize, Damage> {
        let length = u64::read(self)?;
        let room = (self.left() / size.max(1)) as u64;
        if length > room {
            return Err(self.damage(format!("{length} items are announced, but at most {room} fit")));
        }
        Ok(length as usize)
    }
}

/// A value with a representation in bytes.
pub(crate) trait Record: Sized {
    /// The smallest number of bytes of a value.
    const SIZE: usize;
    /// Appends the value.
    fn write(&self, out: &mut Vec<u8>);
    /// Reads a value.
    fn read(from: &mut Source<'_>) -> Result<Self, Damage>;
}

impl Record for u64 {
    const SIZE: usize = 8;
    fn write(&self, out: &mut Vec<u8>) {
        out.extend_from_slice(&self.to_le_bytes());
    }
    fn read(from: &mut Source<'_>) -> Result<Self, Damage> {
        let mut bytes = [0; 8];
        bytes.copy_from_slice(from.take(8)?);
        Ok(Self::from_le_bytes(bytes))
    }
}

impl Record for f64 {
    const SIZE: usize = 8;
    fn write(&self, out: &mut Vec<u8>) {
        self.to_bits().write(out);
    }
    fn read(from: &mut Source<'_>) -> Result<Self, Damage> {
        u64::read(from).map(Self::from_bits)
    }
}

impl Record for bool {
    const SIZE: usize = 1;
    fn write(&self, out: &mut Vec<u8>) {
        out.push(u8::from(*self));
    }
    fn read(from: &mut Source<'_>) -> Result<Self, Damage> {
        match from.take(1)? {
            [0] => Ok(false),
            [1] => Ok(true),
            other => Err(from.damage(format!("a truth value is {}", other[0]))),
        }
    }
}

impl Record for String {
    const SIZE: usize = 8;
    fn write(&self, out: &mut Vec<u8>) {
        (self.len() as u64).write(out);
        out.extend_from_slice(self.as_bytes());
    }
    fn read(from: &mut Source<'_>) -> Result<Self, Damage> {
        let length = from.length(1)?;
        let bytes = from.take(length)?.to_vec();
        Self::from_utf8(bytes).map_err(|_| from.damage("a text is not UTF-8"))
    }
}

/// On Unix a path is stored byte by byte, because it may not be UTF-8.
impl Record for PathBuf {
    const SIZE: usize = 8;
    fn write(&self, out: &mut Vec<u8>) {
        let bytes = self.as_os_str().as_encoded_bytes();
        (bytes.len() as u64).write(out);
        out.extend_from_slice(bytes);
    }
    #[cfg(unix)]
    fn read(from: &mut Source<'_>) -> Result<Self, Damage> {
        use std::os::unix::ffi::OsStringExt;
        let length = from.length(1)?;
        let bytes = from.take(length)?.to_vec();
        Ok(std::ffi::OsString::from_vec(bytes).into())
    }
    #[cfg(not(unix))]
    fn read(from: &mut Source<'_>) -> Result<Self, Damage> {
        String::read(from).map(Self::from)
    }
}

/// Bytes that form a separate record.
#[derive(Debug, Clone, PartialEq, Eq, Default)]
pub(crate) struct Bytes(pub(crate) Vec<u8>);

impl Bytes {
    /// Returns the bytes of a value.
    pub(crate) fn of(value: &impl Record) -> Self {
        let mut bytes = Vec::new();
        value.write(&mut bytes);
        Self(bytes)
    }

    /// Returns the value that these bytes represent.
    pub(crate) fn value<T: Record>(&self) -> Result<T, Damage> {
        let mut source = Source::new(&self.0);
        let value = T::read(&mut source)?;
        if source.left() > 0 {
            return Err(source.damage("there is more than one record"));
        }
        Ok(value)
    }
}

impl Record for Bytes {
    const SIZE: usize = 8;
    fn write(&self, out: &mut Vec<u8>) {
        (self.0.len() as u64).write(out);
        out.extend_from_slice(&self.0);
    }
    fn read(from: &mut Source<'_>) -> Result<Self, Damage> {
        let length = from.length(1)?;
        Ok(Self(from.take(length)?.to_vec()))
    }
}

/// Returns a value as the contents of a file: 8 bytes of magic, the format number, the length of the record, the
/// record, and the CRC-32 of everything before it.
pub(crate) fn seal(magic: &[u8; 8], format: u64, value: &impl Record) -> Vec<u8> {
    let mut bytes = magic.to_vec();
    format.write(&mut bytes);
    Bytes::of(value).write(&mut bytes);
    let sum = crc32fast::hash(&bytes);
    bytes.extend_from_slice(&sum.to_le_bytes());
    bytes
}

/// Returns the value from the bytes of [`seal`].
pub(crate) fn unseal<T: Record>(magic: &[u8; 8], format: u64, bytes: &[u8]) -> Result<T, Damage> {
    let damage = |what: String| Damage { at: 0, what };
    let (head, sum) = split_sum(bytes).ok_or_else(|| damage("it is empty".to_owned()))?;
    let Some(rest) = head.strip_prefix(magic) else {
        return Err(damage(format!("it does not begin with {}", magic.escape_ascii())));
    };
    let mut source = Source::new(rest);
    let found = u64::read(&mut source)?;
    if found != format {
        return Err(damage(format!("it has format {found}, this version of the program reads {format}")));
    }
    let length = u64::read(&mut source)?;
    if length != source.left() as u64 {
        return Err(damage(format!("{length} bytes are announced, {} are left", source.left())));
    }
    if crc32fast::hash(head).to_le_bytes() != sum {
        return Err(damage("its checksum is wrong".to_owned()));
    }
    let value = T::read(&mut source)?;
    if source.left() > 0 {
        return Err(source.damage("there is more than one record"));
    }
    Ok(value)
}

/// Returns the format of sealed bytes, if they are undamaged.
pub(crate) fn format_of(magic: &[u8; 8], bytes: &[u8]) -> Option<u64> {
    let (head, sum) = split_sum(bytes)?;
    let mut source = Source::new(head.strip_prefix(magic)?);
    (crc32fast::hash(head).to_le_bytes() == sum).then(|| u64::read(&mut source).ok()).flatten()
}

fn split_sum(bytes: &[u8]) -> Option<(&[u8], &[u8])> {
    bytes.split_at_checked(bytes.len().checked_sub(4)?)
}

impl<T: Record> Record for Vec<T> {
    const SIZE: usize = 8;
    fn write(&self, out: &mut Vec<u8>) {
        (self.len() as u64).write(out);
        out.reserve(self.len() * T::SIZE);
        self.iter().for_each(|value| value.write(out));
    }
    fn read(from: &mut Source<'_>) -> Result<Self, Damage> {
        let length = from.length(T::SIZE)?;
        // Items may be larger in memory than in the file, so memory for them is not reserved in advance.
        let mut values = Self::new();
        for _ in 0..length {
            values.push(T::read(from)?);
        }
        Ok(values)
    }
}

impl<T: Record> Record for Option<T> {
    const SIZE: usize = 1;
    fn write(&self, out: &mut Vec<u8>) {
        self.is_some().write(out);
        if let Some(value) = self {
            value.write(out);
        }
    }
    fn read(from: &mut Source<'_>) -> Result<Self, Damage> {
        Ok(if bool::read(from)? { Some(T::read(from)?) } else { None })
    }
}

impl<A: Record, B: Record> Record for (A, B) {
    const SIZE: usize = A::SIZE + B::SIZE;
    fn write(&self, out: &mut Vec<u8>) {
        self.0.write(out);
        self.1.write(out);
    }
    fn read(from: &mut Source<'_>) -> Result<Self, Damage> {
        Ok((A::read(from)?, B::read(from)?))
    }
}

impl<const N: usize> Record for [f64; N] {
    const SIZE: usize = 8 * N;
    fn write(&self, out: &mut Vec<u8>) {
        self.iter().for_each(|value| value.write(out));
    }
    fn read(from: &mut Source<'_>) -> Result<Self, Damage> {
        let mut values = [0.0; N];
        for value in &mut values {
            *value = f64::read(from)?;
        }
        Ok(values)
    }
}

impl Record for Work {
    const SIZE: usize = 8;
    fn write(&self, out: &mut Vec<u8>) {
        let counts: Vec<(String, u64)> = self.iter().map(|(name, count)| (name.to_owned(), count)).collect();
        counts.write(out);
    }
    fn read(from: &mut Source<'_>) -> Result<Self, Damage> {
        let counts = Vec::<(String, u64)>::read(from)?;
        // The record contains every count once, in the order of writing; a missing count is not taken as zero.
        Self::from_counts(counts.iter().map(|(name, count)| (name.as_str(), *count)))
            .filter(|work| {
                work.iter().map(|(name, count)| (name.to_owned(), count)).eq(counts.iter().cloned())
            })
            .ok_or_else(|| from.damage("the counts of work are not those of this version"))
    }
}

/// Implements [`Record`] with the named fields, in this order.
macro_rules! record {
    ($type:ty { $($field:ident: $of:ty),+ $(,)? }) => {
        impl $crate::record::Record for $type {
            const SIZE: usize = 0 $(+ <$of as $crate::record::Record>::SIZE)+;
            fn write(&self, out: &mut Vec<u8>) {
                $($crate::record::Record::write(&self.$field, out);)+
            }
            fn read(
                from: &mut $crate::record::Source<'_>,
            ) -> Result<Self, $crate::record::Damage> {
                Ok(Self { $($field: $crate::record::Record::read(from)?),+ })
            }
        }
    };
}
pub(crate) use record;

record!(State { t: f64, q: Vec<f64>, p: Vec<f64> });
record!(StepperMemory {
    method: String,
    arrays: Vec<(String, Vec<f64>)>,
    counts: Vec<(String, u64)>,
    texts: Vec<(String, String)>,
});
record!(StepEnergy {
    prescribed: f64,
    force: f64,
    damping: f64,
    friction: f64,
    contact_damping: f64,
    scheme: f64,
    residual: f64,
});
record!(EnergyLedger { initial: f64, current: f64, parts: StepEnergy, drift: f64, kinetic_max: f64 });
