/* Solves with the factors. */
#include "kkt.h"
#include "kkt_kernel.h"
#include "parallel.h"

#include <math.h>
#include <string.h>

enum { SHARES = 8 }; /* of loops that threads share */

typedef struct {
  const KktMatrix *matrix;
  const KktPlan *plan;
  const KktWork *work;
  int from, until, step;
  double *x; /* of all unknowns */
} Sweep;

/* The pairs of a front: v = r_y / a + Σ z_j x_j with z_j = −a_j / a. */
static double pivot_of(const Sweep *sweep, const KktFront *front, int pair) {
  return sweep->matrix->value[front->pair_entry[pair]];
}

/* x ← what the other rows have on their right-hand sides once the pairs are gone. */
static void forward_pairs(const Sweep *sweep, const KktFront *front, const KktFactors *f) {
  const double *value = sweep->matrix->value;
  double *r = sweep->x, *local = sweep->work->vector;
  int padded = (f->size + 7) & ~7;
  memset(local, 0, sizeof(double) * (size_t)padded);
  for (int t = 0; t < f->pairs; t++) {
    double at_zero = r[f->before[f->shift + front->pairs + f->pair[t]]] / pivot_of(sweep, front, f->pair[t]);
    MT_CHOOSE(mt_kkt_subtract)(f->column.values + (size_t)t * (size_t)padded, 1, padded, &at_zero, local);
  }
  for (int t = 0; t < f->pairs; t++) {
    int i = f->pair[t], v = f->shift + i;
    double share = -(r[f->before[v]] + local[v]) / pivot_of(sweep, front, i);
    for (int q = front->pair_start[i]; q < front->pair_start[i + 1]; q++)
      local[f->shift + front->pair_position[q]] += share * value[front->pair_slot[q]];
    local[v] = 0;
  }
  for (int i = f->first; i < f->size; i++) r[f->before[i]] += local[i];
}

static void backward_pairs(const Sweep *sweep, const KktFront *front, const KktFactors *f) {
  const double *value = sweep->matrix->value;
  double *r = sweep->x, *local = sweep->work->vector;
  int padded = (f->size + 7) & ~7;
  for (int i = 0; i < padded; i++) local[i] = i < f->first || i >= f->size ? 0 : r[f->before[i]];
  for (int t = 0; t < f->pairs; t++) {
    int i = f->pair[t];
    double left = r[f->before[f->shift + front->pairs + i]];
    for (int q = front->pair_start[i]; q < front->pair_start[i + 1]; q++)
      left -= value[front->pair_slot[q]] * local[f->shift + front->pair_position[q]];
    local[f->shift + i] = left / pivot_of(sweep, front, i);
  }
  for (int t = 0; t < f->pairs; t++) {
    int v = f->before[f->shift + f->pair[t]], y = f->before[f->shift + front->pairs + f->pair[t]];
    double product;
    MT_CHOOSE(mt_kkt_dots)(f->column.values + (size_t)t * (size_t)padded, 1, padded, local, &product);
    r[y] = (r[v] - product) / pivot_of(sweep, front, f->pair[t]);
    r[v] = local[f->shift + f->pair[t]];
  }
}

static void forward_front(const Sweep *sweep, int k) {
  const KktFactors *f = &sweep->plan->factors[k];
  double *r = sweep->x, *local = sweep->work->vector;
  int padded = (f->size + 7) & ~7;
  if (f->pairs) forward_pairs(sweep, &sweep->plan->front[k], f);
  memset(local, 0, sizeof(double) * (size_t)padded);
  for (int i = f->start; i < f->pivots; i++) local[i] = r[f->after[i]];
  MT_CHOOSE(mt_kkt_forward)(f->lower.values, f->start, f->pivots, padded, local);
  for (int i = f->start; i < f->pivots; i++) r[f->after[i]] = local[i];
  for (int i = f->pivots; i < f->size; i++) r[f->after[i]] += local[i];
}

static void solve_diagonal(const KktFactors *f, double *x) {
  for (int k = f->start; k < f->pivots; k++) {
    double a = f->diagonal[2 * k], c = f->diagonal[2 * k + 1];
    if (c == 0) {
      x[k] /= a;
    } else {
      double d = f->diagonal[2 * k + 2], determinant = a * d - c * c, one = x[k], other = x[k + 1];
      x[k] = (d * one - c * other) / determinant;
      x[++k] = (a * other - c * one) / determinant;
    }
  }
}

static void backward_front(const Sweep *sweep, int k) {
  const KktFactors *f = &sweep->plan->factors[k];
  double *r = sweep->x, *local = sweep->work->vector;
  int padded = (f->size + 7) & ~7;
  memset(local, 0, sizeof(double) * (size_t)padded);
  for (int i = f->start; i < f->size; i++) local[i] = r[f->after[i]];
  solve_diagonal(f, local);
  MT_CHOOSE(mt_kkt_backward)(f->lower.values, f->start, f->pivots, padded, local);
  for (int i = f->start; i < f->pivots; i++) r[f->after[i]] = local[i];
  if (f->pairs) backward_pairs(sweep, &sweep->plan->front[k], f);
}

