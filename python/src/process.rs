//! Work without Python's lock, which Ctrl-C ends, also in forked processes: of the threads that share work only the one that forked is left there,
//! and no GPU.

use std::any::Any;
use std::cell::RefCell;
use std::error::Error;
use std::panic::{AssertUnwindSafe, catch_unwind, resume_unwind};
use std::process;
use std::sync::atomic::{AtomicBool, AtomicU8, AtomicU32, Ordering};
use std::sync::mpsc::{RecvTimeoutError, sync_channel};
use std::sync::{Arc, OnceLock};
use std::thread;
use std::time::Duration;

use numpy::PyArray1;
use pyo3::prelude::*;
use sheetsplat::internals::abandon;

use crate::error::{Raised, no_threads};
use crate::warnings::{self, Warning};

/// How often the main thread looks for Ctrl-C: well within the 0.2 s after which a user takes a program for stuck.
const POLL: Duration = Duration::from_millis(50);

/// The stack of a thread that works, as large as that of most systems' main threads.
const STACK: usize = 8 << 20;

/// Whether this process was forked from the one that imported the module.
pub(crate) fn is_forked() -> bool {
    static IMPORTED_IN: AtomicU32 = AtomicU32::new(0);
    let now = process::id();
    let imported = IMPORTED_IN.compare_exchange(0, now, Ordering::Relaxed, Ordering::Relaxed);
    imported.is_err_and(|imported| imported != now)
}

/// Whether somebody waits for some work.
#[derive(Default)]
struct Job {
    state: AtomicU8,
    /// For the library, which stops drawing.
    abandoned: Arc<AtomicBool>,
}

/// The states of a job.
const AWAITED: u8 = 0;
const COMMITTED: u8 = 1;
const ABANDONED: u8 = 2;

impl Job {
    fn change(&self, to: u8) -> bool {
        self.state.compare_exchange(AWAITED, to, Ordering::AcqRel, Ordering::Acquire).is_ok()
    }
}

thread_local! {
    /// The job of a thread that works for the main thread.
    static JOB: RefCell<Option<Arc<Job>>> = const { RefCell::new(None) };
}

/// Whether the work of this thread may have an effect that lasts, such as a file. From then on Ctrl-C waits for its end.
pub(crate) fn may_commit() -> bool {
    JOB.with_borrow(|job| job.as_ref().is_none_or(|job| job.change(COMMITTED)))
}

/// The result of work and its warnings, or the panic that ended it.
type Done<T> = thread::Result<(Result<T, Raised>, Vec<Warning>)>;

/// Runs without Python's lock, then warns. Signals reach Python's main thread alone: there another thread works, and Ctrl-C leaves it at once. What
/// it still does then has no effect.
pub(crate) fn detached<T: Send + 'static>(
    py: Python<'_>,
    run: impl FnOnce() -> Result<T, Raised> + Send + 'static,
) -> PyResult<T> {
    let done = if is_main_thread(py)? { watched(py, run)? } else { py.detach(|| done(run)) };
    let (result, heard) = done.unwrap_or_else(|panic| resume_unwind(panic));
    let result = result?;
    warnings::give(py, heard)?;
    Ok(result)
}

fn is_main_thread(py: Python<'_>) -> PyResult<bool> {
    let threading = py.import("threading")?;
    let main = threading.call_method0("main_thread")?.getattr("ident")?;
    threading.call_method0("get_ident")?.eq(main)
}

fn done<T>(run: impl FnOnce() -> Result<T, Raised> + Send) -> Done<T>
where
    T: Send,
{
    catch_unwind(AssertUnwindSafe(|| warnings::heard(|| shared(run))))
}

/// Works with the threads that share work. A forked process makes some for it, which costs less than a millisecond for each.
fn shared<T: Send>(run: impl FnOnce() -> Result<T, Raised> + Send) -> Result<T, Raised> {
    static THREADS: OnceLock<Result<(), String>> = OnceLock::new();
    if is_forked() {
        let pool = rayon::ThreadPoolBuilder::new().build().map_err(|error| no_threads(&error))?;
        let job = JOB.with_borrow(Clone::clone);
        return pool.install(|| as_job(job, run));
    }
    // The error without a source is that somebody has made them before.
    let start = || match rayon::ThreadPoolBuilder::new().build_global() {
        Err(error) if error.source().is_some() => Err(error.to_string()),
        _ => Ok(()),
    };
    THREADS.get_or_init(start).as_ref().map_err(no_threads)?;
    run()
}

/// Works in this thread, which may be another one than the job began in.
fn as_job<T>(job: Option<Arc<Job>>, run: impl FnOnce() -> T) -> T {
    JOB.set(job.clone());
    match job {
        Some(job) => abandon::watch(&job.abandoned, run),
        None => run(),
    }
}

/// Works in another thread, while this one looks for Ctrl-C.
fn watched<T: Send + 'static>(
    py: Python<'_>,
    run: impl FnOnce() -> Result<T, Raised> + Send + 'static,
) -> PyResult<Done<T>> {
    let job = Arc::new(Job::default());
    let (sender, mut receiver) = sync_channel(1);
    let working = Arc::clone(&job);
    // Nobody may wait any more.
    let work = move || drop(sender.send(as_job(Some(working), || done(run))));
    let thread = thread::Builder::new().name("sheetsplat".to_owned()).stack_size(STACK).spawn(work);
    thread.map_err(|error| no_threads(&error))?;
    loop {
        let received;
        (received, receiver) = py.detach(move || (receiver.recv_timeout(POLL), receiver));
        match received {
            Ok(done) => return Ok(done),
            Err(RecvTimeoutError::Disconnected) => {
                return Ok(Err(Box::new("a thread ended without a result") as Box<dyn Any + Send>));
            }
            Err(RecvTimeoutError::Timeout) => {}
        }
        let Err(signal) = py.check_signals() else { continue };
        if job.change(ABANDONED) {
            job.abandoned.store(true, Ordering::Relaxed);
        } else {
            // A file appears, which takes no time.
            py.detach(move || receiver.recv().map(drop)).ok();
        }
        return Err(signal);
    }
}

/// Runs without Python's lock to the end, whatever signals come.
pub(crate) fn undisturbed<T: Send>(
    py: Python<'_>,
    run: impl FnOnce() -> Result<T, Raised> + Send,
) -> Result<T, Raised> {
    py.detach(|| shared(run))
}

/// Prepares for arrays of NumPy. It runs Python code that would panic if Ctrl-C ended it; signals interrupt no thread but the main one.
pub(crate) fn prepare_numpy(py: Python<'_>) -> PyResult<()> {
    static IS_PREPARED: AtomicBool = AtomicBool::new(false);
    if IS_PREPARED.load(Ordering::Relaxed) {
        return Ok(());
    }
    let prepare = || {
        Python::attach(|py| {
            py.import("numpy")?;
            PyArray1::<f32>::zeros(py, 0, false);
            Ok(())
        })
    };
    let thread = thread::Builder::new().spawn(prepare).map_err(|error| no_threads(&error))?;
    let prepared: PyResult<()> = py.detach(|| thread.join()).unwrap_or_else(|panic| resume_unwind(panic));
    IS_PREPARED.store(prepared.is_ok(), Ordering::Relaxed);
    prepared
}

/// Removes what work that nobody waits for has not finished, at the end of the process.
#[pyfunction]
pub(crate) fn tidy() {
    drop(sheetsplat::image::output::remove_temporary());
}
