/* A linear solver for the KKT matrices of one problem: what stands between IPOPT's calls and the factorisation. */
#ifndef MT_KKT_SOLVER_H
#define MT_KKT_SOLVER_H

#include "kkt.h"

typedef struct Kkt Kkt;

/* Counts of what was done, in the order in which Python reads them. */
typedef struct {
  double factorisations, broken_off, wrong_inertia, singular, without_definitions, fronts;
  double solves, refinements, poor_solves, seconds_factorising, seconds_solving, seconds_planning;
  double operations, largest_front, definitions, pairs;
} KktCounts;

/* Return a solver for matrices of these sizes; knot: of each variable, −1 for global ones. NULL: no memory. */
MT_EXPORT Kkt *mt_kkt_new(int variables, int slacks, int equalities, int knots, const int *knot);
MT_EXPORT void mt_kkt_free(Kkt *kkt);

/* Return why the solver refused a matrix, or NULL; then another linear solver has to do it. */
MT_EXPORT const char *mt_kkt_refusal(const Kkt *kkt);
MT_EXPORT void mt_kkt_counts(const Kkt *kkt, KktCounts *counts);

/* Take a structure; returns whether it is taken. A structure as before costs nothing. */
int kkt_take_structure(Kkt *kkt, int size, int triplets, const int *irn, const int *jcn);

/* Factorise the matrix of these triplets; `negative` eigenvalues that are more than there are rows need not be exact. */
int kkt_take_values(Kkt *kkt, const double *values, int *negative);

/* rhs ← K⁻¹ rhs, refined; returns whether there are factors. */
int kkt_take_right_side(Kkt *kkt, double *rhs);

#endif