static void run_forward(void *context, int index) {
  const Sweep *sweep = &((Sweep *)context)[index];
  for (int k = sweep->from; k != sweep->until; k += sweep->step) forward_front(sweep, k);
}

static void run_backward(void *context, int index) {
  const Sweep *sweep = &((Sweep *)context)[index];
  for (int k = sweep->until - sweep->step; k != sweep->from - sweep->step; k -= sweep->step) backward_front(sweep, k);
}

/* The fronts: the two halves meet in the root, which is why the second has right-hand sides of its own there. */
static void solve_fronts(const KktMatrix *matrix, const KktPlan *plan, double *r, double *second) {
  int last = plan->fronts - 1, n = matrix->pattern->size;
  const KktFactors *root = &plan->factors[plan->root];
  Sweep sweeps[3] = {
    {.from = 0, .until = plan->root, .step = 1, .x = r},
    {.from = last, .until = plan->root, .step = -1, .x = second},
    {.from = plan->root, .until = plan->root + 1, .step = 1, .x = r},
  };
  for (int i = 0; i < 3; i++) {
    sweeps[i].matrix = matrix;
    sweeps[i].plan = plan;
    sweeps[i].work = &plan->work[i];
  }
  memcpy(second, r, sizeof(double) * (size_t)n);
  for (int i = root->first; i < root->size; i++) second[root->before[i]] = 0;
  mt_parallel(2, run_forward, sweeps);
  for (int i = root->first; i < root->size; i++) r[root->before[i]] += second[root->before[i]];
  run_forward(sweeps, 2);
  run_backward(sweeps, 2);
  for (int i = root->first; i < root->size; i++) second[root->before[i]] = r[root->before[i]];
  mt_parallel(2, run_backward, sweeps);
  for (int k = last; k != plan->root; k--) {
    const KktFactors *f = &plan->factors[k];
    for (int i = f->first; i < f->end; i++) r[f->before[i]] = second[f->before[i]];
  }
}

/* (r_y σ − e r_s) / det: the multiplier of an inequality row for x = 0, by its block [σ e; e δ]. */
static double multiplier(const KktMatrix *matrix, int d, double of_slack, double of_row) {
  const KktPattern *p = matrix->pattern;
  double sigma = p->slack_diagonal[d] < 0 ? 0 : matrix->value[p->slack_diagonal[d]];
  return (sigma * of_row - matrix->value[p->coupling[d]] * of_slack) / matrix->determinant[d];
}

static double row_times(const KktMatrix *matrix, int row, const double *x) {
  const KktRows *rows = &matrix->pattern->rows;
  double sum = 0;
  for (int q = rows->start[row]; q < rows->start[row + 1]; q++) sum += matrix->value[rows->entry[q]] * x[rows->column[q]];
  return sum;
}

static void subtract_row(const KktMatrix *matrix, int row, double factor, double *from) {
  const KktRows *rows = &matrix->pattern->rows;
  for (int q = rows->start[row]; q < rows->start[row + 1]; q++) from[rows->column[q]] -= matrix->value[rows->entry[q]] * factor;
}

/* The column of a variable in the inequality rows, times their multipliers. */
static double column_times(const KktMatrix *matrix, int variable, const double *multiplier) {
  const KktPattern *p = matrix->pattern;
  const double *of_row = multiplier - kkt_inequality(p, 0);
  double sum = 0;
  for (int e = p->column_inequalities[variable]; e < p->column_start[variable + 1]; e++) sum += matrix->value[e] * of_row[p->row[e]];
  return sum;
}

/* What a part of the condensed rows, or of the variables, needs; parts do not meet. */
typedef struct {
  KktMatrix *matrix;
  const KktPlan *plan;
  const double *rhs;
  double *x, *other;
} Condensed;

static void find_multipliers(void *context, int share) {
  const Condensed *c = context;
  const KktPattern *p = c->matrix->pattern;
  for (int i = kkt_share(p->slacks, share, SHARES); i < kkt_share(p->slacks, share + 1, SHARES); i++) {
    double left = c->rhs[kkt_inequality(p, i)];
    if (c->plan->row_meets[i]) left -= row_times(c->matrix, p->equalities + i, c->other);
    c->matrix->multiplier[i] = multiplier(c->matrix, i, c->rhs[kkt_slack(p, i)], left);
  }
}

static void subtract_rows(void *context, int share) {
  const Condensed *c = context;
  const KktPattern *p = c->matrix->pattern;
  for (int j = kkt_share(p->variables, share, SHARES); j < kkt_share(p->variables, share + 1, SHARES); j++)
    c->x[j] -= column_times(c->matrix, j, c->matrix->multiplier);
}

