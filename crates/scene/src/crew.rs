//! Threads that answer questions: each question is cut into chunks, and every thread takes the next
//! chunk of the question that has waited longest. So one question uses all cores when it is alone,
//! and a short one is answered while a long one is under way; a pool that steals work (rayon) would
//! finish the long one first.

use std::collections::VecDeque;
use std::fmt;
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::sync::atomic::{AtomicBool, AtomicUsize, Ordering};
use std::sync::{Arc, Condvar, Mutex, MutexGuard, PoisonError, mpsc};
use std::thread::{self, JoinHandle};

/// Something that can be answered chunk by chunk, on any thread, in any order.
pub trait Question: Send + Sync + 'static {
    /// The answer to one chunk.
    type Part: Send + 'static;
    /// Number of chunks; at least one.
    fn chunks(&self) -> usize;
    /// Answers one chunk; soon, once `stop` is set.
    fn solve(&self, chunk: usize, stop: &Stop) -> Self::Part;
    /// Whether all of it takes some tens of microseconds at most: less than it costs to hand it to
    /// another thread.
    fn is_brief(&self) -> bool {
        false
    }
}

/// Asks a question to end.
#[derive(Debug, Default)]
pub struct Stop {
    set: AtomicBool,
    abandoned: AtomicBool,
}

/// A chunk panicked, or nobody wanted the answer any more: there is none.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
#[error("the question was ended by a panic, or was abandoned")]
pub struct Panicked;

impl Stop {
    /// Ends the question with what is known.
    pub fn set(&self) {
        self.set.store(true, Ordering::Relaxed);
    }

    /// Ends the question without an answer.
    pub fn abandon(&self) {
        self.abandoned.store(true, Ordering::Relaxed);
        self.set();
    }

    /// Whether to end.
    pub fn is_set(&self) -> bool {
        self.set.load(Ordering::Relaxed)
    }

    /// The flag, for solvers.
    pub fn flag(&self) -> &AtomicBool {
        &self.set
    }
}

/// A number of threads that work together. They end when it is dropped.
pub struct Crew {
    shared: Arc<Shared>,
    threads: Vec<JoinHandle<()>>,
}

#[derive(Default)]
struct Shared {
    queue: Mutex<Queue>,
    ready: Condvar,
}

#[derive(Default)]
struct Queue {
    waiting: VecDeque<Arc<Call>>,
    closed: bool,
}

/// Takes the parts to who asked; with whether all are there.
type Finish = Box<dyn FnOnce(bool) + Send>;

/// A question on its way.
struct Call {
    chunks: usize,
    next: AtomicUsize,
    done: AtomicUsize,
    failed: AtomicBool,
    stop: Arc<Stop>,
    work: Box<dyn Fn(usize) + Send + Sync>,
    finish: Mutex<Option<Finish>>,
}

/// Stack of a thread: solvers that are compiled without optimisation take several megabytes.
const STACK_BYTES: usize = 16 << 20;

impl Crew {
    /// Starts so many threads.
    ///
    /// # Errors
    /// When the system has no more threads.
    pub fn new(threads: usize) -> std::io::Result<Self> {
        let shared = Arc::<Shared>::default();
        let mut crew = Self { shared, threads: Vec::new() };
        for index in 0..threads.max(1) {
            let shared = crew.shared.clone();
            let thread = thread::Builder::new().name(format!("solver-{index}")).stack_size(STACK_BYTES);
            crew.threads.push(thread.spawn(move || shared.work())?);
        }
        Ok(crew)
    }

    /// Number of threads.
    pub fn threads(&self) -> usize {
        self.threads.len()
    }

    /// Answers a question; `done` gets the parts in order, on one of the threads.
    pub fn submit<Q: Question>(
        &self,
        question: Arc<Q>,
        stop: Arc<Stop>,
        done: impl FnOnce(Result<Vec<Q::Part>, Panicked>) + Send + 'static,
    ) {
        let chunks = question.chunks().max(1);
        let parts: Arc<Vec<Mutex<Option<Q::Part>>>> = Arc::new((0..chunks).map(|_| Mutex::new(None)).collect());
        let (results, flag) = (parts.clone(), stop.clone());
        let work = move |chunk: usize| {
            let part = question.solve(chunk, &flag);
            *results[chunk].lock().unwrap_or_else(PoisonError::into_inner) = Some(part);
        };
        let finish = move |complete: bool| {
            let take = |part: &Mutex<Option<Q::Part>>| part.lock().unwrap_or_else(PoisonError::into_inner).take();
            let taken: Option<Vec<_>> = if complete { parts.iter().map(take).collect() } else { None };
            done(taken.ok_or(Panicked));
        };
        let call = Call {
            chunks,
            next: AtomicUsize::new(0),
            done: AtomicUsize::new(0),
            failed: AtomicBool::new(false),
            stop,
            work: Box::new(work),
            finish: Mutex::new(Some(Box::new(finish))),
        };
        self.shared.lock().waiting.push_back(Arc::new(call));
        if chunks > 1 {
            self.shared.ready.notify_all();
        } else {
            self.shared.ready.notify_one();
        }
    }

    /// Answers a question and waits for it.
    ///
    /// # Errors
    /// When a chunk panicked, or the question was abandoned.
    pub fn ask<Q: Question>(&self, question: Arc<Q>, stop: Arc<Stop>) -> Result<Vec<Q::Part>, Panicked> {
        let (sender, receiver) = mpsc::sync_channel(1);
        self.submit(question, stop, move |parts| {
            let _ = sender.send(parts);
        });
        receiver.recv().unwrap_or(Err(Panicked))
    }
}

