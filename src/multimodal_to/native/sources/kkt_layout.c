/* Positions in the fronts, and where every entry of the matrix goes in them. */
#include "kkt_plan.h"

#include <stdlib.h>
#include <string.h>

enum { PANEL_COLUMNS_LEAST = 20, MEMBERS_MOST = 8 };

static int compare(const void *a, const void *b) { return *(const int *)a - *(const int *)b; }

static int *kept(KktArena *arena, const KktList *list) {
  int *copy = kkt_take(arena, (size_t)list->count + 1, sizeof(int));
  if (list->count) memcpy(copy, list->items, sizeof(int) * (size_t)list->count);
  return copy;
}

/* -------------------------------------------------------------------- positions */

/* Sort a border by its places in the parent, and note the runs of consecutive ones. */
static void place_border(KktPlanning *planning, int k, int *place) {
  KktPlan *plan = planning->plan;
  KktList *border = &planning->border_at[k];
  KktFront *parent = &plan->front[plan->front[k].parent];
  int side = parent->child[0] == k ? 0 : 1, count = border->count;
  int *keys = kkt_take(planning->arena, 2 * (size_t)count + 1, sizeof(int));
  for (int i = 0; i < parent->size; i++) place[parent->unknown[i]] = i;
  for (int i = 0; i < count; i++) keys[2 * i] = place[border->items[i]], keys[2 * i + 1] = border->items[i];
  qsort(keys, (size_t)count, 2 * sizeof(int), compare);
  KktList from = {0}, to = {0}, length = {0};
  for (int i = 0; i < count; i++) {
    border->items[i] = keys[2 * i + 1];
    if (i && keys[2 * i] == keys[2 * i - 2] + 1) {
      length.items[length.count - 1]++;
    } else {
      kkt_push(planning->arena, &from, i);
      kkt_push(planning->arena, &to, keys[2 * i]);
      kkt_push(planning->arena, &length, 1);
    }
  }
  parent->runs[side] = from.count;
  parent->run_from[side] = kept(&plan->arena, &from);
  parent->run_to[side] = kept(&plan->arena, &to);
  parent->run_length[side] = kept(&plan->arena, &length);
}

static void place_unknowns(KktPlanning *planning, int k) {
  KktPlan *plan = planning->plan;
  KktFront *front = &plan->front[k];
  const KktList *pairs = &planning->pair_at[k], *rest = &planning->rest_at[k], *border = &planning->border_at[k];
  int count = 0;
  front->pairs = pairs->count / 2;
  front->eliminated = pairs->count + rest->count;
  front->size = front->eliminated + border->count;
  front->unknown = kkt_take(&plan->arena, (size_t)front->size + 1, sizeof(int));
  for (int side = 0; side < 2; side++)
    for (int i = side; i < pairs->count; i += 2) front->unknown[count++] = pairs->items[i];
  for (int i = 0; i < rest->count; i++) front->unknown[count++] = rest->items[i];
  for (int i = 0; i < border->count; i++) front->unknown[count++] = border->items[i];
  for (int i = 0; i < front->eliminated; i++) front->rows += kkt_is_equality(planning->pattern, front->unknown[i]);
}

static void measure(KktPlan *plan) {
  for (int k = 0; k < plan->fronts; k++) {
    const KktFront *front = &plan->front[k];
    double n = front->size - 2 * front->pairs, border = front->size - front->eliminated;
    if (front->size > plan->largest) plan->largest = front->size;
    plan->operations += (n * n * n - border * border * border) / 3;
  }
  plan->stride = (plan->largest + KKT_DELAYED_MOST + 7) / 8 * 8;
  if (plan->stride % 64 == 0) plan->stride += 8; /* columns must not all fall on the same lines of the cache */
}

/* -------------------------------------------------------------------- targets in one front */

enum { TO_FRONT, TO_VALUES, TO_PRODUCTS };

typedef struct {
  KktPlanning *planning;
  KktFront *front;
  int *place;      /* position of an unknown; of a defined variable −1 − its number among those of the front */
  int defined;
  int *group_of, *member_of; /* of each defined variable of the front */
  KktList *touched;          /* positions, of each group, with repeats until sorted */
  KktList products;          /* pairs of defined variables */
  char *seen;                /* of each position of the front, zeros between uses */
} Layout;

