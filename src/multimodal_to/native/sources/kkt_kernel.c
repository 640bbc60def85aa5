/* Dense elimination with symmetric pivots, and the solves with its factor.
 *
 * Blocked as in LAPACK's DSYTRF: a panel of columns is updated when its turn comes, the rest of the front when the panel
 * is full. Pivots of one or two columns are chosen as by J. R. Bunch and L. Kaufman, Some stable methods for calculating
 * inertia and solving symmetric linear systems, Math. Comp. 31 (1977), among the columns that may be eliminated. Growth
 * into the border is held by a threshold, as by I. S. Duff and J. K. Reid, ACM TOMS 9 (1983).
 */
#include "kkt_kernel.h"

#include <math.h>
#include <stddef.h>
#include <string.h>

/* A tile of the update: TILE_ROWS vectors by TILE_COLUMNS columns stay in registers. */
#if defined(MT_SET_AVX512)
enum { TILE_ROWS = 3, TILE_COLUMNS = 8 };
#elif defined(MT_SET_NEON)
enum { TILE_ROWS = 4, TILE_COLUMNS = 6 };
#else
enum { TILE_ROWS = 3, TILE_COLUMNS = 4 };
#endif
enum { LANES = MT_LANES };
#define ALPHA 0.6403882032022076 /* (1 + √17) / 8 */
#define SMALL 1e-6               /* a pivot below this share of its column is compared with rounding errors */
#define ROUNDING 1e-13
#define NOTHING 1e-30

static inline mt_vector *at(double *values) { return (mt_vector *)values; }
static inline mt_vector get(const double *values) { return *(const mt_vector *)values; }
static inline void swap(double *a, double *b) {
  double kept = *a;
  *a = *b;
  *b = kept;
}

/* to[i, j] += sign Σ_p a[i, p] w[j, p] on a tile of full columns; a, w and to have columns of `stride` values. */
static inline __attribute__((always_inline)) void tile(int depth, const double *a, const double *w, int stride, double *to, int rows, int columns) {
  mt_vector sum[TILE_COLUMNS][TILE_ROWS];
  for (int c = 0; c < TILE_COLUMNS; c++)
    for (int r = 0; r < rows; r++) sum[c][r] = (mt_vector){0};
  for (int p = 0; p < depth; p++, a += stride, w += stride) {
    mt_vector left[TILE_ROWS];
    for (int r = 0; r < rows; r++) left[r] = get(a + LANES * r);
#pragma GCC unroll 8
    for (int c = 0; c < TILE_COLUMNS; c++)
#pragma GCC unroll 4
      for (int r = 0; r < rows; r++) sum[c][r] += left[r] * w[c];
  }
#pragma GCC unroll 8
  for (int c = 0; c < TILE_COLUMNS; c++) {
    if (c >= columns) break;
    for (int r = 0; r < rows; r++) *at(to + (size_t)c * (size_t)stride + LANES * r) -= sum[c][r];
  }
}

/* to[:, j] −= Σ_p a[:, p] w[j, p] for columns from … until − 1, from the diagonal down to `rows`. */
static void update_triangle(int depth, const double *a, const double *w, int stride, double *to, int from, int until, int rows) {
  for (int j = from; j < until; j += TILE_COLUMNS) {
    int columns = until - j < TILE_COLUMNS ? until - j : TILE_COLUMNS, i = j & ~(LANES - 1);
    double *column = to + (size_t)j * (size_t)stride;
    if (columns == TILE_COLUMNS)
      for (; i + LANES * TILE_ROWS <= rows; i += LANES * TILE_ROWS)
        tile(depth, a + i, w + j, stride, column + i, TILE_ROWS, TILE_COLUMNS);
    for (; i < rows; i += LANES) tile(depth, a + i, w + j, stride, column + i, 1, columns);
  }
}

