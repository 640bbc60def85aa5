/* The factorisation, front by front. */
#include "kkt.h"
#include "kkt_kernel.h"
#include "parallel.h"

#include <math.h>
#include <stdatomic.h>
#include <string.h>

#define PAIR_GROWTH 1e3       /* most that an entry of a pair's row may be, in sizes of its pivot */
#define DEFINITION_GROWTH 1e4 /* the same for a row that defines a variable */

typedef struct {
  KktMatrix *matrix;
  KktPlan *plan;
  int from, until, step; /* fronts */
  KktWork *work;
  int break_off;
  atomic_int *stop;
  int status, excess, fronts;
} Chain;

/* -------------------------------------------------------------------- the matrix entries of a front */

static double *origin(const KktPlan *plan, const KktFactors *f) {
  return f->matrix + (size_t)f->shift * (size_t)(plan->stride + 1);
}

static void clear(const KktPlan *plan, const KktFactors *f) {
  int rows = (f->size + 7) & ~7;
  for (int j = f->first; j < f->size; j++) {
    int top = j & ~7;
    memset(f->matrix + (size_t)j * (size_t)plan->stride + top, 0, sizeof(double) * (size_t)(rows - top));
  }
}

static void add_entries(const KktMatrix *matrix, const KktFront *front, KktWork *work, double *to) {
  const double *value = matrix->value;
  const int *slot = front->entry_slot, *target = front->entry_target;
  for (int i = 0; i < front->to_front; i++) to[target[i]] += value[slot[i]];
  slot += front->to_front, target += front->to_front;
  for (int i = 0; i < front->to_values; i++) work->values[target[i]] += value[slot[i]];
  slot += front->to_values, target += front->to_values;
  for (int i = 0; i < front->to_products; i++) work->product[target[i]] += value[slot[i]];
}

/* Add w J_dᵀ J_d of each inequality row, with w = −σ / (σ δ − e²) for the block [σ e; e δ] of its s and y. */
static void add_condensed_rows(const KktMatrix *matrix, const KktFront *front, KktWork *work, double *to) {
  const KktPattern *p = matrix->pattern;
  const int *target = front->row_target;
  int padded = (front->panel + 7) & ~7, in_panel = 0, place = 0;
  memset(work->panel, 0, sizeof(double) * (size_t)padded * (size_t)front->panel_rows);
  for (int r = 0; r < front->condensed; r++) {
    int d = front->row[r], count = front->row_start[r + 1] - front->row_start[r], plain = front->row_plain[r];
    const int *slot = front->row_slot + front->row_start[r];
    double sigma = p->slack_diagonal[d] < 0 ? 0 : matrix->value[p->slack_diagonal[d]];
    double weight = -sigma / matrix->determinant[d], *line = work->line;
    for (int a = 0; a < count; a++) line[a] = matrix->value[slot[a]];
    if (front->row_in_panel[r]) {
      double *into = work->panel + (size_t)in_panel * (size_t)padded;
      for (int a = 0; a < plain; a++) into[front->panel_place[place++]] = line[a];
      work->weight[in_panel++] = weight;
    }
    for (int a = front->row_in_panel[r] ? plain : 0; a < count; a++) {
      double x = weight * line[a];
      double *into = a < plain ? to : work->values;
      int b = 0;
      for (; b < plain && b <= a; b++) into[*target++] += x * line[b];
      for (; b <= a; b++) work->product[*target++] += x * line[b];
    }
  }
}

static void add_panel(const KktFront *front, int stride, KktWork *work, double *to) {
  int padded = (front->panel + 7) & ~7;
  if (!front->panel_rows) return;
  MT_CHOOSE(mt_kkt_panel)(work->square, padded, work->panel, work->weighted, work->weight, front->panel_rows);
  for (int c = 0; c < front->panel; c++) {
    double *column = to + (size_t)front->panel_position[c] * (size_t)stride;
    const double *from = work->square + (size_t)c * (size_t)padded;
    for (int r = c; r < front->panel; r++) column[front->panel_position[r]] += from[r];
  }
}

/* -------------------------------------------------------------------- defined variables: v = Σ z_j x_j */