impl Drop for Crew {
    fn drop(&mut self) {
        self.shared.lock().closed = true;
        self.shared.ready.notify_all();
        for thread in self.threads.drain(..) {
            // A crew may be dropped by one of its own threads, with the last question.
            if thread.thread().id() != thread::current().id() {
                let _ = thread.join();
            }
        }
    }
}

impl fmt::Debug for Crew {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_struct("Crew").field("threads", &self.threads.len()).finish_non_exhaustive()
    }
}

impl Shared {
    fn lock(&self) -> MutexGuard<'_, Queue> {
        // Nothing panics while it is held.
        self.queue.lock().unwrap_or_else(PoisonError::into_inner)
    }

    fn work(&self) {
        while let Some((call, chunk)) = self.next() {
            let runs = !call.stop.abandoned.load(Ordering::Relaxed) && !call.failed.load(Ordering::Relaxed);
            if !runs || catch_unwind(AssertUnwindSafe(|| (call.work)(chunk))).is_err() {
                call.failed.store(true, Ordering::Relaxed);
            }
            if call.done.fetch_add(1, Ordering::AcqRel) + 1 == call.chunks {
                let finish = call.finish.lock().unwrap_or_else(PoisonError::into_inner).take();
                if let Some(finish) = finish {
                    finish(!call.failed.load(Ordering::Relaxed));
                }
            }
        }
    }

    /// The next chunk of the question in front, which then goes to the back.
    fn next(&self) -> Option<(Arc<Call>, usize)> {
        let mut queue = self.lock();
        loop {
            if let Some(call) = queue.waiting.pop_front() {
                let chunk = call.next.fetch_add(1, Ordering::Relaxed);
                if chunk + 1 < call.chunks {
                    queue.waiting.push_back(call.clone());
                }
                return Some((call, chunk));
            }
            if queue.closed {
                return None;
            }
            queue = self.ready.wait(queue).unwrap_or_else(PoisonError::into_inner);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::sync::Barrier;

    struct Squares(usize);

    impl Question for Squares {
        type Part = usize;
        fn chunks(&self) -> usize {
            self.0
        }
        fn solve(&self, chunk: usize, _: &Stop) -> usize {
            assert!(chunk != 77, "a defect");
            chunk * chunk
        }
    }

    #[test]
    fn parts_come_in_order_whatever_the_number_of_threads() {
        for threads in 1..5 {
            let crew = Crew::new(threads).expect("threads");
            let parts = crew.ask(Arc::new(Squares(60)), Arc::default()).expect("parts");
            assert_eq!(parts, (0..60).map(|i| i * i).collect::<Vec<_>>());
        }
    }

    #[test]
    fn a_panic_ends_its_question_only() {
        let crew = Crew::new(2).expect("threads");
        assert_eq!(crew.ask(Arc::new(Squares(100)), Arc::default()), Err(Panicked));
        assert_eq!(crew.ask(Arc::new(Squares(3)), Arc::default()), Ok(vec![0, 1, 4]));
    }

    #[test]
    fn an_abandoned_question_has_no_answer() {
        let crew = Crew::new(1).expect("threads");
        let stop = Arc::<Stop>::default();
        stop.abandon();
        assert_eq!(crew.ask(Arc::new(Squares(50)), stop), Err(Panicked));
    }

    /// Two chunks that only end when both have begun, or when the short question was answered.
    struct Meeting(Arc<Barrier>);

    impl Question for Meeting {
        type Part = ();
        fn chunks(&self) -> usize {
            2
        }
        fn solve(&self, _: usize, _: &Stop) {
            self.0.wait();
        }
    }

    #[test]
    fn chunks_of_one_question_run_at_the_same_time() {
        let crew = Crew::new(2).expect("threads");
        crew.ask(Arc::new(Meeting(Arc::new(Barrier::new(2)))), Arc::default()).expect("both met");
    }

    #[test]
    fn a_short_question_is_answered_between_the_chunks_of_a_long_one() {
        let crew = Crew::new(1).expect("threads");
        let order = Arc::new(Mutex::new(Vec::new()));
        struct Noted(usize, char, Arc<Mutex<Vec<char>>>, Option<Arc<Barrier>>);
        impl Question for Noted {
            type Part = ();
            fn chunks(&self) -> usize {
                self.0
            }
            fn solve(&self, chunk: usize, _: &Stop) {
                if let (0, Some(begun)) = (chunk, &self.3) {
                    begun.wait();
                    begun.wait();
                }
                self.2.lock().expect("no panic").push(self.1);
            }
        }
        let begun = Arc::new(Barrier::new(2));
        let (sender, ended) = mpsc::channel();
        let long = Noted(10, 'l', order.clone(), Some(begun.clone()));
        crew.submit(Arc::new(long), Arc::default(), move |_| sender.send(()).expect("sent"));
        begun.wait();
        // The first chunk is under way; the short question comes now.
        let (short_sender, short_ended) = mpsc::channel();
        let short = Noted(1, 's', order.clone(), None);
        crew.submit(Arc::new(short), Arc::default(), move |_| short_sender.send(()).expect("sent"));
        begun.wait();
        short_ended.recv().expect("answered");
        ended.recv().expect("answered");
        let order = order.lock().expect("no panic");
        let at = order.iter().position(|&c| c == 's').expect("noted");
        assert!(at <= 2, "{order:?}");
    }
}
