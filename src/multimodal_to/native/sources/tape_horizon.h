/* Functions of stages at all their intervals, added up to vectors and matrices of the whole horizon. */
#ifndef MT_TAPE_HORIZON_H
#define MT_TAPE_HORIZON_H

#include "tape.h"

typedef struct mt_horizon mt_horizon;

/* Return an empty horizon, or NULL where there is no memory. */
MT_EXPORT mt_horizon *mt_horizon_new(int64_t results);

MT_EXPORT void mt_horizon_delete(mt_horizon *horizon);

/* Add a function that is evaluated `repeats` times; return 0 where there is no memory.
 *
 * tape: of the function; it must live as long as the horizon. NULL: whoever runs the horizon brings the values.
 * arguments: how many the function has.
 * sources: (arguments), the array of the horizon that each argument is a part of.
 * offsets: (arguments, repeats), where in that array it begins.
 * outputs: how many values it has. */
MT_EXPORT int mt_horizon_add(mt_horizon *horizon, const mt_tape *tape, int64_t repeats, int64_t arguments,
                             const int32_t *sources, const int64_t *offsets, int64_t outputs);

/* Say what a result is the sum of, once all functions are there; return 0 where there is no memory.
 *
 * Values count through the functions in their order, in each through its repeats, in each through its outputs.
 *
 * result: which.
 * size: how many numbers it has.
 * first: (size), the first value of each number; −1: it is zero.
 * more: how many values are added to them.
 * targets: (more), the number that each of those is added to, ascending; values of one number add up in their order.
 * terms: (more), the values. */
MT_EXPORT int mt_horizon_result(mt_horizon *horizon, int64_t result, int64_t size, const int64_t *first, int64_t more,
                                const int64_t *targets, const int64_t *terms);

/* Compute results; return 0 where there is no memory, or values are not brought. Any number of threads may call at once.
 *
 * sources: the arrays.
 * results: where each is put; what is NULL is not computed, nor what it alone needs.
 * brought: for each function without a tape its values, (repeats, outputs), where a result needs them. */
MT_EXPORT int mt_horizon_run(mt_horizon *horizon, const double *const *sources, double *const *results,
                             const double *const *brought);

#endif
