/* A function that has a kernel for each instruction set, as Python calls it. */
#include "common.h"

MT_DECLARE(double, mt_test_dot, (int, const double *, const double *))
MT_DECLARE(int, mt_test_lanes, (void))

MT_EXPORT double mt_test_dot(int count, const double *a, const double *b) { return MT_CHOOSE(mt_test_dot)(count, a, b); }
MT_EXPORT int mt_test_lanes(void) { return MT_CHOOSE(mt_test_lanes)(); }
