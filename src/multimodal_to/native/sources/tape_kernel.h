/* What a tape's kernel offers, once for each instruction set. */
#ifndef MT_TAPE_KERNEL_H
#define MT_TAPE_KERNEL_H

#include "tape.h"

/* Return how many knots a run is for. */
#define MT_TAPE_WIDTH_ARGUMENTS (void)

/* Run a tape for as many knots as it is wide.
 *
 * arguments: (arguments, width), where each argument's nonzeros of each knot begin.
 * registers: (registers, width), at 64 bytes; what is in them does not matter.
 * values: (outputs, width), at 64 bytes. */
#define MT_TAPE_RUN_ARGUMENTS \
  (const mt_tape *tape, const double *const *arguments, double *registers, double *values)

#if defined(MT_LANES)
int MT_KERNEL(mt_tape_width) MT_TAPE_WIDTH_ARGUMENTS;
void MT_KERNEL(mt_tape_run) MT_TAPE_RUN_ARGUMENTS;
#else
MT_DECLARE(int, mt_tape_width, MT_TAPE_WIDTH_ARGUMENTS)
MT_DECLARE(void, mt_tape_run, MT_TAPE_RUN_ARGUMENTS)
#endif

#endif