/* Return the positions of a list once each, rising. */
static KktList sorted(const Layout *x, const KktList *positions) {
  KktList once = {0};
  for (int i = 0; i < positions->count; i++) x->seen[positions->items[i]] = 1;
  for (int i = 0; i < x->front->size; i++) {
    if (x->seen[i]) kkt_push(x->planning->arena, &once, i);
    x->seen[i] = 0;
  }
  return once;
}

static const int *row_columns(const KktPlanning *planning, int definition, int *count) {
  const KktPattern *p = planning->pattern;
  int row = planning->plan->definitions.row[definition];
  *count = p->rows.start[row + 1] - p->rows.start[row];
  return p->rows.column + p->rows.start[row];
}

/* Whether two rows have the same columns beside the variables that they define. */
static int alike(const KktPlanning *planning, int one, int other) {
  int n, m, i = 0, j = 0;
  const int *a = row_columns(planning, one, &n), *b = row_columns(planning, other, &m);
  const int *variable = planning->plan->definitions.variable;
  if (n != m) return 0;
  for (;;) {
    if (i < n && a[i] == variable[one]) i++;
    if (j < m && b[j] == variable[other]) j++;
    if (i == n || j == m) return i == n && j == m;
    if (a[i++] != b[j++]) return 0;
  }
}

static void make_groups(Layout *x, int k) {
  const KktList *defined = &x->planning->defined_at[k];
  KktArena *arena = x->planning->arena, *own = &x->planning->plan->arena;
  KktFront *front = x->front;
  x->defined = defined->count;
  x->group_of = kkt_take(arena, (size_t)defined->count + 1, sizeof(int));
  x->member_of = kkt_take(arena, (size_t)defined->count + 1, sizeof(int));
  front->group = kkt_take(own, (size_t)defined->count + 1, sizeof(KktGroup));
  x->touched = kkt_take(arena, (size_t)defined->count + 1, sizeof(KktList));
  for (int i = 0; i < defined->count; i++) {
    int definition = defined->items[i], g = 0;
    while (g < front->groups && (front->group[g].members == MEMBERS_MOST ||
                                 !alike(x->planning, front->group[g].definition[0], definition)))
      g++;
    KktGroup *group = &front->group[g];
    if (g == front->groups) {
      front->groups++;
      group->definition = kkt_take(own, MEMBERS_MOST, sizeof(int));
    }
    x->group_of[i] = g;
    x->member_of[i] = group->members;
    group->definition[group->members++] = definition;
    x->place[x->planning->plan->definitions.variable[definition]] = -1 - i;
  }
}

static void fill_groups(Layout *x) {
  const KktPattern *p = x->planning->pattern;
  const KktDefinitions *d = &x->planning->plan->definitions;
  KktArena *own = &x->planning->plan->arena;
  for (int g = 0; g < x->front->groups; g++) {
    KktGroup *group = &x->front->group[g];
    int count;
    row_columns(x->planning, group->definition[0], &count);
    group->depends = count - 1;
    group->depend = kkt_take(own, (size_t)count, sizeof(int));
    group->slot = kkt_take(own, (size_t)count * (size_t)group->members, sizeof(int));
    group->z = x->front->z_values;
    x->front->z_values += group->depends * group->members;
    for (int m = 0; m < group->members; m++) {
      int row = d->row[group->definition[m]], at = 0;
      for (int q = p->rows.start[row]; q < p->rows.start[row + 1]; q++) {
        if (p->rows.column[q] == d->variable[group->definition[m]]) continue;
        group->depend[at] = x->place[p->rows.column[q]];
        group->slot[at++ * group->members + m] = p->rows.entry[q];
      }
    }
  }
}

static int product_of(Layout *x, int one, int other) {
  int a = one > other ? one : other, b = one > other ? other : one;
  for (int i = 0; i < x->products.count; i += 2)
    if (x->products.items[i] == a && x->products.items[i + 1] == b) return i / 2;
  kkt_push(x->planning->arena, &x->products, a);
  kkt_push(x->planning->arena, &x->products, b);
  return x->products.count / 2 - 1;
}

/* Note that two places have an entry, before the positions that a group touches are known. */
static void note(Layout *x, int a, int b) {
  if (a < 0 && b < 0) product_of(x, -1 - a, -1 - b);
  if (a < 0 && b >= 0) kkt_push(x->planning->arena, &x->touched[x->group_of[-1 - a]], b);
  if (b < 0 && a >= 0) kkt_push(x->planning->arena, &x->touched[x->group_of[-1 - b]], a);
}