static void add_group(const KktGroup *group, const KktWork *work, int stride, double *to) {
  const double *values = work->values + group->first, *z = work->z + group->z;
  const int *position = group->position, members = group->members;
  for (int k = 0; k < group->depends; k++, z += members) {
    int j = group->depend[k], i = 0;
    const double *value = values;
    for (; i < group->touched && position[i] < j; i++, value += members) {
      double sum = 0;
      for (int m = 0; m < members; m++) sum += value[m] * z[m];
      to[(size_t)position[i] * (size_t)stride + (size_t)j] += sum;
    }
    double *column = to + (size_t)j * (size_t)stride;
    if (i < group->touched && position[i] == j)
      for (int m = 0; m < members; m++) column[j] += value[m] * z[m]; /* and once more below */
    for (; i < group->touched; i++, value += members) {
      double sum = 0;
      for (int m = 0; m < members; m++) sum += value[m] * z[m];
      column[position[i]] += sum;
    }
  }
}

/* Substitute: K + T zᵀ + z Tᵀ, with the values T of a defined variable's row and half of its own diagonal's part. */
static void substitute(const KktMatrix *matrix, const KktPlan *plan, const KktFront *front, KktWork *work, double *to) {
  for (int g = 0; g < front->groups; g++) {
    const KktGroup *group = &front->group[g];
    double *z = work->z + group->z;
    for (int m = 0; m < group->members; m++) {
      double inverse = -1 / matrix->value[plan->definitions.entry[group->definition[m]]];
      for (int k = 0; k < group->depends; k++)
        z[k * group->members + m] = inverse * matrix->value[group->slot[k * group->members + m]];
    }
  }
  for (int i = 0; i < front->spreads; i++) {
    double h = front->spread_half[i] ? 0.5 * work->product[front->spread_product[i]] : work->product[front->spread_product[i]];
    work->values[front->spread_target[i]] += h * work->z[front->spread_z[i]];
  }
  for (int g = 0; g < front->groups; g++) add_group(&front->group[g], work, plan->stride, to);
}

/* -------------------------------------------------------------------- what children left */

static void add_children(const KktPlan *plan, const KktFront *front, KktFactors *f) {
  int at = f->first, stride = plan->stride;
  for (int c = 0; c < front->children; c++) {
    const KktFactors *child = &plan->factors[front->child[c]];
    const double *border = child->matrix + (size_t)child->end * (size_t)(stride + 1);
    MT_CHOOSE(mt_kkt_add)
    (origin(plan, f), stride, border, front->runs[c], front->run_from[c], front->run_to[c], front->run_length[c]);
    for (int j = child->pivots; j < child->end; j++, at++) {
      const double *from = child->matrix + (size_t)j * (size_t)stride;
      double *to = f->matrix + (size_t)at * (size_t)stride;
      for (int i = j; i < child->end; i++) to[at + i - j] += from[i];
      for (int r = 0; r < front->runs[c]; r++)
        for (int i = 0; i < front->run_length[c][r]; i++)
          to[f->shift + front->run_to[c][r] + i] += from[child->end + front->run_from[c][r] + i];
    }
  }
}

/* Positions of a front: first what its children could not eliminate, then as planned. */
static int place(const KktPlan *plan, int k, KktFactors *f, double *memory) {
  const KktFront *front = &plan->front[k];
  int waiting = 0, at;
  for (int c = 0; c < front->children; c++)
    waiting += plan->factors[front->child[c]].end - plan->factors[front->child[c]].pivots;
  if (waiting > KKT_DELAYED_MOST) return KKT_CROWDED;
  f->matrix = memory;
  f->shift = (waiting + 7) & ~7;
  f->first = at = f->shift - waiting;
  f->end = f->shift + front->eliminated;
  f->size = f->shift + front->size;
  for (int c = 0; c < front->children; c++) {
    const KktFactors *child = &plan->factors[front->child[c]];
    for (int i = child->pivots; i < child->end; i++) f->before[at++] = child->after[i];
  }
  memcpy(f->before + f->shift, front->unknown, sizeof(int) * (size_t)front->size);
  return KKT_DONE;
}

/* -------------------------------------------------------------------- pairs: rows of few columns */

static int holds(const double *value, int pivot, const int *slot, int count, double growth) {
  double most = 0;
  for (int i = 0; i < count; i++) most = fmax(most, fabs(value[slot[i]]));
  return value[pivot] != 0 && most <= growth * fabs(value[pivot]);
}

