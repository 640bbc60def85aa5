/* A pool of threads for loops whose turns do not depend on each other. */
#ifndef MT_PARALLEL_H
#define MT_PARALLEL_H

#include "common.h"

/* Say how many threads a loop takes, the caller among them; less than one counts as one. At first it is one. */
MT_EXPORT void mt_set_threads(int count);

/* Return how many threads a loop takes. */
MT_EXPORT int mt_threads(void);

/* Call work(context, index) for every index from 0 to count − 1 and return when all calls have.
 *
 * The caller works too. Which thread takes which index is not said, nor in which order; so a result must not depend on
 * it. A call from within work runs its loop alone. Any number of threads may call at once; they share the pool. */
MT_EXPORT void mt_parallel(int count, void (*work)(void *context, int index), void *context);

#endif
