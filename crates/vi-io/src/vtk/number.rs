//! Number types of VTK files, and their decoding from raw bytes.

/// A number type: its meaning and its width in bytes.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Number {
    Signed(usize),
    Unsigned(usize),
    Real(usize),
}

impl Number {
    /// Returns the type with this name in XML files.
    pub(crate) fn from_xml(name: &str) -> Option<Self> {
        Some(match name {
            "Int8" => Self::Signed(1),
            "Int16" => Self::Signed(2),
            "Int32" => Self::Signed(4),
            "Int64" => Self::Signed(8),
            "UInt8" => Self::Unsigned(1),
            "UInt16" => Self::Unsigned(2),
            "UInt32" => Self::Unsigned(4),
            "UInt64" => Self::Unsigned(8),
            "Float32" => Self::Real(4),
            "Float64" => Self::Real(8),
            _ => return None,
        })
    }

    /// Returns the type with this name in legacy files, where `vtkIdType` is a 32-bit int.
    pub(crate) fn from_legacy(name: &[u8]) -> Option<Self> {
        Some(match name.to_ascii_lowercase().as_slice() {
            b"char" | b"signed_char" | b"vtktypeint8" => Self::Signed(1),
            b"short" | b"vtktypeint16" => Self::Signed(2),
            b"int" | b"vtktypeint32" | b"vtkidtype" => Self::Signed(4),
            b"long" | b"long_long" | b"vtktypeint64" => Self::Signed(8),
            b"unsigned_char" | b"vtktypeuint8" => Self::Unsigned(1),
            b"unsigned_short" | b"vtktypeuint16" => Self::Unsigned(2),
            b"unsigned_int" | b"vtktypeuint32" => Self::Unsigned(4),
            b"unsigned_long" | b"unsigned_long_long" | b"vtktypeuint64" => Self::Unsigned(8),
            b"float" => Self::Real(4),
            b"double" => Self::Real(8),
            _ => return None,
        })
    }

    /// Returns the width of one number (bytes).
    pub(crate) fn width(self) -> usize {
        match self {
            Self::Signed(width) | Self::Unsigned(width) | Self::Real(width) => width,
        }
    }

    /// Decodes `bytes`, whose length is a multiple of the width, as f64; integers above 2⁵³ are rounded.
    pub(crate) fn reals(self, bytes: &[u8], big: bool) -> Vec<f64> {
        match self {
            Self::Signed(1) => decode(bytes, big, |b: [u8; 1]| f64::from(i8::from_le_bytes(b))),
            Self::Signed(2) => decode(bytes, big, |b: [u8; 2]| f64::from(i16::from_le_bytes(b))),
            Self::Signed(4) => decode(bytes, big, |b: [u8; 4]| f64::from(i32::from_le_bytes(b))),
            Self::Signed(_) => decode(bytes, big, |b: [u8; 8]| i64::from_le_bytes(b) as f64),
            Self::Unsigned(1) => decode(bytes, big, |b: [u8; 1]| f64::from(u8::from_le_bytes(b))),
            Self::Unsigned(2) => decode(bytes, big, |b: [u8; 2]| f64::from(u16::from_le_bytes(b))),
            Self::Unsigned(4) => decode(bytes, big, |b: [u8; 4]| f64::from(u32::from_le_bytes(b))),
            Self::Unsigned(_) => decode(bytes, big, |b: [u8; 8]| u64::from_le_bytes(b) as f64),
            Self::Real(4) => decode(bytes, big, |b: [u8; 4]| f64::from(f32::from_le_bytes(b))),
            Self::Real(_) => decode(bytes, big, f64::from_le_bytes),
        }
    }

    /// Decodes `bytes`, whose length is a multiple of the width, as integers. Unsigned values above i64::MAX become −1,
    /// which is not a valid index. `None` for a type of real numbers.
    pub(crate) fn integers(self, bytes: &[u8], big: bool) -> Option<Vec<i64>> {
        Some(match self {
            Self::Signed(1) => decode(bytes, big, |b: [u8; 1]| i8::from_le_bytes(b).into()),
            Self::Signed(2) => decode(bytes, big, |b: [u8; 2]| i16::from_le_bytes(b).into()),
            Self::Signed(4) => decode(bytes, big, |b: [u8; 4]| i32::from_le_bytes(b).into()),
            Self::Signed(_) => decode(bytes, big, i64::from_le_bytes),
            Self::Unsigned(1) => decode(bytes, big, |b: [u8; 1]| u8::from_le_bytes(b).into()),
            Self::Unsigned(2) => decode(bytes, big, |b: [u8; 2]| u16::from_le_bytes(b).into()),
            Self::Unsigned(4) => decode(bytes, big, |b: [u8; 4]| u32::from_le_bytes(b).into()),
            Self::Unsigned(_) => {
                decode(bytes, big, |b: [u8; 8]| i64::try_from(u64::from_le_bytes(b)).unwrap_or(-1))
            }
            Self::Real(_) => return None,
        })
    }
}

fn decode<const WIDTH: usize, T>(bytes: &[u8], big: bool, number: impl Fn([u8; WIDTH]) -> T) -> Vec<T> {
    let (chunks, _) = bytes.as_chunks::<WIDTH>();
    let number = |chunk: &[u8; WIDTH]| {
        let mut chunk = *chunk;
        if big {
            chunk.reverse();
        }
        number(chunk)
    };
    chunks.iter().map(number).collect()
}
