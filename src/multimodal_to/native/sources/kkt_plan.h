/* What is known while a plan is made. Fronts are numbered by knot. */
#ifndef MT_KKT_PLAN_H
#define MT_KKT_PLAN_H

#include "kkt.h"

typedef struct {
  KktArena *arena; /* given back when the plan is made */
  KktPlan *plan;
  const KktPattern *pattern;
  const double *value;
  int *order;            /* fronts, children first */
  KktList *curvature_at; /* entries of the Hessian by front */
  KktList *rows_at;      /* rows by front, equality rows first in number */
  KktList *defined_at;   /* definitions whose variables have entries in a front */
  KktList *seen_at;      /* unknowns of a front beside the defined ones and their rows */
  KktList *pair_at;      /* variable, row, variable, row … */
  KktList *rest_at;      /* what else is eliminated */
  KktList *border_at;    /* what goes on to the parent */
} KktPlanning;

static inline int kkt_front_of(const KktPlan *plan, int knot) { return knot < 0 ? plan->root : knot; }

static inline int kkt_is_equality(const KktPattern *p, int unknown) {
  return unknown >= kkt_equality(p, 0) && unknown < kkt_inequality(p, 0);
}

/* Choose which rows define a variable. */
void kkt_choose_definitions(KktPlanning *planning);

/* Choose what each front eliminates. */
void kkt_choose_eliminations(KktPlanning *planning);

/* Give every unknown of every front its position, and every entry its place. */
void kkt_lay_out(KktPlanning *planning);

#endif
