//! Numbers and names of an EXR file, whose length is known: nothing larger than what is left
//! of it is ever reserved.

use std::io::{self, ErrorKind, Read, Seek, SeekFrom};

use super::{ExrFault, header::printable};

/// Longest name of an attribute or channel, bytes.
const MAX_NAME: usize = 255;

/// A file and the place in it.
#[derive(Debug)]
pub struct Stream<R> {
    inner: R,
    length: u64,
    position: u64,
}

impl<R: Read + Seek> Stream<R> {
    /// The whole of a file.
    ///
    /// # Errors
    /// When it cannot be read.
    pub fn new(mut inner: R) -> io::Result<Self> {
        let length = inner.seek(SeekFrom::End(0))?;
        inner.seek(SeekFrom::Start(0))?;
        Ok(Self { inner, length, position: 0 })
    }

    /// Bytes from the start of the file.
    pub fn position(&self) -> u64 {
        self.position
    }

    /// Goes to a place.
    pub fn seek(&mut self, position: u64) -> Result<(), ExrFault> {
        if position > self.length {
            return Err(ExrFault::Incomplete);
        }
        // The distances are short, and what is buffered stays.
        let by = position.cast_signed().wrapping_sub(self.position.cast_signed());
        self.inner.seek_relative(by)?;
        self.position = position;
        Ok(())
    }

    /// The place `size` bytes further on.
    pub fn end_after(&self, size: u64) -> Result<u64, ExrFault> {
        let end = self.position.checked_add(size).filter(|&end| end <= self.length);
        end.ok_or(ExrFault::Incomplete)
    }

    /// The next `size` bytes.
    pub fn bytes(&mut self, size: u64) -> Result<Vec<u8>, ExrFault> {
        let end = self.end_after(size)?;
        let mut bytes = vec![0; usize::try_from(size).map_err(|_| ExrFault::Incomplete)?];
        self.fill(&mut bytes)?;
        debug_assert_eq!(self.position, end);
        Ok(bytes)
    }

    fn fill(&mut self, bytes: &mut [u8]) -> Result<(), ExrFault> {
        self.inner.read_exact(bytes).map_err(|e| match e.kind() {
            ErrorKind::UnexpectedEof => ExrFault::Incomplete,
            _ => ExrFault::Io(e),
        })?;
        self.position += bytes.len() as u64;
        Ok(())
    }

    pub fn array<const N: usize>(&mut self) -> Result<[u8; N], ExrFault> {
        let mut bytes = [0; N];
        self.fill(&mut bytes)?;
        Ok(bytes)
    }

    pub fn u8(&mut self) -> Result<u8, ExrFault> {
        Ok(self.array::<1>()?[0])
    }

    pub fn u32(&mut self) -> Result<u32, ExrFault> {
        Ok(u32::from_le_bytes(self.array()?))
    }

    pub fn i32(&mut self) -> Result<i32, ExrFault> {
        Ok(i32::from_le_bytes(self.array()?))
    }

    pub fn f32(&mut self) -> Result<f32, ExrFault> {
        Ok(f32::from_le_bytes(self.array()?))
    }

    /// A name that a zero byte ends.
    pub fn name(&mut self) -> Result<String, ExrFault> {
        let mut name = Vec::new();
        loop {
            match self.u8()? {
                0 => return Ok(printable(&name)),
                _ if name.len() == MAX_NAME => {
                    return Err(ExrFault::Damaged("a name of more than 255 bytes".into()));
                }
                b => name.push(b),
            }
        }
    }
}