static int diagonal_is_zero(const KktMatrix *matrix, int row) {
  int entry = matrix->pattern->equality_diagonal[row];
  return entry < 0 || matrix->value[entry] == 0;
}

int kkt_definitions_hold(const KktMatrix *matrix, const KktPlan *plan) {
  const KktPattern *p = matrix->pattern;
  const KktDefinitions *d = &plan->definitions;
  for (int i = 0; i < d->count; i++) {
    int start = p->rows.start[d->row[i]], count = p->rows.start[d->row[i] + 1] - start;
    if (!diagonal_is_zero(matrix, d->row[i])) return 0;
    if (!holds(matrix->value, d->entry[i], p->rows.entry + start, count, DEFINITION_GROWTH)) return 0;
  }
  return 1;
}

/* Note which pairs can be eliminated, and copy the rows of their variables. */
static int take_pairs(const KktMatrix *matrix, const KktPlan *plan, const KktFront *front, KktFactors *f) {
  const KktPattern *p = matrix->pattern;
  int padded = (f->size + 7) & ~7, stride = plan->stride;
  f->pairs = 0;
  for (int i = 0; i < front->pairs; i++) {
    int start = front->pair_start[i], count = front->pair_start[i + 1] - start;
    int row = f->before[f->shift + front->pairs + i] - kkt_equality(p, 0);
    if (diagonal_is_zero(matrix, row) && holds(matrix->value, front->pair_entry[i], front->pair_slot + start, count, PAIR_GROWTH))
      f->pair[f->pairs++] = i;
  }
  if (!kkt_grow(&f->column, (size_t)padded * (size_t)f->pairs)) return KKT_NO_MEMORY;
  for (int t = 0; t < f->pairs; t++) {
    double *column = f->column.values + (size_t)t * (size_t)padded;
    int v = f->shift + f->pair[t];
    memset(column, 0, sizeof(double) * (size_t)f->first);
    for (int i = f->first; i < v; i++) column[i] = f->matrix[(size_t)i * (size_t)stride + (size_t)v];
    memcpy(column + v, f->matrix + (size_t)v * (size_t)stride + v, sizeof(double) * (size_t)(padded - v));
  }
  for (int t = 0; t < f->pairs; t++)
    for (int s = 0; s < f->pairs; s++) f->column.values[(size_t)t * (size_t)padded + (size_t)(f->shift + front->pairs + f->pair[s])] = 0;
  return KKT_DONE;
}

static void eliminate_pairs(const KktMatrix *matrix, const KktPlan *plan, const KktFront *front, KktFactors *f, KktWork *work) {
  int padded = (f->size + 7) & ~7, stride = plan->stride, count = front->pair_start[front->pairs];
  double *z = work->z;
  memset(z, 0, sizeof(double) * (size_t)count);
  memset(work->columns, 0, sizeof(double) * (size_t)front->pairs * (size_t)stride);
  for (int t = 0; t < f->pairs; t++) {
    int i = f->pair[t];
    double inverse = -1 / matrix->value[front->pair_entry[i]];
    for (int q = front->pair_start[i]; q < front->pair_start[i + 1]; q++) z[q] = inverse * matrix->value[front->pair_slot[q]];
    memcpy(work->columns + (size_t)i * (size_t)stride, f->column.values + (size_t)t * (size_t)padded, sizeof(double) * (size_t)padded);
  }
  for (int t = 0; t < f->pairs; t++) /* T_v += ½ Σ_w F_vw z_w */
    for (int s = 0; s < f->pairs; s++) {
      int v = f->pair[t], w = f->pair[s];
      double half = 0.5 * f->column.values[(size_t)t * (size_t)padded + (size_t)(f->shift + w)];
      double *column = work->columns + (size_t)v * (size_t)stride;
      for (int q = front->pair_start[w]; q < front->pair_start[w + 1]; q++) column[f->shift + front->pair_position[q]] += half * z[q];
    }
  int whole = f->pairs == front->pairs, skip = f->shift, skip_end = whole ? f->shift + 2 * front->pairs : f->shift;
  for (int t = 0; t < front->pair_targets; t++) {
    int from = front->target_start[t], terms = front->target_start[t + 1] - from;
    MT_CHOOSE(mt_kkt_spread)
    (f->matrix, stride, f->size, f->shift + front->pair_target[t], f->first, skip, skip_end, work->columns,
     front->target_pair + from, front->target_slot + from, terms, z, work->vector);
  }
}

