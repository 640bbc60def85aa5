/* A plan: the fronts, and the rows that define a variable. */
#include "kkt_plan.h"

#include <math.h>
#include <string.h>

enum { SUBSTITUTION_MOST = 6000 }; /* products that a substitution may take: what it saves is about as much */
#define DEFINES 0.01               /* least |a| of a defined variable, as a share of the largest in its row */

static int *filled(KktArena *arena, int count, int value) {
  int *array = kkt_take(arena, (size_t)count + 1, sizeof(int));
  for (int i = 0; i < count; i++) array[i] = value;
  return array;
}

/* Two chains of fronts, from the first and the last knot to the middle. */
static void make_tree(KktPlanning *planning) {
  KktPlan *plan = planning->plan;
  int count = 0;
  plan->fronts = planning->pattern->knots;
  plan->root = plan->fronts / 2;
  plan->front = kkt_take(&plan->arena, (size_t)plan->fronts, sizeof(KktFront));
  planning->order = filled(planning->arena, plan->fronts, 0);
  for (int k = 0; k < plan->root; k++) planning->order[count++] = k;
  for (int k = plan->fronts - 1; k > plan->root; k--) planning->order[count++] = k;
  planning->order[count] = plan->root;
  for (int k = 0; k < plan->fronts; k++) {
    plan->front[k].parent = k == plan->root ? -1 : k < plan->root ? k + 1 : k - 1;
    if (k != plan->root) {
      KktFront *parent = &plan->front[plan->front[k].parent];
      parent->child[parent->children++] = k;
    }
  }
}

static int front_of_entry(const KktPlanning *planning, int e) {
  const int *knot = planning->pattern->knot;
  int a = knot[planning->pattern->row[e]], b = knot[planning->pattern->column[e]];
  return kkt_front_of(planning->plan, a > b ? a : b);
}

static void sort_by_front(KktPlanning *planning) {
  const KktPattern *p = planning->pattern;
  size_t fronts = (size_t)planning->plan->fronts;
  KktArena *arena = planning->arena;
  planning->curvature_at = kkt_take(arena, fronts, sizeof(KktList));
  planning->rows_at = kkt_take(arena, fronts, sizeof(KktList));
  planning->defined_at = kkt_take(arena, fronts, sizeof(KktList));
  planning->seen_at = kkt_take(arena, fronts, sizeof(KktList));
  planning->pair_at = kkt_take(arena, fronts, sizeof(KktList));
  planning->rest_at = kkt_take(arena, fronts, sizeof(KktList));
  planning->border_at = kkt_take(arena, fronts, sizeof(KktList));
  for (int e = 0; e < p->entries; e++)
    if (p->row[e] < p->variables) kkt_push(arena, &planning->curvature_at[front_of_entry(planning, e)], e);
  for (int r = 0; r < p->equalities + p->slacks; r++)
    kkt_push(arena, &planning->rows_at[kkt_front_of(planning->plan, p->home[r])], r);
}

/* The first and the last front that each variable has an entry in. */
static void find_ranges(const KktPlanning *planning, int *first, int *last) {
  const KktPattern *p = planning->pattern;
  for (int i = 0; i < p->variables; i++) first[i] = planning->plan->fronts, last[i] = -1;
  for (int k = 0; k < planning->plan->fronts; k++) {
    for (int t = 0; t < planning->curvature_at[k].count; t++) {
      int e = planning->curvature_at[k].items[t], ends[2] = {p->row[e], p->column[e]};
      for (int side = 0; side < 2; side++) {
        if (k < first[ends[side]]) first[ends[side]] = k;
        if (k > last[ends[side]]) last[ends[side]] = k;
      }
    }
    for (int t = 0; t < planning->rows_at[k].count; t++) {
      int r = planning->rows_at[k].items[t];
      for (int q = p->rows.start[r]; q < p->rows.start[r + 1]; q++) {
        int i = p->rows.column[q];
        if (k < first[i]) first[i] = k;
        if (k > last[i]) last[i] = k;
      }
    }
  }
}

typedef struct {
  KktPlanning *planning;
  int *first, *last;     /* fronts of each variable */
  int *degree;           /* entries and row columns that a variable meets */
  char *of_row;          /* variables in a row that defines another */
} Choice;

/* How many products the substitution of a variable by a row takes; −1 where it must not be. */
static int price(const Choice *choice, int row, int q) {
  const KktPattern *p = choice->planning->pattern;
  const KktDefinitions *chosen = &choice->planning->plan->definitions;
  int v = p->rows.column[q], length = p->rows.start[row + 1] - p->rows.start[row];
  double largest = 0, own = fabs(choice->planning->value[p->rows.entry[q]]);
  if (p->knot[v] < 0 || choice->of_row[v] || chosen->of_variable[v] >= 0) return -1;
  for (int other = p->rows.start[row]; other < p->rows.start[row + 1]; other++) {
    int j = p->rows.column[other];
    double size = fabs(choice->planning->value[p->rows.entry[other]]);
    if (size > largest) largest = size;
    if (j == v) continue;
    if (chosen->of_variable[j] >= 0 || choice->first[j] > choice->first[v] || choice->last[j] < choice->last[v]) return -1;
  }
  if (!(own >= DEFINES * largest) || own == 0) return -1;
  return choice->degree[v] < SUBSTITUTION_MOST ? length * choice->degree[v] : -1;
}

