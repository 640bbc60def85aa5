/* What each front eliminates: a variable where nothing further on refers to it, a row with a variable of its own. */
#include "kkt_plan.h"

#include <math.h>
#include <string.h>

enum { START = 1, END = 2, ROOT = 4 };
enum { PAIR_COLUMNS_MOST = 8 }; /* columns of a row that is eliminated as a pair */
#define PAIRS 0.1               /* least |a| of a pair's variable, as a share of the largest in its row */

typedef struct {
  KktPlanning *planning;
  int *fronts_left;  /* fronts that refer to an unknown and have not come yet */
  int *done;         /* the front that eliminates an unknown, −1: none yet */
  int *mate;         /* the row that a variable is eliminated with, −1: none */
  int *visited, visit;
  int *mark, stamp;
  char *is_pair;
  char *halves;      /* of the tree that refer to an unknown: the root is in both */
  KktList *columns;  /* of each equality row: the variables in the fronts that it has entries with */
} Elimination;

static int marked(Elimination *x, int unknown) {
  int was = x->mark[unknown] == x->stamp;
  x->mark[unknown] = x->stamp;
  return was;
}

/* Note that a front refers to a variable; one that is defined stands for the columns of its row. */
static void see(Elimination *x, int k, int unknown) {
  KktPlanning *planning = x->planning;
  const KktPattern *p = planning->pattern;
  const KktDefinitions *d = &planning->plan->definitions;
  if (marked(x, unknown)) return;
  int definition = unknown < p->variables ? d->of_variable[unknown] : -1;
  if (definition < 0) {
    kkt_push(planning->arena, &planning->seen_at[k], unknown);
    x->fronts_left[unknown]++;
    x->halves[unknown] |= (k <= planning->plan->root ? START : 0) | (k >= planning->plan->root ? END : 0);
    if (k == planning->plan->root) x->halves[unknown] |= ROOT;
    return;
  }
  kkt_push(planning->arena, &planning->defined_at[k], definition);
  int row = d->row[definition];
  for (int q = p->rows.start[row]; q < p->rows.start[row + 1]; q++)
    if (p->rows.column[q] != unknown) see(x, k, p->rows.column[q]);
}

static void see_all(Elimination *x) {
  const KktPattern *p = x->planning->pattern;
  for (int k = 0; k < x->planning->plan->fronts; k++) {
    const KktList *entries = &x->planning->curvature_at[k], *rows = &x->planning->rows_at[k];
    x->stamp++;
    for (int t = 0; t < entries->count; t++) {
      see(x, k, p->row[entries->items[t]]);
      see(x, k, p->column[entries->items[t]]);
    }
    for (int t = 0; t < rows->count; t++) {
      int r = rows->items[t];
      if (r < p->equalities && x->planning->plan->definitions.of_row[r] >= 0) continue;
      for (int q = p->rows.start[r]; q < p->rows.start[r + 1]; q++) see(x, k, p->rows.column[q]);
      if (r < p->equalities) see(x, k, kkt_equality(p, r));
    }
  }
  for (int i = 0; i < p->size; i++) /* what both halves refer to is eliminated in the root */
    if (x->halves[i] == (START | END)) {
      kkt_push(x->planning->arena, &x->planning->seen_at[x->planning->plan->root], i);
      x->fronts_left[i]++;
    }
}

static void find_columns(Elimination *x) {
  const KktPattern *p = x->planning->pattern;
  const KktDefinitions *d = &x->planning->plan->definitions;
  KktArena *arena = x->planning->arena;
  x->columns = kkt_take(arena, (size_t)p->equalities, sizeof(KktList));
  for (int r = 0; r < p->equalities; r++) {
    if (d->of_row[r] >= 0) continue;
    for (int q = p->rows.start[r]; q < p->rows.start[r + 1]; q++) {
      int i = p->rows.column[q], definition = d->of_variable[i];
      if (definition < 0) {
        kkt_push(arena, &x->columns[r], i);
        continue;
      }
      int row = d->row[definition];
      for (int z = p->rows.start[row]; z < p->rows.start[row + 1]; z++)
        if (p->rows.column[z] != i) kkt_push(arena, &x->columns[r], p->rows.column[z]);
    }
  }
}

/* Find a variable of front k for a row, moving the rows of others to other ones (H. W. Kuhn, 1955). */
static int augment(Elimination *x, int k, int row) {
  for (int t = 0; t < x->columns[row].count; t++) {
    int i = x->columns[row].items[t];
    if (x->done[i] != k || x->is_pair[i] || x->visited[i] == x->visit) continue;
    x->visited[i] = x->visit;
    if (x->mate[i] < 0 || augment(x, k, x->mate[i])) {
      x->mate[i] = row;
      return 1;
    }
  }
  return 0;
}

