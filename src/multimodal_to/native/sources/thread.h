/* Locks, conditions and threads of POSIX and of Windows under one name. */
#ifndef MT_THREAD_H
#define MT_THREAD_H

#if defined(_WIN32)
#define WIN32_LEAN_AND_MEAN
#include <windows.h>

typedef SRWLOCK mt_lock;
typedef CONDITION_VARIABLE mt_condition;
#define MT_LOCK_INIT SRWLOCK_INIT
#define MT_CONDITION_INIT CONDITION_VARIABLE_INIT

static inline void mt_acquire(mt_lock *lock) { AcquireSRWLockExclusive(lock); }
static inline void mt_release(mt_lock *lock) { ReleaseSRWLockExclusive(lock); }
static inline void mt_wait(mt_condition *condition, mt_lock *lock) {
  SleepConditionVariableSRW(condition, lock, INFINITE, 0);
}
static inline void mt_wake_all(mt_condition *condition) { WakeAllConditionVariable(condition); }

#else
#include <pthread.h>

typedef pthread_mutex_t mt_lock;
typedef pthread_cond_t mt_condition;
#define MT_LOCK_INIT PTHREAD_MUTEX_INITIALIZER
#define MT_CONDITION_INIT PTHREAD_COND_INITIALIZER

static inline void mt_acquire(mt_lock *lock) { pthread_mutex_lock(lock); }
static inline void mt_release(mt_lock *lock) { pthread_mutex_unlock(lock); }
static inline void mt_wait(mt_condition *condition, mt_lock *lock) { pthread_cond_wait(condition, lock); }
static inline void mt_wake_all(mt_condition *condition) { pthread_cond_broadcast(condition); }
#endif

#endif
