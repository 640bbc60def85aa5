/* The dense part of the factorisation, compiled for each instruction set.
 *
 * A front is a symmetric matrix of which the lower triangle is kept, column by column; columns are `stride` values
 * apart, a multiple of eight, and start at a multiple of 64 bytes. Positions count from the start of the storage.
 */
#ifndef MT_KKT_KERNEL_H
#define MT_KKT_KERNEL_H

#include "common.h"

typedef struct {
  double *matrix;
  int stride, first, end, size; /* positions first … end − 1 may be eliminated, the border is end … size − 1 */
  double threshold;             /* least pivot, as a share of what it meets outside */
  int *unknown;                 /* at each position; it changes places with its column */
  double *rounding;             /* of each unknown: size of what was subtracted from its diagonal so far */
  double *diagonal;             /* D: two values for each position, the diagonal and the one below */
  double *work;                 /* stride × (KKT_PANEL + 2) values */
  int pivots, negative, failed; /* out: end of the positions that were eliminated; failed: a value is no number */
} KktDense;

enum { KKT_PANEL = 16, KKT_BLOCK = 8 };

/* Eliminate what finds a pivot; the rest is left at pivots … end − 1, with its Schur complement and the border's. */
#define KKT_ELIMINATE_ARGUMENTS (KktDense * front)
MT_DECLARE(void, mt_kkt_eliminate, KKT_ELIMINATE_ARGUMENTS)

/* square (lower triangle) = Σ_r weight[r] row_r row_rᵀ; rows of a panel, `padded` values each, a multiple of eight. */
#define KKT_PANEL_ARGUMENTS (double *square, int padded, const double *panel, double *weighted, const double *weight, int rows)
MT_DECLARE(void, mt_kkt_panel, KKT_PANEL_ARGUMENTS)

/* Add s = Σ_v z_v T_v to the column and the row of position j, from position `from` on: matrix += s e_jᵀ + e_j sᵀ.
 * T has columns of `stride` values; terms: pairs of column and index of z. Positions skip … skip_end − 1 are left out. */
#define KKT_SPREAD_ARGUMENTS \
  (double *matrix, int stride, int size, int j, int from, int skip, int skip_end, const double *columns, \
   const int *term_column, const int *term_z, int terms, const double *z, double *sum)
MT_DECLARE(void, mt_kkt_spread, KKT_SPREAD_ARGUMENTS)

/* Add a triangle into a front: its positions are in runs of consecutive ones. */
#define KKT_ADD_ARGUMENTS \
  (double *to, int stride, const double *from, int runs, const int *run_from, const int *run_to, const int *run_length)
MT_DECLARE(void, mt_kkt_add, KKT_ADD_ARGUMENTS)

/* x ← L⁻¹ x and x ← L⁻ᵀ x for the columns first … pivots − 1, kept in blocks of up to eight, by positions 8b … 8b + 7:
 * each column from position 8b to `padded`. x has zeros from the size of the front to `padded`. */
#define KKT_SOLVE_ARGUMENTS (const double *lower, int first, int pivots, int padded, double *x)
MT_DECLARE(void, mt_kkt_forward, KKT_SOLVE_ARGUMENTS)
MT_DECLARE(void, mt_kkt_backward, KKT_SOLVE_ARGUMENTS)

/* x −= Σ_c factor[c] column_c, and dot[c] = column_c · x; columns of `padded` values, one after the other. */
#define KKT_COLUMNS_ARGUMENTS (const double *columns, int count, int padded, const double *factor, double *x)
MT_DECLARE(void, mt_kkt_subtract, KKT_COLUMNS_ARGUMENTS)
#define KKT_DOTS_ARGUMENTS (const double *columns, int count, int padded, const double *x, double *dot)
MT_DECLARE(void, mt_kkt_dots, KKT_DOTS_ARGUMENTS)

#endif