static int group_value(const Layout *x, int defined, int position) {
  const KktGroup *group = &x->front->group[x->group_of[defined]];
  const int *found = bsearch(&position, group->position, (size_t)group->touched, sizeof(int), compare);
  return group->first + (int)(found - group->position) * group->members + x->member_of[defined];
}

/* Where the entry of two places goes. */
static int target_of(Layout *x, int a, int b, int *target) {
  if (a < 0 && b < 0) {
    *target = product_of(x, -1 - a, -1 - b);
    return TO_PRODUCTS;
  }
  if (a >= 0 && b >= 0) {
    *target = a > b ? b * x->planning->plan->stride + a : a * x->planning->plan->stride + b;
    return TO_FRONT;
  }
  *target = a < 0 ? group_value(x, -1 - a, b) : group_value(x, -1 - b, a);
  return TO_VALUES;
}

typedef void (*Visit)(Layout *x, int a, int b, int entry, KktList *lists);

static void visit_note(Layout *x, int a, int b, int entry, KktList *lists) {
  (void)entry, (void)lists;
  note(x, a, b);
}

static void visit_target(Layout *x, int a, int b, int entry, KktList *lists) {
  int target, kind = target_of(x, a, b, &target);
  kkt_push(x->planning->arena, &lists[2 * kind], entry);
  kkt_push(x->planning->arena, &lists[2 * kind + 1], target);
}

/* Every entry of the Hessian and of the equality rows that is in the front. */
static void visit_entries(Layout *x, int k, Visit visit, KktList *lists) {
  const KktPattern *p = x->planning->pattern;
  const KktList *entries = &x->planning->curvature_at[k], *rows = &x->planning->rows_at[k];
  for (int t = 0; t < entries->count; t++) {
    int e = entries->items[t];
    visit(x, x->place[p->row[e]], x->place[p->column[e]], e, lists);
  }
  for (int t = 0; t < rows->count; t++) {
    int r = rows->items[t];
    if (r >= p->equalities || x->planning->plan->definitions.of_row[r] >= 0) continue;
    int y = x->place[kkt_equality(p, r)];
    for (int q = p->rows.start[r]; q < p->rows.start[r + 1]; q++)
      visit(x, y, x->place[p->rows.column[q]], p->rows.entry[q], lists);
    if (p->equality_diagonal[r] >= 0) visit(x, y, y, p->equality_diagonal[r], lists);
  }
}

/* The columns of an inequality row, those in the front first; returns how many these are. */
static int split_row(const Layout *x, int r, KktList *places, KktList *slots) {
  const KktPattern *p = x->planning->pattern;
  int plain = 0;
  places->count = slots->count = 0;
  for (int defined = 0; defined < 2; defined++)
    for (int q = p->rows.start[r]; q < p->rows.start[r + 1]; q++) {
      int place = x->place[p->rows.column[q]];
      if ((place < 0) != defined) continue;
      kkt_push(x->planning->arena, places, place);
      kkt_push(x->planning->arena, slots, p->rows.entry[q]);
      plain += !defined;
    }
  return plain;
}

static void note_rows(Layout *x, int k) {
  const KktList *rows = &x->planning->rows_at[k];
  KktList places = {0}, slots = {0};
  for (int t = 0; t < rows->count; t++) {
    if (rows->items[t] < x->planning->pattern->equalities) continue;
    int plain = split_row(x, rows->items[t], &places, &slots);
    for (int a = plain; a < places.count; a++)
      for (int b = 0; b <= a; b++) note(x, places.items[a], places.items[b]);
  }
}

