/* A factorisation of IPOPT's KKT matrix for problems whose unknowns belong to knots in a row.
 *
 *     [ W + Σ + δ_w          J_cᵀ   J_dᵀ ] x        x: variables that are not fixed, of the knots 0 … N, and global ones
 *     [         Σ_s + δ_w           −1   ] s        s: slacks, one for each inequality row
 *     [ J_c             −δ_c             ] y_c      y_c: multipliers of the equality rows
 *     [ J_d    −1             −δ_c       ] y_d      y_d: multipliers of the inequality rows
 *
 * The order of the unknowns is IPOPT's. A row couples variables of neighbouring knots, and global ones.
 *   1. s and y_d are condensed: a row of weight 1 / (1/Σ_s + δ_c) is added to W.                  kkt_factor.c
 *   2. A row that defines a variable, v = −Σ z_j x_j, is eliminated with it by substitution,
 *      Zᵀ K Z, where that couples no knots that were not coupled.                                kkt_plan.c
 *   3. What is left is factorised as L D Lᵀ in dense fronts, one for each knot, from both ends of
 *      the horizon to its middle. A front adds up the matrix entries of its knot and what the front
 *      before it left, and eliminates what no later front refers to.               kkt_factor.c, kkt_kernel.c
 * Source of the method: I. S. Duff, J. K. Reid, The multifrontal solution of indefinite sparse symmetric linear
 * equations, ACM TOMS 9 (1983); pivots: J. R. Bunch, L. Kaufman, Math. Comp. 31 (1977).
 */
#ifndef MT_KKT_H
#define MT_KKT_H

#include "common.h"

#include <setjmp.h>
#include <stddef.h>

/* Memory that is given back at once; where there is none left, a jump to `failure`. */
typedef struct {
  void **blocks;
  int count, capacity;
  char *chunk; /* that small pieces are cut from */
  size_t left;
  jmp_buf *failure;
} KktArena;

void *kkt_take(KktArena *arena, size_t count, size_t size); /* zeros; from 512 bytes on aligned for vectors */
void kkt_give_back(KktArena *arena);

/* Numbers whose count changes, aligned for vectors; growing does not keep them. */
typedef struct {
  void *block;
  double *values;
  size_t capacity;
} KktBuffer;

int kkt_grow(KktBuffer *buffer, size_t count); /* returns whether there was memory */
void kkt_release(KktBuffer *buffer);

typedef struct {
  int count, capacity, *items;
} KktList;

void kkt_push(KktArena *arena, KktList *list, int item);

/* Rows of a sparse matrix: columns and entries of row i are at start[i] … start[i + 1] − 1. */
typedef struct {
  int *start, *column, *entry;
} KktRows;

/* The matrix: which entries there are, and what each is. Made once for a structure. */
typedef struct {
  int size, variables, slacks, equalities; /* size = variables + 2 slacks + equalities */
  int knots;
  const int *knot;          /* of each variable; −1: a global one */
  int triplets, *triplet_start, *triplet; /* of each entry: IPOPT's triplets that it is the sum of */
  int entries, *row, *column, *column_start; /* entries are numbered column by column */
  int *column_inequalities; /* where those of a column begin that are of inequality rows; they are its last ones */
  int middle;               /* the column that half of the entries are before */
  KktRows rows;             /* equality rows, then inequality rows: their variables */
  KktRows curvature;        /* of each variable: the variables, itself too, that it has an entry with */
  int *equality_diagonal;   /* entries, −1: none */
  int *row_diagonal, *slack_diagonal, *coupling; /* of each inequality row */
  int *home;                /* of each row, equality rows first: the front that its entries go to; −1: the root */
} KktPattern;

/* Where a share of a loop of so many turns begins. */
static inline int kkt_share(int count, int share, int shares) { return (int)((long long)count * share / shares); }

static inline int kkt_slack(const KktPattern *p, int row) { return p->variables + row; }
static inline int kkt_equality(const KktPattern *p, int row) { return p->variables + p->slacks + row; }
static inline int kkt_inequality(const KktPattern *p, int row) { return kkt_equality(p, p->equalities) + row; }

/* Sort the triplets into entries; returns why the matrix is not one of the kind above, or NULL. */
const char *kkt_read_pattern(KktArena *arena, KktPattern *p, const int *irn, const int *jcn);

/* Rows that define a variable: v = −Σ z_j x_j with z_j = a_j / a, and the rest of its row as the unknown y. */
typedef struct {
  int count, *variable, *row, *entry; /* entry: of a */
  int *of_variable, *of_row;          /* place among these, −1: none */
} KktDefinitions;

/* Variables defined by rows with the same columns, in one front: they are substituted together. */
typedef struct {
  int members, *definition;
  int touched, *position;   /* positions in the front that the variables have entries with, rising */
  int depends, *depend;     /* positions in the front of the rows' columns */
  int *slot;                /* entry of column k in the row of member m: slot[k * members + m] */
  int first, z;             /* where the touched values (touched × members) and z (depends × members) begin */
} KktGroup;