/* The variable of front k that a row of few columns is eliminated with, −1: none. */
static int pair_of(const Elimination *x, int k, int row) {
  const KktPattern *p = x->planning->pattern;
  const double *value = x->planning->value;
  const KktDefinitions *d = &x->planning->plan->definitions;
  int best = -1;
  double largest = 0, own = 0;
  if (p->rows.start[row + 1] - p->rows.start[row] > PAIR_COLUMNS_MOST) return -1;
  for (int q = p->rows.start[row]; q < p->rows.start[row + 1]; q++) {
    int i = p->rows.column[q];
    double size = fabs(value[p->rows.entry[q]]);
    if (x->is_pair[i] == 1 || d->of_variable[i] >= 0) return -1;
    if (size > largest) largest = size;
    if (x->done[i] == k && !x->is_pair[i] && size > own) own = size, best = i;
  }
  return own >= PAIRS * largest ? best : -1;
}

/* is_pair: 1 a pair's variable, 2 a variable in the row of one, which must not become the variable of another. */
static void choose_pairs(Elimination *x, int k, const KktList *all) {
  KktPlanning *planning = x->planning;
  const KktPattern *p = planning->pattern;
  for (int t = 0; t < all->count; t++) {
    int y = all->items[t], row = y - kkt_equality(p, 0);
    if (!kkt_is_equality(p, y) || x->fronts_left[y] || kkt_front_of(planning->plan, p->home[row]) != k) continue;
    int v = pair_of(x, k, row);
    if (v < 0) continue;
    for (int q = p->rows.start[row]; q < p->rows.start[row + 1]; q++) x->is_pair[p->rows.column[q]] = 2;
    x->is_pair[v] = x->is_pair[y] = 1;
    x->mate[v] = row;
    x->done[y] = k;
    kkt_push(planning->arena, &planning->pair_at[k], v);
    kkt_push(planning->arena, &planning->pair_at[k], y);
  }
  for (int t = 0; t < all->count; t++)
    if (all->items[t] < p->variables && x->is_pair[all->items[t]] == 2) x->is_pair[all->items[t]] = 0;
}

/* A row that waits although a variable of it was eliminated now has entries with all variables of the border. */
static void spread_waiting_row(Elimination *x, int k, int row, const KktList *all) {
  KktList *columns = &x->columns[row];
  int touched = 0;
  for (int t = 0; t < columns->count && !touched; t++) touched = x->done[columns->items[t]] == k;
  if (!touched) return;
  for (int t = 0; t < all->count; t++) {
    int i = all->items[t];
    if (i < x->planning->pattern->variables && x->done[i] < 0) kkt_push(x->planning->arena, columns, i);
  }
}

static void eliminate(Elimination *x, int k) {
  KktPlanning *planning = x->planning;
  const KktPattern *p = planning->pattern;
  const KktFront *front = &planning->plan->front[k];
  KktList all = {0};
  int root = front->parent < 0;
  x->stamp++;
  for (int c = 0; c < front->children; c++) {
    const KktList *border = &planning->border_at[front->child[c]];
    for (int t = 0; t < border->count; t++)
      if (!marked(x, border->items[t])) kkt_push(planning->arena, &all, border->items[t]);
  }
  for (int t = 0; t < planning->seen_at[k].count; t++) {
    int i = planning->seen_at[k].items[t];
    x->fronts_left[i]--;
    if (!marked(x, i)) kkt_push(planning->arena, &all, i);
  }
  for (int t = 0; t < all.count; t++)
    if (all.items[t] < p->variables && (root || !x->fronts_left[all.items[t]])) x->done[all.items[t]] = k;
  choose_pairs(x, k, &all);
  for (int t = 0; t < all.count; t++) {
    int y = all.items[t];
    if (y < p->variables || x->done[y] >= 0 || (!root && x->fronts_left[y])) continue;
    x->visit++;
    if (root || augment(x, k, y - kkt_equality(p, 0))) x->done[y] = k;
  }
  for (int t = 0; t < all.count; t++) {
    int i = all.items[t];
    if (x->done[i] < 0) {
      if (i >= p->variables) spread_waiting_row(x, k, i - kkt_equality(p, 0), &all);
      kkt_push(planning->arena, &planning->border_at[k], i);
    } else if (x->is_pair[i] != 1) {
      kkt_push(planning->arena, &planning->rest_at[k], i);
    }
  }
}

void kkt_choose_eliminations(KktPlanning *planning) {
  size_t n = (size_t)planning->pattern->size;
  KktArena *arena = planning->arena;
  Elimination x = {.planning = planning};
  x.fronts_left = kkt_take(arena, n, sizeof(int));
  x.visited = kkt_take(arena, n, sizeof(int));
  x.mark = kkt_take(arena, n, sizeof(int));
  x.is_pair = kkt_take(arena, n, 1);
  x.halves = kkt_take(arena, n, 1);
  x.done = kkt_take(arena, n, sizeof(int));
  x.mate = kkt_take(arena, n, sizeof(int));
  for (size_t i = 0; i < n; i++) x.done[i] = x.mate[i] = -1;
  see_all(&x);
  find_columns(&x);
  for (int o = 0; o < planning->plan->fronts; o++) eliminate(&x, planning->order[o]);
}