static void place_rows(Layout *x, int k) {
  const KktPattern *p = x->planning->pattern;
  const KktList *rows = &x->planning->rows_at[k];
  KktArena *arena = x->planning->arena, *own = &x->planning->plan->arena;
  KktFront *front = x->front;
  KktList places = {0}, slots = {0}, row = {0}, start = {0}, plain = {0}, inside = {0}, slot = {0}, target = {0};
  KktList columns = {0}, panel;
  kkt_push(arena, &start, 0);
  for (int t = 0; t < rows->count; t++) {
    if (rows->items[t] < p->equalities) continue;
    int count = split_row(x, rows->items[t], &places, &slots), in_panel = count >= PANEL_COLUMNS_LEAST, to;
    for (int a = in_panel ? count : 0; a < places.count; a++)
      for (int b = 0; b <= a; b++) {
        target_of(x, places.items[a], places.items[b], &to);
        kkt_push(arena, &target, to);
      }
    for (int a = 0; a < count && in_panel; a++) kkt_push(arena, &columns, places.items[a]);
    for (int a = 0; a < slots.count; a++) kkt_push(arena, &slot, slots.items[a]);
    kkt_push(arena, &row, rows->items[t] - p->equalities);
    kkt_push(arena, &plain, count);
    kkt_push(arena, &inside, in_panel);
    kkt_push(arena, &start, slot.count);
    front->panel_rows += in_panel;
    if (places.count > x->planning->plan->row_most) x->planning->plan->row_most = places.count;
  }
  panel = sorted(x, &columns);
  front->panel = panel.count;
  front->panel_position = kept(own, &panel);
  front->panel_place = kkt_take(own, (size_t)columns.count + 1, sizeof(int));
  for (int i = 0; i < columns.count; i++) {
    const int *found = bsearch(&columns.items[i], panel.items, (size_t)panel.count, sizeof(int), compare);
    front->panel_place[i] = (int)(found - panel.items);
  }
  front->condensed = row.count;
  front->row = kept(own, &row);
  front->row_start = kept(own, &start);
  front->row_plain = kept(own, &plain);
  front->row_in_panel = kept(own, &inside);
  front->row_slot = kept(own, &slot);
  front->row_target = kept(own, &target);
}

/* h between two defined variables goes to the one with the longer row, as h·z of the other; its own h by halves. */
static void direct_product(const Layout *x, int product, int *to, int *from) {
  int a = x->products.items[2 * product], b = x->products.items[2 * product + 1];
  const KktGroup *group = x->front->group;
  int longer = group[x->group_of[a]].depends >= group[x->group_of[b]].depends;
  *to = longer ? a : b;
  *from = longer ? b : a;
}

static void sort_touched(Layout *x) {
  KktArena *arena = x->planning->arena;
  KktFront *front = x->front;
  for (int i = 0; i < x->products.count / 2; i++) {
    int to, from;
    direct_product(x, i, &to, &from);
    const KktGroup *group = &front->group[x->group_of[from]];
    for (int z = 0; z < group->depends; z++) kkt_push(arena, &x->touched[x->group_of[to]], group->depend[z]);
  }
  for (int g = 0; g < front->groups; g++) {
    KktList unique = sorted(x, &x->touched[g]);
    front->group[g].touched = unique.count;
    front->group[g].position = kept(&x->planning->plan->arena, &unique);
    front->group[g].first = front->group_values;
    front->group_values += unique.count * front->group[g].members;
  }
}

static void place_products(Layout *x) {
  KktArena *arena = x->planning->arena, *own = &x->planning->plan->arena;
  KktFront *front = x->front;
  KktList product = {0}, z_of = {0}, target = {0}, half = {0};
  front->products = x->products.count / 2;
  for (int i = 0; i < front->products; i++) {
    int to, from;
    direct_product(x, i, &to, &from);
    const KktGroup *group = &front->group[x->group_of[from]];
    for (int z = 0; z < group->depends; z++) {
      kkt_push(arena, &product, i);
      kkt_push(arena, &z_of, group->z + z * group->members + x->member_of[from]);
      kkt_push(arena, &target, group_value(x, to, group->depend[z]));
      kkt_push(arena, &half, to == from);
    }
  }
  front->spreads = product.count;
  front->spread_product = kept(own, &product);
  front->spread_z = kept(own, &z_of);
  front->spread_target = kept(own, &target);
  front->spread_half = kept(own, &half);
}