/* column −= Σ_p a[:, p] w[row, p], from a multiple of eight on. */
static void update_column(double *column, const double *a, const double *w, int stride, int depth, int row, int from, int rows) {
  int i = from;
  for (; i + 4 * LANES <= rows; i += 4 * LANES) {
    mt_vector sum[4] = {get(column + i), get(column + i + LANES), get(column + i + 2 * LANES), get(column + i + 3 * LANES)};
    for (int p = 0; p < depth; p++) {
      const double *left = a + (size_t)p * (size_t)stride + i;
      double factor = w[(size_t)p * (size_t)stride + row];
      for (int r = 0; r < 4; r++) sum[r] -= get(left + LANES * r) * factor;
    }
    for (int r = 0; r < 4; r++) *at(column + i + LANES * r) = sum[r];
  }
  for (; i < rows; i += LANES) {
    mt_vector sum = get(column + i);
    for (int p = 0; p < depth; p++) sum -= get(a + (size_t)p * (size_t)stride + i) * w[(size_t)p * (size_t)stride + row];
    *at(column + i) = sum;
  }
}

typedef long long mt_mask __attribute__((vector_size(8 * MT_LANES)));

static inline mt_vector size_of(mt_vector v) {
  return (mt_vector)((mt_mask)v & ((mt_mask){0} + 0x7fffffffffffffffLL));
}

static inline mt_vector larger(mt_vector a, mt_vector b) {
  mt_mask first = a > b;
  return (mt_vector)(((mt_mask)a & first) | ((mt_mask)b & ~first));
}

/* The largest |value|; what is no number counts as nothing. */
static double largest(const double *values, int from, int until) {
  double most = 0;
  int i = from;
  for (; i < until && i % LANES; i++) most = fabs(values[i]) > most ? fabs(values[i]) : most;
  mt_vector sum = {0};
  for (; i + LANES <= until; i += LANES) sum = larger(size_of(get(values + i)), sum);
  for (int lane = 0; lane < LANES; lane++) most = sum[lane] > most ? sum[lane] : most;
  for (; i < until; i++) most = fabs(values[i]) > most ? fabs(values[i]) : most;
  return most;
}

/* Whether all values are finite numbers: 0 · v is 0 only of these. */
static int all_numbers(const double *values, int from, int until) {
  double all = 0;
  int i = from;
  for (; i < until && i % LANES; i++) all += 0 * values[i];
  mt_vector sum = {0};
  for (; i + LANES <= until; i += LANES) sum += get(values + i) * 0.0;
  for (int lane = 0; lane < LANES; lane++) all += sum[lane];
  for (; i < until; i++) all += 0 * values[i];
  return all == 0;
}

static int place_of(const double *values, int from, int until, double size) {
  for (int i = from; i < until; i++)
    if (fabs(values[i]) == size) return i;
  return until;
}

/* Let columns a < b of a front change places: `done` columns of L are there, and `updated` columns of the panel. */
static void exchange(KktDense *f, int a, int b, int done, int updated) {
  size_t stride = (size_t)f->stride;
  double *m = f->matrix, *one = m + (size_t)a * stride, *other = m + (size_t)b * stride;
  for (int c = f->first; c < done; c++) swap(&m[(size_t)c * stride + (size_t)a], &m[(size_t)c * stride + (size_t)b]);
  for (int c = 0; c < updated; c++) swap(&f->work[(size_t)c * stride + (size_t)a], &f->work[(size_t)c * stride + (size_t)b]);
  swap(&one[a], &other[b]);
  for (int i = a + 1; i < b; i++) swap(&one[i], &m[(size_t)i * stride + (size_t)b]);
  for (int i = b + 1; i < f->size; i++) swap(&one[i], &other[i]);
  int unknown = f->unknown[a];
  f->unknown[a] = f->unknown[b];
  f->unknown[b] = unknown;
}

/* The size of what was subtracted from the diagonal of column k so far, and from its entry in row i if that is more. */
static double subtracted(KktDense *f, int k, int i) {
  size_t stride = (size_t)f->stride;
  double own = f->rounding[f->unknown[k]], beside = 0;
  for (int p = f->first; p < k; p++) {
    const double *column = f->matrix + (size_t)p * stride, *d = f->diagonal + 2 * p;
    double a = fabs(column[k]), b = fabs(d[0]) * a;
    if (d[1] != 0) b += fabs(d[1] * column[stride + (size_t)k]);
    if (p > f->first && d[-1] != 0) b += fabs(d[-1] * column[(ptrdiff_t)k - (ptrdiff_t)stride]);
    own += a * b;
    beside += fabs(column[i]) * b;
  }
  f->rounding[f->unknown[k]] = own;
  return beside > own ? beside : own;
}

