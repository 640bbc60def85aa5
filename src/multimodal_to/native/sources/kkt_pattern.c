/* The structure of a KKT matrix: IPOPT's triplets become distinct entries, and each entry gets a meaning. */
#include "kkt.h"

#include <string.h>

/* Give each distinct place (row ≥ column) of the triplets a number, column by column, inequality rows last in each. */
static void number_entries(KktArena *arena, KktPattern *p, const int *irn, const int *jcn) {
  size_t n = (size_t)p->size, triplets = (size_t)p->triplets;
  int *start = kkt_take(arena, n + 1, sizeof(int)), *next = kkt_take(arena, n, sizeof(int));
  int *order = kkt_take(arena, triplets, sizeof(int)), *number = kkt_take(arena, n, sizeof(int));
  int *place = kkt_take(arena, triplets, sizeof(int));
  p->row = kkt_take(arena, triplets, sizeof(int));
  p->column = kkt_take(arena, triplets, sizeof(int));
  p->column_start = kkt_take(arena, n + 1, sizeof(int));
  p->column_inequalities = kkt_take(arena, n + 1, sizeof(int));
  for (int t = 0; t < p->triplets; t++) start[irn[t] < jcn[t] ? irn[t] : jcn[t]]++; /* they count from one */
  for (int i = 0; i < p->size; i++) start[i + 1] += start[i];
  memcpy(next, start, sizeof(int) * n);
  for (int t = 0; t < p->triplets; t++) order[next[(irn[t] < jcn[t] ? irn[t] : jcn[t]) - 1]++] = t;
  for (int i = 0; i < p->size; i++) number[i] = -1;
  p->entries = 0;
  for (int column = 0; column < p->size; column++) {
    int first = p->column_start[column] = p->entries;
    for (int last = 0; last < 2; last++) {
      if (last) p->column_inequalities[column] = p->entries;
      for (int q = start[column]; q < start[column + 1]; q++) {
        int t = order[q], row = (irn[t] > jcn[t] ? irn[t] : jcn[t]) - 1;
        if ((row >= kkt_inequality(p, 0)) != last) continue;
        if (number[row] < first) {
          number[row] = p->entries;
          p->row[p->entries] = row;
          p->column[p->entries++] = column;
        }
        place[t] = number[row];
      }
    }
  }
  p->column_start[p->size] = p->entries;
  for (p->middle = 0; p->column_start[p->middle] < p->entries / 2;) p->middle++;
  p->triplet_start = kkt_take(arena, (size_t)p->entries + 2, sizeof(int));
  p->triplet = kkt_take(arena, triplets, sizeof(int));
  for (int t = 0; t < p->triplets; t++) p->triplet_start[place[t] + 2]++;
  for (int e = 0; e < p->entries; e++) p->triplet_start[e + 2] += p->triplet_start[e + 1];
  for (int t = 0; t < p->triplets; t++) p->triplet[p->triplet_start[place[t] + 1]++] = t;
}

enum { VARIABLE, SLACK, EQUALITY, INEQUALITY };

static int kind_of(const KktPattern *p, int unknown) {
  if (unknown < p->variables) return VARIABLE;
  if (unknown < p->variables + p->slacks) return SLACK;
  return unknown < kkt_inequality(p, 0) ? EQUALITY : INEQUALITY;
}

/* Note the single entries, and count those of rows and of variables or, the second time, write them down. */
static const char *sort_entries(KktPattern *p, int *row_count, int *curvature_count, int write) {
  for (int e = 0; e < p->entries; e++) {
    int i = p->row[e], j = p->column[e], a = kind_of(p, i), b = kind_of(p, j); /* i ≥ j, so a ≥ b */
    if (a == VARIABLE) {
      for (int side = 0; side < (i == j ? 1 : 2); side++) {
        int at = side ? j : i, other = side ? i : j, to = curvature_count[at]++;
        if (write) p->curvature.column[to] = other, p->curvature.entry[to] = e;
      }
    } else if (i == j) {
      if (a == SLACK) p->slack_diagonal[i - p->variables] = e;
      if (a == EQUALITY) p->equality_diagonal[i - kkt_equality(p, 0)] = e;
      if (a == INEQUALITY) p->row_diagonal[i - kkt_inequality(p, 0)] = e;
    } else if (b == VARIABLE && a != SLACK) {
      int to = row_count[i - kkt_equality(p, 0)]++;
      if (write) p->rows.column[to] = j, p->rows.entry[to] = e;
    } else if (b == SLACK && a == INEQUALITY && i - kkt_inequality(p, 0) == j - p->variables) {
      p->coupling[j - p->variables] = e;
    } else {
      return "an entry of the KKT matrix is neither of the Hessian, nor of a row, nor of a slack";
    }
  }
  return NULL;
}

/* Turn counts into where each begins; returns the start array, one longer. */
static int *starts(KktArena *arena, const int *count, int n) {
  int *start = kkt_take(arena, (size_t)n + 1, sizeof(int));
  for (int i = 0; i < n; i++) start[i + 1] = start[i] + count[i];
  return start;
}

static int *filled(KktArena *arena, int count, int value) {
  int *array = kkt_take(arena, (size_t)count + 1, sizeof(int));
  for (int i = 0; i < count; i++) array[i] = value;
  return array;
}

const char *kkt_read_pattern(KktArena *arena, KktPattern *p, const int *irn, const int *jcn) {
  for (int t = 0; t < p->triplets; t++)
    if (irn[t] < 1 || irn[t] > p->size || jcn[t] < 1 || jcn[t] > p->size) return "an entry is outside the KKT matrix";
  number_entries(arena, p, irn, jcn);
  int rows = p->equalities + p->slacks;
  p->equality_diagonal = filled(arena, p->equalities, -1);
  p->row_diagonal = filled(arena, p->slacks, -1);
  p->slack_diagonal = filled(arena, p->slacks, -1);
  p->coupling = filled(arena, p->slacks, -1);
  int *row_count = filled(arena, rows, 0), *curvature_count = filled(arena, p->variables, 0);
  const char *refusal = sort_entries(p, row_count, curvature_count, 0);
  if (refusal) return refusal;
  p->rows.start = starts(arena, row_count, rows);
  p->curvature.start = starts(arena, curvature_count, p->variables);
  p->rows.column = filled(arena, p->rows.start[rows], 0);
  p->rows.entry = filled(arena, p->rows.start[rows], 0);
  p->curvature.column = filled(arena, p->curvature.start[p->variables], 0);
  p->curvature.entry = filled(arena, p->curvature.start[p->variables], 0);
  memcpy(row_count, p->rows.start, sizeof(int) * (size_t)rows);
  memcpy(curvature_count, p->curvature.start, sizeof(int) * (size_t)p->variables);
  sort_entries(p, row_count, curvature_count, 1);
  for (int d = 0; d < p->slacks; d++)
    if (p->coupling[d] < 0) return "an inequality row of the KKT matrix has no slack";
  p->home = filled(arena, rows, -1);
  for (int r = 0; r < rows; r++)
    for (int q = p->rows.start[r]; q < p->rows.start[r + 1]; q++) {
      int knot = p->knot[p->rows.column[q]];
      if (knot > p->home[r]) p->home[r] = knot;
    }
  return NULL;
}