static void sort_pairs(Layout *x, const KktList *position, const KktList *start) {
  KktArena *arena = x->planning->arena, *own = &x->planning->plan->arena;
  KktFront *front = x->front;
  int *keys = kkt_take(arena, 2 * (size_t)position->count + 1, sizeof(int));
  for (int i = 0; i < position->count; i++) keys[2 * i] = position->items[i], keys[2 * i + 1] = i;
  qsort(keys, (size_t)position->count, 2 * sizeof(int), compare);
  KktList target = {0}, first = {0}, pair = {0}, slot = {0};
  for (int i = 0; i < position->count; i++) {
    int owner = 0;
    while (start->items[owner + 1] <= keys[2 * i + 1]) owner++;
    if (!i || keys[2 * i] != keys[2 * i - 2]) {
      kkt_push(arena, &target, keys[2 * i]);
      kkt_push(arena, &first, i);
    }
    kkt_push(arena, &pair, owner);
    kkt_push(arena, &slot, keys[2 * i + 1]);
  }
  kkt_push(arena, &first, position->count);
  front->pair_targets = target.count;
  front->pair_target = kept(own, &target);
  front->target_start = kept(own, &first);
  front->target_pair = kept(own, &pair);
  front->target_slot = kept(own, &slot);
}

static void place_pairs(Layout *x) {
  const KktPattern *p = x->planning->pattern;
  KktArena *arena = x->planning->arena, *own = &x->planning->plan->arena;
  KktFront *front = x->front;
  KktList entry = {0}, start = {0}, position = {0}, slot = {0};
  kkt_push(arena, &start, 0);
  for (int i = 0; i < front->pairs; i++) {
    int v = front->unknown[i], row = front->unknown[front->pairs + i] - kkt_equality(p, 0);
    for (int q = p->rows.start[row]; q < p->rows.start[row + 1]; q++) {
      if (p->rows.column[q] == v) {
        kkt_push(arena, &entry, p->rows.entry[q]);
      } else {
        kkt_push(arena, &position, x->place[p->rows.column[q]]);
        kkt_push(arena, &slot, p->rows.entry[q]);
      }
    }
    kkt_push(arena, &start, position.count);
  }
  front->pair_entry = kept(own, &entry);
  front->pair_start = kept(own, &start);
  front->pair_position = kept(own, &position);
  front->pair_slot = kept(own, &slot);
  sort_pairs(x, &position, &start);
}

static void place_entries(Layout *x, int k) {
  KktArena *own = &x->planning->plan->arena;
  KktFront *front = x->front;
  KktList lists[6] = {{0}};
  visit_entries(x, k, visit_target, lists);
  front->to_front = lists[0].count;
  front->to_values = lists[2].count;
  front->to_products = lists[4].count;
  size_t count = (size_t)(front->to_front + front->to_values + front->to_products);
  front->entry_slot = kkt_take(own, count + 1, sizeof(int));
  front->entry_target = kkt_take(own, count + 1, sizeof(int));
  for (int kind = 0, at = 0; kind < 3; at += lists[2 * kind++].count)
    for (int i = 0; i < lists[2 * kind].count; i++) {
      front->entry_slot[at + i] = lists[2 * kind].items[i];
      front->entry_target[at + i] = lists[2 * kind + 1].items[i];
    }
}

static void note_largest(KktPlan *plan, const KktFront *front) {
  if (front->panel > plan->panel_most) plan->panel_most = front->panel;
  if (front->panel_rows > plan->panel_rows_most) plan->panel_rows_most = front->panel_rows;
  if (front->group_values > plan->group_values_most) plan->group_values_most = front->group_values;
  if (front->z_values > plan->z_values_most) plan->z_values_most = front->z_values;
  if (front->products > plan->products_most) plan->products_most = front->products;
}

void kkt_lay_out(KktPlanning *planning) {
  KktPlan *plan = planning->plan;
  int *place = kkt_take(planning->arena, (size_t)planning->pattern->size + 1, sizeof(int));
  for (int o = plan->fronts - 1; o >= 0; o--) {
    int k = planning->order[o];
    if (plan->front[k].parent >= 0) place_border(planning, k, place);
    place_unknowns(planning, k);
  }
  measure(plan);
  char *seen = kkt_take(planning->arena, (size_t)plan->largest + 1, 1);
  for (int k = 0; k < plan->fronts; k++) {
    Layout x = {.planning = planning, .front = &plan->front[k], .place = place, .seen = seen};
    for (int i = 0; i < x.front->size; i++) place[x.front->unknown[i]] = i;
    make_groups(&x, k);
    fill_groups(&x);
    visit_entries(&x, k, visit_note, NULL);
    note_rows(&x, k);
    sort_touched(&x);
    place_entries(&x, k);
    place_rows(&x, k);
    place_products(&x);
    place_pairs(&x);
    note_largest(plan, x.front);
  }
}