static void complete_rows(void *context, int share) {
  const Condensed *c = context;
  const KktPattern *p = c->matrix->pattern;
  for (int i = kkt_share(p->slacks, share, SHARES); i < kkt_share(p->slacks, share + 1, SHARES); i++) {
    int s = kkt_slack(p, i), y = kkt_inequality(p, i);
    double delta = p->row_diagonal[i] < 0 ? 0 : c->matrix->value[p->row_diagonal[i]], e = c->matrix->value[p->coupling[i]];
    double rest = c->rhs[y] - row_times(c->matrix, p->equalities + i, c->x);
    c->x[y] = multiplier(c->matrix, i, c->rhs[s], rest);
    c->x[s] = (delta * c->rhs[s] - e * rest) / c->matrix->determinant[i];
  }
}

/* r ← the right-hand side once slacks, inequality rows and defined variables are gone; start: these at x = 0. */
static void reduce(KktMatrix *matrix, const KktPlan *plan, const double *rhs, double *r, double *start) {
  const KktPattern *p = matrix->pattern;
  const KktDefinitions *d = &plan->definitions;
  Condensed condensed = {.matrix = matrix, .plan = plan, .rhs = rhs, .x = r, .other = start};
  memcpy(r, rhs, sizeof(double) * (size_t)p->size);
  memset(start, 0, sizeof(double) * (size_t)p->variables);
  for (int i = 0; i < d->count; i++) start[d->variable[i]] = rhs[kkt_equality(p, d->row[i])] / matrix->value[d->entry[i]];
  mt_parallel(SHARES, find_multipliers, &condensed);
  mt_parallel(SHARES, subtract_rows, &condensed);
  for (int i = 0; i < d->count; i++)
    for (int q = plan->meets.start[i]; q < plan->meets.start[i + 1]; q++)
      r[plan->meets.column[q]] -= matrix->value[plan->meets.entry[q]] * start[d->variable[i]];
  for (int i = 0; i < d->count; i++) {
    double of_variable = r[d->variable[i]];
    subtract_row(matrix, d->row[i], of_variable / matrix->value[d->entry[i]], r);
  }
}

/* Fill in what `reduce` took out. */
static void complete(KktMatrix *matrix, const KktPlan *plan, const double *rhs, double *x) {
  const KktPattern *p = matrix->pattern;
  const KktDefinitions *d = &plan->definitions;
  Condensed condensed = {.matrix = matrix, .plan = plan, .rhs = rhs, .x = x};
  for (int i = 0; i < d->count; i++) x[d->variable[i]] = 0;
  for (int i = 0; i < d->count; i++) {
    double rest = rhs[kkt_equality(p, d->row[i])] - row_times(matrix, d->row[i], x);
    x[d->variable[i]] = rest / matrix->value[d->entry[i]];
  }
  mt_parallel(SHARES, complete_rows, &condensed);
  for (int i = 0; i < d->count; i++) {
    double rest = rhs[d->variable[i]] - column_times(matrix, d->variable[i], x + kkt_inequality(p, 0));
    for (int q = plan->meets.start[i]; q < plan->meets.start[i + 1]; q++)
      rest -= matrix->value[plan->meets.entry[q]] * x[plan->meets.column[q]];
    x[kkt_equality(p, d->row[i])] = rest / matrix->value[d->entry[i]];
  }
}

void kkt_solve(KktMatrix *matrix, const KktPlan *plan, double *rhs) {
  size_t n = (size_t)matrix->pattern->size;
  double *x = matrix->solution, *other = x + n;
  reduce(matrix, plan, rhs, x, other);
  solve_fronts(matrix, plan, x, other);
  complete(matrix, plan, rhs, x);
  memcpy(rhs, x, sizeof(double) * n);
}

typedef struct {
  const KktMatrix *matrix;
  const double *x;
  double *residual[2];
} Residual;

static void subtract_columns(void *context, int half) {
  const Residual *r = context;
  const KktPattern *p = r->matrix->pattern;
  const double *value = r->matrix->value, *x = r->x;
  double *residual = r->residual[half];
  for (int j = half ? p->middle : 0; j < (half ? p->size : p->middle); j++) {
    double sum = 0, of_column = x[j];
    for (int e = p->column_start[j]; e < p->column_start[j + 1]; e++) {
      int i = p->row[e];
      sum += value[e] * x[i];
      if (i != j) residual[i] -= value[e] * of_column;
    }
    residual[j] -= sum;
  }
}

void kkt_residual(const KktMatrix *matrix, const double *rhs, const double *x, double *residual) {
  size_t n = (size_t)matrix->pattern->size;
  double *second = matrix->solution;
  Residual halves = {.matrix = matrix, .x = x, .residual = {residual, second}};
  memcpy(residual, rhs, sizeof(double) * n);
  memset(second, 0, sizeof(double) * n);
  mt_parallel(2, subtract_columns, &halves);
  for (size_t i = 0; i < n; i++) residual[i] += second[i];
}