enum { NONE = 0, ONE = 1, TWO = 2 };

/* Choose a pivot for column k, whose updated values are in w; `active` columns may be one. Its place goes to *with. */
static int choose(KktDense *f, int k, int active, int from, int done, int rows, double *w, int *with) {
  size_t stride = (size_t)f->stride;
  double *other = w + stride, diagonal = fabs(w[k]), below = largest(w, k + 1, active);
  double outside = largest(w, active, f->size), own = diagonal > below ? diagonal : below, all = own > outside ? own : outside;
  int i = diagonal < below ? place_of(w, k + 1, active, below) : k;
  *with = k;
  if (all < NOTHING || own < f->threshold * all) return NONE;
  if ((own < SMALL || own < SMALL * all) && own <= ROUNDING * subtracted(f, k, i)) return NONE;
  if (diagonal >= ALPHA * below) return diagonal >= f->threshold * outside ? ONE : NONE;
  int start = k & ~7;
  memset(other + start, 0, sizeof(double) * 8);
  for (int r = k; r < i; r++) other[r] = f->matrix[(size_t)r * stride + (size_t)i];
  memcpy(other + i, f->matrix + (size_t)i * stride + i, sizeof(double) * (size_t)(rows - i));
  if (done) update_column(other, f->matrix + (size_t)from * stride, f->work, f->stride, done, i, start, rows);
  double beside = fmax(largest(other, k, i), largest(other, i + 1, active)), beyond = largest(other, active, f->size);
  *with = i;
  if (diagonal * beside >= ALPHA * below * below) {
    *with = k;
    return diagonal >= f->threshold * outside ? ONE : NONE;
  }
  if (fabs(other[i]) >= ALPHA * beside) {
    if (fabs(other[i]) < f->threshold * beyond) return NONE;
    memcpy(w + start, other + start, sizeof(double) * (size_t)(rows - start));
    return ONE;
  }
  double a = diagonal, c = fabs(w[i]), d = fabs(other[i]), det = fabs(w[k] * other[i] - w[i] * w[i]);
  int held = f->threshold * (d * outside + c * beyond) <= det && f->threshold * (c * outside + a * beyond) <= det;
  return held ? TWO : NONE;
}

static void keep_one(KktDense *f, int k, const double *w, int rows) {
  double *column = f->matrix + (size_t)k * (size_t)f->stride, inverse = 1.0 / w[k];
  f->diagonal[2 * k] = w[k];
  f->diagonal[2 * k + 1] = 0;
  f->negative += w[k] < 0;
  for (int i = k & ~7; i < rows; i += LANES) *at(column + i) = get(w + i) * inverse;
  for (int i = k & ~7; i < k; i++) column[i] = 0;
  column[k] = 1;
}

static void keep_two(KktDense *f, int k, double *w, int rows) {
  double *second = w + (size_t)f->stride, *column = f->matrix + (size_t)k * (size_t)f->stride, *next = column + f->stride;
  double a = w[k], c = w[k + 1], d = second[k + 1], det = a * d - c * c;
  double to_first = d / det, across = -c / det, to_second = a / det;
  second[k] = c;
  for (int i = k & ~7; i < rows; i += LANES) {
    mt_vector x = get(w + i), y = get(second + i);
    *at(column + i) = x * to_first + y * across;
    *at(next + i) = x * across + y * to_second;
  }
  for (int i = k & ~7; i < k; i++) column[i] = next[i] = 0;
  for (int i = (k + 1) & ~7; i < k + 1; i++) next[i] = 0;
  column[k] = next[k + 1] = 1;
  column[k + 1] = next[k] = 0;
  f->diagonal[2 * k] = a;
  f->diagonal[2 * k + 1] = c;
  f->diagonal[2 * k + 2] = d;
  f->diagonal[2 * k + 3] = 0;
  f->negative += det < 0 ? 1 : a < 0 ? 2 : 0;
}