static void swap_columns(const KktPlan *plan, KktFactors *f, int a, int b) {
  size_t stride = (size_t)plan->stride;
  double *m = f->matrix, kept;
#define SWAP(one, other) (kept = (one), (one) = (other), (other) = kept)
  for (int c = f->first; c < a; c++) SWAP(m[(size_t)c * stride + (size_t)a], m[(size_t)c * stride + (size_t)b]);
  SWAP(m[(size_t)a * (stride + 1)], m[(size_t)b * (stride + 1)]);
  for (int i = a + 1; i < b; i++) SWAP(m[(size_t)a * stride + (size_t)i], m[(size_t)i * stride + (size_t)b]);
  for (int i = b + 1; i < f->size; i++) SWAP(m[(size_t)a * stride + (size_t)i], m[(size_t)b * stride + (size_t)i]);
#undef SWAP
  int unknown = f->after[a];
  f->after[a] = f->after[b];
  f->after[b] = unknown;
}

/* Bring the pairs that were eliminated to the front of the others. */
static void set_pairs_aside(const KktPlan *plan, const KktFront *front, KktFactors *f) {
  memcpy(f->after + f->first, f->before + f->first, sizeof(int) * (size_t)(f->size - f->first));
  f->start = f->first + 2 * f->pairs;
  if (!f->pairs || (f->first == f->shift && f->pairs == front->pairs)) return;
  int gone = f->first; /* next place for an eliminated column */
  for (int side = 0; side < 2; side++)
    for (int t = 0; t < f->pairs; t++, gone++) {
      int at = f->shift + side * front->pairs + f->pair[t], unknown = f->before[at];
      for (at = gone; f->after[at] != unknown;) at++;
      if (at != gone) swap_columns(plan, f, gone, at);
    }
}

/* -------------------------------------------------------------------- one front */

static int keep_factors(const KktPlan *plan, KktFactors *f) {
  int padded = (f->size + 7) & ~7;
  size_t count = 0;
  for (int k = f->start; k < f->pivots; k++) count += (size_t)(padded - (k & ~7));
  if (!kkt_grow(&f->lower, count)) return KKT_NO_MEMORY;
  double *to = f->lower.values;
  for (int k = f->start; k < f->pivots; k++) {
    int top = k & ~7;
    memcpy(to, f->matrix + (size_t)k * (size_t)plan->stride + top, sizeof(double) * (size_t)(padded - top));
    to += padded - top;
  }
  return KKT_DONE;
}

/* Pivots may be the smaller the more columns wait: a column that waits for ever makes the matrix singular. */
static double threshold(double usual, int waiting) { return waiting <= 6 ? usual : waiting <= 12 ? 1e-3 * usual : 1e-6 * usual; }

static int factorise_front(Chain *chain, int k, int which) {
  KktMatrix *matrix = chain->matrix;
  KktPlan *plan = chain->plan;
  const KktFront *front = &plan->front[k];
  KktFactors *f = &plan->factors[k];
  KktWork *work = chain->work;
  int status = place(plan, k, f, work->matrix[which]);
  if (status) return status;
  double *to = origin(plan, f);
  clear(plan, f);
  memset(work->values, 0, sizeof(double) * (size_t)front->group_values);
  memset(work->product, 0, sizeof(double) * (size_t)front->products);
  add_entries(matrix, front, work, to);
  add_condensed_rows(matrix, front, work, to);
  add_panel(front, plan->stride, work, to);
  substitute(matrix, plan, front, work, to);
  add_children(plan, front, f);
  if ((status = take_pairs(matrix, plan, front, f))) return status;
  if (f->pairs) eliminate_pairs(matrix, plan, front, f, work);
  set_pairs_aside(plan, front, f);
  KktDense dense = {
    .matrix = f->matrix, .stride = plan->stride, .first = f->start, .end = f->end, .size = f->size,
    .threshold = threshold(matrix->threshold, f->shift - f->first), .unknown = f->after,
    .rounding = matrix->rounding, .diagonal = f->diagonal, .work = work->columns,
  };
  MT_CHOOSE(mt_kkt_eliminate)(&dense);
  if (dense.failed) return KKT_NO_NUMBER;
  f->pivots = dense.pivots;
  f->negative = dense.negative + f->pairs;
  f->rows = f->pairs;
  for (int i = f->start; i < f->pivots; i++) f->rows += f->after[i] >= matrix->pattern->variables;
  if (front->parent < 0 && f->pivots < f->end) return KKT_SINGULAR;
  return keep_factors(plan, f);
}

