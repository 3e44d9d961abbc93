//! Large things on the heap: the core's buffers are megabytes that no usual stack holds while they are built.

use crate::run::RunError;

/// Builds a value on a thread with a stack large enough for it, and moves it to the heap.
///
/// # Errors
/// What `build` says, or that the system gives no such thread.
pub(crate) fn on_heap<T, E>(build: impl FnOnce() -> Result<T, E> + Send + 'static) -> Result<Box<T>, RunError>
where
    T: Send + 'static,
    E: Send + 'static,
    RunError: From<E>,
{
    let bytes = size_of::<T>();
    let builder = std::thread::Builder::new().stack_size(4 * bytes + (1 << 20));
    let thread = builder
        .spawn(move || build().map(Box::new))
        .map_err(|source| RunError::Memory { bytes, source: Some(source) })?;
    let built = thread.join().map_err(|_| RunError::Memory { bytes, source: None })?;
    Ok(built?)
}
