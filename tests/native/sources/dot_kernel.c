/* Σ a_i b_i, a vector register at a time; the sums of the lanes are added at the end. */
#include "common.h"

double MT_KERNEL(mt_test_dot)(int count, const double *a, const double *b) {
  mt_vector sums = {0};
  int i = 0;
  for (; i + MT_LANES <= count; i += MT_LANES) sums += *(const mt_unaligned *)(a + i) * *(const mt_unaligned *)(b + i);
  double sum = 0;
  for (int lane = 0; lane < MT_LANES; lane++) sum += sums[lane];
  for (; i < count; i++) sum += a[i] * b[i];
  return sum;
}

int MT_KERNEL(mt_test_lanes)(void) { return MT_LANES; }
