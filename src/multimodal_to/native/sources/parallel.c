/* A pool of threads: a list of loops under one lock, from which callers and workers take one index at a time.
 *
 * A loop lives on its caller's stack while it runs. Workers are made when a loop first needs them, and sleep between
 * loops. After a fork the child has no workers, whatever the parent had; it makes its own.
 */
#include "parallel.h"

#include "thread.h"

#if !defined(_WIN32)
#include <signal.h>
#endif

typedef struct Loop {
  int count, next, finished; /* indices: all, the first not taken, how many are done */
  void (*work)(void *, int);
  void *context;
  struct Loop *after;
} Loop;

static struct {
  mt_lock lock;
  mt_condition work, done;
  Loop *first;          /* loops with an index that nobody has taken */
  int threads, workers; /* wanted in a loop, with its caller; running */
} pool = {.lock = MT_LOCK_INIT, .work = MT_CONDITION_INIT, .done = MT_CONDITION_INIT, .threads = 1};

static _Thread_local int inside; /* a loop's work runs on this thread */

/* Take an index of a loop and run it; the lock is held before and after. */
static void turn(Loop *loop) {
  int index = loop->next++;
  if (loop->next == loop->count) {
    Loop **link = &pool.first;
    while (*link != loop) link = &(*link)->after;
    *link = loop->after;
  }
  mt_release(&pool.lock);
  inside = 1;
  loop->work(loop->context, index);
  inside = 0;
  mt_acquire(&pool.lock);
  if (++loop->finished == loop->count) mt_wake_all(&pool.done); /* the caller may return: loop is gone after this */
}

static void worker(void) {
  mt_acquire(&pool.lock);
  while (pool.workers < pool.threads) {
    if (pool.first) turn(pool.first);
    else mt_wait(&pool.work, &pool.lock);
  }
  pool.workers--;
  mt_release(&pool.lock);
}

#if defined(_WIN32)
static DWORD WINAPI entry(void *nothing) {
  (void)nothing;
  worker();
  return 0;
}

static int start_worker(void) {
  HANDLE thread = CreateThread(NULL, 0, entry, NULL, 0, NULL);
  if (thread) CloseHandle(thread);
  return thread != NULL;
}

static void ready(void) {}
#else
enum { STACK = 8 << 20 }; /* [bytes]; some systems give a thread far less than the main one */

static void *entry(void *nothing) {
  (void)nothing;
  worker();
  return NULL;
}

/* Signals are for the threads that Python knows, so a worker is born with all of them blocked. */
static int start_worker(void) {
  pthread_t thread;
  pthread_attr_t attributes;
  sigset_t all, before;
  if (pthread_attr_init(&attributes)) return 0;
  pthread_attr_setdetachstate(&attributes, PTHREAD_CREATE_DETACHED);
  pthread_attr_setstacksize(&attributes, STACK);
  sigfillset(&all);
  pthread_sigmask(SIG_SETMASK, &all, &before);
  int failed = pthread_create(&thread, &attributes, entry, NULL);
  pthread_sigmask(SIG_SETMASK, &before, NULL);
  pthread_attr_destroy(&attributes);
  return !failed;
}

static void before_fork(void) { mt_acquire(&pool.lock); }
static void after_fork_in_parent(void) { mt_release(&pool.lock); }
static void after_fork_in_child(void) {
  pool.work = pool.done = (mt_condition)MT_CONDITION_INIT; /* those who waited are not here */
  pool.first = NULL;
  pool.workers = 0;
  mt_release(&pool.lock);
}

static void follow_forks(void) { pthread_atfork(before_fork, after_fork_in_parent, after_fork_in_child); }

static void ready(void) {
  static pthread_once_t once = PTHREAD_ONCE_INIT;
  pthread_once(&once, follow_forks);
}
#endif

void mt_set_threads(int count) {
  ready();
  mt_acquire(&pool.lock);
  pool.threads = count < 1 ? 1 : count;
  mt_wake_all(&pool.work); /* workers that are too many leave */
  mt_release(&pool.lock);
}

int mt_threads(void) {
  mt_acquire(&pool.lock);
  int count = pool.threads;
  mt_release(&pool.lock);
  return count;
}

static void alone(int count, void (*work)(void *, int), void *context) {
  for (int index = 0; index < count; index++) work(context, index);
}

void mt_parallel(int count, void (*work)(void *context, int index), void *context) {
  if (count <= 1 || inside || mt_threads() == 1) {
    alone(count, work, context);
    return;
  }
  Loop loop = {.count = count, .work = work, .context = context};
  mt_acquire(&pool.lock);
  while (pool.workers < pool.threads - 1 && start_worker()) pool.workers++;
  loop.after = pool.first;
  pool.first = &loop;
  mt_wake_all(&pool.work);
  while (loop.next < loop.count) turn(&loop);
  while (loop.finished < loop.count) mt_wait(&pool.done, &pool.lock);
  mt_release(&pool.lock);
}