/* Eliminate columns of one panel, from k on; returns the end of what was eliminated. */
static int eliminate_panel(KktDense *f, int k, int *active, int rows) {
  size_t stride = (size_t)f->stride;
  int from = k;
  while (k < *active && k - from < KKT_PANEL) {
    int done = k - from, start = k & ~7, with;
    double *w = f->work + (size_t)done * stride;
    memcpy(w + start, f->matrix + (size_t)k * stride + start, sizeof(double) * (size_t)(rows - start));
    if (done) update_column(w, f->matrix + (size_t)from * stride, f->work, f->stride, done, k, start, rows);
    if (!all_numbers(w, k, f->size)) {
      f->failed = 1;
      return k;
    }
    int step = choose(f, k, *active, from, done, rows, w, &with);
    if (step == NONE) {
      subtracted(f, k, k);
      if (k < --*active) exchange(f, k, *active, k, done);
      continue;
    }
    if (with != k + step - 1) {
      exchange(f, k + step - 1, with, k, done);
      for (int c = 0; c < step; c++) swap(&w[(size_t)c * stride + (size_t)(k + step - 1)], &w[(size_t)c * stride + (size_t)with]);
    }
    if (step == ONE) keep_one(f, k, w, rows);
    else keep_two(f, k, w, rows);
    k += step;
  }
  return k;
}

void MT_KERNEL(mt_kkt_eliminate) KKT_ELIMINATE_ARGUMENTS {
  KktDense *f = front;
  size_t stride = (size_t)f->stride;
  int k = f->first, active = f->end, rows = (f->size + 7) & ~7;
  f->negative = f->failed = 0;
  while (k < active && !f->failed) {
    int from = k;
    k = eliminate_panel(f, k, &active, rows);
    if (k > from && !f->failed)
      update_triangle(k - from, f->matrix + (size_t)from * stride, f->work, f->stride, f->matrix, k, f->size, rows);
  }
  f->pivots = k;
}

void MT_KERNEL(mt_kkt_panel) KKT_PANEL_ARGUMENTS {
  for (int r = 0; r < rows; r++)
    for (int i = 0; i < padded; i += LANES) {
      size_t place = (size_t)r * (size_t)padded + (size_t)i;
      *at(weighted + place) = get(panel + place) * -weight[r];
    }
  memset(square, 0, sizeof(double) * (size_t)padded * (size_t)padded);
  update_triangle(rows, panel, weighted, padded, square, 0, padded, padded);
}

void MT_KERNEL(mt_kkt_spread) KKT_SPREAD_ARGUMENTS {
  int start = from & ~7, rows = (size + 7) & ~7;
  memset(sum + start, 0, sizeof(double) * (size_t)(rows - start));
  for (int t = 0; t < terms; t++) {
    const double *column = columns + (size_t)term_column[t] * (size_t)stride;
    double factor = z[term_z[t]];
    for (int i = start; i < rows; i += LANES) *at(sum + i) += get(column + i) * factor;
  }
  double *own = matrix + (size_t)j * (size_t)stride;
  for (int i = j & ~7; i < rows; i += LANES) *at(own + i) += get(sum + i);
  own[j] += sum[j];
  for (int i = from; i < (j < skip ? j : skip); i++) matrix[(size_t)i * (size_t)stride + (size_t)j] += sum[i];
  for (int i = skip_end > from ? skip_end : from; i < j; i++) matrix[(size_t)i * (size_t)stride + (size_t)j] += sum[i];
}

