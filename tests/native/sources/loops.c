/* Loops that show whether the pool does what it says. */
#include "parallel.h"

#include <stdatomic.h>
#include <stdlib.h>
#include <time.h>

typedef struct {
  long *square;
  int inner;
} Squares;

static void square(void *context, int index) { ((long *)context)[index] = (long)index * index; }

/* One square for each index; each index runs a loop of its own inside. */
static void row(void *context, int index) {
  Squares *rows = context;
  mt_parallel(rows->inner, square, rows->square + (long)index * rows->inner);
}

static long sum_of(long count, const long *numbers) {
  long sum = 0;
  for (long i = 0; i < count; i++) sum += numbers[i];
  return sum;
}

/* Return how often, in so many loops one after the other, the squares of 0 to count − 1 had another sum than they have. */
MT_EXPORT int mt_test_wrong_sums(int loops, int count) {
  int wrong = 0;
  long expected = (long)(count - 1) * count * (2L * count - 1) / 6;
  long *squares = malloc(sizeof(long) * (size_t)(count > 0 ? count : 1));
  for (int loop = 0; loop < loops; loop++) {
    for (int i = 0; i < count; i++) squares[i] = -1;
    mt_parallel(count, square, squares);
    wrong += sum_of(count, squares) != expected;
  }
  free(squares);
  return wrong;
}

/* Return the sum of the squares of 0 to inner − 1, outer times, where each of the outer turns runs an inner loop. */
MT_EXPORT long mt_test_nested(int outer, int inner) {
  Squares rows = {malloc(sizeof(long) * (size_t)outer * (size_t)inner), inner};
  mt_parallel(outer, row, &rows);
  long sum = sum_of((long)outer * inner, rows.square);
  free(rows.square);
  return sum;
}

typedef struct {
  atomic_int here;
  int expected;
  double patience; /* [s] */
} Meeting;

/* Come, and wait until all are here or patience ends. */
static void meet(void *context, int index) {
  (void)index;
  Meeting *meeting = context;
  atomic_fetch_add(&meeting->here, 1);
  struct timespec start, now;
  timespec_get(&start, TIME_UTC);
  do timespec_get(&now, TIME_UTC);
  while (atomic_load(&meeting->here) < meeting->expected &&
         (double)(now.tv_sec - start.tv_sec) + 1e-9 * (double)(now.tv_nsec - start.tv_nsec) < meeting->patience);
  if (atomic_load(&meeting->here) < meeting->expected) atomic_fetch_sub(&meeting->here, 1);
}

/* Return whether all turns of a loop run at once: each waits for the others. */
MT_EXPORT int mt_test_all_at_once(int count, double patience) {
  Meeting meeting = {0, count, patience};
  mt_parallel(count, meet, &meeting);
  return atomic_load(&meeting.here) == count;
}
