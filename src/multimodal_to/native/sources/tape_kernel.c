/* The loop that runs a tape: one instruction for several knots, then a jump to the next one's place in the code.
 *
 * Every operation is what CasADi 3.7 and 3.8 do with doubles (its calculus.hpp), with the same functions of the C
 * library, so that values are the same to the last bit. That needs -ffp-contract=off. */
#include "tape_kernel.h"

#include <math.h>
#include <string.h>

/* How many knots a run is for, and the vector registers that a value takes. Of 4, 8, 16 and 32 knots, 8 and 16 are the
 * fastest with every instruction set, within a tenth of each other; 8 leave more blocks for threads to share. */
enum { WIDTH = 8, REGISTERS = WIDTH / MT_LANES };

typedef int64_t bits __attribute__((vector_size(8 * MT_LANES)));
typedef struct {
  mt_vector part[REGISTERS];
} wide;

static inline bits bits_of(mt_vector value) {
  bits same;
  memcpy(&same, &value, sizeof same);
  return same;
}

static inline mt_vector value_of(bits value) {
  mt_vector same;
  memcpy(&same, &value, sizeof same);
  return same;
}

static inline mt_vector all(double value) {
  return value - (mt_vector){0};
}

/* 1 where a comparison holds, else 0. */
static inline mt_vector truth(bits mask) {
  return value_of(mask & bits_of(all(1.0)));
}

/* One value where a comparison holds, another where it does not. */
static inline mt_vector choose(bits mask, mt_vector yes, mt_vector no) {
  return value_of((mask & bits_of(yes)) | (~mask & bits_of(no)));
}

static inline bits sign_bit(void) {
  return bits_of(all(-0.0));
}

int MT_KERNEL(mt_tape_width)(void) {
  return WIDTH;
}

#define NEXT                            \
  {                                     \
    at++;                               \
    goto *places[at->operation];        \
  }
#define PARTS for (int part = 0; part < REGISTERS; part++)
#define REGISTER(index) (*(wide *)((char *)registers + (size_t)(uint32_t)(index) * sizeof(wide)))
#define x (REGISTER(at->first).part[part])
#define y (REGISTER(at->second).part[part])
#define z (REGISTER(at->third).part[part])
#define VECTORS(name, value)                             \
  name : {                                               \
    PARTS { REGISTER(at->out).part[part] = (value); }    \
  }                                                      \
  NEXT
#define SCALARS(name, value)                                            \
  name : {                                                              \
    const double *first = (const double *)&REGISTER(at->first);         \
    const double *second = (const double *)&REGISTER(at->second);       \
    double *out = (double *)&REGISTER(at->out);                         \
    for (int lane = 0; lane < WIDTH; lane++) {                          \
      const double u = first[lane], v = second[lane];                   \
      (void)v;                                                          \
      out[lane] = (value);                                              \
    }                                                                   \
  }                                                                     \
  NEXT

void MT_KERNEL(mt_tape_run)(const mt_tape *tape, const double *const *arguments, double *registers, double *values) {
#define PLACE(name) &&name,
  static const void *const places[] = {MT_TAPE_OPERATIONS(PLACE) MT_TAPE_OWN_OPERATIONS(PLACE)};
#undef PLACE
  const mt_instruction *at = tape->instructions;
  goto *places[at->operation];

CONST: {
  PARTS { REGISTER(at->out).part[part] = all(tape->constants[at->first]); }
}
  NEXT
INPUT: {
  double *out = (double *)&REGISTER(at->out);
  const double *const *argument = arguments + (size_t)at->first * WIDTH;
  for (int lane = 0; lane < WIDTH; lane++) out[lane] = argument[lane][at->second];
}
  NEXT
OUTPUT: {
  memcpy(values + (size_t)at->out * WIDTH, &REGISTER(at->first), sizeof(wide));
}
  NEXT
  VECTORS(ASSIGN, x)
  VECTORS(LIFT, x)
  VECTORS(ADD, x + y)
  VECTORS(SUB, x - y)
  VECTORS(MUL, (x) * (y))
  VECTORS(DIV, x / y)
  VECTORS(NEG, -x)
  VECTORS(TWICE, x + x)
  VECTORS(SQ, (x) * (x))
  VECTORS(INV, 1.0 / x)
  VECTORS(MULTIPLY_ADD, (x) * (y) + z)
  VECTORS(MULTIPLY_SUBTRACT, (x) * (y) - z)
  VECTORS(SUBTRACT_PRODUCT, z - (x) * (y))
  VECTORS(FABS, value_of(bits_of(x) & ~sign_bit()))
  VECTORS(SIGN, choose(x < 0.0, all(-1.0), choose(x > 0.0, all(1.0), x)))
  VECTORS(COPYSIGN, value_of((bits_of(x) & ~sign_bit()) | (bits_of(y) & sign_bit())))
  VECTORS(FMIN, choose((y < x) | (x != x), y, x)) /* of two zeros the first, of NaN and a number the number */
  VECTORS(FMAX, choose((y > x) | (x != x), y, x))
  VECTORS(IF_ELSE_ZERO, value_of(~(x == 0.0) & bits_of(y)))
  VECTORS(NOT, truth(x == 0.0))
  VECTORS(AND, truth((x != 0.0) & (y != 0.0)))
  VECTORS(OR, truth((x != 0.0) | (y != 0.0)))
  VECTORS(LT, truth(x < y))
  VECTORS(LE, truth(x <= y))
  VECTORS(EQ, truth(x == y))
  VECTORS(NE, truth(x != y))
  SCALARS(SQRT, sqrt(u))
  SCALARS(FLOOR, floor(u))
  SCALARS(CEIL, ceil(u))
  SCALARS(FMOD, fmod(u, v))
  SCALARS(REMAINDER, remainder(u, v))
  SCALARS(POW, pow(u, v))
  SCALARS(CONSTPOW, pow(u, v))
  SCALARS(EXP, exp(u))
  SCALARS(LOG, log(u))
  SCALARS(EXPM1, expm1(u))
  SCALARS(LOG1P, log1p(u))
  SCALARS(ERF, erf(u))
  SCALARS(HYPOT, hypot(u, v))
  SCALARS(SIN, sin(u))
  SCALARS(COS, cos(u))
  SCALARS(TAN, tan(u))
  SCALARS(ASIN, asin(u))
  SCALARS(ACOS, acos(u))
  SCALARS(ATAN, atan(u))
  SCALARS(ATAN2, atan2(u, v))
  SCALARS(SINH, sinh(u))
  SCALARS(COSH, cosh(u))
  SCALARS(TANH, tanh(u))
  SCALARS(ASINH, asinh(u))
  SCALARS(ACOSH, acosh(u))
  SCALARS(ATANH, atanh(u))
END:
  return;
}