void MT_KERNEL(mt_kkt_add) KKT_ADD_ARGUMENTS {
  for (int r = 0; r < runs; r++)
    for (int c = 0; c < run_length[r]; c++) {
      const double *column = from + (size_t)(run_from[r] + c) * (size_t)stride;
      double *into = to + (size_t)(run_to[r] + c) * (size_t)stride;
      for (int q = r; q < runs; q++) {
        int skip = q == r ? c : 0, length = run_length[q] - skip, i = 0;
        const double *x = column + run_from[q] + skip;
        double *y = into + run_to[q] + skip;
        for (; i + LANES <= length; i += LANES) *(mt_unaligned *)(y + i) += *(const mt_unaligned *)(x + i);
        for (; i < length; i++) y[i] += x[i];
      }
    }
}

void MT_KERNEL(mt_kkt_forward) KKT_SOLVE_ARGUMENTS {
  for (int k = first; k < pivots;) {
    int top = k & ~7, until = top + 8 < pivots ? top + 8 : pivots, count = until - k;
    size_t length = (size_t)(padded - top);
    double s[KKT_BLOCK] = {0};
    for (int c = 0; c < count; c++) {
      s[c] = x[k + c];
      for (int i = c + 1; i < count; i++) x[k + i] -= lower[(size_t)c * length + (size_t)(k + i - top)] * s[c];
      for (int i = until; i < top + 8; i++) x[i] -= lower[(size_t)c * length + (size_t)(i - top)] * s[c];
    }
    if (count == KKT_BLOCK) {
      for (int i = 8; i < (int)length; i += LANES) {
        mt_vector sum = get(x + top + i);
#pragma GCC unroll 8
        for (int c = 0; c < KKT_BLOCK; c++) sum -= get(lower + (size_t)c * length + i) * s[c];
        *at(x + top + i) = sum;
      }
    } else {
      for (int c = 0; c < count; c++)
        for (int i = 8; i < (int)length; i += LANES) *at(x + top + i) -= get(lower + (size_t)c * length + i) * s[c];
    }
    lower += (size_t)count * length;
    k = until;
  }
}

static double total(mt_vector v) {
  double sum = 0;
  for (int i = 0; i < LANES; i++) sum += v[i];
  return sum;
}

void MT_KERNEL(mt_kkt_backward) KKT_SOLVE_ARGUMENTS {
  size_t offset = 0;
  for (int k = first; k < pivots;) {
    int top = k & ~7, until = top + 8 < pivots ? top + 8 : pivots;
    offset += (size_t)(until - k) * (size_t)(padded - top);
    k = until;
  }
  for (int until = pivots; until > first;) {
    int top = (until - 1) & ~7, k = top > first ? top : first, count = until - k;
    size_t length = (size_t)(padded - top);
    offset -= (size_t)count * length;
    const double *block = lower + offset;
    mt_vector sum[KKT_BLOCK] = {{0}};
    if (count == KKT_BLOCK) {
      for (int i = 8; i < (int)length; i += LANES) {
        mt_vector value = get(x + top + i);
#pragma GCC unroll 8
        for (int c = 0; c < KKT_BLOCK; c++) sum[c] += get(block + (size_t)c * length + i) * value;
      }
    } else {
      for (int c = 0; c < count; c++)
        for (int i = 8; i < (int)length; i += LANES) sum[c] += get(block + (size_t)c * length + i) * get(x + top + i);
    }
    for (int c = count - 1; c >= 0; c--) {
      double value = x[k + c] - total(sum[c]);
      for (int i = k + c + 1; i < top + 8; i++) value -= block[(size_t)c * length + (size_t)(i - top)] * x[i];
      x[k + c] = value;
    }
    until = k;
  }
}

void MT_KERNEL(mt_kkt_subtract) KKT_COLUMNS_ARGUMENTS {
  for (int c = 0; c < count; c++)
    for (int i = 0; i < padded; i += LANES) *at(x + i) -= get(columns + (size_t)c * (size_t)padded + i) * factor[c];
}

void MT_KERNEL(mt_kkt_dots) KKT_DOTS_ARGUMENTS {
  for (int c = 0; c < count; c++) {
    mt_vector sum = {0};
    for (int i = 0; i < padded; i += LANES) sum += get(columns + (size_t)c * (size_t)padded + i) * get(x + i);
    dot[c] = total(sum);
  }
}