/* -------------------------------------------------------------------- chains of fronts */

enum { WAITING_MOST = 8 };

/* Whether the block of the equality rows that wait has no positive eigenvalue in the Schur complement, nor a doubtful
 * one; *count is how many wait. By Cholesky's method on the block's negative. */
static int rows_that_wait_are_negative(const KktMatrix *matrix, const KktPlan *plan, const KktFactors *f, int *count) {
  int at[WAITING_MOST], rows = 0;
  double a[WAITING_MOST][WAITING_MOST];
  for (int i = f->pivots; i < f->size; i++) {
    if (f->after[i] < matrix->pattern->variables) continue;
    if (rows < WAITING_MOST) at[rows] = i;
    rows++;
  }
  *count = rows;
  if (rows > WAITING_MOST) return 0;
  for (int i = 0; i < rows; i++)
    for (int j = 0; j <= i; j++) a[i][j] = -f->matrix[(size_t)at[j] * (size_t)plan->stride + (size_t)at[i]];
  for (int k = 0; k < rows; k++) {
    double tiny = 1e-12 * (1 + matrix->rounding[f->after[at[k]]]);
    if (a[k][k] < -tiny) return 0;
    for (int i = k + 1; i < rows; i++) {
      if (a[k][k] <= tiny) {
        if (fabs(a[i][k]) > tiny) return 0;
        continue;
      }
      double factor = a[i][k] / a[k][k];
      for (int j = k + 1; j <= i; j++) a[i][j] -= factor * a[j][k];
    }
  }
  return 1;
}

/* Factorise the fronts of a chain.
 *
 * The equality rows that no front has reached form a zero block, or a negative one, in what is left; so do those that
 * wait, where that is found. What is left then has at least as many negative eigenvalues as there are such rows, and
 * more negative pivots than rows eliminated are too many in the whole: the factorisation need not go on. */
static void run_chain(Chain *chain) {
  int which = 0, negative = 0, rows = 0;
  for (int k = chain->from; k != chain->until; k += chain->step, which ^= 1) {
    const KktFactors *f = &chain->plan->factors[k];
    int waiting;
    chain->status = factorise_front(chain, k, which);
    if (chain->status) {
      atomic_store(chain->stop, 1);
      return;
    }
    chain->fronts++;
    negative += f->negative;
    rows += f->rows;
    if (chain->break_off && negative > rows &&
        (rows_that_wait_are_negative(chain->matrix, chain->plan, f, &waiting) || negative > rows + waiting)) {
      chain->excess = 1;
      atomic_store(chain->stop, 1);
      return;
    }
    if (atomic_load_explicit(chain->stop, memory_order_relaxed)) return;
  }
}

static void run_one(void *context, int index) { run_chain(&((Chain *)context)[index]); }

/* The 2 × 2 blocks [σ e; e δ] of slacks and inequality rows: determinants, and negative eigenvalues; −1: a singular one. */
static int condense(KktMatrix *matrix) {
  const KktPattern *p = matrix->pattern;
  int negative = 0;
  for (int d = 0; d < p->slacks; d++) {
    double sigma = p->slack_diagonal[d] < 0 ? 0 : matrix->value[p->slack_diagonal[d]];
    double delta = p->row_diagonal[d] < 0 ? 0 : matrix->value[p->row_diagonal[d]], e = matrix->value[p->coupling[d]];
    double determinant = sigma * delta - e * e;
    if (!(fabs(determinant) > 0) || !isfinite(determinant)) return -1;
    matrix->determinant[d] = determinant;
    negative += determinant < 0 ? 1 : sigma < 0 ? 2 : 0;
  }
  return negative;
}

