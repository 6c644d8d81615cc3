//! A piece of shared memory without a name: a memfd that its maker maps and children inherit. Nothing of it
//! can be left behind.

#![allow(unsafe_code)]

use rustix::fs::{MemfdFlags, ftruncate, memfd_create};
use rustix::mm::{MapFlags, ProtFlags, mmap, munmap};
use std::io;
use std::ops::Deref;
use std::os::fd::{AsRawFd, BorrowedFd, OwnedFd};
use std::ptr::NonNull;
use std::sync::atomic::{AtomicU64, Ordering};

/// What may lie in it.
///
/// # Safety
/// `repr(C)`, of atomics only, and valid whatever the bytes are.
pub unsafe trait Mappable {
    /// Environment variable that tells a child the descriptor.
    const FD: &'static str;
    /// What [`Self::magic`] is, so that another one's is refused.
    const MAGIC: u64;
    /// Who starts such children, for the error.
    const STARTED_BY: &'static str;

    /// The word that says what it is.
    fn magic(&self) -> &AtomicU64;
}

/// The memory, mapped into this process.
pub struct Mapped<T: Mappable> {
    content: NonNull<T>,
    /// Kept open by the maker so that children inherit it.
    fd: Option<OwnedFd>,
}

// SAFETY: the content consists of atomics only.
unsafe impl<T: Mappable> Send for Mapped<T> {}
// SAFETY: as above.
unsafe impl<T: Mappable> Sync for Mapped<T> {}

impl<T: Mappable> Mapped<T> {
    /// New and empty. Its descriptor is inherited by children.
    pub fn create() -> io::Result<Self> {
        let fd = memfd_create("hilare", MemfdFlags::empty())?;
        ftruncate(&fd, size_of::<T>() as u64)?;
        let mapped = Self { content: map(&fd)?, fd: Some(fd) };
        mapped.magic().store(T::MAGIC, Ordering::SeqCst);
        Ok(mapped)
    }

    /// What [`Mappable::FD`] must be for a child.
    pub fn inherited_fd(&self) -> String {
        self.fd.as_ref().map_or(-1, AsRawFd::as_raw_fd).to_string()
    }

    /// The maker: the memory, to be passed on to a process that is not its child.
    pub fn descriptor(&self) -> io::Result<OwnedFd> {
        self.fd.as_ref().ok_or(io::ErrorKind::NotFound)?.try_clone()
    }

    /// A child: the memory its maker passed on.
    pub fn inherit() -> io::Result<Self> {
        let wrong = |why: &str| io::Error::other(format!("{}: {why}; {}", T::FD, T::STARTED_BY));
        let number = std::env::var(T::FD).map_err(|_| wrong("not set"))?;
        let number: i32 =
            number.parse().ok().filter(|fd| *fd > 2).ok_or_else(|| wrong("not a descriptor"))?;
        // SAFETY: borrowed for this call only; a number that is not an open descriptor makes fstat
        // and mmap fail.
        let fd = unsafe { BorrowedFd::borrow_raw(number) };
        if rustix::fs::fstat(fd)?.st_size as usize != size_of::<T>() {
            return Err(wrong("of another version of hilare"));
        }
        let mapped = Self { content: map(fd)?, fd: None };
        if mapped.magic().load(Ordering::SeqCst) != T::MAGIC {
            return Err(wrong("of another version of hilare"));
        }
        Ok(mapped)
    }
}

fn map<T>(fd: impl std::os::fd::AsFd) -> io::Result<NonNull<T>> {
    let (protection, flags) = (ProtFlags::READ | ProtFlags::WRITE, MapFlags::SHARED | MapFlags::POPULATE);
    // SAFETY: a fresh mapping of a file of that size; nothing else is unmapped.
    let address = unsafe { mmap(std::ptr::null_mut(), size_of::<T>(), protection, flags, fd, 0) }?;
    NonNull::new(address.cast()).ok_or_else(|| io::Error::other("mmap returned null"))
}

impl<T: Mappable> Deref for Mapped<T> {
    type Target = T;

    fn deref(&self) -> &T {
        // SAFETY: mapped at creation, unmapped on drop only; any content is valid, as Mappable promises.
        unsafe { self.content.as_ref() }
    }
}

impl<T: Mappable> Drop for Mapped<T> {
    fn drop(&mut self) {
        // SAFETY: mapped by us with this size; no reference outlives self.
        let _ = unsafe { munmap(self.content.as_ptr().cast(), size_of::<T>()) };
    }
}
