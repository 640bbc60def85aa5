/* A tape: the operations of a function of scalars, one after another. It runs for several knots at once. */
#ifndef MT_TAPE_H
#define MT_TAPE_H

#include <stdint.h>

#include "common.h"

/* CasADi's names of the operations that a tape takes from it. The order is the tape's own. */
#define MT_TAPE_OPERATIONS(each)                                                                                        \
  each(CONST) each(INPUT) each(OUTPUT) each(ASSIGN) each(LIFT) each(ADD) each(SUB) each(MUL) each(DIV) each(NEG)        \
  each(TWICE) each(SQ) each(INV) each(SQRT) each(FABS) each(SIGN) each(COPYSIGN) each(IF_ELSE_ZERO) each(NOT) each(AND) \
  each(OR) each(LT) each(LE) each(EQ) each(NE) each(FLOOR) each(CEIL) each(FMIN) each(FMAX) each(FMOD) each(REMAINDER)  \
  each(POW) each(CONSTPOW) each(EXP) each(LOG) each(EXPM1) each(LOG1P) each(ERF) each(HYPOT) each(SIN) each(COS)        \
  each(TAN) each(ASIN) each(ACOS) each(ATAN) each(ATAN2) each(SINH) each(COSH) each(TANH) each(ASINH) each(ACOSH)       \
  each(ATANH)

/* Two operations of CasADi in one, each rounded as it would be alone: first × second + third, first × second − third,
 * third − first × second. The last one ends the tape. */
#define MT_TAPE_OWN_OPERATIONS(each) each(MULTIPLY_ADD) each(MULTIPLY_SUBTRACT) each(SUBTRACT_PRODUCT) each(END)

#define MT_TAPE_ENUMERATED(name) MT_TAPE_##name,
enum { MT_TAPE_OPERATIONS(MT_TAPE_ENUMERATED) MT_TAPE_OWN_OPERATIONS(MT_TAPE_ENUMERATED) MT_TAPE_KINDS };

/* CONST: out ← constants[first]. INPUT: out ← nonzero `second` of argument `first`. OUTPUT: value `out` ← first.
 * All others: out ← operation(first, second, third). These are registers, each of a value for every knot. */
typedef struct {
  uint16_t operation;
  uint16_t third;
  int32_t out;
  int32_t first;
  int32_t second;
} mt_instruction;

typedef struct {
  int64_t count; /* of instructions, END among them */
  int64_t registers;
  int64_t arguments;
  int64_t outputs; /* how many values a knot has */
  mt_instruction *instructions;
  double *constants;
} mt_tape;

/* Return the name of an operation as CasADi has it, or NULL behind the last one. */
MT_EXPORT const char *mt_tape_operation(int index);

/* Return the tape of a function's instructions, or NULL where there is no memory or an instruction makes no sense.
 *
 * read: (count, 4), the rows operation, i0, i1, i2 in CasADi's order: i0 is the register that is written, i1 and i2 are
 * those that are read. CONST: i1 and i2 are the halves of the number. INPUT: argument i1, nonzero i2. OUTPUT: nonzero
 * i2 of the only output is register i1.
 * arguments: how many the function has.
 * outputs: how many nonzeros its output has; those that no instruction writes are no values of the tape. */
MT_EXPORT mt_tape *mt_tape_new(int64_t count, const int32_t *read, int64_t arguments, int64_t outputs);

MT_EXPORT void mt_tape_delete(mt_tape *tape);

/* Return the number of instructions that are left, and of registers. */
MT_EXPORT int64_t mt_tape_count(const mt_tape *tape);
MT_EXPORT int64_t mt_tape_registers(const mt_tape *tape);

#endif
