/* A plan: the fronts, and the rows that define a variable. */
#include "kkt_plan.h"

#include <math.h>
#include <stdlib.h>

enum { SUBSTITUTION_MOST = 2500 }; /* products that a substitution may take: what it saves is about as much */
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
  int row, place, variable; /* place: among the entries of the rows */
  int conflicts;            /* other rows that could define something but have the variable in them */
  int reach;                /* fronts that the variable lives over */
  int products;             /* that the substitution takes */
} Candidate;

typedef struct {
  KktPlanning *planning;
  int *first, *last; /* fronts of each variable */
  int *degree;       /* other unknowns that a variable meets */
  Candidate *candidate;
  int candidates;
} Choice;

static void find_degrees(Choice *choice) {
  const KktPattern *p = choice->planning->pattern;
  KktArena *arena = choice->planning->arena;
  int rows = p->equalities + p->slacks, *met = filled(arena, p->variables, -1);
  KktList *rows_with = kkt_take(arena, (size_t)p->variables + 1, sizeof(KktList));
  for (int r = 0; r < rows; r++)
    for (int q = p->rows.start[r]; q < p->rows.start[r + 1]; q++) kkt_push(arena, &rows_with[p->rows.column[q]], r);
  for (int i = 0; i < p->variables; i++) {
    if (p->knot[i] < 0) continue;
    choice->degree[i] = p->curvature.start[i + 1] - p->curvature.start[i];
    for (int q = p->curvature.start[i]; q < p->curvature.start[i + 1]; q++) met[p->curvature.column[q]] = i;
    for (int t = 0; t < rows_with[i].count; t++) {
      int r = rows_with[i].items[t];
      choice->degree[i] += r < p->equalities;
      for (int q = p->rows.start[r]; r >= p->equalities && q < p->rows.start[r + 1]; q++) {
        choice->degree[i] += met[p->rows.column[q]] != i;
        met[p->rows.column[q]] = i;
      }
    }
  }
}

/* Products that the substitution takes: what the variable meets, and the row itself, each with every entry of the row. */
static double products(const Choice *choice, int v, int length) { return (double)length * (choice->degree[v] + length); }

/* Whether a row may define the variable in place q: it is large enough, and lives where the row's others live too. */
static int may_define(const Choice *choice, int row, int q) {
  const KktPattern *p = choice->planning->pattern;
  const double *value = choice->planning->value;
  int v = p->rows.column[q], length = p->rows.start[row + 1] - p->rows.start[row];
  double largest = 0, own = fabs(value[p->rows.entry[q]]);
  if (p->knot[v] < 0 || own == 0 || products(choice, v, length) > SUBSTITUTION_MOST) return 0;
  for (int other = p->rows.start[row]; other < p->rows.start[row + 1]; other++) {
    int j = p->rows.column[other];
    largest = fmax(largest, fabs(value[p->rows.entry[other]]));
    if (choice->first[j] > choice->first[v] || choice->last[j] < choice->last[v]) return 0;
  }
  return own >= DEFINES * largest;
}

static void find_candidates(Choice *choice) {
  const KktPattern *p = choice->planning->pattern;
  KktArena *arena = choice->planning->arena;
  int *rows_with = filled(arena, p->variables, 0);
  choice->candidate = kkt_take(arena, (size_t)p->rows.start[p->equalities] + 1, sizeof(Candidate));
  for (int row = 0; row < p->equalities; row++) {
    int before = choice->candidates;
    for (int q = p->rows.start[row]; q < p->rows.start[row + 1]; q++) {
      if (!may_define(choice, row, q)) continue;
      int v = p->rows.column[q], length = p->rows.start[row + 1] - p->rows.start[row];
      choice->candidate[choice->candidates++] = (Candidate){
        .row = row, .place = q, .variable = v, .reach = choice->last[v] - choice->first[v], .products = (int)products(choice, v, length),
      };
    }
    if (choice->candidates > before)
      for (int q = p->rows.start[row]; q < p->rows.start[row + 1]; q++) rows_with[p->rows.column[q]]++;
  }
  for (int i = 0; i < choice->candidates; i++) choice->candidate[i].conflicts = rows_with[choice->candidate[i].variable] - 1;
}

static int compare_candidates(const void *one, const void *other) {
  const Candidate *a = one, *b = other;
  if (a->conflicts != b->conflicts) return a->conflicts < b->conflicts ? -1 : 1;
  if (a->reach != b->reach) return a->reach > b->reach ? -1 : 1;
  if (a->products != b->products) return a->products < b->products ? -1 : 1;
  return (a->place > b->place) - (a->place < b->place);
}

void kkt_choose_definitions(KktPlanning *planning) {
  const KktPattern *p = planning->pattern;
  KktDefinitions *chosen = &planning->plan->definitions;
  Choice choice = {.planning = planning};
  choice.first = filled(planning->arena, p->variables, 0);
  choice.last = filled(planning->arena, p->variables, 0);
  choice.degree = filled(planning->arena, p->variables, 0);
  char *in_row = kkt_take(planning->arena, (size_t)p->variables + 1, 1); /* variables in a row that defines another */
  find_ranges(planning, choice.first, choice.last);
  find_degrees(&choice);
  find_candidates(&choice);
  qsort(choice.candidate, (size_t)choice.candidates, sizeof(Candidate), compare_candidates);
  for (int i = 0; i < choice.candidates; i++) {
    const Candidate *c = &choice.candidate[i];
    int free_of_others = chosen->of_row[c->row] < 0 && !in_row[c->variable];
    for (int q = p->rows.start[c->row]; q < p->rows.start[c->row + 1] && free_of_others; q++)
      free_of_others = chosen->of_variable[p->rows.column[q]] < 0;
    if (!free_of_others) continue;
    chosen->variable[chosen->count] = c->variable;
    chosen->row[chosen->count] = c->row;
    chosen->entry[chosen->count] = p->rows.entry[c->place];
    chosen->of_variable[c->variable] = chosen->of_row[c->row] = chosen->count++;
    for (int q = p->rows.start[c->row]; q < p->rows.start[c->row + 1]; q++) in_row[p->rows.column[q]] = 1;
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
  plan->row_meets = kkt_take(&plan->arena, (size_t)p->slacks + 1, 1);
  for (int i = 0; i < p->slacks; i++)
    for (int q = p->rows.start[p->equalities + i]; q < p->rows.start[p->equalities + i + 1]; q++)
      if (d->of_variable[p->rows.column[q]] >= 0) plan->row_meets[i] = 1;
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