typedef struct {
  int parent, children, child[2];
  int pairs, eliminated, size; /* positions: pairs of variables, their rows, the rest that is eliminated, the border */
  int *unknown;                /* of each position */
  int rows;                    /* equality rows among those eliminated */
  /* Pairs: an equality row of few columns with a variable that is eliminated here. */
  int *pair_entry, *pair_start, *pair_position, *pair_slot;
  /* The same by position: the pairs whose rows have an entry there, and which of pair_slot it is. */
  int pair_targets, *pair_target, *target_start, *target_pair, *target_slot;
  /* Entries of the matrix: value[entry_slot] is added to the front, to values of groups, and to products. */
  int to_front, to_values, to_products, *entry_slot, *entry_target;
  /* Inequality rows: the columns in the front, row_plain of them, then the defined ones. Their products with each
   * other go to row_target, one after the other; those of columns in the front only where the row is not in the panel. */
  int condensed, *row, *row_start, *row_plain, *row_in_panel, *row_slot, *row_target;
  /* Inequality rows of many columns: a dense block on the positions panel[]. */
  int panel_rows, panel, *panel_position, *panel_place; /* of each plain column of a row in the panel: its place there */
  int groups;
  KktGroup *group;
  int group_values, z_values;
  /* Products of two defined variables: h · z is added to the values of a group. */
  int products, spreads, *spread_product, *spread_z, *spread_target, *spread_half;
  /* How a child's border is placed here: runs of consecutive positions. */
  int runs[2], *run_from[2], *run_to[2], *run_length[2];
} KktFront;

/* What a front leaves for the solves. Positions count from the start of the front's storage; those of the plan are
 * shifted, to make place for what children could not eliminate. */
typedef struct {
  int shift, first, end, size; /* first … end − 1 could be eliminated, the border is end … size − 1 */
  int pairs, *pair;            /* the pairs that were eliminated, by number in the plan */
  int start, pivots;           /* start … pivots − 1 were eliminated one by one or by two; pivots … end − 1 wait */
  int *before, *after;         /* unknown at each position before and after columns changed places */
  int negative, rows;          /* eigenvalues, and equality rows, of all that was eliminated */
  double *matrix;              /* the front itself, until its parent has taken it */
  double *diagonal;            /* D: two values for each position, the diagonal and the one below */
  KktBuffer lower;             /* L in blocks of columns, as the kernels have it */
  KktBuffer column;            /* of each pair that was eliminated: its variable's row of the front */
} KktFactors;

/* Memory of one chain of fronts. */
typedef struct {
  double *matrix[2]; /* a front and its child */
  double *values, *z, *product, *panel, *weighted, *weight, *square, *columns, *vector, *line;
} KktWork;

typedef struct {
  KktArena arena, scratch; /* scratch: given back when the plan is made */
  const KktPattern *pattern;
  int fronts, root;
  KktFront *front;
  KktDefinitions definitions;
  int stride;      /* of a front's columns */
  int largest;     /* front */
  int panel_most, panel_rows_most, group_values_most, z_values_most, products_most;
  int row_most;      /* columns of an inequality row */
  double operations; /* of a factorisation, about */
  char *row_meets;   /* of each inequality row: whether there is a defined variable in it */
  KktRows meets;     /* of each definition: unknowns that its variable has entries with, but for its own row */
  KktFactors *factors;
  KktWork work[3];   /* of the chain from the start, of that from the end, and of the root */
} KktPlan;

enum { KKT_DELAYED_MOST = 64 }; /* columns that a front takes over without a pivot */

/* Make a plan from the pattern and the values of one matrix, which say what a row may define. */
void kkt_make_plan(KktPlan *plan, const KktPattern *p, const double *value, int substitute);

/* Take the memory that factorisations by a plan need; give back all memory of a plan. */
void kkt_take_work(KktPlan *plan);
void kkt_free_plan(KktPlan *plan);

enum { KKT_DONE = 0, KKT_SINGULAR = 1, KKT_NO_NUMBER = 2, KKT_CROWDED = 3, KKT_NO_MEMORY = 4 };

typedef struct {
  int status;
  int complete; /* 0: broken off, as there are certainly too many negative eigenvalues */
  int negative; /* eigenvalues */
  int fronts;   /* that were factorised */
} KktOutcome;

/* A matrix of numbers, and the state of its factorisation. */
typedef struct {
  const KktPattern *pattern;
  double *value;       /* of each entry */
  double *determinant; /* of each inequality row's 2 × 2 block of s and y_d */
  double *rounding;    /* of each unknown: size of what was subtracted from its diagonal */
  double *solution;    /* 2 × size values for the solves */
  double *multiplier;  /* of each inequality row, for the solves */
  double threshold;
  int from_end_first;  /* which half had too many negative eigenvalues the last time */
} KktMatrix;

KktOutcome kkt_factorise(KktMatrix *matrix, KktPlan *plan, int break_off);

/* Whether rows define their variables with the values that are there: their diagonals are zero, and |a| not too small. */
int kkt_definitions_hold(const KktMatrix *matrix, const KktPlan *plan);

/* rhs ← K⁻¹ rhs by the factors of a plan. */
void kkt_solve(KktMatrix *matrix, const KktPlan *plan, double *rhs);

/* residual = rhs − K x. */
void kkt_residual(const KktMatrix *matrix, const double *rhs, const double *x, double *residual);

#endif