static void define(Choice *choice, int row, int q) {
  const KktPattern *p = choice->planning->pattern;
  KktDefinitions *chosen = &choice->planning->plan->definitions;
  int v = p->rows.column[q];
  chosen->variable[chosen->count] = v;
  chosen->row[chosen->count] = row;
  chosen->entry[chosen->count] = p->rows.entry[q];
  chosen->of_variable[v] = chosen->of_row[row] = chosen->count++;
  for (int other = p->rows.start[row]; other < p->rows.start[row + 1]; other++) choice->of_row[p->rows.column[other]] = 1;
}

void kkt_choose_definitions(KktPlanning *planning) {
  const KktPattern *p = planning->pattern;
  Choice choice = {.planning = planning};
  choice.first = filled(planning->arena, p->variables, 0);
  choice.last = filled(planning->arena, p->variables, 0);
  choice.degree = filled(planning->arena, p->variables, 0);
  choice.of_row = kkt_take(planning->arena, (size_t)p->variables, 1);
  find_ranges(planning, choice.first, choice.last);
  for (int i = 0; i < p->variables; i++) choice.degree[i] = p->curvature.start[i + 1] - p->curvature.start[i];
  for (int r = 0; r < p->equalities + p->slacks; r++) {
    int length = p->rows.start[r + 1] - p->rows.start[r];
    for (int q = p->rows.start[r]; q < p->rows.start[r + 1]; q++)
      choice.degree[p->rows.column[q]] += r < p->equalities ? 1 : length;
  }
  for (int row = 0; row < p->equalities; row++) {
    int best = -1, cost = 0;
    for (int q = p->rows.start[row]; q < p->rows.start[row + 1]; q++) {
      int asked = price(&choice, row, q), v = p->rows.column[q];
      if (asked < 0 || asked > SUBSTITUTION_MOST) continue;
      int longer = best < 0 ? 1 : choice.last[v] - choice.first[v] - choice.last[p->rows.column[best]] + choice.first[p->rows.column[best]];
      if (longer > 0 || (longer == 0 && asked < cost)) best = q, cost = asked;
    }
    if (best >= 0) define(&choice, row, best);
  }
}

static void start_definitions(KktPlan *plan, const KktPattern *p) {
  KktDefinitions *d = &plan->definitions;
  d->variable = filled(&plan->arena, p->equalities, 0);
  d->row = filled(&plan->arena, p->equalities, 0);
  d->entry = filled(&plan->arena, p->equalities, 0);
  d->of_variable = filled(&plan->arena, p->variables, -1);
  d->of_row = filled(&plan->arena, p->equalities, -1);
}

/* List what the defined variables have entries with. */
static void find_meetings(KktPlan *plan, const KktPattern *p, KktArena *scratch) {
  const KktDefinitions *d = &plan->definitions;
  KktList *other = kkt_take(scratch, (size_t)d->count + 1, sizeof(KktList));
  KktList *entry = kkt_take(scratch, (size_t)d->count + 1, sizeof(KktList));
  int total = 0, *start = filled(&plan->arena, d->count, 0);
  for (int i = 0; i < d->count; i++)
    for (int q = p->curvature.start[d->variable[i]]; q < p->curvature.start[d->variable[i] + 1]; q++) {
      kkt_push(scratch, &other[i], p->curvature.column[q]);
      kkt_push(scratch, &entry[i], p->curvature.entry[q]);
    }
  for (int r = 0; r < p->equalities; r++)
    for (int q = p->rows.start[r]; q < p->rows.start[r + 1]; q++) {
      int i = d->of_variable[p->rows.column[q]];
      if (i < 0 || d->row[i] == r) continue;
      kkt_push(scratch, &other[i], kkt_equality(p, r));
      kkt_push(scratch, &entry[i], p->rows.entry[q]);
    }
  for (int i = 0; i < d->count; i++) start[i] = total, total += other[i].count;
  start[d->count] = total;
  plan->meets = (KktRows){start, filled(&plan->arena, total, 0), filled(&plan->arena, total, 0)};
  for (int i = 0; i < d->count; i++)
    for (int t = 0; t < other[i].count; t++) {
      plan->meets.column[start[i] + t] = other[i].items[t];
      plan->meets.entry[start[i] + t] = entry[i].items[t];
    }
}

void kkt_make_plan(KktPlan *plan, const KktPattern *p, const double *value, int substitute) {
  KktPlanning planning = {.arena = &plan->scratch, .plan = plan, .pattern = p, .value = value};
  plan->pattern = p;
  plan->scratch.failure = plan->arena.failure;
  make_tree(&planning);
  start_definitions(plan, p);
  sort_by_front(&planning);
  if (substitute) kkt_choose_definitions(&planning);
  kkt_choose_eliminations(&planning);
  kkt_lay_out(&planning);
  find_meetings(plan, p, &plan->scratch);
  kkt_give_back(&plan->scratch);
}