KktOutcome kkt_factorise(KktMatrix *matrix, KktPlan *plan, int break_off) {
  const KktPattern *p = matrix->pattern;
  KktOutcome outcome = {0};
  atomic_int stop = 0;
  int condensed = condense(matrix), last = plan->fronts - 1;
  if (condensed < 0) return (KktOutcome){.status = KKT_SINGULAR};
  memset(matrix->rounding, 0, sizeof(double) * (size_t)p->size);
  Chain chains[3] = {
    {.from = 0, .until = plan->root, .step = 1},
    {.from = last, .until = plan->root, .step = -1},
    {.from = plan->root, .until = plan->root + 1, .step = 1},
  };
  for (int i = 0; i < 3; i++) {
    chains[i].matrix = matrix;
    chains[i].plan = plan;
    chains[i].work = &plan->work[i];
    chains[i].break_off = break_off;
    chains[i].stop = &stop;
  }
  if (mt_threads() > 1) {
    mt_parallel(2, run_one, chains);
  } else {
    run_chain(&chains[matrix->from_end_first]);
    if (!atomic_load(&stop)) run_chain(&chains[!matrix->from_end_first]);
  }
  if (chains[0].excess != chains[1].excess) matrix->from_end_first = chains[1].excess;
  if (!atomic_load(&stop)) run_chain(&chains[2]);
  for (int i = 0; i < 3; i++) {
    outcome.fronts += chains[i].fronts;
    if (chains[i].status) outcome.status = chains[i].status;
    if (chains[i].excess) outcome.negative = p->size;
  }
  outcome.complete = !atomic_load(&stop);
  if (outcome.complete) {
    outcome.negative = condensed + plan->definitions.count;
    for (int k = 0; k < plan->fronts; k++) outcome.negative += plan->factors[k].negative;
  }
  return outcome;
}

/* -------------------------------------------------------------------- memory */

static double *numbers(KktPlan *plan, size_t count) { return kkt_take(&plan->arena, count + 64, sizeof(double)); }

void kkt_take_work(KktPlan *plan) {
  size_t stride = (size_t)plan->stride, panel = (size_t)((plan->panel_most + 7) & ~7);
  plan->factors = kkt_take(&plan->arena, (size_t)plan->fronts, sizeof(KktFactors));
  size_t pairs = 0, z = (size_t)plan->z_values_most;
  for (int k = 0; k < plan->fronts; k++) {
    const KktFront *front = &plan->front[k];
    KktFactors *f = &plan->factors[k];
    f->before = kkt_take(&plan->arena, stride, sizeof(int));
    f->after = kkt_take(&plan->arena, stride, sizeof(int));
    f->pair = kkt_take(&plan->arena, (size_t)front->pairs + 1, sizeof(int));
    f->diagonal = numbers(plan, 2 * stride);
    if ((size_t)front->pairs > pairs) pairs = (size_t)front->pairs;
    if ((size_t)front->pair_start[front->pairs] > z) z = (size_t)front->pair_start[front->pairs];
  }
  size_t columns = pairs > KKT_PANEL + 2 ? pairs : KKT_PANEL + 2;
  for (int i = 0; i < 3; i++) {
    KktWork *work = &plan->work[i];
    for (int side = 0; side < 2; side++) work->matrix[side] = numbers(plan, stride * stride);
    work->values = numbers(plan, (size_t)plan->group_values_most);
    work->z = numbers(plan, z);
    work->product = numbers(plan, (size_t)plan->products_most);
    work->panel = numbers(plan, panel * (size_t)plan->panel_rows_most);
    work->weighted = numbers(plan, panel * (size_t)plan->panel_rows_most);
    work->weight = numbers(plan, (size_t)plan->panel_rows_most);
    work->square = numbers(plan, panel * panel);
    work->columns = numbers(plan, stride * columns);
    work->vector = numbers(plan, stride);
    work->line = numbers(plan, (size_t)plan->row_most);
  }
}

void kkt_free_plan(KktPlan *plan) {
  for (int k = 0; plan->factors && k < plan->fronts; k++) {
    kkt_release(&plan->factors[k].lower);
    kkt_release(&plan->factors[k].column);
  }
  kkt_give_back(&plan->scratch);
  kkt_give_back(&plan->arena);
  *plan = (KktPlan){0};
}
